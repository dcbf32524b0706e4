//! V-cycles, and conjugate gradients with them.
//!
//! One symmetric Gauss-Seidel sweep before and after the coarse correction, and one more of the unknowns that are slow,
//! next to it. A sweep goes through large blocks of rows at
//! the same time, each with the values that the other blocks had before; the blocks depend on the size alone, so the
//! result is the same for any number of threads. The cycle is a preconditioner, and works in single precision: what it
//! costs is reading matrices. Iterates, residuals and scalar products are double.

use super::cholesky::Cholesky;
use super::rows::RowsRef;
use crate::error::Error;
use crate::progress::Progress;
use rayon::prelude::*;

/// Blocks of a sweep.
const BLOCKS: usize = 16;

/// Rows of a block at least.
const LEAST_BLOCK: usize = 8192;

/// Couplings between blocks, as a share of all, that a sweep bears.
const MOST_STRANGE: f64 = 0.05;

/// Entries of a vector that one thread takes at a time; scalar products are sums over these parts, in order.
const PART: usize = 8192;

/// A matrix by rows in single precision.
struct Single {
    indptr: Vec<u32>,
    indices: Vec<u32>,
    values: Vec<f32>,
}

/// An order of unknowns, if it is not the given one.
#[derive(Default)]
struct Order {
    /// Old number by new number, or nothing.
    old: Vec<u32>,
    /// New number by old number, or nothing.
    new: Vec<u32>,
}

impl Order {
    /// The given order if blocks of it are mostly coupled within themselves, else breadth first over the couplings.
    fn of(a: RowsRef<'_>) -> Self {
        let (n, block) = (a.len(), block_of(a.len()));
        let strange = |i: &usize| a.row(*i).0.iter().filter(|&&j| j as usize / block != i / block).count();
        let strange: usize = (0..n).into_par_iter().with_min_len(PART).map(|i| strange(&i)).sum();
        if (strange as f64) < MOST_STRANGE * a.indices.len() as f64 {
            return Self::default();
        }
        // from the far end of a first search, so that its fronts are short
        let first = breadth_first(a, 0);
        let old = breadth_first(a, first[n - 1]);
        let mut new = vec![0; n];
        old.iter().enumerate().for_each(|(k, &i)| new[i as usize] = k as u32);
        Self { old, new }
    }

    fn old_of(&self, i: usize) -> usize {
        self.old.get(i).map_or(i, |&i| i as usize)
    }

    fn new_of(&self, i: usize) -> usize {
        self.new.get(i).map_or(i, |&i| i as usize)
    }
}

/// Rows of a block of a sweep.
fn block_of(n: usize) -> usize {
    n.div_ceil(BLOCKS).max(LEAST_BLOCK)
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

impl Single {
    fn new(rows: RowsRef<'_>, order: &Order, columns: &Order) -> Self {
        let row = |i: usize| rows.row(order.old_of(i));
        let all = || (0..rows.len()).into_par_iter().with_min_len(PART);
        let mut indptr = Vec::with_capacity(rows.len() + 1);
        indptr.push(0);
        let mut end = 0;
        indptr.extend((0..rows.len()).map(|i| {
            end += row(i).0.len() as u32;
            end
        }));
        let indices = all().flat_map_iter(|i| row(i).0.iter().map(|&j| columns.new_of(j as usize) as u32)).collect();
        let values = all().flat_map_iter(|i| row(i).1.iter().map(|&value| value as f32)).collect();
        Self { indptr, indices, values }
    }

    #[inline(always)]
    fn row(&self, i: usize) -> (&[u32], &[f32]) {
        let range = self.indptr[i] as usize..self.indptr[i + 1] as usize;
        (&self.indices[range.clone()], &self.values[range])
    }

    /// `y_i = change(i, y_i, (self x)_i)`.
    fn apply(&self, x: &[f32], y: &mut [f32], change: impl Fn(usize, f32, f32) -> f32 + Sync) {
        y.par_chunks_mut(PART).enumerate().for_each(|(part, y)| {
            for (k, value) in y.iter_mut().enumerate() {
                let i = part * PART + k;
                let (columns, values) = self.row(i);
                let sum: f32 = columns.iter().zip(values).map(|(&j, a)| a * x[j as usize]).sum();
                *value = change(i, *value, sum);
            }
        });
    }
}

/// One level but the coarsest.
struct Level {
    order: Order,
    a: Single,
    inverse: Vec<f32>,
    /// Unknowns that are swept once more, ascending in their new numbers.
    slow: Vec<u32>,
    p: Single,
    r: Single,
}

/// What a level is made of: operator, prolongation, restriction, and the unknowns that are swept once more.
pub type Stage<'a> = (RowsRef<'a>, RowsRef<'a>, RowsRef<'a>, &'a [i64]);

/// Vectors of a level.
struct Space {
    b: Vec<f32>,
    x: Vec<f32>,
    /// Values before a sweep, residuals after.
    spare: Vec<f32>,
}

/// A V-cycle.
pub struct Cycle {
    levels: Vec<Level>,
    coarsest: Cholesky,
    size: usize,
}

impl Cycle {
    /// From all levels but the coarsest, finest first, and the coarsest operator.
    pub fn new(stages: &[Stage<'_>], coarsest: RowsRef<'_>) -> Result<Self, Error> {
        let mut levels: Vec<Level> = Vec::new();
        let mut orders: Vec<Order> = stages.par_iter().map(|(a, ..)| Order::of(*a)).collect();
        orders.push(Order::default());
        let mut orders = orders.into_iter().peekable();
        let mut size = stages.first().map_or(coarsest.len(), |stage| stage.0.len());
        let finest = size;
        for (a, p, r, slow) in stages {
            let fits = a.len() == size && a.columns == size && p.len() == size && r.columns == size;
            if !fits || r.len() != p.columns {
                return Err(Error::Argument("the matrices of two levels do not fit".into()));
            }
            size = p.columns;
            let diagonal = |i: usize| {
                let (columns, values) = a.row(i);
                let own = columns.iter().position(|&j| j as usize == i).map_or(0.0, |k| values[k]);
                if own > 0.0 {
                    Ok((1.0 / own) as f32)
                } else {
                    Err(Error::Argument(format!("row {i} of a matrix has the diagonal {own}, expected a positive one")))
                }
            };
            let order = orders.next().unwrap_or_default();
            let plain = Order::default();
            let below = orders.peek().unwrap_or(&plain);
            let inverse = (0..a.len()).map(|i| diagonal(order.old_of(i))).collect::<Result<_, _>>()?;
            if slow.iter().any(|&i| usize::try_from(i).map_or(true, |i| i >= a.len())) {
                return Err(Error::Argument("'slow' names an unknown that is not there".into()));
            }
            let mut slow: Vec<u32> = slow.iter().map(|&i| order.new_of(i as usize) as u32).collect();
            slow.sort_unstable();
            let (p, r) = (Single::new(*p, &order, below), Single::new(*r, below, &order));
            levels.push(Level { a: Single::new(*a, &order, &order), order, inverse, slow, p, r });
        }
        if coarsest.len() != size || coarsest.columns != size {
            return Err(Error::Argument("the coarsest matrix does not fit".into()));
        }
        Ok(Self { levels, coarsest: Cholesky::new(coarsest)?, size: finest })
    }

    /// Unknowns of the finest level.
    pub fn size(&self) -> usize {
        self.size
    }

    fn spaces(&self) -> Vec<Space> {
        let space = |n: usize| Space { b: vec![0.0; n], x: vec![0.0; n], spare: vec![0.0; n] };
        let sizes = self.levels.iter().map(|level| level.inverse.len());
        sizes.chain([self.coarsest.size]).map(space).collect()
    }

    /// `z` = one cycle on `r` from 0.
    fn precondition(&self, r: &[f64], z: &mut [f64], spaces: &mut [Space]) {
        // so that small residuals do not leave the range of single precision
        let scale = dot(r, r).sqrt();
        if scale == 0.0 {
            z.fill(0.0);
            return;
        }
        let plain = Order::default();
        let order = self.levels.first().map_or(&plain, |level| &level.order);
        let b = spaces[0].b.par_iter_mut().with_min_len(PART).enumerate();
        b.for_each(|(i, b)| *b = (r[order.old_of(i)] / scale) as f32);
        self.descend(0, spaces);
        let x = &spaces[0].x;
        let z = z.par_iter_mut().with_min_len(PART).enumerate();
        z.for_each(|(i, z)| *z = f64::from(x[order.new_of(i)]) * scale);
    }

    fn descend(&self, depth: usize, spaces: &mut [Space]) {
        let (here, below) = spaces.split_at_mut(1);
        let Space { b, x, spare } = &mut here[0];
        let Some(level) = self.levels.get(depth) else {
            return self.coarsest.solve(b, x);
        };
        x.fill(0.0);
        level.sweep(b, x, spare, true, false);
        level.sweep(b, x, spare, false, false);
        level.sweep(b, x, spare, true, true);
        level.sweep(b, x, spare, false, true);
        level.a.apply(x, spare, |i, _, sum| b[i] - sum);
        level.r.apply(spare, &mut below[0].b, |_, _, sum| sum);
        self.descend(depth + 1, below);
        level.p.apply(&below[0].x, x, |_, old, sum| old + sum);
        level.sweep(b, x, spare, true, true);
        level.sweep(b, x, spare, false, true);
        level.sweep(b, x, spare, true, false);
        level.sweep(b, x, spare, false, false);
    }
}

impl Level {
    /// Half a symmetric sweep, over all unknowns or the slow ones.
    fn sweep(&self, b: &[f32], x: &mut [f32], before: &mut [f32], forward: bool, slow: bool) {
        if slow && self.slow.is_empty() {
            return;
        }
        let block = block_of(x.len());
        let relax = |x: &mut [f32], first: usize, before: &[f32]| {
            let end = first + x.len();
            if slow {
                let place = |i: usize| self.slow.partition_point(|&k| (k as usize) < i);
                let rows = self.slow[place(first)..place(end)].iter().map(|&i| i as usize);
                self.relax(b, x, first, before, rows, forward);
            } else {
                self.relax(b, x, first, before, first..end, forward);
            }
        };
        if x.len() <= block {
            return relax(x, 0, &[]);
        }
        before.copy_from_slice(x);
        let before = &*before;
        x.par_chunks_mut(block).enumerate().for_each(|(k, x)| relax(x, k * block, before));
    }

    /// Relaxes rows of a block.
    fn relax(
        &self,
        b: &[f32],
        x: &mut [f32],
        first: usize,
        before: &[f32],
        rows: impl DoubleEndedIterator<Item = usize>,
        forward: bool,
    ) {
        let mut relax = |i: usize| {
            let (columns, values) = self.a.row(i);
            let mut sum = b[i];
            for (&j, a) in columns.iter().zip(values) {
                let j = j as usize;
                sum -= a * x.get(j.wrapping_sub(first)).copied().unwrap_or_else(|| before[j]);
            }
            x[i - first] += sum * self.inverse[i];
        };
        if forward {
            rows.for_each(&mut relax);
        } else {
            rows.rev().for_each(&mut relax);
        }
    }
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    let parts = x.par_chunks(PART).zip(y.par_chunks(PART));
    let sums: Vec<f64> = parts.map(|(x, y)| x.iter().zip(y).map(|(a, b)| a * b).sum()).collect();
    sums.iter().sum()
}

/// `y += scale x`.
fn add(y: &mut [f64], scale: f64, x: &[f64]) {
    let parts = y.par_chunks_mut(PART).zip(x.par_chunks(PART));
    parts.for_each(|(y, x)| y.iter_mut().zip(x).for_each(|(y, x)| *y += scale * x));
}

fn product(a: RowsRef<'_>, x: &[f64], y: &mut [f64]) {
    y.par_chunks_mut(PART).enumerate().for_each(|(part, y)| {
        for (k, value) in y.iter_mut().enumerate() {
            let (columns, values) = a.row(part * PART + k);
            *value = columns.iter().zip(values).map(|(&j, a)| a * x[j as usize]).sum();
        }
    });
}

/// What an iteration aims at.
#[derive(Debug, Clone, Copy)]
pub struct Goal {
    /// Residual relative to the right-hand side.
    pub tolerance: f64,
    /// Iterations at most.
    pub iterations: usize,
    /// Conjugate gradients, or cycles alone.
    pub accelerated: bool,
}

/// Solves `a x = b` from 0; returns `x` and the norms of the residuals, the first one before any iteration.
pub fn solve(
    cycle: &Cycle,
    a: RowsRef<'_>,
    b: &[f64],
    goal: Goal,
    progress: &Progress,
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let n = b.len();
    if a.len() != n || a.columns != n || cycle.size() != n {
        return Err(Error::Argument(format!("'b' has {n} entries, expected {}", cycle.size())));
    }
    let mut spaces = cycle.spaces();
    let (mut x, mut r, mut z) = (vec![0.0; n], b.to_vec(), vec![0.0; n]);
    let (mut p, mut q, mut last) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut norms = vec![dot(&r, &r).sqrt()];
    let wanted = goal.tolerance * norms[0];
    let mut rho = 1.0;
    for k in 0..goal.iterations {
        if norms[k] <= wanted {
            break;
        }
        progress.check()?;
        cycle.precondition(&r, &mut z, &mut spaces);
        if goal.accelerated {
            // Polak and Ribière's form bears a preconditioner that is symmetric up to single precision only
            let old = rho;
            rho = dot(&r, &z);
            let beta = if k == 0 { 0.0 } else { (rho - dot(&last, &z)) / old };
            let parts = p.par_chunks_mut(PART).zip(z.par_chunks(PART));
            parts.for_each(|(p, z)| p.iter_mut().zip(z).for_each(|(p, z)| *p = z + beta * *p));
            product(a, &p, &mut q);
            let alpha = rho / dot(&p, &q);
            if !alpha.is_finite() {
                break;
            }
            last.copy_from_slice(&r);
            add(&mut x, alpha, &p);
            add(&mut r, -alpha, &q);
        } else {
            add(&mut x, 1.0, &z);
            product(a, &z, &mut q);
            add(&mut r, -1.0, &q);
        }
        norms.push(dot(&r, &r).sqrt());
    }
    Ok((x, norms))
}

/// One cycle on `r` from 0.
pub fn precondition(cycle: &Cycle, r: &[f64]) -> Result<Vec<f64>, Error> {
    if r.len() != cycle.size() {
        return Err(Error::Argument(format!("'r' has {} entries, expected {}", r.len(), cycle.size())));
    }
    let mut z = vec![0.0; r.len()];
    cycle.precondition(r, &mut z, &mut cycle.spaces());
    Ok(z)
}
