//! Levels of a simplified domain (`features = "drop"`): what is smaller than the spacing is closed or cut off.
//!
//! Nodes are selected as in Figure 2, but none is forced. Facet vertices that stand out at the scale of f come first, and
//! those that do so at f/2 too (corners, not the vertices beside one) may be twice as near to each other: what is lost
//! with the corner of a thin part is much. Then come those that stand out at f/2 only (what is no corner should not keep out
//! what is one on a finer level), the other vertices of walls, and last those of interfaces, all under the conflict rule. No
//! vertex is put back: chords that would be no valid domain are given up instead. The cells of the constrained Delaunay
//! triangulation of what is kept are inside where valid chords say so; elsewhere most of their sample points (centroid
//! and three towards the corners) must lie in the input mesh. Then slivers are peeled off the rim, or a node of them is
//! taken out; for the next round the triangulation is mended where that is less work than a new one (see `again`).
//!
//! Selection goes from coarse to fine, as in Figure 3. A node that ends in no cell is taken out, of this level and of all
//! coarser ones: levels are settled from fine to coarse, and as the sets only shrink, once is enough.

mod again;
mod assemble;
mod flip;
mod levels;
mod mend;
mod order;
mod parts;
mod pinch;
mod trim;

use crate::domain::{Chord, Domain, Sight};
use crate::error::Error;
use crate::hierarchy::Input;
use crate::level::{Candidates, Choice, LevelMesh, Rules, select_interior};
use crate::point::{NONE, Point};
use crate::progress::Progress;
use crate::selection::{greedy, rank};
use parts::Parts;
use std::collections::HashMap;

pub use assemble::Dropped;

/// Smallest angle of a cell that is left on the rim, in degrees.
const RIM_ANGLE_DEG: f64 = 15.0;

/// Mending may change the area by this share of the input's more than dropping features did.
const MOST_CHANGE: f64 = 0.05;

/// Larger cells, by their share of the area of the input, are peeled off the rim only if they can't be mended.
const PEEL: f64 = 0.01;

/// Rounds in which that is tried.
const MENDING: usize = 4;

/// Triangulations of one level at most: each but the last takes out nodes that end in no cell.
const MOST_ROUNDS: usize = 32;

/// What selection goes by.
#[derive(Clone, Copy)]
pub struct Terms<'a> {
    /// The parameters of Figure 2.
    pub rules: Rules,
    /// Cosine of the feature angle.
    pub cos_feature: f64,
    /// Facet vertices that may not be kept; empty where all may be.
    pub is_barred: &'a [bool],
}

/// Selects a level's nodes among the candidates, keeping `seeds` (see [`crate::level::select`]).
pub fn select(
    domain: &Domain,
    candidates: &Candidates<'_>,
    f: &[f64],
    seeds: &Choice,
    candidate_of: impl Fn(u32) -> u32,
    Terms { rules, cos_feature, is_barred }: Terms<'_>,
    progress: &Progress,
) -> Result<Choice, Error> {
    let facets = domain.len();
    let seeded: Vec<u32> = seeds.interior.iter().map(|&node| candidate_of(node)).collect();
    let mut kept = if seeds.kept.is_empty() { vec![false; facets] } else { seeds.kept.clone() };
    let mut keep: Vec<u32> = (0..facets as u32).filter(|&v| kept[v as usize]).collect();
    keep.extend(&seeded);
    let is_speck = domain.specks(&f[..facets]);
    let (mut corners, mut lesser, mut order) = (Vec::new(), Vec::new(), Vec::new());
    let mut room = f.to_vec();
    let is_free = |&v: &u32| {
        let is_barred = is_barred.get(v as usize).is_some_and(|&barred| barred);
        !is_barred && !kept[v as usize] && !is_speck[domain.chain_of(v) as usize]
    };
    for v in (0..facets as u32).filter(is_free) {
        let at = |scale: f64| domain.stands_out(v, scale * f[v as usize], cos_feature);
        if let Some(sharpness) = at(1.0) {
            if at(0.5).is_some() {
                room[v as usize] /= 2.0;
            }
            corners.push((sharpness, v));
        } else if let Some(sharpness) = at(0.5) {
            lesser.push((sharpness, v));
        } else {
            order.push(v);
        }
    }
    let by_sharpness = |mut corners: Vec<(f64, u32)>| {
        corners.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        corners.into_iter().map(|(_, v)| v)
    };
    let corners: Vec<u32> = by_sharpness(corners).collect();
    for v in greedy(&candidates.tree, &room, rules.beta, &corners, &keep, progress)? {
        kept[v as usize] = true;
        keep.push(v);
    }
    rank(&mut order, f);
    let is_wall = |&v: &u32| !domain.chains[domain.chain_of(v) as usize].edges[0].interior;
    let (walls, inner): (Vec<u32>, Vec<u32>) = order.into_iter().partition(is_wall);
    let order: Vec<u32> = by_sharpness(lesser).chain(walls).chain(inner).collect();
    for v in greedy(&candidates.tree, f, rules.beta, &order, &keep, progress)? {
        kept[v as usize] = true;
    }
    let obstacles: Vec<Point<2>> = seeded.iter().map(|&k| candidates.points[k as usize]).collect();
    let chords = domain.valid_chords(&kept, f, &obstacles, &[]);
    let (interior, _) = select_interior(domain, candidates, f, seeds, &seeded, &kept, &chords, rules, progress)?;
    Ok(Choice { kept, interior, chords, ..Choice::default() })
}

/// The input as the settling of levels sees it.
pub struct Ground<'a> {
    domain: &'a Domain,
    input: &'a Input<'a>,
    sight: Sight<'a>,
    /// For each node an eye: a cell that has it.
    home: Vec<u32>,
    parts: Parts,
    /// Tag of every cell, empty where all have `tag`.
    tags: Vec<i64>,
    tag: i64,
    /// Facet vertex of a node.
    vertex_of: HashMap<u32, u32>,
    /// Facet edges at each facet vertex.
    degree: Vec<u32>,
    /// Those of them that have cells on one side only.
    outer: Vec<u32>,
    cos_feature: f64,
    area: f64,
    loops: usize,
}

impl<'a> Ground<'a> {
    /// Runtime: O(m), O(m log m) where there are several tags.
    pub fn new(domain: &'a Domain, input: &'a Input<'a>, cos_feature: f64) -> Ground<'a> {
        let mut home = vec![NONE; input.points.len()];
        for (t, cell) in input.cells.iter().enumerate() {
            cell.iter().for_each(|&node| home[node as usize] = t as u32);
        }
        let (mut degree, mut outer) = (vec![0; domain.len()], vec![0; domain.len()]);
        for edge in domain.chains.iter().flat_map(|chain| &chain.edges) {
            let is_outer = edge.sides[0].is_inside() != edge.sides[1].is_inside();
            for v in edge.vertices {
                degree[v as usize] += 1;
                outer[v as usize] += u32::from(is_outer);
            }
        }
        let boundary: Vec<[u32; 2]> =
            input.facets.iter().filter(|facet| facet.cell_tags.1.is_none()).map(|facet| facet.nodes).collect();
        let (tag, tags) = cell_tags(input);
        Ground {
            sight: Sight::new(domain),
            vertex_of: (0..domain.len() as u32)
                .flat_map(|v| domain.copies(v).iter().map(move |&node| (node, v)))
                .collect(),
            parts: Parts::new(input, &home),
            home,
            tags,
            tag,
            degree,
            // a needle's may be rounded below zero
            area: input.cells.iter().map(|cell| area(&cell.map(|i| input.points[i as usize])).max(0.0)).sum(),
            loops: assemble::loops(&boundary),
            outer,
            cos_feature,
            domain,
            input,
        }
    }

    /// A point inside the mesh near a node, and the tag there.
    fn eye(&self, node: u32) -> (Point<2>, i64) {
        let t = self.home[node as usize] as usize;
        let corners = self.input.cells.get(t).map(|i| self.input.points[i as usize]);
        (centroid(&corners), self.tags.get(t).copied().unwrap_or(self.tag))
    }

    /// Makes the mesh of a choice from nodes that `allowed` admits, and takes out of the choice what is not in it.
    /// `f` is by facet vertex.
    pub fn settle(
        &self,
        choice: &mut Choice,
        f: &[f64],
        allowed: Option<&[bool]>,
    ) -> Result<Option<(LevelMesh, Dropped)>, Error> {
        let is_allowed = |node: u32| allowed.is_none_or(|allowed| allowed[node as usize]);
        choice.interior.retain(|&node| is_allowed(node));
        for v in 0..self.domain.len() as u32 {
            choice.kept[v as usize] &= self.domain.copies(v).iter().any(|&node| is_allowed(node));
        }
        let (mut most_change, mut memory) = (None, trim::Memory::default());
        let mut best: Option<((usize, f64), Choice, trim::Trimmed)> = None;
        let mut most_area = PEEL * self.area;
        for round in 0..MOST_ROUNDS {
            let obstacles: Vec<Point<2>> = choice.interior.iter().map(|&i| self.input.points[i as usize]).collect();
            choice.chords = self.domain.valid_chords(&choice.kept, f, &obstacles, &choice.chords);
            let Some(mut cells) = self.triangulate(choice, f, is_allowed, &mut memory)? else { break };
            cells.peel(RIM_ANGLE_DEG, most_area);
            cells.unpinch(RIM_ANGLE_DEG, |site| self.runs(site));
            cells.drop_crumbs();
            cells.free_moot_chords(|c| self.is_given(&choice.chords[c]));
            let victims = cells.victims(RIM_ANGLE_DEG, |s| self.cost(&cells, s, f));
            let shape = cells.shape(RIM_ANGLE_DEG);
            let change = (cells.area() - self.area).abs();
            let most = *most_change.get_or_insert(change + MOST_CHANGE * self.area);
            let mut next = choice.clone();
            let is_last = !self.take_out(&mut next, &cells, &victims);
            let is_better = |old: &(usize, f64)| shape.0 < old.0 || (shape.0 == old.0 && shape.1 >= old.1);
            if change <= most && best.as_ref().is_none_or(|(old, ..)| is_better(old)) {
                best = Some((shape, std::mem::replace(choice, next), cells));
            } else {
                *choice = next;
            }
            if shape.0 > 0 && most_area < f64::INFINITY && (is_last || round >= MENDING) {
                // what can't be mended is peeled off, however large
                most_area = f64::INFINITY;
            } else if is_last {
                break;
            }
        }
        let Some((_, settled, mut cells)) = best else { return Ok(None) };
        let made = self.assemble(&settled, &mut cells, is_allowed)?;
        *choice = settled;
        self.take_out(choice, &cells, &[]);
        Ok(Some(made))
    }

    /// Whether the user gave a facet along a chord, on one of its sides.
    fn is_given(&self, chord: &Chord) -> bool {
        let is_given = |side: usize| self.attribute(chord, side).is_some();
        is_given(0) || is_given(1)
    }

    /// Runs of cells around a site in the input: two boundary edges bound each.
    fn runs(&self, site: u32) -> usize {
        self.outer.get(site as usize).map_or(1, |&edges| (edges as usize / 2).max(1))
    }

    /// What taking out a site costs: nothing for an interior node, most for a corner of the domain.
    fn cost(&self, cells: &trim::Trimmed, s: u32, f: &[f64]) -> u32 {
        let v = cells.sites[s as usize];
        if v >= self.domain.len() as u32 {
            return 0;
        }
        if self.domain.stands_out(v, f[v as usize], self.cos_feature).is_some() { 2 } else { 1 }
    }

    /// Takes nodes without a cell, and other sites, out of a choice; whether there were any.
    fn take_out(&self, choice: &mut Choice, cells: &trim::Trimmed, victims: &[u32]) -> bool {
        let mut used = vec![false; cells.sites.len()];
        cells.alive().for_each(|t| cells.cells.cells[t].iter().for_each(|&s| used[s as usize] = true));
        victims.iter().for_each(|&s| used[s as usize] = false);
        let facets = self.domain.len() as u32;
        let mut lost = std::collections::HashSet::new();
        for (&site, _) in cells.sites.iter().zip(&used).filter(|&(_, &used)| !used) {
            match site.checked_sub(facets) {
                Some(node) => {
                    lost.insert(node);
                }
                None => choice.kept[site as usize] = false,
            }
        }
        choice.interior.retain(|node| !lost.contains(node));
        used.iter().any(|&used| !used)
    }
}

fn centroid([a, b, c]: &[Point<2>; 3]) -> Point<2> {
    [(a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0]
}

fn area([a, b, c]: &[Point<2>; 3]) -> f64 {
    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
}

/// The one tag of all cells, or a tag for each: from the facets, flooded up to the next facet.
fn cell_tags(input: &Input<'_>) -> (i64, Vec<i64>) {
    let known = input.facets.iter().flat_map(|facet| [Some(facet.cell_tags.0), facet.cell_tags.1]).flatten();
    let first = input.facets.first().map_or(0, |facet| facet.cell_tags.0);
    if known.clone().all(|tag| tag == first) {
        return (first, Vec::new());
    }
    let mut beside: HashMap<[u32; 2], i64> = HashMap::new();
    for facet in input.facets {
        let [a, b] = facet.nodes;
        beside.insert([a, b], facet.cell_tags.0);
        if let Some(tag) = facet.cell_tags.1 {
            beside.insert([b, a], tag);
        }
    }
    let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * input.cells.len());
    let mut tags = vec![None; input.cells.len()];
    let mut stack = Vec::new();
    for (t, cell) in input.cells.iter().enumerate() {
        for k in 0..3 {
            let [a, b] = [cell[k], cell[(k + 1) % 3]];
            match beside.get(&[a, b]) {
                Some(&tag) if tags[t].is_none() => {
                    tags[t] = Some(tag);
                    stack.push(t as u32);
                }
                Some(_) => {}
                None => edges.push(([a.min(b), a.max(b)], t as u32)),
            }
        }
    }
    edges.sort_unstable();
    let mut around: Vec<[u32; 3]> = vec![[NONE; 3]; input.cells.len()];
    for pair in edges.chunk_by(|a, b| a.0 == b.0).filter(|run| run.len() == 2) {
        for (t, other) in [(pair[0].1, pair[1].1), (pair[1].1, pair[0].1)] {
            if let Some(free) = around[t as usize].iter_mut().find(|n| **n == NONE) {
                *free = other;
            }
        }
    }
    while let Some(t) = stack.pop() {
        for &n in around[t as usize].iter().filter(|&&n| n != NONE) {
            if tags[n as usize].is_none() {
                tags[n as usize] = tags[t as usize];
                stack.push(n);
            }
        }
    }
    (first, tags.into_iter().map(|tag| tag.unwrap_or(first)).collect())
}

/// Which side of a chord has cells in the input.
fn sides(domain: &Domain, chord: &Chord) -> [bool; 2] {
    domain.chains[chord.chain as usize].edge(chord.from).sides.map(|side| side.is_inside())
}
