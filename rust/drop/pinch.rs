//! Nodes where a level only touches itself, though the input does not.
//!
//! ```text
//!        inside \     / outside
//!                \   /
//!     outside     \ /     outside       the cells around a node form two runs with gaps between
//!                 / \
//!                /   \
//!       outside /     \ inside
//! ```
//!
//! A short run is cut off, or a short gap filled with cells that are no slivers, where that leaves fewer such nodes; of
//! the ways that do, the one that changes the area least.

use super::trim::Trimmed;
use crate::point::NONE;

/// Runs and gaps of more cells are left alone.
const MOST_CELLS: usize = 3;

impl Trimmed {
    /// Cuts off runs and fills gaps at nodes that have more runs than `natural` says.
    pub fn unpinch(&mut self, limit_deg: f64, natural: impl Fn(u32) -> usize) {
        let mut cell_at = vec![NONE; self.sites.len()];
        for (t, cell) in self.cells.iter().enumerate() {
            cell.corners.iter().for_each(|&s| cell_at[s as usize] = t as u32);
        }
        let excess = |trimmed: &Trimmed, s: u32| {
            let fan = trimmed.fan(cell_at[s as usize], s);
            let n = fan.len();
            let starts = (0..n).filter(|&i| trimmed.is_in(fan[i]) && !trimmed.is_in(fan[(i + n - 1) % n])).count();
            starts.saturating_sub(natural(trimmed.sites[s as usize]))
        };
        for s in 0..self.sites.len() as u32 {
            while cell_at[s as usize] != NONE && excess(self, s) > 0 {
                let mut best: Option<(f64, Vec<u32>, Option<i64>, u32)> = None;
                for (cells, label, part) in self.ways(cell_at[s as usize], s, limit_deg) {
                    let mut sites: Vec<u32> = cells.iter().flat_map(|&t| self.cells[t as usize].corners).collect();
                    sites.sort_unstable();
                    sites.dedup();
                    let count = |trimmed: &Trimmed| -> usize { sites.iter().map(|&s| excess(trimmed, s)).sum() };
                    let before = count(self);
                    let old: Vec<Option<i64>> = cells.iter().map(|&t| self.label[t as usize]).collect();
                    cells.iter().for_each(|&t| self.label[t as usize] = label);
                    let after = count(self);
                    cells.iter().zip(old).for_each(|(&t, old)| self.label[t as usize] = old);
                    let change: f64 = cells.iter().map(|&t| self.area_of(t as usize)).sum();
                    if after < before && best.as_ref().is_none_or(|(least, ..)| change < *least) {
                        best = Some((change, cells, label, part));
                    }
                }
                let Some((_, cells, label, part)) = best else { break };
                for &t in &cells {
                    (self.label[t as usize], self.part[t as usize]) = (label, part);
                }
            }
        }
    }

    /// The cells around a site; at a corner of the hull [`NONE`] stands for what is beyond it.
    fn fan(&self, t: u32, s: u32) -> Vec<u32> {
        let mut fan: Vec<u32> = self.around(t as usize, s).map(|t| t as u32).collect();
        if self.cells[fan[0] as usize].neighbours[self.corner(fan[0] as usize, s)] == NONE {
            fan.push(NONE);
        }
        fan
    }

    fn is_in(&self, t: u32) -> bool {
        t != NONE && self.label[t as usize].is_some()
    }

    /// Short runs to be cut off (no label) and short gaps to be filled (with a label and a part).
    fn ways(&self, t: u32, s: u32, limit_deg: f64) -> Vec<(Vec<u32>, Option<i64>, u32)> {
        let mut fan = self.fan(t, s);
        let n = fan.len();
        let Some(start) = (0..n).find(|&i| self.is_in(fan[i]) && !self.is_in(fan[(i + n - 1) % n])) else {
            return Vec::new();
        };
        fan.rotate_left(start);
        let mut ways = Vec::new();
        let (mut last_label, mut last_part) = (None, 0);
        for run in fan.chunk_by(|&a, &b| self.is_in(a) == self.is_in(b)) {
            let is_in = self.is_in(run[0]);
            if is_in {
                let last = run[run.len() - 1] as usize;
                (last_label, last_part) = (self.label[last], self.part[last]);
            }
            let fills = |t: u32| t != NONE && self.angle[t as usize] >= limit_deg && self.fits(t as usize, last_part);
            let fits = is_in || run.iter().all(|&t| fills(t));
            if run.len() <= MOST_CELLS && fits {
                ways.push((run.to_vec(), if is_in { None } else { last_label }, last_part));
            }
        }
        ways
    }
}
