//! Where the finer mesh ends around the nodes that it shares with the coarse one.
//!
//! A shared node is a point of both meshes, but not all that the coarse mesh has there is on the side of all that the
//! finer one has there: a slit or a notch of the finer mesh may leave the node between the two.
//!
//! ```text
//!        v            v is a neighbour of s in the finer mesh, h and e are on the boundary of the coarse one, and what is
//!         \  /////    hatched is in neither. Turning from v to e meets the hatched gap, turning to h does not: so v may
//!     h    \ //// e   take a value of h, or of s itself, but none of e.
//!   --------s--------
//!      coarse mesh
//! ```

use super::halfedges::HalfEdges;
use crate::point::{NONE, Point, orient};

/// The boundary edges of the finer mesh at each shared node.
pub struct Walls<'a> {
    points: &'a [Point<2>],
    /// Where those of each coarse node start.
    starts: Vec<u32>,
    ends: Vec<End>,
}

/// A boundary edge at a node.
#[derive(Clone, Copy)]
struct End {
    /// The node at its other end.
    node: u32,
    /// Whether the edge comes in (then the gap is on its left, seen from the node), or goes out (on its right).
    comes_in: bool,
}

impl<'a> Walls<'a> {
    /// Takes the boundary edges of the finer mesh, their cell on the left; `on_boundary` tells their nodes from others.
    /// Runtime: O(b log b + m).
    pub fn new(
        points: &'a [Point<2>],
        boundary: &[[u32; 2]],
        on_boundary: impl Fn(u32) -> bool,
        injection: &[u32],
    ) -> Self {
        let mut at: Vec<(u32, End)> = Vec::with_capacity(2 * boundary.len());
        for &[a, b] in boundary {
            at.push((a, End { node: b, comes_in: false }));
            at.push((b, End { node: a, comes_in: true }));
        }
        at.sort_by_key(|&(node, _)| node);
        let mut starts = vec![0];
        let mut ends = Vec::new();
        for &v in injection {
            if v != NONE && on_boundary(v) {
                let first = at.partition_point(|&(node, _)| node < v);
                ends.extend(at[first..].iter().take_while(|&&(node, _)| node == v).map(|&(_, end)| end));
            }
            starts.push(ends.len() as u32);
        }
        Self { points, starts, ends }
    }

    fn at(&self, node: u32) -> &[End] {
        &self.ends[self.starts[node as usize] as usize..self.starts[node as usize + 1] as usize]
    }

    /// Whether the finer mesh ends somewhere around a coarse node.
    pub fn ends_at(&self, node: u32) -> bool {
        !self.at(node).is_empty()
    }

    /// Whether the finer mesh ends on the way from the direction of its point `v`, node `to` of it or `NONE`, to that of a
    /// boundary edge `h` at the same coarse node.
    pub fn part(&self, mesh: &HalfEdges<'_>, node: u32, to: u32, v: &Point<2>, h: u32) -> bool {
        let origin = &mesh.points[node as usize];
        let goes_out = mesh.node(h) == node;
        let other = mesh.point(if goes_out { super::halfedges::next(h) } else { h });
        // outside is on the right of a half-edge: ways to one that goes out turn to the left, and the others to the right
        self.at(node).iter().filter(|end| end.comes_in == goes_out).any(|end| {
            let p = &self.points[end.node as usize];
            let same = end.node != to && turn(origin, v, p) == 0;
            !same && comes_before(origin, v, p, other, goes_out)
        })
    }
}

/// Quarter of the turn from `v` to `p` about `o`: 0 and 2 are on the line, 1 is left of it and 3 right.
fn turn(o: &Point<2>, v: &Point<2>, p: &Point<2>) -> u8 {
    let side = orient(o, v, p);
    if side != 0.0 {
        return if side > 0.0 { 1 } else { 3 };
    }
    if (v[0] - o[0]) * (p[0] - o[0]) + (v[1] - o[1]) * (p[1] - o[1]) > 0.0 { 0 } else { 2 }
}

/// Whether `p` comes before `q` in a turn about `o` from `v` on.
fn comes_before(o: &Point<2>, v: &Point<2>, p: &Point<2>, q: &Point<2>, leftwards: bool) -> bool {
    let way = |x: &Point<2>| match turn(o, v, x) {
        side if leftwards => side,
        side => (4 - side) % 4,
    };
    let between = orient(o, p, q);
    way(p) < way(q) || way(p) == way(q) && way(p) % 2 == 1 && if leftwards { between > 0.0 } else { between < 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_come_in_the_order_of_the_turn() {
        let around = [[1.0, 0.0], [1.0, 1.0], [-1.0, 1.0], [-2.0, 0.0], [-1.0, -2.0], [3.0, -1.0]];
        let o = [0.0, 0.0];
        for (i, p) in around.iter().enumerate() {
            for (j, q) in around.iter().enumerate() {
                assert_eq!(comes_before(&o, &around[0], p, q, true), i < j);
                let right = |k: usize| (6 - k) % 6;
                assert_eq!(comes_before(&o, &around[0], p, q, false), right(i) < right(j));
            }
        }
    }
}
