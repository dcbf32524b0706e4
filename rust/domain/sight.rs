//! What lies at a point of the plane: inside the mesh or not, and in which material.
//!
//! The first facet edge that is met on the way from a point to anywhere tells what lies at the point. The way leads across an
//! edge near by, so that hardly any others come near it, however many there are:
//!
//! ```text
//!     ------------+----   edge near by
//!            ----/-----   first edge on the way: what lies below it lies at x
//!               x
//! ```
//!
//! Signs are exact, and edges cross nowhere: which is the first one is a matter of signs. A point on an edge counts as right
//! of it, and one on a vertex as right of the first edge there.
//!
//! A hole may be gone, closed by the material around it. What lies in it (islands) and what lies around it then see nothing of
//! each other.

use super::{Domain, FacetEdge, Side};
use crate::point::{NONE, Point, distance, orient};
use crate::segments::Segments;

/// The facet edges of a domain, to be looked at from near by.
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

/// Some point, and what lies at it and at all points nearer than `reach` to it.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    x: Point<2>,
    reach: f64,
    spot: Option<Spot>,
}

impl Default for Seen {
    /// Nothing was seen yet.
    fn default() -> Seen {
        Seen { x: [0.0; 2], reach: 0.0, spot: None }
    }
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
            let spot = self.below(at(v)).and_then(|e| self.spot(e, self.above(e)));
            self.hole_around[c as usize] =
                spot.map_or(NONE, |spot| if spot.hole == NONE { spot.around } else { spot.hole });
        }
        self.has_islands = self.hole_around.iter().any(|&hole| hole != NONE);
    }

    /// Tag of the cell at `x`, `None` outside, seen from a point `eye` in the mesh. Holes that are gone are closed. What was seen
    /// last is at hand for points near by.
    ///
    /// Runtime: O(log s), usually.
    pub fn look(&self, eye: &Point<2>, x: &Point<2>, is_gone: impl Fn(u32) -> bool, last: &mut Seen) -> Option<i64> {
        let spot = self.again(x, last).filter(|spot| spot.hole == NONE || is_gone(spot.hole))?;
        let closed = |spot: Spot| self.outward(spot.around).find(|&hole| is_gone(hole));
        let is_seen = !self.has_islands || self.again(eye, last).is_none_or(|own| closed(own) == closed(spot));
        is_seen.then_some(spot.tag)
    }

    /// What lies at `x`, which may be known.
    fn again(&self, x: &Point<2>, last: &mut Seen) -> Option<Spot> {
        if distance(x, &last.x) >= last.reach {
            let (spot, reach) = self.at(x).unwrap_or((None, 0.0));
            *last = Seen { x: *x, reach, spot };
        }
        last.spot
    }

    /// A hole and the holes around it.
    fn outward(&self, hole: u32) -> impl Iterator<Item = u32> {
        let next = |&hole: &u32| self.hole_around.get(hole as usize).copied();
        std::iter::successors(Some(hole), next).filter(|&hole| hole != NONE)
    }

    /// What lies at `x`, `None` outside all, and how near no edge comes. `None` where there are no edges.
    fn at(&self, x: &Point<2>) -> Option<(Option<Spot>, f64)> {
        let (near, reach) = self.tree.nearby(x)?;
        let (first, on) = self.first(x, &self.beyond(x, near));
        let spot = match (on, first) {
            (Some(e), _) => self.spot(e, &self.edges[e as usize].1.sides[1]),
            (_, Some(e)) => self.spot(e, self.side(e, x)),
            // rounding hides the edge near by
            _ => self.below(x).and_then(|e| self.spot(e, self.above(e))),
        };
        Some((spot, reach))
    }

    /// A point as far beyond an edge as `x` is before it, not in line with its ends.
    fn beyond(&self, x: &Point<2>, e: u32) -> Point<2> {
        let [a, b] = self.ends(e);
        let (along, to) = ([b[0] - a[0], b[1] - a[1]], [x[0] - a[0], x[1] - a[1]]);
        let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
        let t = (to[0] * along[0] + to[1] * along[1]) / length / length;
        let nearest = t.clamp(0.0, 1.0);
        let away = distance(&to, &[nearest * along[0], nearest * along[1]]);
        let margin = (away / length).min(0.5);
        let t = t.max(margin).min(1.0 - margin);
        [0, 1].map(|k| x[k] + 2.0 * (t * along[k] - to[k]))
    }

    /// The first edge on the way from `x` to another point, and the first in number that `x` lies on.
    fn first(&self, x: &Point<2>, to: &Point<2>) -> (Option<u32>, Option<u32>) {
        let (mut first, mut on) = (None, None::<u32>);
        self.tree.meeting(x, to, |e| {
            let [a, b] = self.ends(e);
            let turn = orient(a, b, x);
            if turn == 0.0 && is_boxed(x, [a, b]) {
                on = Some(on.map_or(e, |on| on.min(e)));
            }
            let after = orient(a, b, to);
            let is_reached = (turn > 0.0 && after <= 0.0) || (turn < 0.0 && after >= 0.0);
            // a vertex on the way counts as left of it
            let is_crossed = is_reached && (orient(x, to, a) >= 0.0) != (orient(x, to, b) >= 0.0);
            if is_crossed && first.is_none_or(|first| self.is_before(e, first, x)) {
                first = Some(e);
            }
        });
        (first, on)
    }

    /// Whether the first of two edges that one way from `x` crosses is crossed before the other. As they cross nowhere, one of
    /// them lies on one side of the other.
    fn is_before(&self, e: u32, f: u32, x: &Point<2>) -> bool {
        let ([a, b], [c, d]) = (self.ends(e), self.ends(f));
        let (of_c, of_d) = (orient(a, b, c), orient(a, b, d));
        if of_c.max(of_d) <= 0.0 || of_c.min(of_d) >= 0.0 {
            return (of_c.max(of_d) > 0.0) != (orient(a, b, x) > 0.0);
        }
        (orient(c, d, a).max(orient(c, d, b)) > 0.0) == (orient(c, d, x) > 0.0)
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

    /// The next edge below `x`.
    fn below(&self, x: &Point<2>) -> Option<u32> {
        let is_below = |e: u32| {
            let [left, right] = self.rightward(e);
            left[0] <= x[0] && x[0] < right[0] && orient(left, right, x) > 0.0
        };
        self.tree.highest_below(x, self.floor.min(x[1]), is_below, |e, f| self.is_higher(e, f))
    }

    /// Whether the first of two edges is the upper one where both are below a point.
    fn is_higher(&self, e: u32, f: u32) -> bool {
        let [[a, b], [c, d]] = [e, f].map(|edge| self.rightward(edge));
        let first = if a[0] >= c[0] { orient(c, d, a) } else { -orient(a, b, c) };
        let last = if b[0] <= d[0] { orient(c, d, b) } else { -orient(a, b, d) };
        if first == 0.0 { last > 0.0 } else { first > 0.0 }
    }

    fn ends(&self, e: u32) -> [&Point<2>; 2] {
        self.edges[e as usize].1.vertices.map(|v| &self.domain.points[v as usize])
    }

    /// Ends of an edge from left to right.
    fn rightward(&self, e: u32) -> [&Point<2>; 2] {
        let [a, b] = self.ends(e);
        if a[0] < b[0] { [a, b] } else { [b, a] }
    }

    /// The side of an edge, not a vertical one, that lies above it.
    fn above(&self, e: u32) -> &Side {
        let [a, b] = self.ends(e);
        &self.edges[e as usize].1.sides[usize::from(a[0] > b[0])]
    }

    /// The side of an edge that a point lies on.
    fn side(&self, e: u32, x: &Point<2>) -> &Side {
        let [a, b] = self.ends(e);
        &self.edges[e as usize].1.sides[usize::from(orient(a, b, x) < 0.0)]
    }
}

/// Whether a point lies in the box of two others.
fn is_boxed(x: &Point<2>, [a, b]: [&Point<2>; 2]) -> bool {
    (0..2).all(|k| a[k].min(b[k]) <= x[k] && x[k] <= a[k].max(b[k]))
}
