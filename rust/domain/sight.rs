//! What lies at a point of the plane: inside the mesh or not, and in which material.
//!
//! The answer is seen from a point that is known to lie inside: every facet edge that the line of sight crosses may
//! change it. Signs are exact and a vertex on the line of sight counts as left of it, so a line through vertices crosses
//! every closed loop an even number of times if its ends are on one side.

use super::{Domain, FacetEdge};
use crate::point::{Point, orient};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};

/// The facet edges of a domain, to be looked across.
pub struct Sight<'a> {
    domain: &'a Domain,
    /// Facet edges, each with its chain.
    edges: Vec<(u32, FacetEdge)>,
    tree: RTree<GeomWithData<Rectangle<Point<2>>, u32>>,
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
        let boxes = edges.iter().zip(0u32..).map(|((_, edge), e)| {
            let [a, b] = edge.vertices.map(|v| domain.points[v as usize]);
            GeomWithData::new(Rectangle::from_corners(a, b), e)
        });
        Sight { domain, tree: RTree::bulk_load(boxes.collect()), edges }
    }

    /// Tag of the cell at `x`, `None` outside, seen from a point `eye` inside a cell of the given tag. Chains that are gone
    /// are not seen.
    pub fn look(&self, eye: &Point<2>, tag: i64, x: &Point<2>, is_gone: impl Fn(u32) -> bool) -> Option<i64> {
        let (mut is_inside, mut latest, mut seen) = (true, 0.0, tag);
        for item in self.tree.locate_in_envelope_intersecting(AABB::from_corners(*eye, *x)) {
            let (chain, edge) = &self.edges[item.data as usize];
            if is_gone(*chain) {
                continue;
            }
            let [a, b] = edge.vertices.map(|v| &self.domain.points[v as usize]);
            if (orient(eye, x, a) >= 0.0) == (orient(eye, x, b) >= 0.0) {
                continue;
            }
            let (from, to) = (orient(a, b, eye), orient(a, b, x));
            if (from > 0.0) == (to > 0.0) {
                continue;
            }
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
