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
use super::rows::{RowsRef, parts};
use crate::error::Error;
use crate::progress::Progress;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Entries of a vector that one thread takes at a time; scalar products are sums over these parts, in order.
const PART: usize = 8192;

/// A matrix by rows in single precision: columns and values.
struct Single {
    starts: Vec<u32>,
    entries: Vec<(u32, f32)>,
}

impl Single {
    /// A matrix in a new order.
    fn new(rows: RowsRef<'_>, order: &Order, columns: &Order) -> Self {
        let [all] = Self::split(rows, order, columns, |_, _| 0);
        all
    }

    /// Matrices of the entries of each part, by what `part(new row, new column)` says; N for none.
    fn split<const N: usize>(
        rows: RowsRef<'_>,
        order: &Order,
        columns: &Order,
        part: impl Fn(usize, usize) -> usize + Sync,
    ) -> [Self; N] {
        let row = |i: usize| {
            let (indices, values) = rows.row(order.old_of(i));
            indices.iter().map(|&j| columns.new_of(j as usize)).zip(values)
        };
        let count = |i: usize| {
            let mut counts = [0; N];
            row(i).for_each(|(j, _)| {
                if let Some(count) = counts.get_mut(part(i, j)) {
                    *count += 1
                }
            });
            counts
        };
        let counts: Vec<[u32; N]> = (0..rows.len()).into_par_iter().with_min_len(PART).map(count).collect();
        let mut made: [Self; N] = std::array::from_fn(|k| {
            let mut starts = Vec::with_capacity(rows.len() + 1);
            starts.push(0);
            starts.extend(counts.iter().scan(0, |end, count| {
                *end += count[k];
                Some(*end)
            }));
            Self { entries: vec![(0, 0.0); starts[rows.len()] as usize], starts }
        });
        let sizes = |k: usize| counts.chunks(PART).map(move |rows| rows.iter().map(|row| row[k] as usize).sum());
        let mut places: Vec<[&mut [(u32, f32)]; N]> = Vec::new();
        places.resize_with(counts.len().div_ceil(PART), || std::array::from_fn(|_| Default::default()));
        for (k, made) in made.iter_mut().enumerate() {
            let cut = parts(&mut made.entries, &sizes(k).collect::<Vec<_>>());
            cut.into_iter().zip(&mut places).for_each(|(slice, place)| place[k] = slice);
        }
        places.into_par_iter().enumerate().for_each(|(chunk, places)| {
            let mut filled = [0; N];
            for i in chunk * PART..((chunk + 1) * PART).min(rows.len()) {
                for (j, &value) in row(i) {
                    let k = part(i, j);
                    if k < N {
                        places[k][filled[k]] = (j as u32, value as f32);
                        filled[k] += 1;
                    }
                }
            }
        });
        made
    }

    #[inline(always)]
    fn row_times(&self, i: usize, x: &Vector) -> f32 {
        let row = &self.entries[self.starts[i] as usize..self.starts[i + 1] as usize];
        row.iter().map(|&(j, value)| value * x.get(j as usize)).sum()
    }

    /// `y_i = change(i, (self x)_i)`.
    fn apply(&self, x: &Vector, y: &Vector, change: impl Fn(usize, f32) -> f32 + Sync) {
        let rows = (0..self.starts.len() - 1).into_par_iter().with_min_len(PART);
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

type Cluster = (Vec<u32>, Cholesky);

/// One level but the coarsest.
struct Level {
    order: Order,
    diagonal: Vec<f32>,
    inverse: Vec<f32>,
    /// Left and right of the diagonal: the way back of a sweep needs the right only.
    lower: Single,
    upper: Single,
    /// Unknowns that are swept once more, ascending in their new numbers.
    slow: Vec<u32>,
    /// Unknowns that are relaxed together: by the block that they lie in, and in the end those in several or the seam.
    clusters: Vec<Vec<Cluster>>,
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
            if slow.iter().any(|&i| usize::try_from(i).map_or(true, |i| i >= a.len())) {
                return Err(Error::Argument("'slow' names an unknown that is not there".into()));
            }
            let mut slow: Vec<u32> = slow.iter().map(|&i| order.new_of(i as usize) as u32).collect();
            slow.sort_unstable();
            let clusters = by_block(clusters(*a, &diagonal), &order);
            let (p, r) = (Single::new(*p, &order, below), Single::new(*r, below, &order));
            let side = |i: usize, j: usize| if i == j { 2 } else { usize::from(j > i) };
            let [lower, upper] = Single::split(*a, &order, &order, side);
            let own = || (0..a.len()).into_par_iter().with_min_len(PART).map(|i| diagonal[order.old_of(i)]);
            let (inverse, diagonal) =
                (own().map(|own| (1.0 / own) as f32).collect(), own().map(|own| own as f32).collect());
            levels.push(Level { order, diagonal, inverse, lower, upper, slow, clusters, p, r });
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
        let sizes = self.levels.iter().map(|level| level.diagonal.len());
        sizes.chain([self.coarsest.size]).map(space).collect()
    }

    /// `z` = one cycle on `r`, whose norm is given, from 0; returns the scalar products of `z` with two others.
    fn precondition(&self, r: &[f64], norm: f64, z: &mut [f64], others: [&[f64]; 2], spaces: &[Space]) -> [f64; 2] {
        if norm == 0.0 {
            z.fill(0.0);
            return [0.0; 2];
        }
        let plain = Order::default();
        let order = self.levels.first().map_or(&plain, |level| &level.order);
        // so that small residuals do not leave the range of single precision
        spaces[0].b.fill(|i| (r[order.old_of(i)] / norm) as f32);
        self.descend(0, true, spaces);
        let x = &spaces[0].x;
        let parts = z.par_chunks_mut(PART).zip(others[0].par_chunks(PART)).zip(others[1].par_chunks(PART)).enumerate();
        sums(parts.map(|(part, ((z, one), two))| {
            let mut sums = [0.0; 2];
            for (k, z) in z.iter_mut().enumerate() {
                *z = f64::from(x.get(order.new_of(part * PART + k))) * norm;
                sums[0] += *z * one[k];
                sums[1] += *z * two[k];
            }
            sums
        }))
    }

    /// One cycle on `x`, from 0 or from the values it has.
    fn descend(&self, depth: usize, from_zero: bool, spaces: &[Space]) {
        let Space { b, x, residual } = &spaces[depth];
        let Some(level) = self.levels.get(depth) else {
            return self.coarsest.solve(|i| b.get(i), |i, value| x.set(i, value));
        };
        let below = &spaces[depth + 1];
        level.sweep(&spaces[depth], from_zero);
        level.sweep_slow(&spaces[depth]);
        level.relax_clusters(&spaces[depth]);
        residual.fill(|i| b.get(i) - level.row_times(i, x));
        level.r.apply(residual, &below.b, |_, sum| sum);
        self.descend(depth + 1, true, spaces);
        if self.twice == Some(depth + 1) {
            self.descend(depth + 1, false, spaces);
        }
        level.p.apply(&below.x, x, |i, sum| x.get(i) + sum);
        level.relax_clusters(&spaces[depth]);
        level.sweep_slow(&spaces[depth]);
        level.sweep(&spaces[depth], false);
    }
}

impl Level {
    #[inline(always)]
    fn row_times(&self, i: usize, x: &Vector) -> f32 {
        self.diagonal[i] * x.get(i) + self.lower.row_times(i, x) + self.upper.row_times(i, x)
    }

    /// A symmetric sweep. From 0, nothing right of the diagonal counts on the way there.
    fn sweep(&self, space: &Space, from_zero: bool) {
        let ends = &self.order.ends;
        let start = |k: usize| if k == 0 { 0 } else { ends[k - 1] };
        let there = |rows: Range<usize>| {
            if from_zero { self.there::<true>(space, rows) } else { self.there::<false>(space, rows) }
        };
        let seam = ends.last().copied().unwrap_or(0)..self.diagonal.len();
        (0..ends.len()).into_par_iter().for_each(|k| there(start(k)..ends[k]));
        there(seam.clone());
        self.back(space, seam);
        (0..ends.len()).into_par_iter().for_each(|k| self.back(space, start(k)..ends[k]));
    }

    /// A symmetric sweep over the slow unknowns.
    fn sweep_slow(&self, space: &Space) {
        if self.slow.is_empty() {
            return;
        }
        let mut cuts = vec![0];
        cuts.extend(self.order.ends.iter().map(|&end| self.slow.partition_point(|&k| (k as usize) < end)));
        let blocks = || cuts.par_windows(2).map(|cut| self.slow[cut[0]..cut[1]].iter().map(|&i| i as usize));
        let seam = || self.slow[cuts[cuts.len() - 1]..].iter().map(|&i| i as usize);
        blocks().for_each(|rows| self.there::<false>(space, rows));
        self.there::<false>(space, seam());
        self.back(space, seam());
        blocks().for_each(|rows| self.back(space, rows));
    }

    /// The way there of a sweep, over some rows; keeps what it sees of the right-hand side left of the diagonal, for the
    /// way back.
    #[inline(always)]
    fn there<const FROM_ZERO: bool>(&self, Space { b, x, residual }: &Space, rows: impl Iterator<Item = usize>) {
        for i in rows {
            let left = b.get(i) - self.lower.row_times(i, x);
            residual.set(i, left);
            x.set(i, (if FROM_ZERO { left } else { left - self.upper.row_times(i, x) }) * self.inverse[i]);
        }
    }

    /// The way back: left of the diagonal nothing has changed since the way there (Conrad and Wallach 1979).
    #[inline(always)]
    fn back(&self, Space { x, residual, .. }: &Space, rows: impl DoubleEndedIterator<Item = usize>) {
        for i in rows.rev() {
            x.set(i, (residual.get(i) - self.upper.row_times(i, x)) * self.inverse[i]);
        }
    }

    /// Relaxes each cluster, there and back; those of different blocks at the same time.
    fn relax_clusters(&self, Space { b, x, .. }: &Space) {
        let Some((several, blocks)) = self.clusters.split_last() else { return };
        let relax = |(rows, factor): &Cluster| {
            let row = |k: usize| rows[k] as usize;
            let residual: Vec<f32> = (0..rows.len()).map(|k| b.get(row(k)) - self.row_times(row(k), x)).collect();
            factor.solve(|k| residual[k], |k, change| x.set(row(k), x.get(row(k)) + change));
        };
        blocks.par_iter().for_each(|clusters| clusters.iter().for_each(relax));
        several.iter().for_each(relax);
        several.iter().rev().for_each(relax);
        blocks.par_iter().for_each(|clusters| clusters.iter().rev().for_each(relax));
    }
}

/// Clusters in new numbers, by the block of an order that they lie in, and in the end the others; nothing if there is none.
fn by_block(clusters: Vec<Cluster>, order: &Order) -> Vec<Vec<Cluster>> {
    let ends = &order.ends;
    let mut made: Vec<Vec<Cluster>> = Vec::new();
    for (mut rows, factor) in clusters {
        rows.iter_mut().for_each(|i| *i = order.new_of(*i as usize) as u32);
        let block = |i: u32| ends.partition_point(|&end| end <= i as usize);
        let first = block(rows[0]);
        let place = if rows.iter().all(|&i| block(i) == first) { first } else { ends.len() };
        made.resize_with(ends.len() + 1, Vec::new);
        made[place].push((rows, factor));
    }
    made
}

/// Sums of parts, in their order.
fn sums<const N: usize>(parts: impl IndexedParallelIterator<Item = [f64; N]>) -> [f64; N] {
    let parts: Vec<[f64; N]> = parts.collect();
    std::array::from_fn(|k| parts.iter().map(|part| part[k]).sum())
}

fn norm(x: &[f64]) -> f64 {
    let [sum] = sums(x.par_chunks(PART).map(|x| [x.iter().map(|x| x * x).sum()]));
    sum.sqrt()
}

/// `y = a x`; returns the scalar product of both.
fn product(a: RowsRef<'_>, x: &[f64], y: &mut [f64]) -> f64 {
    let [sum] = sums(y.par_chunks_mut(PART).enumerate().map(|(part, y)| {
        let mut sum = 0.0;
        for (i, y) in (part * PART..).zip(y) {
            let (columns, values) = a.row(i);
            *y = columns.iter().zip(values).map(|(&j, a)| a * x[j as usize]).sum();
            sum += *y * x[i];
        }
        [sum]
    }));
    sum
}

/// `x += scale p` and `r -= scale q`; returns the norm of `r`.
fn step(scale: f64, (x, p): (&mut [f64], &[f64]), (r, q): (&mut [f64], &[f64])) -> f64 {
    let left = x.par_chunks_mut(PART).zip(p.par_chunks(PART));
    let right = r.par_chunks_mut(PART).zip(q.par_chunks(PART));
    let [sum] = sums(left.zip(right).map(|((x, p), (r, q))| {
        x.iter_mut().zip(p).for_each(|(x, p)| *x += scale * p);
        r.iter_mut().zip(q).for_each(|(r, q)| *r -= scale * q);
        [r.iter().map(|r| r * r).sum()]
    }));
    sum.sqrt()
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
    let (mut p, mut q) = (vec![0.0; n], vec![0.0; n]);
    let mut norms = vec![norm(&r)];
    let wanted = goal.tolerance * norms[0];
    let mut curvature = 1.0;
    for k in 0..goal.iterations {
        if norms[k] <= wanted {
            break;
        }
        progress.check()?;
        let [rho, change] = cycle.precondition(&r, norms[k], &mut z, [&r, &q], &spaces);
        if goal.accelerated {
            // Polak and Ribière's form bears a preconditioner that is symmetric up to single precision only; residuals
            // differ by alpha q, and alpha is the old rho / (p . q)
            let beta = -change / curvature;
            let parts = p.par_chunks_mut(PART).zip(z.par_chunks(PART));
            parts.for_each(|(p, z)| p.iter_mut().zip(z).for_each(|(p, z)| *p = z + beta * *p));
            curvature = product(a, &p, &mut q);
            let alpha = rho / curvature;
            if !alpha.is_finite() {
                break;
            }
            norms.push(step(alpha, (&mut x, &p), (&mut r, &q)));
        } else {
            product(a, &z, &mut q);
            norms.push(step(1.0, (&mut x, &z), (&mut r, &q)));
        }
    }
    Ok((x, norms))
}

/// One cycle on `r` from 0.
pub fn precondition(cycle: &Cycle, r: &[f64]) -> Result<Vec<f64>, Error> {
    if r.len() != cycle.size() {
        return Err(Error::Argument(format!("'r' has {} entries, expected {}", r.len(), cycle.size())));
    }
    let mut z = vec![0.0; r.len()];
    cycle.precondition(r, norm(r), &mut z, [r, r], &cycle.spaces());
    Ok(z)
}
