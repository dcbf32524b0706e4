//! Spacing functions (Miller, Talmor, Teng 1997, Definitions 3.2 to 3.4).
//!
//! - [`nearest`]: NN_P (3.2), at the points and anywhere. Points at a (rounded) distance of 0 count as one.
//! - [`CoarseSpacing`]: the C-coarsening (3.3), `min_p ( C g(p) + L |p - x| )` with the paper's slope 1 widened to a
//!   gradation L, and held under the gaps of the domain where given: `min_p ( min(C g(p), cap(p)) + L |p - x| )`.
//! - `threshold`: 3.4.
//!
//! All are exact bit for bit: the minimum over all points of the rounded formula, whatever the order in which they are
//! met. Searches prune with bounds that are monotone in floating point (see `kdtree`), or leave room for rounding (`walk`).

mod cap;
mod few;
mod thin;
mod walk;

use crate::error::Error;
use crate::kdtree::{KdTree, LEAF};
use crate::lanes;
use crate::point::{Point, distance_2};
use crate::progress::Progress;
use cap::Cap;
use few::Few;
use rayon::prelude::*;
use std::borrow::Cow;
use std::cell::Cell;
use std::ops::Range;
use walk::{Home, Level, Queries};

/// What is known of the distance to other sites where nothing is.
const NONE_APART: [f64; LEAF] = [0.0; LEAF];

/// Queries that one thread answers in one go.
const ASKED_AT_ONCE: usize = 1024;

/// Squares of anything as great do not vanish.
const SQUARABLE: f64 = 1e-150;

/// NN_P at the points of the tree, by original index: the least distance over 0 to another point, infinite where all
/// points coincide or there is only one.
///
/// Runtime: O(n log n) for bounded density, in parallel.
pub fn nearest<const D: usize>(tree: &KdTree<D>, progress: &Progress) -> Result<Vec<f64>, Error> {
    Ok(tree.by_index(&nearest_by_leaves(tree, progress)?))
}

/// [`nearest`] in leaf order.
pub(crate) fn nearest_by_leaves<const D: usize>(tree: &KdTree<D>, progress: &Progress) -> Result<Vec<f64>, Error> {
    by_leaves(tree, progress, |leaves, found| nearest_in(tree, leaves, found))
}

/// NN_P anywhere: the radius of the smallest closed ball about x that holds two points of P at different locations.
pub fn nearest_at<const D: usize>(tree: &KdTree<D>, at: &[Point<D>], progress: &Progress) -> Result<Vec<f64>, Error> {
    let queries = KdTree::new(at);
    let in_leaf_order = in_blocks(queries.points(), 0.0, progress, |points, found| {
        for (x, value) in points.iter().zip(found) {
            *value = match tree.nearest(x, None).1 {
                Some(first) => tree.nearest(x, Some(&tree.points()[first])).0.sqrt(),
                None => f64::INFINITY,
            };
        }
    })?;
    Ok(queries.by_index(&in_leaf_order))
}

/// max(g, C min g) (Definition 3.4).
pub fn threshold(g: &[f64], factor: f64) -> Vec<f64> {
    let least = factor * g.iter().copied().fold(f64::INFINITY, f64::min);
    g.iter().map(|&value| if value < least { least } else { value }).collect()
}

/// The C-coarsening of a spacing g over the points of a tree, for any C (see the module).
#[derive(Debug)]
pub struct CoarseSpacing<'a, const D: usize> {
    tree: Cow<'a, KdTree<D>>,
    gradation: f64,
    /// In leaf order.
    g: Cow<'a, [f64]>,
    least_g: Vec<f64>,
    cap: Option<Cap>,
    is_nearest: bool,
}

impl<'a, const D: usize> CoarseSpacing<'a, D> {
    /// Prepares for g and `cap`, both by original index; an infinite `cap` holds nothing down, nor does one that is not
    /// there: `cap` may be shorter.
    ///
    /// Runtime: O(n).
    pub fn new(tree: &'a KdTree<D>, g: &[f64], cap: Option<&[f64]>, gradation: f64) -> Self {
        Self::over(Cow::Borrowed(tree), Cow::Owned(tree.in_leaf_order(g)), None, gradation).held(cap)
    }

    /// For g in leaf order.
    pub(crate) fn of_leaves(tree: &'a KdTree<D>, g: &'a [f64], cap: Option<&[f64]>, gradation: f64) -> Self {
        Self::over(Cow::Borrowed(tree), Cow::Borrowed(g), None, gradation).held(cap)
    }

    fn over(tree: Cow<'a, KdTree<D>>, g: Cow<'a, [f64]>, cap: Option<Cap>, gradation: f64) -> Self {
        CoarseSpacing { least_g: tree.node_min(&g), tree, gradation, g, cap, is_nearest: false }
    }

    /// The same, held under a cap by original index.
    fn held(self, cap: Option<&[f64]>) -> Self {
        CoarseSpacing { cap: cap.map(|cap| Cap::new(&self.tree, cap)), ..self }
    }

    /// The same, for a g that is [`nearest`] of these points: none but copies of it is nearer to a point than its g, so
    /// that few others come into question at the points themselves.
    pub fn of_nearest(self) -> Self {
        CoarseSpacing { is_nearest: true, ..self }
    }

    /// f at every point of the tree, by original index.
    pub fn at_points(&self, factor: f64, progress: &Progress) -> Result<Vec<f64>, Error> {
        Ok(self.tree.by_index(&self.at_leaves(factor, progress)?))
    }

    /// f at every point of the tree, in leaf order.
    fn at_leaves(&self, factor: f64, progress: &Progress) -> Result<Vec<f64>, Error> {
        let level = self.level([factor]);
        by_leaves(&self.tree, progress, |leaves, mut found| {
            let mut winner = None;
            for leaf in leaves {
                let range = self.tree.range(leaf);
                let (best, rest) = found.split_at_mut(range.len());
                let has_copies = !self.is_nearest || may_have_copies(&self.tree.points()[range.clone()]);
                let first = range.clone().step_by(LEAF);
                let chunks = self.tree.points()[range.clone()].chunks(LEAF).zip(self.g[range].chunks(LEAF));
                for (((points, apart), best), first) in chunks.zip(best.chunks_mut(LEAF)).zip(first) {
                    let apart = if self.is_nearest { apart } else { &NONE_APART[..points.len()] };
                    let home = Some(Home { leaf, first, has_copies });
                    level.block(Queries { points, apart, home }, best.as_chunks_mut().0, &mut winner);
                }
                found = rest;
            }
        })
    }

    /// Whether the sites are the points of this very tree.
    pub fn is_over(&self, tree: &KdTree<D>) -> bool {
        std::ptr::eq(tree, &*self.tree)
    }

    /// f at the points of a tree, by original index: this spacing's own (then as [`CoarseSpacing::at_points`]) or another.
    pub fn at_tree(&self, factor: f64, at: &KdTree<D>, progress: &Progress) -> Result<Vec<f64>, Error> {
        Ok(at.by_index(&self.at_leaves_of(factor, at, progress)?))
    }

    /// The same in leaf order.
    pub(crate) fn at_leaves_of(&self, factor: f64, at: &KdTree<D>, progress: &Progress) -> Result<Vec<f64>, Error> {
        if self.is_over(at) {
            return self.at_leaves(factor, progress);
        }
        Ok(self.at_sorted([factor], at.points(), progress)?.into_flattened())
    }

    /// f at any locations; fast when many neighbours are asked for together, in any order.
    pub fn at(&self, factor: f64, at: &[Point<D>], progress: &Progress) -> Result<Vec<f64>, Error> {
        self.at_tree(factor, &KdTree::new(at), progress)
    }

    /// f for some factors, ascending, at locations that already are in some spatial order: one walk finds it for all.
    pub(crate) fn at_sorted<const K: usize>(
        &self,
        factors: [f64; K],
        at: &[Point<D>],
        progress: &Progress,
    ) -> Result<Vec<[f64; K]>, Error> {
        let level = self.level(factors);
        in_blocks(at, [0.0; K], progress, |points, found| {
            let mut winner = None;
            for (queries, best) in points.chunks(LEAF / 3).zip(found.chunks_mut(LEAF / 3)) {
                let apart = &NONE_APART[..queries.len()];
                level.block(Queries { points: queries, apart, home: None }, best, &mut winner);
            }
        })
    }

    /// For some factors.
    fn level<const K: usize>(&self, factors: [f64; K]) -> Level<'_, 'a, D, K> {
        // rounding is monotone: never over the weight of any point in the node
        let grown = self.least_g.iter().map(|g| factors.map(|factor| factor * g));
        let under = |grown: [f64; K], cap: f64| grown.map(|grown| if cap < grown { cap } else { grown });
        let least = match &self.cap {
            Some(cap) => grown.zip(&cap.least).map(|(grown, &cap)| under(grown, cap)).collect(),
            None => grown.collect(),
        };
        Level { spacing: self, factors, least }
    }
}

/// The C-coarsening as one call: g at the points, f at `at` or at the points themselves.
pub fn coarsened<const D: usize>(
    points: &[Point<D>],
    g: &[f64],
    factor: f64,
    gradation: f64,
    at: Option<&[Point<D>]>,
    progress: &Progress,
) -> Result<Vec<f64>, Error> {
    let tree = KdTree::new(points);
    let spacing = CoarseSpacing::new(&tree, g, None, gradation);
    match at {
        Some(at) => spacing.at(factor, at, progress),
        None => spacing.at_points(factor, progress),
    }
}

/// NN_P at the points of some leaves of the tree.
fn nearest_in<const D: usize>(tree: &KdTree<D>, leaves: Range<usize>, mut found: &mut [f64]) {
    for leaf in leaves {
        let own = tree.range(leaf);
        let (best, rest) = found.split_at_mut(own.len());
        found = rest;
        let around = tree.bounds(leaf);
        let chunks = tree.points()[own].chunks(LEAF).zip(best.chunks_mut(LEAF));
        for (queries, best) in chunks {
            let mut few = Few::<D, 1>::new(queries);
            let limit = Cell::new(f64::INFINITY);
            tree.descend_from(
                leaf,
                |node| tree.bounds(node).gap_2(around) < limit.get(),
                |node, range| {
                    let bounds = tree.bounds(node);
                    let range = if bounds.is_location() { range.start..range.end.min(range.start + 1) } else { range };
                    let points = &tree.points()[lanes::whole(&range, tree.len())];
                    for k in lanes::ones(few.asked(|x, _, [best]| bounds.distance_2(x) < best)) {
                        let least = least_apart_2(points, few.at(k));
                        let best = few.best_mut(0, k);
                        *best = if least < *best { least } else { *best };
                    }
                    limit.set(few.greatest()[0]);
                },
            );
            best.iter_mut().zip(few.best(0)).for_each(|(value, best)| *value = best.sqrt());
        }
    }
}

/// The least squared distance over 0 from x to some points.
#[inline(always)]
fn least_apart_2<const D: usize>(points: &[Point<D>], x: &Point<D>) -> f64 {
    let [least] = lanes::least_of(points, [], |p, []| {
        let d_2 = distance_2(p, x);
        [if d_2 > 0.0 { d_2 } else { f64::INFINITY }]
    });
    least
}

/// Whether two of some points may be at a (rounded) distance of 0; never so where they are sorted and apart.
fn may_have_copies<const D: usize>(points: &[Point<D>]) -> bool {
    let follows = |p: &Point<D>, q: &Point<D>| {
        let steps = || p.iter().zip(q).map(|(p, q)| q - p);
        steps().find(|&step| step != 0.0).is_some_and(|step| step >= SQUARABLE)
    };
    !points.windows(2).all(|pair| follows(&pair[0], &pair[1]))
}

/// Answers for the points of a tree, in leaf order: some leaves at once, these in parallel.
fn by_leaves<const D: usize>(
    tree: &KdTree<D>,
    progress: &Progress,
    answer: impl Fn(Range<usize>, &mut [f64]) + Sync,
) -> Result<Vec<f64>, Error> {
    let mut found = vec![0.0; tree.len()];
    let mut rest = &mut found[..];
    let mut parts = Vec::new();
    for part in tree.parts(ASKED_AT_ONCE) {
        let (own, others) = rest.split_at_mut(tree.range(part).len());
        parts.push((part, own));
        rest = others;
    }
    parts.into_par_iter().try_for_each(|(part, found)| {
        progress.check()?;
        let count = found.len();
        answer(tree.leaves(part), found);
        progress.advance(count as u64);
        Ok(())
    })?;
    Ok(found)
}

/// Answers spatially sorted queries by blocks in parallel.
fn in_blocks<const D: usize, T: Clone + Send>(
    queries: &[Point<D>],
    nothing: T,
    progress: &Progress,
    answer: impl Fn(&[Point<D>], &mut [T]) + Sync,
) -> Result<Vec<T>, Error> {
    let mut found = vec![nothing; queries.len()];
    queries.par_chunks(ASKED_AT_ONCE).zip(found.par_chunks_mut(ASKED_AT_ONCE)).try_for_each(|(queries, found)| {
        progress.check()?;
        answer(queries, found);
        progress.advance(queries.len() as u64);
        Ok(())
    })?;
    Ok(found)
}
