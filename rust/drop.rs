//! Levels of a simplified domain (`features = "drop"`): what is smaller than the spacing is closed or cut off.
//!
//! Nodes are selected as in Figure 2 (see `select`), but none is forced, and no vertex is put back to make chords valid: chords
//! that would be no valid domain are given up instead. The cells of the constrained Delaunay triangulation of what is kept
//! are inside where valid chords say so; elsewhere most of their sample points (centroid and three towards the corners)
//! must lie in the input mesh. Parts are never joined (see `parts`). Then slivers are peeled off the rim, or a node of them
//! is taken out; for the next round the triangulation is mended where that is less work than a new one (see `again`). Where
//! neither helps, a sliver is the thin bridge between two pieces of a level, which are cut apart there.
//!
//! Where a level would change the area by more than a twentieth more than the finer one does, one between the two is made first
//! (see `levels`), so that features are not lost all at once.
//!
//! Selection goes from coarse to fine, as in Figure 3, first of the facet vertices of all levels (see `facets`): where an interior
//! node of a coarser level keeps a vertex out, or a level is drawn from one that lacks it, a chord of a finer one may cut off
//! much. With `features = "auto"` the levels that keep features keep those vertices. A node that ends in no cell is taken out, of this level and of all
//! coarser ones: levels are settled from fine to coarse, and as the sets only shrink, once is enough.

mod again;
mod assemble;
mod facets;
mod flip;
mod levels;
mod mend;
mod order;
mod parts;
mod pinch;
mod select;
mod trim;

use crate::domain::{Chord, Domain, Sight};
use crate::error::Error;
use crate::hierarchy::Input;
use crate::level::{Choice, LevelMesh};
use crate::point::Point;
use std::collections::HashMap;
use std::sync::Arc;

pub use assemble::Dropped;
pub(crate) use parts::Parts;

/// Smallest angle of a cell that is left on the rim, in degrees.
const RIM_ANGLE_DEG: f64 = 15.0;

/// Mending may change the area by this share of the input's more than dropping features did.
const MOST_CHANGE: f64 = 0.05;

/// By this share where that leaves no sliver.
const MOST_FOR_ALL: f64 = 0.08;

/// By this share where that leaves no sliver once they are cut through: there is no other means then.
const MOST_AT_LAST: f64 = 0.25;

/// Larger cells, by their share of the area of the input, are peeled off the rim only if they can't be mended.
const PEEL: f64 = 0.01;

/// Rounds in which that is tried.
const MENDING: usize = 4;

/// Rounds after which mending is given up where none of them made the level better.
const IN_VAIN: usize = 6;

/// Triangulations of one level at most before slivers are cut through, and then again: each but the last takes out nodes.
const MOST_ROUNDS: usize = 32;

/// The input as the settling of levels sees it.
pub struct Ground<'a> {
    domain: &'a Domain,
    input: &'a Input<'a>,
    sight: Sight<'a>,
    parts: Arc<Parts>,
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
    /// Runtime: O(m + s log s) for m cells and s facet edges.
    pub fn new(domain: &'a Domain, input: &'a Input<'a>, parts: Arc<Parts>, cos_feature: f64) -> Ground<'a> {
        let (mut degree, mut outer) = (vec![0; domain.len()], vec![0; domain.len()]);
        for edge in domain.chains.iter().flat_map(|chain| &chain.edges) {
            for v in edge.vertices {
                degree[v as usize] += 1;
                outer[v as usize] += u32::from(edge.is_outer());
            }
        }
        let boundary: Vec<[u32; 2]> =
            input.facets.iter().filter(|facet| facet.cell_tags.1.is_none()).map(|facet| facet.nodes).collect();
        Ground {
            sight: Sight::new(domain),
            vertex_of: (0..domain.len() as u32)
                .flat_map(|v| domain.copies(v).iter().map(move |&node| (node, v)))
                .collect(),
            parts,
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

    /// A point inside the mesh near a node.
    fn eye(&self, node: u32) -> Point<2> {
        centroid(&self.input.cells.get(self.parts.home[node as usize] as usize).map(|i| self.input.points[i as usize]))
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
        let (mut first_change, mut memory) = (None, trim::Memory::default());
        let mut best: Option<((usize, f64), Choice, trim::Trimmed)> = None;
        let (mut most_area, mut severs, mut better_at) = (PEEL * self.area, false, 0);
        for round in 0..2 * MOST_ROUNDS {
            let obstacles: Vec<Point<2>> = choice.interior.iter().map(|&i| self.input.points[i as usize]).collect();
            choice.chords = self.domain.valid_chords(&choice.kept, f, &obstacles, &choice.chords);
            let Some(mut cells) = self.triangulate(choice, f, is_allowed, &mut memory)? else { break };
            cells.peel(RIM_ANGLE_DEG, most_area, severs);
            cells.unpinch(RIM_ANGLE_DEG, |site| self.runs(site));
            cells.drop_crumbs();
            cells.free_moot_chords(|c| self.is_given(&choice.chords[c]));
            let victims = cells.victims(RIM_ANGLE_DEG, |s| self.cost(&cells, s, f));
            let shape = cells.shape(RIM_ANGLE_DEG);
            let change = (cells.area() - self.area).abs();
            let most = *first_change.get_or_insert(change)
                + match shape.0 {
                    0 if severs => MOST_AT_LAST,
                    0 => MOST_FOR_ALL,
                    _ => MOST_CHANGE,
                } * self.area;
            let mut next = choice.clone();
            let is_last = !self.take_out(&mut next, &cells, &victims);
            let is_better = |old: &(usize, f64)| shape.0 < old.0 || (shape.0 == old.0 && shape.1 >= old.1);
            if change <= most && best.as_ref().is_none_or(|(old, ..)| is_better(old)) {
                best = Some((shape, std::mem::replace(choice, next), cells));
                better_at = round;
            } else {
                *choice = next;
            }
            let gives_up = !severs && (round - better_at >= IN_VAIN || round + 1 == MOST_ROUNDS);
            if shape.0 > 0 && most_area < f64::INFINITY && (is_last || round >= MENDING) {
                // what can't be mended is peeled off, however large
                most_area = f64::INFINITY;
            } else if is_last || gives_up {
                // slivers that are left hold larger pieces together, which are cut apart there
                let Some((_, settled, _)) = best.as_ref().filter(|(shape, ..)| shape.0 > 0 && !severs) else { break };
                *choice = settled.clone();
                (most_area, severs, first_change) = (f64::INFINITY, true, None);
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
        cells.alive().for_each(|t| cells.cells[t].corners.iter().for_each(|&s| used[s as usize] = true));
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

/// Which side of a chord has cells in the input.
fn sides(domain: &Domain, chord: &Chord) -> [bool; 2] {
    domain.chains[chord.chain as usize].edge(chord.from).sides.map(|side| side.is_inside())
}
