//! Layers of stretched cells, as they are made along walls of flows, thinned until cells are no needles.
//!
//! ```text
//!     o-----------------o            o-----------------o
//!     o-----------------o
//!     o-----------------o     to
//!     o-----------------o
//!     ===================            ===================      wall
//! ```
//!
//! Spacing is the distance to the nearest node, so across such a layer it is that between two sheets of nodes, and a level would
//! keep every other sheet with all of its nodes. Peeling would take the needles off sheet by sheet, and the wall with them.
//! Interior nodes of needles (cells of angles under [`NEEDLE_DEG`]) are selected once more instead, by the conflict rule
//! with half the needle's length as the spacing; and a node over a wall whose angle over the wall's ends is that
//! small is taken out.

use super::Ground;
use super::trim::Trimmed;
use crate::error::Error;
use crate::kdtree::KdTree;
use crate::point::{NONE, Point, distance};
use crate::progress::Progress;
use crate::selection::greedy;
use std::collections::HashSet;

/// Cells under this angle are needles, in degrees.
const NEEDLE_DEG: f64 = 7.5;

/// With this two nodes conflict that are nearer than the mean of their spacings.
const BETA: f64 = 2.0;

/// Spacing of the nodes that stay, as a share of the needle's length.
const SHARE: f64 = 0.5;

impl Ground<'_> {
    /// Interior sites that go so that needles vanish.
    pub(super) fn thinned(&self, trimmed: &Trimmed) -> Result<Vec<u32>, Error> {
        let facets = self.domain.len() as u32;
        let is_interior = |s: u32| trimmed.sites[s as usize] >= facets;
        let mut room = vec![0.0f64; trimmed.sites.len()];
        let mut over = HashSet::new();
        for t in trimmed.alive().filter(|&t| trimmed.angle[t] < NEEDLE_DEG) {
            let cell = trimmed.cells.cells[t];
            let p = cell.map(|s| trimmed.points[s as usize]);
            let length = [0, 1, 2].map(|k| distance(&p[k], &p[(k + 1) % 3]));
            let longest = length.into_iter().fold(0.0, f64::max);
            let shortest = length.into_iter().fold(f64::INFINITY, f64::min);
            for k in 0..3 {
                room[cell[k] as usize] = room[cell[k] as usize].max(SHARE * longest);
                let is_wall = trimmed.across(t, k) == NONE && trimmed.cells.constraints[t][k] != NONE;
                let opposite = cell[(k + 2) % 3];
                if is_wall && length[k] > shortest && is_interior(opposite) {
                    over.insert(opposite);
                }
            }
        }
        let marked: Vec<u32> =
            (0..room.len() as u32).filter(|&s| room[s as usize] > 0.0 && !over.contains(&s)).collect();
        let points: Vec<Point<2>> = marked.iter().map(|&s| trimmed.points[s as usize]).collect();
        let rooms: Vec<f64> = marked.iter().map(|&s| room[s as usize]).collect();
        let (mut order, keep): (Vec<u32>, Vec<u32>) =
            (0..marked.len() as u32).partition(|&k| is_interior(marked[k as usize]));
        let node = |k: u32| trimmed.sites[marked[k as usize] as usize];
        order.sort_unstable_by(|&a, &b| rooms[b as usize].total_cmp(&rooms[a as usize]).then(node(a).cmp(&node(b))));
        let stays: HashSet<u32> =
            greedy(&KdTree::new(&points), &rooms, BETA, &order, &keep, &Progress::default())?.into_iter().collect();
        let mut lost: Vec<u32> = over.into_iter().collect();
        lost.extend(order.into_iter().filter(|k| !stays.contains(k)).map(|k| marked[k as usize]));
        lost.sort_unstable();
        Ok(lost)
    }
}
