//! Weak couplings of a coarse operator, left out.
//!
//! Most of what Galerkin's products have beyond the nearest neighbours is weak. A weak coupling w between i and j is handed
//! on to the way over the neighbour k to which both are coupled most (as in Falgout and Schroder 2014):
//!
//! ```text
//!      k
//!     / \      w (u_i - u_j)²  becomes  2 w (u_i - u_k)² + 2 w (u_k - u_j)²,
//!    i - j     the same for linear functions if k lies halfway, and never less
//! ```
//!
//! Where there is no such k the coupling stays, so nothing falls apart. Repulsions, `a_ij > 0`, are added to the diagonal.
//! Rows and columns sum to what they did, and a positive definite matrix stays one.

use super::rows::{Rows, RowsRef};
use crate::error::Error;
use rayon::prelude::*;

/// Rows that one thread looks at at a time.
const CHUNK: usize = 1024;

/// A coupling that is left out.
struct Weak {
    ends: [usize; 2],
    /// The neighbour that it goes over, if it is none that repels.
    over: Option<usize>,
    /// Mean of both entries.
    half: f64,
}

/// The square matrix without its couplings with `|a_ij|` and `|a_ji| < least · sqrt(a_ii a_jj)`.
///
/// Runtime: O(entries + weak entries · entries of a row); what is weak is found in parallel.
pub fn filtered(mut a: Rows, least: f64) -> Result<Rows, Error> {
    let view = a.view();
    let diagonal: Vec<Option<usize>> = (0..view.len()).map(|i| place(view, i, i)).collect();
    let starts: Vec<usize> = (0..view.len()).step_by(CHUNK).collect();
    let found: Vec<Vec<Weak>> = starts
        .into_par_iter()
        .map(|start| {
            let rows = start..(start + CHUNK).min(view.len());
            rows.flat_map(|i| weak_couplings(view, &diagonal, i, least)).collect()
        })
        .collect();
    let mut gone = vec![false; a.data.len()];
    for Weak { ends: [i, j], over, half } in found.into_iter().flatten() {
        for (i, j) in [(i, j), (j, i)] {
            let entry = |a: &Rows, i: usize, j: usize| place(a.view(), i, j);
            let mut left = 0.0;
            if let Some(at) = entry(&a, i, j) {
                gone[at] = true;
                left += a.data[at];
            }
            if let Some(k) = over {
                for (i, k) in [(i, k), (k, i)] {
                    let (at, own) = (entry(&a, i, k), diagonal[i]);
                    if let (Some(at), Some(own)) = (at, own) {
                        a.data[at] += 2.0 * half;
                        a.data[own] -= 2.0 * half;
                    }
                }
            }
            if let Some(own) = diagonal[i] {
                a.data[own] += left;
            }
        }
    }
    a.without(&gone)
}

/// The weak couplings between i and unknowns after it.
fn weak_couplings(a: RowsRef<'_>, diagonal: &[Option<usize>], i: usize, least: f64) -> Vec<Weak> {
    let own = |i: usize| diagonal[i].map_or(0.0, |at| a.data[at]);
    let is_weak = |i: usize, j: usize, size: f64| size * size < least * least * (own(i) * own(j));
    let (columns, values) = a.row(i);
    let mut found = Vec::new();
    for (&j, &value) in columns.iter().zip(values) {
        let j = j as usize;
        let back = if j > i { place(a, j, i).map_or(0.0, |at| a.data[at]) } else { continue };
        if !is_weak(i, j, value.abs().max(back.abs())) {
            continue;
        }
        let half = (value + back) / 2.0;
        if half > 0.0 {
            found.push(Weak { ends: [i, j], over: None, half });
            continue;
        }
        // the common neighbour whose lesser coupling is the strongest; that one must not be weak itself
        let mut best: Option<(f64, usize)> = None;
        let (others, strengths) = a.row(j);
        let mut at = 0;
        for (&k, &strength) in columns.iter().zip(values) {
            while at < others.len() && others[at] < k {
                at += 1;
            }
            let (k_index, other) = (k as usize, others.get(at).filter(|&&other| other == k).map(|_| -strengths[at]));
            let Some(other) = other.filter(|_| k_index != i && k_index != j) else { continue };
            let lesser = other.min(-strength);
            if lesser > best.map_or(0.0, |best| best.0)
                && !is_weak(i, k_index, -strength)
                && !is_weak(j, k_index, other)
            {
                best = Some((lesser, k_index));
            }
        }
        if let Some((_, k)) = best {
            found.push(Weak { ends: [i, j], over: Some(k), half });
        }
    }
    found
}

/// Where the entry of row i and column j stands.
fn place(a: RowsRef<'_>, i: usize, j: usize) -> Option<usize> {
    a.row(i).0.binary_search(&(j as i32)).ok().map(|k| a.indptr[i] as usize + k)
}
