//! What lies at a point of the plane: inside the mesh or not, and in which material.
//!
//! The answer is seen from a point that is known to lie inside: every facet edge that the line of sight crosses may
//! change it. Signs are exact and a vertex on the line of sight counts as left of it, so a line through vertices crosses
//! every closed loop an even number of times if its ends are on one side.

use super::{Domain, FacetEdge};
use crate::point::{Point, orient};
use crate::segments::Segments;

/// The facet edges of a domain, to be looked across.
pub struct Sight<'a> {
    domain: &'a Domain,
    /// Facet edges, each with its chain.
    edges: Vec<(u32, FacetEdge)>,
    tree: Segments,
}

impl<'a> Sight<'a> {
    /// Runtime: O(s log s) for s facet edges.
    pub fn new(domain: &'a Domain) -> Sight<'a> {
        let edges: Vec<(u32, FacetEdge)> = domain
            .chains
            .iter()
            .zip(0..)
            .flat_map(|(chain, c)| chain.edges.iter().map(move |&edge| (c, edge)))
            .collect();
        let ends: Vec<[u32; 2]> = edges.iter().map(|(_, edge)| edge.vertices).collect();
        Sight { domain, tree: Segments::new(&domain.points, &ends), edges }
    }

    /// Tag of the cell at `x`, `None` outside, seen from a point `eye` inside a cell of the given tag. Chains that are gone
    /// are not seen.
    pub fn look(&self, eye: &Point<2>, tag: i64, x: &Point<2>, is_gone: impl Fn(u32) -> bool) -> Option<i64> {
        let mut crossed = Vec::new();
        self.tree.meeting(eye, x, |e| {
            let (chain, edge) = &self.edges[e as usize];
            let [a, b] = edge.vertices.map(|v| &self.domain.points[v as usize]);
            if is_gone(*chain) || (orient(eye, x, a) >= 0.0) == (orient(eye, x, b) >= 0.0) {
                return;
            }
            let (from, to) = (orient(a, b, eye), orient(a, b, x));
            if (from > 0.0) != (to > 0.0) {
                crossed.push((e, from, to));
            }
        });
        // edges that are crossed at one time: the last counts
        crossed.sort_unstable_by_key(|one| one.0);
        let (mut is_inside, mut latest, mut seen) = (true, 0.0, tag);
        for (e, from, to) in crossed {
            let edge = &self.edges[e as usize].1;
            let [left, right] = edge.sides;
            is_inside ^= edge.is_outer();
            let side = if to > 0.0 { left } else { right };
            let time = from / (from - to);
            if side.is_inside() && time >= latest {
                (latest, seen) = (time, side.cell_tag);
            }
        }
        is_inside.then_some(seen)
    }
}
