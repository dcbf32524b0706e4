//! The mesh of a level from its cells: copies of doubled vertices, facets with their tags, what was dropped.

use super::trim::Trimmed;
use super::{Ground, sides};
use crate::domain::{Chord, Side};
use crate::error::Error;
use crate::level::{Choice, LevelMesh};
use crate::point::NONE;
use std::collections::HashMap;

/// What a level of a simplified domain lacks or has too much.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Dropped {
    /// Boundary loops of the input less those of the level.
    pub loops_closed: usize,
    /// Area of the level outside the input.
    pub area_gained: f64,
    /// Area of the input outside the level.
    pub area_lost: f64,
}

impl Dropped {
    /// By how much the area differs from that of the input.
    pub fn change(&self) -> f64 {
        (self.area_gained - self.area_lost).abs()
    }
}

/// Number of connected pieces of a boundary, by nodes.
pub fn loops(boundary: &[[u32; 2]]) -> usize {
    let mut parent: HashMap<u32, u32> = HashMap::new();
    fn root(parent: &mut HashMap<u32, u32>, mut at: u32) -> u32 {
        loop {
            let up = *parent.entry(at).or_insert(at);
            if up == at {
                return at;
            }
            let above = *parent.entry(up).or_insert(up);
            parent.insert(at, above);
            at = above;
        }
    }
    let mut joined = 0;
    for &[a, b] in boundary {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        if a != b {
            parent.insert(a.max(b), a.min(b));
            joined += 1;
        }
    }
    parent.len() - joined
}

impl Ground<'_> {
    /// Makes the mesh of a level. Copies are chosen among the nodes that `is_allowed` admits.
    pub fn assemble(
        &self,
        choice: &Choice,
        trimmed: &mut Trimmed,
        is_allowed: impl Fn(u32) -> bool,
    ) -> Result<(LevelMesh, Dropped), Error> {
        let (alive, corners) = loop {
            let mut alive: Vec<usize> = trimmed.alive().collect();
            alive.sort_unstable_by_key(|&t| trimmed.cells[t].corners);
            let corners = self.corners(choice, trimmed, &alive, &is_allowed)?;
            if trimmed.part_again(&alive, &corners) {
                continue;
            }
            if !trimmed.close_slits(&alive, &corners) {
                break (alive, corners);
            }
            trimmed.free_moot_chords(|c| self.is_given(&choice.chords[c]));
        };
        let trimmed = &*trimmed;
        let mut nodes: Vec<u32> = corners.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let index_of = |node: u32| nodes.binary_search(&node).map_or(NONE, |i| i as u32);
        let mut mesh = LevelMesh {
            cells: corners.iter().map(|cell| cell.map(index_of)).collect(),
            cell_tags: alive.iter().filter_map(|&t| trimmed.label[t]).collect(),
            ..LevelMesh::default()
        };
        // edges by their nodes: (ends, cell, corner where it starts)
        let mut edges: Vec<([u32; 2], u32, u8)> = Vec::with_capacity(3 * mesh.cells.len());
        for (c, cell) in mesh.cells.iter().enumerate() {
            for k in 0..3 {
                let [a, b] = [cell[k], cell[(k + 1) % 3]];
                edges.push(([a.min(b), a.max(b)], c as u32, k as u8));
            }
        }
        edges.sort_unstable();
        let mut interior = Vec::new();
        for run in edges.chunk_by(|a, b| a.0 == b.0) {
            let (_, c, k) = run[0];
            let (c, k) = (c as usize, k as usize);
            let ends = [mesh.cells[c][k], mesh.cells[c][(k + 1) % 3]];
            let constraint = trimmed.cells[alive[c]].constraints[k];
            let on_chord = (constraint != NONE)
                .then(|| self.attribute(&choice.chords[constraint as usize / 2], constraint as usize % 2));
            match run {
                [_] => {
                    let sites = [k, (k + 1) % 3].map(|k| trimmed.sites[trimmed.cells[alive[c]].corners[k] as usize]);
                    mesh.facets.push(ends);
                    mesh.facet_cells.push([c as u32, NONE]);
                    mesh.facet_tags.push(on_chord.unwrap_or_else(|| self.nearby(sites)));
                }
                [_, (_, other, _)] => {
                    let other_side = || {
                        let chord = (constraint != NONE).then(|| &choice.chords[constraint as usize / 2])?;
                        self.attribute(chord, 1 - constraint as usize % 2)
                    };
                    let given = on_chord.flatten().or_else(other_side);
                    if given.is_some() || mesh.cell_tags[c] != mesh.cell_tags[*other as usize] {
                        interior.push((ends, [c as u32, *other], given));
                    }
                }
                _ => return Err(Error::Internal(format!("an edge of nodes {ends:?} with {} cells", run.len()))),
            }
        }
        mesh.n_boundary = mesh.facets.len();
        for (ends, cells, given) in interior {
            mesh.facets.push(ends);
            mesh.facet_cells.push(cells);
            mesh.facet_tags.push(given);
        }
        mesh.nodes = nodes;
        let dropped = self.dropped(choice, trimmed, &mesh);
        Ok((mesh, dropped))
    }

    /// Nodes of the cells. The cells around a doubled vertex fall into sectors between rim and slits; a sector has the
    /// copy that the chord at its end has on this side, or the lowest that is allowed.
    fn corners(
        &self,
        choice: &Choice,
        trimmed: &Trimmed,
        alive: &[usize],
        is_allowed: impl Fn(u32) -> bool,
    ) -> Result<Vec<[u32; 3]>, Error> {
        let facets = self.domain.len() as u32;
        let cells = &trimmed.cells;
        let mut corners = vec![[NONE; 3]; cells.len()];
        for &t in alive {
            for k in 0..3 {
                let site = trimmed.sites[cells[t].corners[k] as usize];
                if let Some(node) = site.checked_sub(facets) {
                    corners[t][k] = node;
                    continue;
                }
                let copies = self.domain.copies(site);
                if let [node] = copies {
                    corners[t][k] = *node;
                    continue;
                }
                if corners[t][k] != NONE {
                    continue;
                }
                let s = cells[t].corners[k];
                let sector = trimmed.sector(t, s);
                let first = sector[0];
                let last = sector[sector.len() - 1];
                let (begin, end) = (
                    cells[first].constraints[trimmed.corner(first, s)],
                    cells[last].constraints[(trimmed.corner(last, s) + 2) % 3],
                );
                let asked = [self.copy(choice, begin, true), self.copy(choice, end, false)];
                let fits = |node: u32| is_allowed(node) && self.is_of(node, trimmed.part[t]);
                let asked = asked.into_iter().flatten().find(|&node| fits(node));
                let lowest = || copies.iter().copied().find(|&node| fits(node));
                let node = asked
                    .or_else(lowest)
                    .ok_or_else(|| Error::Internal(format!("no copy of facet vertex {site} is left")))?;
                sector.iter().for_each(|&t| corners[t][trimmed.corner(t, s)] = node);
            }
        }
        Ok(alive.iter().map(|&t| corners[t]).collect())
    }

    /// The copy that the inside cell at a constraint has where its edge starts, or else where it ends.
    pub(super) fn copy(&self, choice: &Choice, constraint: u32, at_start: bool) -> Option<u32> {
        if constraint == NONE {
            return None;
        }
        let chord = &choice.chords[constraint as usize / 2];
        let chain = &self.domain.chains[chord.chain as usize];
        let s = constraint as usize % 2;
        let node = if at_start == (s == 0) {
            chain.edge(chord.from).sides[s].tail
        } else {
            chain.edge(chord.to - 1).sides[s].head
        };
        (node != NONE).then_some(node)
    }

    /// Facet tag of the longest part of a chord's piece, on one of its sides; `None` where that part is not given.
    pub(super) fn attribute(&self, chord: &Chord, side: usize) -> Option<i64> {
        let chain = &self.domain.chains[chord.chain as usize];
        let side = if sides(self.domain, chord)[side] { side } else { 1 - side };
        longest((chord.from..chord.to).map(|k| {
            let k = k as usize % chain.edges.len();
            (chain.edges[k].sides[side], chain.arc[k + 1] - chain.arc[k])
        }))
    }

    /// Facet tag of a rim edge that is no chord: of the boundary between its ends, the shorter way, where they lie on one
    /// chain, or else of the boundary at one of them.
    fn nearby(&self, sites: [u32; 2]) -> Option<i64> {
        let domain = self.domain;
        let places = sites.map(|s| if s < domain.len() as u32 { domain.places(s) } else { Vec::new() });
        let outer = |c: u32| !domain.chains[c as usize].edges[0].interior;
        let tag_of = |c: u32, k: usize| {
            let chain = &domain.chains[c as usize];
            let side = chain.edges[k].sides.into_iter().find(|side| side.is_inside());
            side.map(|side| (side, chain.arc[k + 1] - chain.arc[k]))
        };
        for &(c, a) in places[0].iter().filter(|&&(c, _)| outer(c)) {
            let Some(&(_, b)) = places[1].iter().find(|&&(other, _)| other == c) else { continue };
            let chain = &domain.chains[c as usize];
            let (low, high) = (a.min(b) as usize, a.max(b) as usize);
            let along = chain.arc[high] - chain.arc[low];
            return if chain.closed && 2.0 * along > chain.length() {
                longest((high..chain.edges.len()).chain(0..low).filter_map(|k| tag_of(c, k)))
            } else {
                longest((low..high).filter_map(|k| tag_of(c, k)))
            };
        }
        let &(c, k) = places.iter().flatten().find(|&&(c, _)| outer(c))?;
        longest(tag_of(c, (k as usize).min(domain.chains[c as usize].edges.len() - 1)).into_iter())
    }

    /// What the level lacks. Between a chord and its chain areas are exact; what remains of the difference of areas is
    /// put down to gain or to loss as its sign says.
    fn dropped(&self, choice: &Choice, trimmed: &Trimmed, mesh: &LevelMesh) -> Dropped {
        let loops = loops(&mesh.facets[..mesh.n_boundary]);
        let (mut gained, mut lost) = (0.0, 0.0);
        let mut is_rim = vec![false; choice.chords.len()];
        for t in trimmed.alive() {
            for k in (0..3).filter(|&k| trimmed.across(t, k) == NONE && trimmed.cells[t].constraints[k] != NONE) {
                is_rim[trimmed.cells[t].constraints[k] as usize / 2] = true;
            }
        }
        for (chord, _) in choice.chords.iter().zip(is_rim).filter(|&(_, rim)| rim) {
            let [left, right] = self.domain.strips(chord);
            match sides(self.domain, chord) {
                // where the chain lies left of the chord, what is between is right of the chain
                [true, false] => (gained, lost) = (gained + left, lost + right),
                [false, true] => (gained, lost) = (gained + right, lost + left),
                _ => {}
            }
        }
        let rest = trimmed.area() - self.area - (gained - lost);
        Dropped {
            loops_closed: self.loops.saturating_sub(loops),
            area_gained: gained + rest.max(0.0),
            area_lost: lost + (-rest).max(0.0),
        }
    }
}

/// Tag of the longest part of some sides, each with its length.
fn longest(sides: impl Iterator<Item = (Side, f64)>) -> Option<i64> {
    let mut lengths: Vec<(Option<i64>, f64)> = Vec::new();
    for (side, length) in sides {
        let tag = side.given.then_some(side.tag);
        match lengths.iter_mut().find(|(other, _)| *other == tag) {
            Some((_, sum)) => *sum += length,
            None => lengths.push((tag, length)),
        }
    }
    let mut best = (None, -1.0);
    for (tag, sum) in lengths {
        if sum > best.1 {
            best = (tag, sum);
        }
    }
    best.0
}
