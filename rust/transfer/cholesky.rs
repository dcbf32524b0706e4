//! The dense factor of the coarsest matrix of a multigrid.

use super::rows::RowsRef;
use crate::error::Error;

/// A dense lower factor.
pub struct Cholesky {
    /// Unknowns.
    pub size: usize,
    lower: Vec<f64>,
}

impl Cholesky {
    /// Factors a matrix. Runtime: O(n³), for some hundreds of unknowns.
    pub fn new(a: RowsRef<'_>) -> Result<Self, Error> {
        let size = a.len();
        let mut lower = vec![0.0; size * size];
        for i in 0..size {
            let (columns, values) = a.row(i);
            columns.iter().zip(values).for_each(|(&j, value)| lower[i * size + j as usize] += value);
        }
        for i in 0..size {
            // what is left of a singular matrix is rounding, of either sign
            let rounding = size as f64 * f64::EPSILON * lower[i * size + i];
            for j in 0..=i {
                let (row, other) = (&lower[i * size..i * size + j], &lower[j * size..j * size + j]);
                let left = lower[i * size + j] - row.iter().zip(other).map(|(a, b)| a * b).sum::<f64>();
                lower[i * size + j] = if i > j {
                    left / lower[j * size + j]
                } else if left > rounding {
                    left.sqrt()
                } else {
                    let text = "the coarsest matrix is not positive definite: hold an unknown, or use another solver";
                    return Err(Error::Argument(text.into()));
                };
            }
        }
        Ok(Self { size, lower })
    }

    /// Solves for `x`.
    pub fn solve(&self, b: impl Fn(usize) -> f32, mut set: impl FnMut(usize, f32)) {
        let n = self.size;
        let mut y: Vec<f64> = (0..n).map(|i| f64::from(b(i))).collect();
        for i in 0..n {
            let sum: f64 = (0..i).map(|j| self.lower[i * n + j] * y[j]).sum();
            y[i] = (y[i] - sum) / self.lower[i * n + i];
        }
        for i in (0..n).rev() {
            y[i] /= self.lower[i * n + i];
            for j in 0..i {
                y[j] -= self.lower[i * n + j] * y[i];
            }
        }
        y.into_iter().enumerate().for_each(|(i, y)| set(i, y as f32));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::rows::Rows;

    #[test]
    fn singular_matrices_are_refused_whatever_the_rounding() {
        let n = 30;
        for seed in 1..50u32 {
            // couplings of a complete graph; rows sum to 0
            let coupling = |i: usize, j: usize| f64::from((seed * (i * j + i + j) as u32) % 97) / 97.0;
            let mut data = vec![0.0; n * n];
            for i in 0..n {
                for j in (0..n).filter(|&j| j != i) {
                    data[i * n + j] = -coupling(i, j);
                    data[i * n + i] += coupling(i, j);
                }
            }
            let indptr = (0..=n).map(|i| (i * n) as i32).collect();
            let indices = (0..n * n).map(|k| (k % n) as i32).collect();
            let mut a = Rows { columns: n, indptr, indices, data };
            assert!(Cholesky::new(a.view()).is_err(), "{seed}");
            a.data[0] += 1e-6;
            assert!(Cholesky::new(a.view()).is_ok(), "{seed}");
        }
    }
}
