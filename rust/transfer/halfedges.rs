//! Half-edges of a triangle mesh.
//!
//! Half-edge `3 c + k` runs from node `k` of cell `c` to its next node, the cell on its left:
//!
//! ```text
//!            apex
//!           /    \
//!    prev  /      \  next
//!         v        ^
//!        a ---h---> b
//!          twin(h): b -> a in the cell below, NONE on the boundary
//! ```

use crate::error::Error;
use crate::point::{NONE, Point};
use rayon::prelude::*;

/// A mesh, its cells counter-clockwise, that can be walked in.
pub struct HalfEdges<'a> {
    /// Nodes.
    pub points: &'a [Point<2>],
    /// Cells.
    pub cells: &'a [[u32; 3]],
    twin: Vec<u32>,
    starts: Vec<u32>,
    /// End node and half-edge, by start node.
    out: Vec<[u32; 2]>,
}

/// The next half-edge of the same cell.
#[inline(always)]
pub fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before, of the same cell.
#[inline(always)]
pub fn prev(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

impl<'a> HalfEdges<'a> {
    /// Finds the twins by the half-edges that leave a node. Runtime: O(n + m) for bounded degrees.
    pub fn new(points: &'a [Point<2>], cells: &'a [[u32; 3]]) -> Result<Self, Error> {
        if cells.len() > (u32::MAX / 3) as usize - 1 {
            return Err(Error::Argument(format!("{} cells, expected at most {}", cells.len(), u32::MAX / 3 - 1)));
        }
        let mut starts = vec![0u32; points.len() + 1];
        for &node in cells.as_flattened() {
            match starts.get_mut(node as usize + 1) {
                Some(count) => *count += 1,
                None => {
                    return Err(Error::Argument(format!("a cell names node {node} of {}", points.len())));
                }
            }
        }
        for i in 0..points.len() {
            starts[i + 1] += starts[i];
        }
        let mut place = starts.clone();
        let mut out = vec![[NONE; 2]; 3 * cells.len()];
        for (c, cell) in cells.iter().enumerate() {
            for k in 0..3 {
                let at = &mut place[cell[k] as usize];
                out[*at as usize] = [cell[(k + 1) % 3], (3 * c + k) as u32];
                *at += 1;
            }
        }
        let twin_of = |h: usize| {
            let (cell, k) = (cells[h / 3], h % 3);
            let (a, b) = (cell[k], cell[(k + 1) % 3]);
            let from_b = &out[starts[b as usize] as usize..starts[b as usize + 1] as usize];
            from_b.iter().find(|edge| edge[0] == a).map_or(NONE, |edge| edge[1])
        };
        let twin = (0..3 * cells.len()).into_par_iter().with_min_len(4096).map(twin_of).collect();
        Ok(Self { points, cells, twin, starts, out })
    }

    /// The same edge in the cell on the other side, or `NONE`.
    #[inline(always)]
    pub fn twin(&self, h: u32) -> u32 {
        self.twin[h as usize]
    }

    /// The node that a half-edge leaves.
    #[inline(always)]
    pub fn node(&self, h: u32) -> u32 {
        self.cells[(h / 3) as usize][(h % 3) as usize]
    }

    /// The point that a half-edge leaves.
    #[inline(always)]
    pub fn point(&self, h: u32) -> &Point<2> {
        &self.points[self.node(h) as usize]
    }

    /// End node and half-edge of all that leave a node.
    pub fn leaving(&self, node: u32) -> &[[u32; 2]] {
        &self.out[self.starts[node as usize] as usize..self.starts[node as usize + 1] as usize]
    }

    /// All half-edges on the boundary, ascending.
    pub fn boundary(&self) -> impl Iterator<Item = u32> {
        (0..self.twin.len() as u32).filter(|&h| self.twin(h) == NONE)
    }

    /// The boundary half-edge that goes on where `h`, on the boundary, ends.
    pub fn next_on_boundary(&self, h: u32) -> u32 {
        let mut edge = next(h);
        // a fan of an open side ends at the boundary: no more turns than half-edges
        for _ in 0..self.twin.len() {
            match self.twin(edge) {
                NONE => break,
                across => edge = next(across),
            }
        }
        edge
    }

    /// The boundary half-edge that ends where `h`, on the boundary, starts.
    pub fn prev_on_boundary(&self, h: u32) -> u32 {
        let mut edge = prev(h);
        for _ in 0..self.twin.len() {
            match self.twin(edge) {
                NONE => break,
                across => edge = prev(across),
            }
        }
        edge
    }

    /// Whether directions at a node say too little about the side that is meant: it is where parts only touch, or its
    /// cells fill more than three quarters of the turn, as around the tip of a slit.
    pub fn is_tip(&self, node: u32) -> bool {
        let mut fans = 0;
        let mut angle = 0.0;
        for &[_, h] in self.leaving(node) {
            fans += usize::from(self.twin(h) == NONE);
            let (p, a, b) = (self.point(h), self.point(next(h)), self.point(prev(h)));
            let (u, v) = ([a[0] - p[0], a[1] - p[1]], [b[0] - p[0], b[1] - p[1]]);
            angle += f64::atan2(u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1]);
        }
        fans > 1 || (fans == 1 && angle > 1.5 * std::f64::consts::PI)
    }
}
