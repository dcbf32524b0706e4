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

/// No entry.
const NONE: u32 = u32::MAX;

/// A coupling that is left out, given by where entries stand.
struct Weak {
    ends: [u32; 2],
    /// Of the rows of both ends and the columns of the other one.
    entries: [u32; 2],
    over: Option<Way>,
    /// Mean of both entries.
    half: f64,
}

/// The way over a neighbour k that does not repel.
struct Way {
    k: u32,
    /// From both ends to k.
    there: [u32; 2],
    /// From k to both ends.
    back: [u32; 2],
}

/// The square matrix without its couplings with `|a_ij|` and `|a_ji| < least · sqrt(a_ii a_jj)`.
///
/// Runtime: O(entries + weak entries · entries of a row); what is weak is found in parallel.
pub fn filtered(mut a: Rows, least: f64) -> Result<Rows, Error> {
    let view = a.view();
    let rows = (0..view.len()).into_par_iter().with_min_len(CHUNK);
    let (diagonal, own): (Vec<u32>, Vec<f64>) =
        rows.map(|i| place(view, i, i)).map(|at| (at, at_or_0(view, at))).unzip();
    let starts: Vec<usize> = (0..view.len()).step_by(CHUNK).collect();
    let found: Vec<Vec<Weak>> = starts
        .into_par_iter()
        .map(|start| {
            let mut found = Vec::new();
            let rows = start..(start + CHUNK).min(view.len());
            rows.for_each(|i| weak_couplings(view, &own, i, least, &mut found));
            found
        })
        .collect();
    let mut gone = vec![false; a.data.len()];
    for Weak { ends, entries, over, half } in found.iter().flatten() {
        for end in 0..2 {
            let (at, own) = (entries[end], diagonal[ends[end] as usize]);
            let left = at_or_0(a.view(), at);
            if at != NONE {
                gone[at as usize] = true;
            }
            if let Some(Way { k, there, back }) = over {
                for (at, own) in [(there[end], own), (back[end], diagonal[*k as usize])] {
                    if at != NONE && own != NONE {
                        a.data[at as usize] += 2.0 * half;
                        a.data[own as usize] -= 2.0 * half;
                    }
                }
            }
            if own != NONE {
                a.data[own as usize] += left;
            }
        }
    }
    a.without(&gone)
}

/// Adds the weak couplings between i and unknowns after it.
fn weak_couplings(a: RowsRef<'_>, own: &[f64], i: usize, least: f64, found: &mut Vec<Weak>) {
    let bound = |i: usize, j: usize| least * least * (own[i] * own[j]);
    let is_weak = |i: usize, j: usize, size: f64| size * size < bound(i, j);
    let (columns, values) = a.row(i);
    for (at, (&column, &value)) in columns.iter().zip(values).enumerate() {
        let j = column as usize;
        if j <= i || !is_weak(i, j, value) {
            continue;
        }
        let entry = place(a, j, i);
        let back = at_or_0(a, entry);
        if !is_weak(i, j, back) {
            continue;
        }
        let half = (value + back) / 2.0;
        let over = if half > 0.0 { None } else { way(a, [i, j], is_weak) };
        if half > 0.0 || over.is_some() {
            found.push(Weak {
                ends: [i as u32, j as u32],
                entries: [a.indptr[i] as u32 + at as u32, entry],
                over,
                half,
            });
        }
    }
}

/// The way over the common neighbour whose lesser coupling is the strongest; that one must not be weak itself.
fn way(a: RowsRef<'_>, [i, j]: [usize; 2], is_weak: impl Fn(usize, usize, f64) -> bool) -> Option<Way> {
    let (columns, values) = a.row(i);
    let (others, strengths) = a.row(j);
    let (mut best, mut strongest, mut at) = (None, 0.0, 0);
    for (place, (&k, &strength)) in columns.iter().zip(values).enumerate() {
        while at < others.len() && others[at] < k {
            at += 1;
        }
        if at == others.len() {
            break;
        }
        let index = k as usize;
        if others[at] != k || index == i || index == j {
            continue;
        }
        let (one, other) = (-strength, -strengths[at]);
        let lesser = other.min(one);
        if lesser > strongest && !is_weak(i, index, one) && !is_weak(j, index, other) {
            (best, strongest) = (Some((index, [place, at])), lesser);
        }
    }
    best.map(|(k, [one, other])| Way {
        k: k as u32,
        there: [(a.indptr[i] as usize + one) as u32, (a.indptr[j] as usize + other) as u32],
        back: [place(a, k, i), place(a, k, j)],
    })
}

/// Where the entry of row i and column j stands.
fn place(a: RowsRef<'_>, i: usize, j: usize) -> u32 {
    a.row(i).0.binary_search(&(j as i32)).map_or(NONE, |k| a.indptr[i] as u32 + k as u32)
}

fn at_or_0(a: RowsRef<'_>, at: u32) -> f64 {
    if at == NONE { 0.0 } else { a.data[at as usize] }
}
