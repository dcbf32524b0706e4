//! Products of sparse matrices for Galerkin's coarse operators, `R A P`.
//!
//! Row by row (Gustavson 1978): a row of `R A`, and then that row times `P`. Entries are summed up in the order in which
//! they are met, and sorted in the end. A row depends on nothing but its factors, so the result is the same for any number
//! of threads.

use super::filter::filtered;
use super::rows::{Block, Rows, RowsRef};
use crate::error::Error;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Rows that one thread makes at a time.
const CHUNK: usize = 1024;

/// The transpose of `p`, and `p.T a p` without its entries under `least` times the roots of both diagonals.
pub fn products(a: RowsRef<'_>, p: RowsRef<'_>, least: f64) -> Result<(Rows, Rows), Error> {
    let restriction = p.transposed();
    let made = triple(restriction.view(), a, p)?;
    let made = if least > 0.0 { filtered(made, least)? } else { made };
    Ok((restriction, made))
}

/// The triple product `r a p`.
///
/// With `r a` first there is less to sum up than with `a p`: a row of `r` joins neighbours, whose rows of `a` overlap.
/// Runtime: O(entries of r · entries of a row of a + entries of `r a` · entries of a row of p).
pub fn triple(r: RowsRef<'_>, a: RowsRef<'_>, p: RowsRef<'_>) -> Result<Rows, Error> {
    if r.columns != a.len() || a.columns != p.len() {
        let (m, k) = (r.len(), r.columns);
        let shapes = format!("({m}, {k}), ({}, {}), ({}, {})", a.len(), a.columns, p.len(), p.columns);
        return Err(Error::Argument(format!("the shapes {shapes} do not fit for a product")));
    }
    let starts: Vec<usize> = (0..r.len()).step_by(CHUNK).collect();
    let spare = Mutex::new(Vec::new());
    let blocks = starts.into_par_iter().map(|start| {
        let kept = spare.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let (mut half, mut sum, mut made) =
            kept.unwrap_or_else(|| (Sum::new(a.columns), Sum::new(p.columns), Block::default()));
        for i in start..(start + CHUNK).min(r.len()) {
            half.add_rows(r.row(i), a);
            sum.add_rows(half.entries(), p);
            half.clear();
            sum.columns.sort_unstable();
            made.counts.push(sum.columns.len() as u32);
            made.indices.extend_from_slice(&sum.columns);
            made.data.extend_from_slice(sum.entries().1);
            sum.clear();
        }
        let block = made.clone();
        made.clear();
        spare.lock().unwrap_or_else(PoisonError::into_inner).push((half, sum, made));
        block
    });
    Rows::stacked(p.columns, blocks.collect())
}

/// A row in the making.
struct Sum {
    /// By column, what is summed up, and the row that it was last done for.
    slots: Vec<(f64, u32)>,
    row: u32,
    columns: Vec<i32>,
    values: Vec<f64>,
}

impl Sum {
    fn new(columns: usize) -> Self {
        Self { slots: vec![(0.0, 0); columns], row: 1, columns: Vec::new(), values: Vec::new() }
    }

    /// Adds the rows of a matrix that a row combines.
    #[inline(always)]
    fn add_rows(&mut self, (rows, scales): (&[i32], &[f64]), of: RowsRef<'_>) {
        let Self { slots, row, columns, .. } = self;
        let (slots, row) = (slots.as_mut_slice(), *row);
        for (&k, &scale) in rows.iter().zip(scales) {
            let (indices, values) = of.row(k as usize);
            for (&column, &value) in indices.iter().zip(values) {
                let slot = &mut slots[column as usize];
                if slot.1 == row {
                    slot.0 += scale * value;
                } else {
                    *slot = (scale * value, row);
                    columns.push(column);
                }
            }
        }
    }

    /// Columns and values, in the order of the columns' list.
    fn entries(&mut self) -> (&[i32], &[f64]) {
        self.values.clear();
        self.values.extend(self.columns.iter().map(|&column| self.slots[column as usize].0));
        (&self.columns, &self.values)
    }

    /// Starts the next row.
    fn clear(&mut self) {
        self.columns.clear();
        self.row += 1;
    }
}
