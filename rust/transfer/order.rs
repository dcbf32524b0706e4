//! Orders of unknowns for Gauss-Seidel sweeps on all cores: blocks that are not coupled to each other, then their seam.

use super::rows::RowsRef;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Blocks of a sweep.
const BLOCKS: usize = 16;

/// Rows of a block at least.
const LEAST_BLOCK: usize = 8192;

/// Couplings between blocks, as a share of all, that the given order may have.
const MOST_STRANGE: f64 = 0.05;

/// Entries that one thread takes at a time.
const PART: usize = 8192;

/// An order of unknowns: blocks that are not coupled, then their seam.
#[derive(Default)]
pub struct Order {
    /// Old number by new number, or nothing where the order is the given one.
    old: Vec<u32>,
    /// New number by old number, or nothing.
    new: Vec<u32>,
    /// Ends of the blocks in new numbers, or nothing if all is one block.
    pub ends: Vec<usize>,
}

impl Order {
    /// The given order within blocks if these are mostly coupled within themselves, else breadth first over the couplings.
    pub fn of(a: RowsRef<'_>) -> Self {
        let (n, block) = (a.len(), a.len().div_ceil(BLOCKS).max(LEAST_BLOCK));
        if n <= block {
            return Self::default();
        }
        let strange = |i: &usize| a.row(*i).0.iter().filter(|&&j| j as usize / block != i / block).count();
        let strange: usize = (0..n).into_par_iter().with_min_len(PART).map(|i| strange(&i)).sum();
        let old = if (strange as f64) < MOST_STRANGE * a.indices.len() as f64 {
            (0..n as u32).collect()
        } else {
            // from the far end of a first search, so that its fronts are short
            let first = breadth_first(a, 0);
            breadth_first(a, first[n - 1])
        };
        Self::seamed(a, &old, block)
    }

    /// Blocks of an order, and their seam.
    fn seamed(a: RowsRef<'_>, given: &[u32], block: usize) -> Self {
        let n = given.len();
        // at most `BLOCKS`, so that a byte is enough
        let mut block_of = vec![0u8; n];
        given.iter().enumerate().for_each(|(k, &i)| block_of[i as usize] = (k / block) as u8);
        let in_seam: Vec<AtomicBool> = (0..n).map(|_| AtomicBool::new(false)).collect();
        (0..n).into_par_iter().with_min_len(PART).for_each(|i| {
            for &j in a.row(i).0 {
                let j = j as usize;
                if block_of[i] != block_of[j] {
                    in_seam[if block_of[i] > block_of[j] { i } else { j }].store(true, Relaxed);
                }
            }
        });
        let blocks: Vec<(Vec<u32>, Vec<u32>)> = given
            .par_chunks(block)
            .map(|members| members.iter().partition(|&&i| !in_seam[i as usize].load(Relaxed)))
            .collect();
        let (mut old, mut ends) = (Vec::with_capacity(n), Vec::new());
        for (members, _) in &blocks {
            old.extend_from_slice(members);
            ends.push(old.len());
        }
        blocks.iter().for_each(|(_, seam)| old.extend_from_slice(seam));
        let mut new = vec![0; n];
        old.iter().enumerate().for_each(|(k, &i)| new[i as usize] = k as u32);
        Self { old, new, ends }
    }

    /// The given number of a new one.
    pub fn old_of(&self, i: usize) -> usize {
        self.old.get(i).map_or(i, |&i| i as usize)
    }

    /// The new number of a given one.
    pub fn new_of(&self, i: usize) -> usize {
        self.new.get(i).map_or(i, |&i| i as usize)
    }
}

fn breadth_first(a: RowsRef<'_>, start: u32) -> Vec<u32> {
    let n = a.len();
    let mut seen = vec![false; n];
    let mut order = Vec::with_capacity(n);
    for root in std::iter::once(start as usize).chain(0..n) {
        if seen[root] {
            continue;
        }
        seen[root] = true;
        let mut at = order.len();
        order.push(root as u32);
        while at < order.len() {
            for &j in a.row(order[at] as usize).0 {
                if !std::mem::replace(&mut seen[j as usize], true) {
                    order.push(j as u32);
                }
            }
            at += 1;
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Couplings of a grid of `side` × `side` unknowns whose numbers are `number` of their places; the far one of each
    /// pair may not know of it.
    fn order_of_grid(side: usize, number: impl Fn(usize) -> usize, both: bool) {
        let n = side * side;
        let mut rows = vec![Vec::new(); n];
        for k in 0..n {
            let (i, right, up) = (number(k), k % side + 1 < side, k / side + 1 < side);
            rows[i].push(i as i32);
            for other in [right.then_some(k + 1), up.then_some(k + side)].into_iter().flatten() {
                rows[i].push(number(other) as i32);
                if both {
                    rows[number(other)].push(i as i32);
                }
            }
        }
        let mut indptr = vec![0];
        indptr.extend(rows.iter().scan(0, |end, row| {
            *end += row.len() as i32;
            Some(*end)
        }));
        let (indices, data) = (rows.concat(), vec![1.0; *indptr.last().unwrap() as usize]);
        let a = RowsRef { indptr: &indptr, indices: &indices, data: &data, columns: n };
        let order = Order::of(a);
        let mut all: Vec<usize> = (0..n).map(|i| order.new_of(i)).collect();
        assert!((0..n).all(|i| order.old_of(all[i]) == i));
        let block = |i: usize| order.ends.partition_point(|&end| end <= order.new_of(i));
        for i in 0..n {
            for &j in a.row(i).0 {
                let (own, other) = (block(i), block(j as usize));
                assert!(own == other || own.max(other) == order.ends.len(), "{i} {j}");
            }
        }
        all.sort_unstable();
        assert!(all.into_iter().eq(0..n));
        assert!(order.ends.len() > 1 && n - order.ends.last().unwrap() < n / 10);
    }

    #[test]
    fn blocks_are_coupled_to_their_seam_only() {
        let side = 151;
        order_of_grid(side, |k| k, true);
        order_of_grid(side, |k| k, false);
        // scattered numbers
        order_of_grid(side, |k| k * 7919 % (side * side), true);
    }
}
