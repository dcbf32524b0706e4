//! What lies at a point of the plane: inside the mesh or not, and in which material.
//!
//! The facet edge right below a point tells what lies above it. Facet edges cross nowhere, so that it is found without a look
//! at those farther down, however many there are:
//!
//! ```text
//!         x
//!         |         what lies above the edge lies at x
//!     ----+----
//!   ------------- not looked at
//! ```
//!
//! Signs are exact. A point on an edge counts as right of it, and one on a vertex as right of the first edge there.
//!
//! A hole may be gone, closed by the material around it. What lies in it (islands) and what lies around it then see nothing of
//! each other.

use super::{Domain, FacetEdge, Side};
use crate::point::{NONE, Point, orient};
use crate::segments::Segments;
use std::cell::Cell;

/// The facet edges of a domain, to be looked at from above.
pub struct Sight<'a> {
    domain: &'a Domain,
    /// Facet edges, each with its chain.
    edges: Vec<(u32, FacetEdge)>,
    tree: Segments,
    /// Least y of the facets.
    floor: f64,
    /// Whether each chain bounds a hole.
    is_hole: Vec<bool>,
    /// For each chain the innermost hole that it lies in, or [`NONE`].
    hole_around: Vec<u32>,
    has_islands: bool,
}

/// What lies at a point in the mesh or in a hole.
#[derive(Debug, Clone, Copy)]
struct Spot {
    /// Tag of the cell, in a hole of the cells around it.
    tag: i64,
    /// The hole that it lies in, by its chain, or [`NONE`].
    hole: u32,
    /// The innermost hole around that cell, or around those cells.
    around: u32,
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
        let floor = domain.points.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
        let tree = Segments::new(&domain.points, &ends);
        let is_hole: Vec<bool> = (0..domain.chains.len() as u32).map(|c| domain.is_hole(c)).collect();
        let hole_around = vec![NONE; is_hole.len()];
        let mut sight = Sight { domain, edges, tree, floor, is_hole, hole_around, has_islands: false };
        sight.nest();
        sight
    }

    /// Finds the hole around each chain.
    fn nest(&mut self) {
        let at = |v: u32| &self.domain.points[v as usize];
        let lower = |v: &u32, w: &u32| at(*v)[1].total_cmp(&at(*w)[1]).then(at(*v)[0].total_cmp(&at(*w)[0]));
        let lowest = |c: u32| self.domain.chains[c as usize].vertices.iter().copied().min_by(lower).unwrap_or(0);
        // an edge below the lowest vertex of a chain is of a chain that reaches farther down
        let mut order: Vec<(u32, u32)> = (0..self.domain.chains.len() as u32).map(|c| (lowest(c), c)).collect();
        order.sort_by(|a, b| lower(&a.0, &b.0));
        for (v, c) in order {
            let (below, _) = self.below(at(v));
            let spot = below.and_then(|e| self.spot(e, self.above(e)));
            self.hole_around[c as usize] =
                spot.map_or(NONE, |spot| if spot.hole == NONE { spot.around } else { spot.hole });
        }
        self.has_islands = self.hole_around.iter().any(|&hole| hole != NONE);
    }

    /// Tag of the cell at `x`, `None` outside, seen from a point `eye` in the mesh. Holes that are gone are closed.
    ///
    /// Runtime: O(log s), usually.
    pub fn look(&self, eye: &Point<2>, x: &Point<2>, is_gone: impl Fn(u32) -> bool) -> Option<i64> {
        let spot = self.at(x).filter(|spot| spot.hole == NONE || is_gone(spot.hole))?;
        let closed = |spot: Spot| self.outward(spot.around).find(|&hole| is_gone(hole));
        let is_seen = !self.has_islands || self.at(eye).is_none_or(|own| closed(own) == closed(spot));
        is_seen.then_some(spot.tag)
    }

    /// A hole and the holes around it.
    fn outward(&self, hole: u32) -> impl Iterator<Item = u32> {
        let next = |&hole: &u32| self.hole_around.get(hole as usize).copied();
        std::iter::successors(Some(hole), next).filter(|&hole| hole != NONE)
    }

    /// What lies at `x`, `None` outside all.
    fn at(&self, x: &Point<2>) -> Option<Spot> {
        match self.below(x) {
            (_, Some(on)) => self.spot(on, &self.edges[on as usize].1.sides[1]),
            (below, None) => below.and_then(|e| self.spot(e, self.above(e))),
        }
    }

    /// What lies on a side of an edge.
    fn spot(&self, e: u32, side: &Side) -> Option<Spot> {
        let chain = self.edges[e as usize].0;
        let around = self.hole_around[chain as usize];
        if side.is_inside() {
            return Some(Spot { tag: side.cell_tag, hole: NONE, around });
        }
        let hole = if self.is_hole[chain as usize] { chain } else { around };
        let rim = &self.domain.chains.get(hole as usize)?.edges[0];
        let tag = rim.sides.iter().find(|side| side.is_inside())?.cell_tag;
        Some(Spot { tag, hole, around: self.hole_around[hole as usize] })
    }

    /// The next edge below `x`, and the first one that it lies on.
    fn below(&self, x: &Point<2>) -> (Option<u32>, Option<u32>) {
        let on = Cell::new(None::<u32>);
        let is_below = |e: u32| {
            let [left, right] = self.rightward(e);
            let turn = orient(left, right, x);
            if turn == 0.0 && is_boxed(x, [left, right]) {
                on.set(Some(on.get().map_or(e, |first| first.min(e))));
            }
            left[0] <= x[0] && x[0] < right[0] && turn > 0.0
        };
        let below = self.tree.highest_below(x, self.floor.min(x[1]), is_below, |e, f| self.is_higher(e, f));
        (below, on.get())
    }

    /// Whether the first of two edges is the upper one where both are below a point.
    fn is_higher(&self, e: u32, f: u32) -> bool {
        let [[a, b], [c, d]] = [e, f].map(|edge| self.rightward(edge));
        let first = if a[0] >= c[0] { orient(c, d, a) } else { -orient(a, b, c) };
        let last = if b[0] <= d[0] { orient(c, d, b) } else { -orient(a, b, d) };
        if first == 0.0 { last > 0.0 } else { first > 0.0 }
    }

    /// Ends of an edge from left to right.
    fn rightward(&self, e: u32) -> [&Point<2>; 2] {
        let [a, b] = self.edges[e as usize].1.vertices.map(|v| &self.domain.points[v as usize]);
        if a[0] < b[0] { [a, b] } else { [b, a] }
    }

    /// The side of an edge, not a vertical one, that lies above it.
    fn above(&self, e: u32) -> &Side {
        let edge = &self.edges[e as usize].1;
        let [a, b] = edge.vertices.map(|v| &self.domain.points[v as usize]);
        &edge.sides[usize::from(a[0] > b[0])]
    }
}

/// Whether a point lies in the box of two others.
fn is_boxed(x: &Point<2>, [a, b]: [&Point<2>; 2]) -> bool {
    (0..2).all(|k| a[k].min(b[k]) <= x[k] && x[k] <= a[k].max(b[k]))
}
