//! Fans: the segments at a vertex of many, so that those with a common end are not all compared with each other.
//!
//! Of two segments that share an end only those in the same direction meet anywhere else. A node of the tree that holds nothing but
//! segments at one vertex, in the order of their directions, is a wedge; a segment at that vertex that leaves outside the wedge
//! meets none of them elsewhere:
//!
//! ```text
//!         \  | /  wedge
//!          \ |/
//!     ------ o
//! ```

use crate::point::{NONE, Point, orient, turn};

/// Segments at a vertex that make a fan.
const MANY: u32 = 16;

/// The fans among some segments.
pub struct Fans {
    points: Vec<Point<2>>,
    /// For each segment its vertex of many segments, or [`NONE`]; of two the one of more.
    hub: Vec<u32>,
    /// Segments of a fan follow each other, counter-clockwise.
    rank: Vec<u32>,
    /// For each node of the tree the hub of all its segments, or [`NONE`], and the far ends of the first and the last.
    wedges: Vec<(u32, [u32; 2])>,
}

impl Fans {
    /// `None` where no vertex has many segments. Runtime: O(n), for the segments of fans O(n log n).
    pub fn find(points: &[Point<2>], ends: &[[u32; 2]]) -> Option<Fans> {
        let mut degree = vec![0u32; points.len()];
        ends.iter().flatten().for_each(|&v| degree[v as usize] += 1);
        if degree.iter().all(|&many| many < MANY) {
            return None;
        }
        let of = |&[a, b]: &[u32; 2]| {
            let v = if degree[a as usize] >= degree[b as usize] { a } else { b };
            if degree[v as usize] < MANY { NONE } else { v }
        };
        let hub: Vec<u32> = ends.iter().map(of).collect();
        let mut order: Vec<u32> = (0..ends.len() as u32).collect();
        order.sort_unstable_by(|&s, &t| {
            let (v, w) = (hub[s as usize], hub[t as usize]);
            let direction = || {
                let [p, q] = [s, t].map(|s| points[other(ends[s as usize], v) as usize]);
                turn(&points[v as usize], &p, &q)
            };
            let both = || if v == NONE { std::cmp::Ordering::Equal } else { direction() };
            v.cmp(&w).then_with(both).then(s.cmp(&t))
        });
        let mut rank = vec![0; ends.len()];
        (0..).zip(order).for_each(|(k, s)| rank[s as usize] = k);
        Some(Fans { points: points.to_vec(), hub, rank, wedges: Vec::new() })
    }

    /// The vertex of many segments that one belongs to.
    pub fn hub(&self, segment: u32) -> Option<&Point<2>> {
        self.points.get(self.hub[segment as usize] as usize)
    }

    /// Place of a segment where all else is equal.
    pub fn rank(&self, segment: u32) -> u32 {
        self.rank[segment as usize]
    }

    /// Takes the segments of the next node of the tree.
    pub fn push(&mut self, segments: &[u32], ends: &[[u32; 2]]) {
        let hub = segments.first().map_or(NONE, |&s| self.hub[s as usize]);
        let is_fan = hub != NONE && segments.iter().all(|&s| self.hub[s as usize] == hub);
        let first = segments.iter().min_by_key(|&&s| self.rank(s));
        let last = segments.iter().max_by_key(|&&s| self.rank(s));
        self.wedges.push(match (first, last) {
            (Some(&first), Some(&last)) if is_fan => (hub, [first, last].map(|s| other(ends[s as usize], hub))),
            _ => (NONE, [NONE; 2]),
        });
    }

    /// Whether a segment may meet those of a node elsewhere than at a hub that is an end of it.
    pub fn may_meet(&self, node: usize, segment: [u32; 2]) -> bool {
        let (hub, wedge) = self.wedges[node];
        if hub == NONE || !segment.contains(&hub) {
            return true;
        }
        let [v, far, first, last] = [hub, other(segment, hub), wedge[0], wedge[1]].map(|v| &self.points[v as usize]);
        if turn(v, first, last).is_eq() {
            return turn(v, first, far).is_eq();
        }
        let is_convex = orient(v, first, last) > 0.0;
        !is_convex || (orient(v, first, far) >= 0.0 && orient(v, far, last) >= 0.0)
    }
}

fn other([a, b]: [u32; 2], v: u32) -> u32 {
    if a == v { b } else { a }
}
