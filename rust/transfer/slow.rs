//! Unknowns that are slow: where the coarse ones are so far apart that relaxation alone does not reach all between them.
//!
//! Compatible relaxation (Livne 2004): errors of 1 at all unknowns but the coarse ones, which stay 0, are relaxed by as many
//! sweeps as a cycle has. Where much of them is left, a cycle is slow.

use super::rows::RowsRef;
use crate::error::Error;

/// Symmetric Gauss-Seidel sweeps.
const SWEEPS: usize = 2;

/// The unknowns, ascending, where more than `left` of the errors is left. Runtime: O(entries), one thread.
pub fn slow(a: RowsRef<'_>, coarse: &[bool], left: f64) -> Result<Vec<u32>, Error> {
    let n = a.len();
    if a.columns != n || coarse.len() != n {
        let sizes = format!("{n} rows and {} columns, 'coarse' {} entries", a.columns, coarse.len());
        return Err(Error::Argument(format!("'A' has {sizes}")));
    }
    let free = |&i: &usize| !coarse[i];
    let mut e: Vec<f64> = (0..n).map(|i| f64::from(u8::from(free(&i)))).collect();
    let mut relax = |i: usize| {
        let (columns, values) = a.row(i);
        let (mut sum, mut own) = (0.0, 0.0);
        for (&j, value) in columns.iter().zip(values) {
            if j as usize == i {
                own = *value;
            } else {
                sum -= value * e[j as usize];
            }
        }
        if own != 0.0 {
            e[i] = sum / own;
        }
    };
    for _ in 0..SWEEPS {
        (0..n).filter(free).for_each(&mut relax);
        (0..n).rev().filter(free).for_each(&mut relax);
    }
    Ok((0..n as u32).filter(|&i| e[i as usize].abs() > left).collect())
}
