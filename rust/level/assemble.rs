//! A triangulated choice as a mesh of the input's nodes.

use super::{Choice, Triangulated};
use crate::domain::{Chord, Domain};
use crate::error::Error;
use crate::point::NONE;
use crate::triangulation::Cell;
use rayon::prelude::*;
use std::collections::HashMap;

/// A coarse mesh in the terms of the input's nodes.
#[derive(Debug, Clone, Default)]
pub struct LevelMesh {
    /// Nodes of the input mesh, ascending.
    pub nodes: Vec<u32>,
    /// Cells, as indices into `nodes`.
    pub cells: Vec<[u32; 3]>,
    /// Tags of the cells.
    pub cell_tags: Vec<i64>,
    /// Facet edges, boundary first with their cell on the left, as indices into `nodes`.
    pub facets: Vec<[u32; 2]>,
    /// Left and right cell of each, [`NONE`] where there is none.
    pub facet_cells: Vec<[u32; 2]>,
    /// Tag of each that stems from a given facet.
    pub facet_tags: Vec<Option<i64>>,
    /// How many of the facets are boundary.
    pub n_boundary: usize,
}

/// Turns sites into node copies, carries tags to cells, lists the facets.
pub fn assemble(domain: &Domain, choice: &Choice, level: &Triangulated) -> Result<LevelMesh, Error> {
    let (sites, cells) = (&level.sites, &level.cells);
    let facets = domain.len() as u32;
    // each node with its site, none where that has several
    let mut sited: Vec<(u32, u32)> = Vec::with_capacity(sites.len());
    for (&s, site) in sites.iter().zip(0..) {
        match s.checked_sub(facets) {
            Some(node) => sited.push((node, site)),
            None => match domain.copies(s) {
                [node] => sited.push((*node, site)),
                copies => sited.extend(copies.iter().map(|&node| (node, NONE))),
            },
        }
    }
    sited.par_sort_unstable();
    let nodes: Vec<u32> = sited.iter().map(|&(node, _)| node).collect();
    // index of the node of each site with one copy
    let mut single = vec![NONE; sites.len()];
    sited.iter().zip(0..).filter(|((_, site), _)| *site != NONE).for_each(|(&(_, site), i)| single[site as usize] = i);
    let mut shared: HashMap<u32, u32> = HashMap::new();
    let index_of = |node: u32| nodes.binary_search(&node).map_or(NONE, |i| i as u32);
    let mut out = LevelMesh { cell_tags: tags(domain, &choice.chords, cells), ..LevelMesh::default() };
    out.cells = cells.par_iter().map(|cell| cell.corners.map(|s| single[s as usize])).collect();
    let is_open = |&t: &usize| out.cells[t].contains(&NONE);
    for t in (0..cells.len()).into_par_iter().filter(is_open).collect::<Vec<_>>() {
        for k in (0..3).filter(|&k| single[cells[t].corners[k] as usize] == NONE) {
            let node = copy_at(domain, &choice.chords, cells, t as u32, cells[t].corners[k])?;
            out.cells[t][k] = *shared.entry(node).or_insert_with(|| index_of(node));
        }
    }
    let mut beside = vec![[NONE; 2]; choice.chords.len()];
    let is_beside = |&t: &usize| cells[t].constraints != [NONE; 3];
    for t in (0..cells.len()).into_par_iter().filter(is_beside).collect::<Vec<_>>() {
        for &c in cells[t].constraints.iter().filter(|&&c| c != NONE) {
            beside[c as usize / 2][c as usize % 2] = t as u32;
        }
    }
    for interior in [false, true] {
        for (chord, &[left, right]) in choice.chords.iter().zip(&beside) {
            let chain = &domain.chains[chord.chain as usize];
            let (first, last) = (chain.edge(chord.from), chain.edge(chord.to - 1));
            if first.interior != interior {
                continue;
            }
            for s in 0..if interior { 1 } else { 2 } {
                let side = first.sides[s];
                if !side.is_inside() {
                    continue;
                }
                let ends = [index_of(side.tail), index_of(last.sides[s].head)];
                out.facets.push(if s == 0 { ends } else { [ends[1], ends[0]] });
                out.facet_cells.push(if interior { [left, right] } else { [[left, right][s], NONE] });
                out.facet_tags.push(side.given.then_some(side.tag));
            }
        }
        if !interior {
            out.n_boundary = out.facets.len();
        }
    }
    out.nodes = nodes;
    Ok(out)
}

/// The copy of a doubled vertex that a cell has: turn clockwise around it to the wall, and ask the wall's side.
fn copy_at(domain: &Domain, chords: &[Chord], cells: &[Cell], cell: u32, site: u32) -> Result<u32, Error> {
    let mut at = cell as usize;
    for _ in 0..=cells.len() {
        let Some(k) = (0..3).find(|&k| cells[at].corners[k] == site) else { break };
        if cells[at].neighbours[k] != NONE {
            at = cells[at].neighbours[k] as usize;
            continue;
        }
        let constraint = cells[at].constraints[k];
        let chord = &chords[constraint as usize / 2];
        let chain = &domain.chains[chord.chain as usize];
        return Ok(if constraint.is_multiple_of(2) {
            chain.edge(chord.from).sides[0].tail
        } else {
            chain.edge(chord.to - 1).sides[1].head
        });
    }
    Err(Error::Internal(format!("no wall around site {site}")))
}

/// Tag of each cell: from the sides of the chords, flooded up to the next chord.
fn tags(domain: &Domain, chords: &[Chord], cells: &[Cell]) -> Vec<i64> {
    let all_sides = chords.iter().flat_map(|chord| &domain.chains[chord.chain as usize].edge(chord.from).sides);
    let mut own = all_sides.filter(|side| side.is_inside()).map(|side| side.cell_tag);
    if let Some(first) = own.next()
        && own.all(|tag| tag == first)
    {
        return vec![first; cells.len()];
    }
    let mut tags = vec![0; cells.len()];
    let mut known = vec![false; cells.len()];
    let mut stack = Vec::new();
    for t in 0..cells.len() {
        if let Some(&c) = cells[t].constraints.iter().find(|&&c| c != NONE) {
            let chord = &chords[c as usize / 2];
            let side = domain.chains[chord.chain as usize].edge(chord.from).sides[c as usize % 2];
            if !known[t] {
                (tags[t], known[t]) = (side.cell_tag, true);
                stack.push(t);
            }
        }
        while let Some(at) = stack.pop() {
            for k in 0..3 {
                let next = cells[at].neighbours[k];
                if next != NONE && cells[at].constraints[k] == NONE && !known[next as usize] {
                    (tags[next as usize], known[next as usize]) = (tags[at], true);
                    stack.push(next as usize);
                }
            }
        }
    }
    tags
}
