//! Products of sparse matrices for Galerkin's coarse operators, `R A P`.
//!
//! Row by row (Gustavson 1978): the entries of a row are summed up in a list, in the order in which they are met, and
//! sorted in the end. A row depends on nothing but its factors, so the result is the same for any number of threads.

use super::rows::{Block, Rows, RowsRef};
use crate::error::Error;
use rayon::prelude::*;

/// Rows that one thread makes at a time.
const CHUNK: usize = 1024;

/// The triple product `r a p`, without the intermediate matrix.
///
/// With prolongations `p` by triangles and `r` its transpose each row of `a` is looked at three times; storing `a p`
/// would cost more than that. Runtime: O(entries of r · entries of a row of a · entries of a row of p).
pub fn triple(r: RowsRef<'_>, a: RowsRef<'_>, p: RowsRef<'_>) -> Result<Rows, Error> {
    if r.columns != a.len() || a.columns != p.len() {
        let (m, k) = (r.len(), r.columns);
        let shapes = format!("({m}, {k}), ({}, {}), ({}, {})", a.len(), a.columns, p.len(), p.columns);
        return Err(Error::Argument(format!("the shapes {shapes} do not fit for a product")));
    }
    let starts: Vec<usize> = (0..r.len()).step_by(CHUNK).collect();
    let blocks = starts.into_par_iter().map_init(
        || Sum::new(p.columns),
        |sum, start| {
            let mut block = Block::default();
            for i in start..(start + CHUNK).min(r.len()) {
                let (rows, weights) = r.row(i);
                for (&k, &weight) in rows.iter().zip(weights) {
                    let (columns, values) = a.row(k as usize);
                    for (&l, &value) in columns.iter().zip(values) {
                        let scale = weight * value;
                        let (ends, shares) = p.row(l as usize);
                        for (&j, &share) in ends.iter().zip(shares) {
                            sum.add(j, scale * share);
                        }
                    }
                }
                sum.write(&mut block);
            }
            block
        },
    );
    Rows::stacked(p.columns, blocks.collect())
}

/// A row in the making.
struct Sum {
    /// By column, what is summed up, and the row that it was last done for.
    slots: Vec<(f64, u32)>,
    row: u32,
    columns: Vec<i32>,
}

impl Sum {
    fn new(columns: usize) -> Self {
        Self { slots: vec![(0.0, u32::MAX); columns], row: 0, columns: Vec::new() }
    }

    #[inline(always)]
    fn add(&mut self, column: i32, value: f64) {
        let slot = &mut self.slots[column as usize];
        if slot.1 == self.row {
            slot.0 += value;
        } else {
            *slot = (value, self.row);
            self.columns.push(column);
        }
    }

    fn write(&mut self, block: &mut Block) {
        self.columns.sort_unstable();
        block.counts.push(self.columns.len() as u32);
        block.data.extend(self.columns.iter().map(|&column| self.slots[column as usize].0));
        block.indices.append(&mut self.columns);
        self.row += 1;
    }
}
