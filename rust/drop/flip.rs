//! Edges that stopped being facets: a chord whose two sides ended in one material is an edge like any other, and so must
//! be Delaunay.
//!
//! The cells were triangulated with every valid chord as a constraint, before it was known which of them still bound
//! anything. Flipping edges whose opposite corner lies in their circle ends at the constrained Delaunay triangulation
//! of the facets that are left (Lawson 1977), and no smallest angle of two cells gets worse.

use super::trim::Trimmed;
use crate::point::NONE;

impl Trimmed {
    /// Frees the chords that bound nothing; `stays` says which are facets whatever lies beside them.
    pub fn free_moot_chords(&mut self, stays: impl Fn(usize) -> bool) {
        let mut stack = Vec::new();
        for t in 0..self.label.len() {
            for k in 0..3 {
                let constraint = self.cells[t].constraints[k];
                if constraint == NONE || stays(constraint as usize / 2) || !self.is_of_one_material(t, k) {
                    continue;
                }
                let other = self.cells[t].neighbours[k] as usize;
                let back = self.edge_to(other, t);
                self.cells[t].constraints[k] = NONE;
                self.cells[other].constraints[back] = NONE;
                stack.push((t, k));
            }
        }
        self.settle(stack, |trimmed, t, k| trimmed.cells[t].constraints[k] == NONE && trimmed.is_of_one_material(t, k));
    }

    /// Flips edges (of a cell, from a corner on) that are not Delaunay, and what they leave so, where they may be.
    pub(super) fn settle(&mut self, mut stack: Vec<(usize, usize)>, may_flip: impl Fn(&Trimmed, usize, usize) -> bool) {
        while let Some((t, k)) = stack.pop() {
            let other = self.cells[t].neighbours[k];
            if other == NONE || !may_flip(self, t, k) {
                continue;
            }
            let other = other as usize;
            let back = self.edge_to(other, t);
            if self.encloses(t, self.cells[other].corners[(back + 2) % 3]) {
                self.flip((t, k), (other, back));
                stack.extend([t, other].into_iter().flat_map(|t| (0..3).map(move |k| (t, k))));
            }
        }
    }

    /// Makes slits with the same nodes on both sides edges like any other; whether there were any. `corners` are the nodes
    /// of the cells that are `alive`, one for each.
    pub fn close_slits(&mut self, alive: &[usize], corners: &[[u32; 3]]) -> bool {
        let mut nodes = vec![[NONE; 3]; self.label.len()];
        alive.iter().zip(corners).for_each(|(&t, &cell)| nodes[t] = cell);
        let mut closed = Vec::new();
        for &t in alive {
            for k in 0..3 {
                let (next, constraint) = (self.cells[t].neighbours[k], self.cells[t].constraints[k]);
                if next == NONE || constraint == NONE || !self.is_slit[constraint as usize / 2] {
                    continue;
                }
                let next = next as usize;
                let back = self.edge_to(next, t);
                if nodes[t][k] == nodes[next][(back + 1) % 3] && nodes[t][(k + 1) % 3] == nodes[next][back] {
                    closed.push(constraint as usize / 2);
                }
            }
        }
        closed.iter().for_each(|&c| self.is_slit[c] = false);
        !closed.is_empty()
    }

    fn is_of_one_material(&self, t: usize, k: usize) -> bool {
        let other = self.across(t, k);
        other != NONE && self.label[t].is_some() && self.label[t] == self.label[other as usize]
    }

    /// The edge of a cell that leads to another.
    pub(super) fn edge_to(&self, t: usize, other: usize) -> usize {
        self.cells[t].neighbours.iter().position(|&n| n as usize == other).unwrap_or(0)
    }

    /// Turns the edge that two cells share.
    ///
    /// ```text
    ///       w                 w
    ///     / t \             / | \
    ///    u --- v    to     u t|s v
    ///     \ s /             \ | /
    ///       x                 x
    /// ```
    pub(super) fn flip(&mut self, (t, k): (usize, usize), (s, back): (usize, usize)) {
        let cells = &mut self.cells;
        let [k1, k2, j1, j2] = [(k + 1) % 3, (k + 2) % 3, (back + 1) % 3, (back + 2) % 3];
        let [u, v, w, x] = [cells[t].corners[k], cells[t].corners[k1], cells[t].corners[k2], cells[s].corners[j2]];
        let (beside_t, beside_s) = (cells[t].neighbours, cells[s].neighbours);
        let (on_t, on_s) = (cells[t].constraints, cells[s].constraints);
        cells[t].corners = [u, x, w];
        cells[t].neighbours = [beside_s[j1], s as u32, beside_t[k2]];
        cells[t].constraints = [on_s[j1], NONE, on_t[k2]];
        cells[s].corners = [x, v, w];
        cells[s].neighbours = [beside_s[j2], beside_t[k1], t as u32];
        cells[s].constraints = [on_s[j2], on_t[k1], NONE];
        for (cell, from, to) in [(beside_s[j1], s, t), (beside_t[k1], t, s)] {
            if cell != NONE
                && let Some(n) = cells[cell as usize].neighbours.iter_mut().find(|n| **n as usize == from)
            {
                *n = to as u32;
            }
        }
        for t in [t, s] {
            self.renewed(t);
        }
    }
}
