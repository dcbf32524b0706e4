//! V-cycles, and conjugate gradients with them.
//!
//! One symmetric Gauss-Seidel sweep before and after the coarse correction, and one more of the unknowns that are slow,
//! next to it. A sweep goes through large blocks of rows at the same time, and then through their seam: the rows that are
//! coupled to an earlier block. Blocks see nothing of each other but the seam, so this is Gauss-Seidel in one order of
//! the unknowns, for any number of threads. (With the values that other blocks had before, what is strongly coupled across
//! two blocks would converge slowly.) The cycle is a preconditioner, and works in single precision: what it costs is
//! reading matrices. Iterates, residuals and scalar products are double.

use super::cholesky::Cholesky;
use super::clusters::clusters;
use super::order::Order;
use super::rows::RowsRef;
use crate::error::Error;
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Entries of a vector that one thread takes at a time; scalar products are sums over these parts, in order.
const PART: usize = 8192;

/// A matrix by rows in single precision.
struct Single {
    indptr: Vec<u32>,
    indices: Vec<u32>,
    values: Vec<f32>,
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

    #[inline(always)]
    fn row_times(&self, i: usize, x: &Vector) -> f32 {
        let (columns, values) = self.row(i);
        columns.iter().zip(values).map(|(&j, a)| a * x.get(j as usize)).sum()
    }

    /// `y_i = change(i, (self x)_i)`.
    fn apply(&self, x: &Vector, y: &Vector, change: impl Fn(usize, f32) -> f32 + Sync) {
        let rows = (0..self.indptr.len() - 1).into_par_iter().with_min_len(PART);
        rows.for_each(|i| y.set(i, change(i, self.row_times(i, x))));
    }
}

/// Numbers that threads may write while others read other ones of them.
struct Vector(Vec<AtomicU32>);

impl Vector {
    fn zeros(n: usize) -> Self {
        Self((0..n).map(|_| AtomicU32::new(0)).collect())
    }

    #[inline(always)]
    fn get(&self, i: usize) -> f32 {
        f32::from_bits(self.0[i].load(Relaxed))
    }

    #[inline(always)]
    fn set(&self, i: usize, value: f32) {
        self.0[i].store(value.to_bits(), Relaxed);
    }

    fn fill(&self, value: impl Fn(usize) -> f32 + Sync) {
        (0..self.0.len()).into_par_iter().with_min_len(PART).for_each(|i| self.set(i, value(i)));
    }
}

/// One level but the coarsest.
struct Level {
    order: Order,
    a: Single,
    inverse: Vec<f32>,
    /// Unknowns that are swept once more, ascending in their new numbers.
    slow: Vec<u32>,
    /// Unknowns that are relaxed together.
    clusters: Vec<(Vec<u32>, Cholesky)>,
    p: Single,
    r: Single,
}

/// What a level is made of: operator, prolongation, restriction, and the unknowns that are swept once more.
pub type Stage<'a> = (RowsRef<'a>, RowsRef<'a>, RowsRef<'a>, &'a [i64]);

/// Vectors of a level.
struct Space {
    b: Vector,
    x: Vector,
    residual: Vector,
}

/// A V-cycle.
pub struct Cycle {
    levels: Vec<Level>,
    coarsest: Cholesky,
    size: usize,
    /// The level that is visited twice in a row, if any.
    twice: Option<usize>,
}

impl Cycle {
    /// From all levels but the coarsest, finest first, the coarsest operator, and the level that is visited twice in a row.
    pub fn new(stages: &[Stage<'_>], coarsest: RowsRef<'_>, twice: Option<usize>) -> Result<Self, Error> {
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
            let rows = (0..a.len()).into_par_iter().with_min_len(PART);
            let diagonal: Vec<f64> = rows.map(|i| a.entry(i, i)).collect();
            if let Some(i) = diagonal.iter().position(|&own| own.is_nan() || own <= 0.0) {
                let own = diagonal[i];
                let text = format!("row {i} of a matrix has the diagonal {own}, expected a positive one");
                return Err(Error::Argument(text));
            }
            let order = orders.next().unwrap_or_default();
            let plain = Order::default();
            let below = orders.peek().unwrap_or(&plain);
            let inverse = (0..a.len()).map(|i| (1.0 / diagonal[order.old_of(i)]) as f32).collect();
            if slow.iter().any(|&i| usize::try_from(i).map_or(true, |i| i >= a.len())) {
                return Err(Error::Argument("'slow' names an unknown that is not there".into()));
            }
            let mut slow: Vec<u32> = slow.iter().map(|&i| order.new_of(i as usize) as u32).collect();
            slow.sort_unstable();
            let mut clusters = clusters(*a, &diagonal);
            clusters.iter_mut().flat_map(|cluster| &mut cluster.0).for_each(|i| *i = order.new_of(*i as usize) as u32);
            let (p, r) = (Single::new(*p, &order, below), Single::new(*r, below, &order));
            levels.push(Level { a: Single::new(*a, &order, &order), order, inverse, slow, clusters, p, r });
        }
        if coarsest.len() != size || coarsest.columns != size {
            return Err(Error::Argument("the coarsest matrix does not fit".into()));
        }
        Ok(Self { levels, coarsest: Cholesky::new(coarsest)?, size: finest, twice })
    }

    /// Unknowns of the finest level.
    pub fn size(&self) -> usize {
        self.size
    }

    fn spaces(&self) -> Vec<Space> {
        let space = |n: usize| Space { b: Vector::zeros(n), x: Vector::zeros(n), residual: Vector::zeros(n) };
        let sizes = self.levels.iter().map(|level| level.inverse.len());
        sizes.chain([self.coarsest.size]).map(space).collect()
    }

    /// `z` = one cycle on `r` from 0.
    fn precondition(&self, r: &[f64], z: &mut [f64], spaces: &[Space]) {
        // so that small residuals do not leave the range of single precision
        let scale = dot(r, r).sqrt();
        if scale == 0.0 {
            z.fill(0.0);
            return;
        }
        let plain = Order::default();
        let order = self.levels.first().map_or(&plain, |level| &level.order);
        spaces[0].b.fill(|i| (r[order.old_of(i)] / scale) as f32);
        spaces[0].x.fill(|_| 0.0);
        self.descend(0, spaces);
        let x = &spaces[0].x;
        let z = z.par_iter_mut().with_min_len(PART).enumerate();
        z.for_each(|(i, z)| *z = f64::from(x.get(order.new_of(i))) * scale);
    }

    /// One cycle on `x`, from the values it has.
    fn descend(&self, depth: usize, spaces: &[Space]) {
        let Space { b, x, residual } = &spaces[depth];
        let Some(level) = self.levels.get(depth) else {
            return self.coarsest.solve(|i| b.get(i), |i, value| x.set(i, value));
        };
        let below = &spaces[depth + 1];
        level.sweep(b, x, false);
        level.sweep(b, x, true);
        level.relax_clusters(b, x);
        level.a.apply(x, residual, |i, sum| b.get(i) - sum);
        level.r.apply(residual, &below.b, |_, sum| sum);
        below.x.fill(|_| 0.0);
        for _ in 0..if self.twice == Some(depth + 1) { 2 } else { 1 } {
            self.descend(depth + 1, spaces);
        }
        level.p.apply(&below.x, x, |i, sum| x.get(i) + sum);
        level.relax_clusters(b, x);
        level.sweep(b, x, true);
        level.sweep(b, x, false);
    }
}

impl Level {
    /// A symmetric sweep, over all unknowns or the slow ones.
    fn sweep(&self, b: &Vector, x: &Vector, slow: bool) {
        if slow && self.slow.is_empty() {
            return;
        }
        let ends = &self.order.ends;
        let seam = ends.last().copied().unwrap_or(0)..self.inverse.len();
        let blocks = |forward: bool| {
            (0..ends.len()).into_par_iter().for_each(|k| {
                let start = if k == 0 { 0 } else { ends[k - 1] };
                self.relax(b, x, start..ends[k], slow, forward);
            });
        };
        blocks(true);
        self.relax(b, x, seam.clone(), slow, true);
        self.relax(b, x, seam, slow, false);
        blocks(false);
    }

    /// Half a symmetric sweep over some rows, or the slow ones of them.
    fn relax(&self, b: &Vector, x: &Vector, rows: Range<usize>, slow: bool, forward: bool) {
        if slow {
            let place = |i: usize| self.slow.partition_point(|&k| (k as usize) < i);
            let slow = &self.slow[place(rows.start)..place(rows.end)];
            self.relax_each(b, x, slow.iter().map(|&i| i as usize), forward);
        } else {
            self.relax_each(b, x, rows, forward);
        }
    }

    /// Relaxes each cluster, there and back.
    fn relax_clusters(&self, b: &Vector, x: &Vector) {
        let mut residual = Vec::new();
        for (rows, factor) in self.clusters.iter().chain(self.clusters.iter().rev()) {
            let row = |k: usize| rows[k] as usize;
            residual.clear();
            residual.extend((0..rows.len()).map(|k| b.get(row(k)) - self.a.row_times(row(k), x)));
            factor.solve(|k| residual[k], |k, change| x.set(row(k), x.get(row(k)) + change));
        }
    }

    fn relax_each(&self, b: &Vector, x: &Vector, rows: impl DoubleEndedIterator<Item = usize>, forward: bool) {
        let relax = |i: usize| x.set(i, x.get(i) + (b.get(i) - self.a.row_times(i, x)) * self.inverse[i]);
        if forward {
            rows.for_each(relax);
        } else {
            rows.rev().for_each(relax);
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
    let spaces = cycle.spaces();
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
        cycle.precondition(&r, &mut z, &spaces);
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
    cycle.precondition(r, &mut z, &cycle.spaces());
    Ok(z)
}
