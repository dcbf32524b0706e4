//! Spacing functions (Miller, Talmor, Teng 1997, Definitions 3.2 to 3.4).
//!
//! - [`nearest`]: NN_P (3.2), at the points and anywhere. Points at a (rounded) distance of 0 count as one.
//! - [`CoarseSpacing`]: the C-coarsening (3.3), `min_p ( C g(p) + L |p - x| )` with the paper's slope 1 widened to a
//!   gradation L, and held under the gaps of the domain where given: `min_p ( min(C g(p), cap(p)) + L |p - x| )`.
//! - `threshold`: 3.4.
//!
//! All are exact bit for bit: the minimum over all points of the rounded formula, whatever the order in which they are
//! met. Searches prune with bounds that are monotone in floating point only (see `kdtree`).
//!
//! Queries go in blocks of neighbours: one walk down the tree serves a block, with its box in place of the point, and
//! starts from what is known already: C g at the query itself, and the site that won at the query before.

mod thin;

use crate::error::Error;
use crate::kdtree::{Bounds, GRAIN, KdTree, LEAF};
use crate::point::{Point, distance, distance_2};
use crate::progress::Progress;
use rayon::prelude::*;
use std::borrow::Cow;
use std::cell::Cell;
use std::ops::Range;
use std::slice;

/// Queries walk down the tree together while their box is at most so many times as wide as g at the site that won last.
const WIDTHS_TOGETHER: f64 = 32.0;

/// What is known of the distance to other sites where nothing is.
const NONE_APART: [f64; LEAF] = [0.0; LEAF];

/// Squares of anything as great do not vanish.
const SQUARABLE: f64 = 1e-150;

/// Minima are taken in so many lanes.
const LANES: usize = 8;
const _: () = assert!(LEAF.is_multiple_of(LANES));

/// NN_P at the points of the tree, by original index: the least distance over 0 to another point, infinite where all
/// points coincide or there is only one.
///
/// Runtime: O(n log n) for bounded density, in parallel.
pub fn nearest<const D: usize>(tree: &KdTree<D>, progress: &Progress) -> Result<Vec<f64>, Error> {
    let in_leaf_order = by_leaves(tree, progress, |leaves, found| nearest_in(tree, leaves, found))?;
    Ok(by_index(tree, &in_leaf_order))
}

/// NN_P anywhere: the radius of the smallest closed ball about x that holds two points of P at different locations.
pub fn nearest_at<const D: usize>(tree: &KdTree<D>, at: &[Point<D>], progress: &Progress) -> Result<Vec<f64>, Error> {
    let queries = KdTree::new(at);
    let in_leaf_order = in_blocks(queries.points(), progress, |points, found| {
        for (x, value) in points.iter().zip(found) {
            *value = match tree.nearest(x, None).1 {
                Some(first) => tree.nearest(x, Some(&tree.points()[first])).0.sqrt(),
                None => f64::INFINITY,
            };
        }
    })?;
    Ok(by_index(&queries, &in_leaf_order))
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
    g: Vec<f64>,
    least_g: Vec<f64>,
    cap: Option<Cap>,
    is_nearest: bool,
}

/// What holds the spacing down, in leaf order and its minimum by node.
#[derive(Debug)]
struct Cap {
    at: Vec<f64>,
    least: Vec<f64>,
}

impl<'a, const D: usize> CoarseSpacing<'a, D> {
    /// Prepares for g and `cap`, both by original index; an infinite `cap` holds nothing down.
    ///
    /// Runtime: O(n).
    pub fn new(tree: &'a KdTree<D>, g: &[f64], cap: Option<&[f64]>, gradation: f64) -> Self {
        Self::over(Cow::Borrowed(tree), g, cap, gradation)
    }

    fn over(tree: Cow<'a, KdTree<D>>, g: &[f64], cap: Option<&[f64]>, gradation: f64) -> Self {
        let in_leaf_order =
            |values: &[f64]| -> Vec<f64> { tree.order().par_iter().map(|&i| values[i as usize]).collect() };
        let g = in_leaf_order(g);
        let least_g = tree.node_min(&g);
        let cap = cap.map(|cap| {
            let at = in_leaf_order(cap);
            Cap { least: tree.node_min(&at), at }
        });
        CoarseSpacing { tree, gradation, g, least_g, cap, is_nearest: false }
    }

    /// The same, for a g that is [`nearest`] of these points: none but copies of it is nearer to a point than its g, so
    /// that few others come into question at the points themselves.
    pub fn of_nearest(self) -> Self {
        CoarseSpacing { is_nearest: true, ..self }
    }

    /// f at every point of the tree, by original index.
    pub fn at_points(&self, factor: f64, progress: &Progress) -> Result<Vec<f64>, Error> {
        Ok(by_index(&self.tree, &self.at_leaves(factor, progress)?))
    }

    /// f at every point of the tree, in leaf order.
    fn at_leaves(&self, factor: f64, progress: &Progress) -> Result<Vec<f64>, Error> {
        let level = self.level(factor);
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
                    level.block(Queries { points, apart, home }, best, &mut winner);
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
        if self.is_over(at) {
            return self.at_points(factor, progress);
        }
        Ok(by_index(at, &self.at_sorted(factor, at.points(), progress)?))
    }

    /// f at any locations; fast when many neighbours are asked for together, in any order.
    pub fn at(&self, factor: f64, at: &[Point<D>], progress: &Progress) -> Result<Vec<f64>, Error> {
        self.at_tree(factor, &KdTree::new(at), progress)
    }

    /// f at locations that already are in some spatial order.
    fn at_sorted(&self, factor: f64, at: &[Point<D>], progress: &Progress) -> Result<Vec<f64>, Error> {
        let level = self.level(factor);
        in_blocks(at, progress, |points, found| {
            let mut winner = None;
            for (queries, best) in points.chunks(LEAF / 3).zip(found.chunks_mut(LEAF / 3)) {
                let apart = &NONE_APART[..queries.len()];
                level.block(Queries { points: queries, apart, home: None }, best, &mut winner);
            }
        })
    }

    /// For one factor.
    fn level(&self, factor: f64) -> Level<'_, 'a, D> {
        // rounding is monotone: never over the weight of any point in the node
        let grown = self.least_g.iter().map(|g| factor * g);
        let least = match &self.cap {
            Some(cap) => grown.zip(&cap.least).map(|(grown, &cap)| if cap < grown { cap } else { grown }).collect(),
            None => grown.collect(),
        };
        Level { spacing: self, factor, least }
    }
}

/// A spacing with its factor, and the least weight of every node.
struct Level<'s, 'a, const D: usize> {
    spacing: &'s CoarseSpacing<'a, D>,
    factor: f64,
    least: Vec<f64>,
}

/// The site that won last.
type Winner = Option<usize>;

/// A few neighbours to find f at.
#[derive(Clone, Copy)]
struct Queries<'q, const D: usize> {
    points: &'q [Point<D>],
    /// No site but at a query itself is nearer to it than this.
    apart: &'q [f64],
    home: Option<Home>,
}

/// Where queries are that are sites themselves.
#[derive(Clone, Copy)]
struct Home {
    leaf: usize,
    /// Leaf position of the first.
    first: usize,
    /// Whether a site of their leaf may lie at one of them.
    has_copies: bool,
}

impl<const D: usize> Level<'_, '_, D> {
    #[inline(always)]
    fn weight(&self, position: usize) -> f64 {
        let grown = self.factor * self.spacing.g[position];
        match &self.spacing.cap {
            Some(cap) if cap.at[position] < grown => cap.at[position],
            _ => grown,
        }
    }

    #[inline(always)]
    fn cone(&self, position: usize, x: &Point<D>) -> f64 {
        self.weight(position) + self.spacing.gradation * distance(&self.spacing.tree.points()[position], x)
    }

    /// The least cone of a leaf at x.
    ///
    /// Written for vector units: the cones one by one without a branch, then their minimum.
    #[inline(always)]
    fn least_cone(&self, node: usize, range: Range<usize>, x: &Point<D>) -> f64 {
        let has_cap = self.spacing.cap.as_ref().is_some_and(|cap| cap.least[node] < f64::INFINITY);
        let mut least = f64::INFINITY;
        for start in range.clone().step_by(LEAF) {
            let some = self.least_of_few(has_cap, start..range.end.min(start + LEAF), x);
            least = if some < least { some } else { least };
        }
        least
    }

    /// The least cone of up to [`LEAF`] sites at x.
    #[inline(always)]
    fn least_of_few(&self, has_cap: bool, range: Range<usize>, x: &Point<D>) -> f64 {
        let slope = self.spacing.gradation;
        let mut cones = [f64::INFINITY; LEAF];
        let cones_of =
            cones.iter_mut().zip(&self.spacing.tree.points()[range.clone()]).zip(&self.spacing.g[range.clone()]);
        match &self.spacing.cap {
            Some(cap) if has_cap => {
                for (((cone, p), g), &cap) in cones_of.zip(&cap.at[range]) {
                    let grown = self.factor * g;
                    *cone = (if cap < grown { cap } else { grown }) + slope * distance(p, x);
                }
            }
            _ => {
                for ((cone, p), g) in cones_of {
                    *cone = self.factor * g + slope * distance(p, x);
                }
            }
        }
        least_of(&cones)
    }

    /// f at a few neighbours.
    fn block(&self, queries: Queries<'_, D>, best: &mut [f64], winner: &mut Winner) {
        let Queries { points, apart, home } = queries;
        let around = Bounds::of(points);
        let start = |around: &Bounds<D>| home.map_or_else(|| self.spacing.tree.leaf_near(around), |home| home.leaf);
        // a walk for all looks at sites that win nowhere, within about the box's width of the winner: no loss where few
        // sites are there, but a bad one where a far cluster of much finer ones wins
        let together = winner.is_some_and(|p| around.width() <= WIDTHS_TOGETHER * self.spacing.g[p]);
        if together {
            self.walk(start(&around), queries, &around, best, winner);
        } else {
            for (k, ((x, apart), best)) in points.iter().zip(apart).zip(best).enumerate() {
                let home = home.map(|home| Home { first: home.first + k, ..home });
                let query = Queries { points: slice::from_ref(x), apart: slice::from_ref(apart), home };
                let around = Bounds::of([x]);
                self.walk(start(&around), query, &around, slice::from_mut(best), winner);
            }
        }
    }

    /// One walk over the tree for a few queries in the box `around`, from a node near them.
    #[inline(always)]
    fn walk(
        &self,
        start: usize,
        Queries { points, apart, home }: Queries<'_, D>,
        around: &Bounds<D>,
        best: &mut [f64],
        winner: &mut Winner,
    ) {
        let (tree, slope) = (&*self.spacing.tree, self.spacing.gradation);
        for (k, (x, best)) in points.iter().zip(best.iter_mut()).enumerate() {
            let own = home.map_or(f64::INFINITY, |home| self.weight(home.first + k));
            let known = winner.map_or(f64::INFINITY, |p| self.cone(p, x));
            *best = if known < own { known } else { own };
        }
        // what is known of the leaf of the queries holds for it too
        let lone_home = home.filter(|home| !home.has_copies).map_or(0, |home| home.leaf);
        let limit = Cell::new(greatest(best));
        // the leaf that won last, and the query there: which of its sites it was is asked once, at the end
        let mut last = None;
        tree.descend_from(
            start,
            |node| self.least[node] + slope * tree.bounds(node).gap_2(around).sqrt() < limit.get(),
            |node, range| {
                let (bounds, least) = (tree.bounds(node), self.least[node]);
                // copies of one point: a minimum of rounded sums is the rounded sum with the minimum
                let lone = bounds.is_location();
                let mut bound = [0.0; LEAF];
                for ((x, &apart), bound) in points.iter().zip(apart).zip(&mut bound) {
                    let near = bounds.distance_2(x).sqrt();
                    // at no distance there may be a copy of the query
                    let is_apart = near > 0.0 || node == lone_home;
                    let near = if is_apart && near < apart { apart } else { near };
                    *bound = least + slope * near;
                }
                for (k, ((x, &bound), best)) in points.iter().zip(&bound).zip(best.iter_mut()).enumerate() {
                    if bound < *best {
                        let value = if lone { bound } else { self.least_cone(node, range.clone(), x) };
                        if value < *best {
                            *best = value;
                            last = Some((if lone { range.start..range.start + 1 } else { range.clone() }, k));
                        }
                    }
                }
                limit.set(greatest(best));
            },
        );
        if let Some((mut range, k)) = last {
            let any = range.start;
            *winner = range.find(|&p| self.cone(p, &points[k]) == best[k]).or(Some(any));
        } else if let Some(home) = home {
            *winner = Some(home.first + points.len() - 1);
        }
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
        let (queries, around) = (&tree.points()[own], tree.bounds(leaf));
        best.fill(f64::INFINITY);
        let limit = Cell::new(f64::INFINITY);
        tree.descend_from(
            leaf,
            |node| tree.bounds(node).gap_2(around) < limit.get(),
            |node, range| {
                let bounds = tree.bounds(node);
                let range = if bounds.is_location() { range.start..range.end.min(range.start + 1) } else { range };
                for (x, best) in queries.iter().zip(best.iter_mut()) {
                    if bounds.distance_2(x) < *best {
                        for points in tree.points()[range.clone()].chunks(LEAF) {
                            let least = least_apart_2(points, x);
                            *best = if least < *best { least } else { *best };
                        }
                    }
                }
                limit.set(greatest(best));
            },
        );
        best.iter_mut().for_each(|value| *value = value.sqrt());
    }
}

/// The least squared distance over 0 from x to up to [`LEAF`] points.
#[inline(always)]
fn least_apart_2<const D: usize>(points: &[Point<D>], x: &Point<D>) -> f64 {
    let mut distances = [f64::INFINITY; LEAF];
    for (least, p) in distances.iter_mut().zip(points) {
        let d_2 = distance_2(p, x);
        *least = if d_2 > 0.0 { d_2 } else { f64::INFINITY };
    }
    least_of(&distances)
}

/// Whether two of some points may be at a (rounded) distance of 0; never so where they are sorted and apart.
fn may_have_copies<const D: usize>(points: &[Point<D>]) -> bool {
    let follows = |p: &Point<D>, q: &Point<D>| {
        let steps = || p.iter().zip(q).map(|(p, q)| q - p);
        steps().find(|&step| step != 0.0).is_some_and(|step| step >= SQUARABLE)
    };
    !points.windows(2).all(|pair| follows(&pair[0], &pair[1]))
}

/// The least value, in vector units.
#[inline(always)]
fn least_of(values: &[f64; LEAF]) -> f64 {
    let mut least = [f64::INFINITY; LANES];
    for values in values.chunks_exact(LANES) {
        for (least, &value) in least.iter_mut().zip(values) {
            *least = if value < *least { value } else { *least };
        }
    }
    let mut width = LANES / 2;
    while width > 0 {
        for k in 0..width {
            let other = least[k + width];
            least[k] = if other < least[k] { other } else { least[k] };
        }
        width /= 2;
    }
    least[0]
}

#[inline(always)]
fn greatest(values: &[f64]) -> f64 {
    values.iter().fold(f64::NEG_INFINITY, |a, &b| if b > a { b } else { a })
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
    for part in tree.parts(GRAIN) {
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
fn in_blocks<const D: usize>(
    queries: &[Point<D>],
    progress: &Progress,
    answer: impl Fn(&[Point<D>], &mut [f64]) + Sync,
) -> Result<Vec<f64>, Error> {
    let mut found = vec![0.0; queries.len()];
    queries.par_chunks(GRAIN).zip(found.par_chunks_mut(GRAIN)).try_for_each(|(queries, found)| {
        progress.check()?;
        answer(queries, found);
        progress.advance(queries.len() as u64);
        Ok(())
    })?;
    Ok(found)
}

/// From leaf order to the original order.
fn by_index<const D: usize>(tree: &KdTree<D>, in_leaf_order: &[f64]) -> Vec<f64> {
    tree.positions().par_iter().map(|&position| in_leaf_order[position as usize]).collect()
}
