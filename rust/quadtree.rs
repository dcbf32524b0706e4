//! Spacing of a balanced quadtree (Miller, Talmor, Teng 1997, section 6.2, after Bern, Eppstein and Gilbert), d = 1 to 3.
//!
//! The root is the cube at the least coordinates `lo` whose side S is the power of two next above the extent. Points are
//! put on a grid of 2^42 cells an axis, `floor((x - lo) / S * 2^42)` clipped to the root, and all the rest is integer
//! arithmetic; points in one cell of that grid count as one, and locations outside the root take the nearest leaf.
//!
//! - **Split** every cell that holds a point while another point lies in the 3^d cells of its level around it. (At most
//!   one point a leaf alone puts no bound under the distance of two points on either side of a leaf's edge.)
//! - **Balance**: leaves that share a face, an edge or a corner differ by at most one level. With a cell of level l all
//!   its neighbours of level l exist, that is, their parents are split: one pass from the deepest level up.
//! - The **spacing** at x is 15/16 of the side of the leaf that holds x. The point of a leaf has no other within one side,
//!   so this never exceeds NN at the points; the sixteenth covers the rounding of `x - lo`.
//!
//! ```text
//!  +-------+---+---+     a, b share no leaf, but a leaf's side is
//!  |       |   |   |     no measure of their distance unless the
//!  |       +---+---+     cells around a are empty as well
//!  |      a|b  |   |
//!  +-------+---+---+
//! ```

use crate::error::Error;
use crate::kdtree::Bounds;
use crate::point::Point;
use crate::progress::Progress;
use rayon::prelude::*;
use std::collections::HashSet;
use std::hash::{BuildHasherDefault, Hasher};

/// Levels of the grid.
const DEPTH: u32 = 42;

/// Share of a leaf's side that is its spacing.
const SHARE: f64 = 15.0 / 16.0;

/// Locations that one thread answers between two looks at the progress.
const AT_ONCE: usize = 8192;

type Cell<const D: usize> = [u64; D];
type Cells<const D: usize> = HashSet<Cell<D>, BuildHasherDefault<Mixer>>;

/// The spacing of the quadtree of `points` at some locations; infinite where all points are at one location.
///
/// Runtime: O((n + leaves) depth).
pub fn spacing<const D: usize>(points: &[Point<D>], at: &[Point<D>], progress: &Progress) -> Result<Vec<f64>, Error> {
    let root = Root::around(points);
    let split = split_cells(&root, points, progress)?;
    let mut found = vec![0.0; at.len()];
    at.par_chunks(AT_ONCE).zip(found.par_chunks_mut(AT_ONCE)).try_for_each(|(at, found)| {
        progress.check()?;
        for (x, value) in at.iter().zip(found) {
            let level = leaf_level(&split, root.cell(x));
            *value = if split.is_empty() { f64::INFINITY } else { SHARE * (root.side * 0.5f64.powi(level as i32)) };
        }
        Ok(())
    })?;
    Ok(found)
}

/// The root cube.
struct Root<const D: usize> {
    lo: Point<D>,
    side: f64,
}

impl<const D: usize> Root<D> {
    fn around(points: &[Point<D>]) -> Self {
        let bounds = Bounds::of(points);
        let axis = bounds.widest();
        Root { lo: bounds.lo, side: power_of_two_above(bounds.hi[axis] - bounds.lo[axis]) }
    }

    /// The cell of the grid that holds x.
    fn cell(&self, x: &Point<D>) -> Cell<D> {
        let cells = (1u64 << DEPTH) as f64;
        std::array::from_fn(|k| ((x[k] - self.lo[k]) / self.side * cells).clamp(0.0, cells - 1.0) as u64)
    }
}

/// The least power of two over `x`, 1 for 0.
fn power_of_two_above(x: f64) -> f64 {
    let mut power = if x < 1.0 { f64::MIN_POSITIVE } else { 1.0 };
    if x <= 0.0 || !x.is_finite() {
        return 1.0;
    }
    while power <= x {
        power *= 2.0;
    }
    power
}

/// The cell of level `level` that holds a cell of the grid.
fn ancestor<const D: usize>(cell: Cell<D>, level: u32) -> Cell<D> {
    cell.map(|i| i >> (DEPTH - level))
}

/// The split cells of the balanced tree, level by level.
fn split_cells<const D: usize>(
    root: &Root<D>,
    points: &[Point<D>],
    progress: &Progress,
) -> Result<Vec<Cells<D>>, Error> {
    let mut cells: Vec<Cell<D>> = points.par_iter().map(|p| root.cell(p)).collect();
    cells.par_sort_unstable_by_key(interleaved);
    cells.dedup();
    let mut levels = Vec::new();
    // a point whose cell is crowded no more crowds nobody else's: being within one cell is mutual
    while cells.len() > 1 && levels.len() < DEPTH as usize {
        progress.check()?;
        let level = levels.len() as u32;
        let crowded = crowded_cells(&cells, level);
        cells.retain(|&cell| crowded.contains(&ancestor(cell, level)));
        levels.push(crowded);
    }
    while levels.last().is_some_and(Cells::is_empty) {
        levels.pop();
    }
    for level in (1..levels.len()).rev() {
        progress.check()?;
        let (coarser, finer) = levels.split_at_mut(level);
        let last = (1 << level) - 1;
        for cell in &finer[0] {
            each_around(cell.map(|i| i.saturating_sub(1) / 2), cell.map(|i| (i + 1).min(last) / 2), |parent| {
                coarser[level - 1].insert(parent);
            });
        }
    }
    Ok(levels)
}

/// The cells of a level that hold one of `cells` (sorted, distinct) and another within their 3^d neighbours.
fn crowded_cells<const D: usize>(cells: &[Cell<D>], level: u32) -> Cells<D> {
    let runs: Vec<&[Cell<D>]> = cells.chunk_by(|a, b| ancestor(*a, level) == ancestor(*b, level)).collect();
    let occupied: Cells<D> = runs.iter().map(|run| ancestor(run[0], level)).collect();
    let last = (1 << level) - 1;
    let crowded = |run: &&[Cell<D>]| {
        let cell = ancestor(run[0], level);
        let mut held = 0;
        each_around(cell.map(|i| i.saturating_sub(1)), cell.map(|i| (i + 1).min(last)), |neighbour| {
            held += usize::from(occupied.contains(&neighbour));
        });
        run.len() > 1 || held > 1
    };
    runs.iter().filter(|run| crowded(run)).map(|run| ancestor(run[0], level)).collect()
}

/// Calls `visit` for every cell from `from` to `to`, both included.
fn each_around<const D: usize>(from: Cell<D>, to: Cell<D>, mut visit: impl FnMut(Cell<D>)) {
    let mut cell = from;
    loop {
        visit(cell);
        let mut axis = 0;
        while axis < D && cell[axis] == to[axis] {
            cell[axis] = from[axis];
            axis += 1;
        }
        if axis == D {
            return;
        }
        cell[axis] += 1;
    }
}

/// The level of the leaf that holds a cell of the grid: the first at which its ancestor is not split.
fn leaf_level<const D: usize>(split: &[Cells<D>], cell: Cell<D>) -> u32 {
    let (mut whole, mut broken) = (0, split.len());
    while whole < broken {
        let middle = usize::midpoint(whole, broken);
        if split[middle].contains(&ancestor(cell, middle as u32)) {
            whole = middle + 1;
        } else {
            broken = middle;
        }
    }
    whole as u32
}

/// The bits of all axes in turn: the order in which every cell of every level is a run.
fn interleaved<const D: usize>(cell: &Cell<D>) -> u128 {
    (0..DEPTH).rev().fold(0, |key, bit| cell.iter().fold(key, |key, i| key << 1 | u128::from(i >> bit & 1)))
}

/// Hashes small integers by multiplication; cells are no secret and need no protection.
#[derive(Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|&byte| self.write_u64(u64::from(byte)));
    }

    fn write_u64(&mut self, value: u64) {
        self.0 = (self.0.rotate_left(23) ^ value).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    }

    fn write_usize(&mut self, value: usize) {
        self.write_u64(value as u64);
    }

    fn finish(&self) -> u64 {
        self.0 ^ self.0 >> 29
    }
}
