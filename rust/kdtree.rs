//! Static k-d tree: the one search structure of points, generic over the dimension.
//!
//! Median splits along the widest side of the tight box, ties broken by original index; at most [`LEAF`] points in a
//! leaf, sorted by coordinates and then index. The nodes form a complete binary tree in heap order (root 1, children `2k` and `2k + 1`), and node `j` of depth
//! `k` holds the leaf positions `j*n >> k .. (j+1)*n >> k`, so that no ranges are stored. Points are kept in leaf order,
//! which is a space-filling order too: whoever has many queries asks them in that order.
//!
//! Weights are not part of the tree: [`KdTree::node_min`] and [`KdTree::node_max`] fold any values over the nodes in O(n),
//! and one tree serves as many weights as there are levels.
//!
//! Every bound is monotone in floating point: the distance to a box is made of the operations that make the distance to a
//! point, so the rounded bound never exceeds the rounded distance to a point within. Searches are exact bit for bit.

// coordinates of several points are walked together; an iterator over one of them hides the formula
#![allow(clippy::needless_range_loop)]

mod build;

use crate::point::{Point, distance_2};
use crate::remaining::remaining_from;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::OnceLock;

/// The most points in a leaf: 13 to 24 of them in a large tree. Going down to half as many costs more in branches that
/// nobody can foretell than it saves in distances, which vector units take several at once.
pub const LEAF: usize = 24;

/// Below this many points a subtree is built, or a block of queries answered, by one thread.
pub const GRAIN: usize = 8192;

#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// A closed axis-parallel box; empty where `lo > hi`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds<const D: usize> {
    /// Least coordinates.
    pub lo: Point<D>,
    /// Greatest coordinates.
    pub hi: Point<D>,
}

impl<const D: usize> Bounds<D> {
    /// Holds nothing.
    pub const EMPTY: Self = Bounds { lo: [f64::INFINITY; D], hi: [f64::NEG_INFINITY; D] };

    /// The tight box of some points.
    #[inline]
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Point<D>>) -> Self {
        let mut bounds = Self::EMPTY;
        for p in points {
            for k in 0..D {
                bounds.lo[k] = if p[k] < bounds.lo[k] { p[k] } else { bounds.lo[k] };
                bounds.hi[k] = if p[k] > bounds.hi[k] { p[k] } else { bounds.hi[k] };
            }
        }
        bounds
    }

    /// The tight box of both.
    #[inline]
    pub fn merged(&self, other: &Self) -> Self {
        let mut bounds = *self;
        for k in 0..D {
            bounds.lo[k] = if other.lo[k] < bounds.lo[k] { other.lo[k] } else { bounds.lo[k] };
            bounds.hi[k] = if other.hi[k] > bounds.hi[k] { other.hi[k] } else { bounds.hi[k] };
        }
        bounds
    }

    /// Whether all that is inside lies at one location.
    #[inline(always)]
    pub fn is_location(&self) -> bool {
        self.lo == self.hi
    }

    /// The axis of the longest side, the first of equals.
    #[inline]
    pub fn widest(&self) -> usize {
        let mut axis = 0;
        for k in 1..D {
            if self.hi[k] - self.lo[k] > self.hi[axis] - self.lo[axis] {
                axis = k;
            }
        }
        axis
    }

    /// The length of the longest side.
    #[inline]
    pub fn width(&self) -> f64 {
        let axis = self.widest();
        self.hi[axis] - self.lo[axis]
    }

    /// Squared distance to a point; at most [`distance_2`] to any point inside, in floats too.
    #[inline(always)]
    pub fn distance_2(&self, x: &Point<D>) -> f64 {
        let mut sum = 0.0;
        for k in 0..D {
            let d = greater(greater(self.lo[k] - x[k], x[k] - self.hi[k]), 0.0);
            sum += d * d;
        }
        sum
    }

    /// Squared distance to another box; at most [`distance_2`] of any two points inside them, in floats too.
    #[inline(always)]
    pub fn gap_2(&self, other: &Self) -> f64 {
        let mut sum = 0.0;
        for k in 0..D {
            let d = greater(greater(self.lo[k] - other.hi[k], other.lo[k] - self.hi[k]), 0.0);
            sum += d * d;
        }
        sum
    }
}

/// The tree (see the module).
#[derive(Debug, Clone)]
pub struct KdTree<const D: usize> {
    points: Vec<Point<D>>,
    order: Vec<u32>,
    positions: OnceLock<Vec<u32>>,
    bounds: Vec<Bounds<D>>,
    first_leaf: usize,
    /// Where leaves begin, and the last one ends, where they do not follow the formula: see [`KdTree::subset`].
    starts: Option<Vec<u32>>,
}

impl<const D: usize> KdTree<D> {
    /// Builds the tree of finite points, fewer than 2³² of them.
    ///
    /// Runtime: O(n log n), in parallel; the result does not depend on the number of threads.
    pub fn new(points: &[Point<D>]) -> Self {
        Self::of(points.len(), |i| points[i])
    }

    /// The same, of `n` points by their numbers.
    pub fn of(n: usize, point: impl Fn(usize) -> Point<D> + Sync) -> Self {
        let mut first_leaf = 1;
        while n.div_ceil(first_leaf) > LEAF {
            first_leaf *= 2;
        }
        let (points, order) = build::in_leaf_order(n, point, first_leaf);
        KdTree { points, order, positions: OnceLock::new(), bounds: Vec::new(), first_leaf, starts: None }.boxed()
    }

    fn boxed(mut self) -> Self {
        self.bounds = self.folded(Bounds::EMPTY, |range| Bounds::of(&self.points[range]), Bounds::merged);
        self
    }

    /// A tree of the points at some ascending leaf positions, which are its original indices from then on. No point
    /// is sorted again: nodes are split where those of this tree are, so that leaves may hold any number of points, about
    /// half of [`LEAF`] on average.
    ///
    /// Runtime: O(n), in parallel.
    pub fn subset(&self, kept: &[u32]) -> Self {
        let mut first_leaf = self.first_leaf;
        while first_leaf > 1 && kept.len() * 2 <= first_leaf * LEAF {
            first_leaf /= 2;
        }
        let begin = |leaf: usize| if leaf < 2 * first_leaf { self.range(leaf).start } else { self.len() };
        let starts = (first_leaf..2 * first_leaf + 1)
            .into_par_iter()
            .with_min_len(GRAIN / LEAF)
            .map(|leaf| kept.partition_point(|&p| (p as usize) < begin(leaf)) as u32)
            .collect();
        let points = kept.par_iter().map(|&p| self.points[p as usize]).collect();
        let order = (0..kept.len() as u32).collect();
        KdTree { points, order, positions: OnceLock::new(), bounds: Vec::new(), first_leaf, starts: Some(starts) }
            .boxed()
    }

    /// The points in leaf order.
    pub fn points(&self) -> &[Point<D>] {
        &self.points
    }

    /// Leaf position → original index.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The same tree, the points of index `first` and greater numbered from there on in leaf order; also what their
    /// indices were.
    pub fn numbered_from(mut self, first: u32) -> (Self, Vec<u32>) {
        let n = self.len() as u32;
        let fixed: Vec<u32> = (0..n).into_par_iter().filter(|&p| self.order[p as usize] < first).collect();
        let mut positions = vec![0; self.len()];
        let (of_fixed, of_others) = positions.split_at_mut(fixed.len());
        fixed.iter().for_each(|&p| of_fixed[self.order[p as usize] as usize] = p);
        let mut were = vec![0; of_others.len()];
        let chunks = were.par_chunks_mut(GRAIN).zip(of_others.par_chunks_mut(GRAIN)).enumerate();
        chunks.for_each(|(chunk, (were, positions))| {
            for ((was, own), p) in were.iter_mut().zip(positions).zip(remaining_from(&fixed, chunk * GRAIN)) {
                (*was, *own) = (self.order[p], p as u32);
            }
        });
        self.order.par_chunks_mut(GRAIN).enumerate().for_each(|(chunk, order)| {
            let start = chunk * GRAIN - fixed.partition_point(|&p| (p as usize) < chunk * GRAIN);
            let others = order.iter_mut().filter(|index| **index >= first);
            others.zip(first + start as u32..).for_each(|(index, number)| *index = number);
        });
        (KdTree { positions: positions.into(), ..self }, were)
    }

    /// The point of an original index.
    #[inline(always)]
    pub fn point(&self, index: u32) -> &Point<D> {
        &self.points[self.positions()[index as usize] as usize]
    }

    /// Original index → leaf position; made when first asked for.
    pub fn positions(&self) -> &[u32] {
        self.positions.get_or_init(|| {
            // by one thread: another that helped might come to wait for this very cell
            let mut positions = vec![0; self.order.len()];
            for (position, &index) in self.order.iter().enumerate() {
                positions[index as usize] = position as u32;
            }
            positions
        })
    }

    /// Values in leaf order by original index.
    pub fn by_index(&self, in_leaf_order: &[f64]) -> Vec<f64> {
        self.positions().par_iter().map(|&position| in_leaf_order[position as usize]).collect()
    }

    /// Values by original index in leaf order.
    pub fn in_leaf_order(&self, by_index: &[f64]) -> Vec<f64> {
        self.order.par_iter().map(|&index| by_index[index as usize]).collect()
    }

    /// How many points there are.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The box of a node.
    #[inline(always)]
    pub fn bounds(&self, node: usize) -> &Bounds<D> {
        &self.bounds[node]
    }

    /// Leaf positions of a node.
    #[inline(always)]
    pub fn range(&self, node: usize) -> Range<usize> {
        match &self.starts {
            None => range(node, self.points.len()),
            Some(starts) => {
                let leaves = self.leaves(node);
                starts[leaves.start - self.first_leaf] as usize..starts[leaves.end - self.first_leaf] as usize
            }
        }
    }

    /// Nodes of one depth that hold up to `most` points each, in leaf order (leaves where `most` is less than [`LEAF`]).
    pub fn parts(&self, most: usize) -> Range<usize> {
        let mut first = 1;
        while first < self.first_leaf && self.len().div_ceil(first) > most {
            first *= 2;
        }
        first..2 * first
    }

    /// The leaf that holds a position; not in a [`KdTree::subset`].
    #[inline(always)]
    pub fn leaf_of(&self, position: usize) -> usize {
        self.node_of(position, self.first_leaf)
    }

    /// The node that holds a position, among those of the depth that begins with the node `first`; not in a
    /// [`KdTree::subset`].
    #[inline(always)]
    pub fn node_of(&self, position: usize, first: usize) -> usize {
        first + ((position + 1) * first).div_ceil(self.len()) - 1
    }

    /// The leaves under a node.
    pub fn leaves(&self, node: usize) -> Range<usize> {
        let below = self.first_leaf.ilog2() - node.ilog2();
        node << below..(node + 1) << below
    }

    /// Whether searches go no further down: a leaf, or all points at one location.
    #[inline(always)]
    fn is_end(&self, node: usize) -> bool {
        node >= self.first_leaf || self.bounds[node].is_location()
    }

    /// A value for every node (heap order, entry 0 unused): `leaf` makes it at the leaves, `join` from two children.
    pub fn folded<T: Copy + Send + Sync>(
        &self,
        empty: T,
        leaf: impl Fn(Range<usize>) -> T + Sync,
        join: impl Fn(&T, &T) -> T,
    ) -> Vec<T> {
        let mut values = vec![empty; 2 * self.first_leaf];
        let leaves = &mut values[self.first_leaf..];
        leaves.par_iter_mut().enumerate().with_min_len(GRAIN / LEAF).for_each(|(k, value)| {
            *value = leaf(self.range(self.first_leaf + k));
        });
        for node in (1..self.first_leaf).rev() {
            values[node] = join(&values[2 * node], &values[2 * node + 1]);
        }
        values
    }

    /// The least of `values` (in leaf order) in every node; NaN counts as absent.
    pub fn node_min(&self, values: &[f64]) -> Vec<f64> {
        let least = |a: &f64, b: &f64| if b < a { *b } else { *a };
        self.folded(f64::INFINITY, |range| values[range].iter().fold(f64::INFINITY, |a, b| least(&a, b)), least)
    }

    /// The greatest of `values` (in leaf order) in every node; NaN counts as absent.
    pub fn node_max(&self, values: &[f64]) -> Vec<f64> {
        self.folded_max(|range| values[range].iter().copied())
    }

    /// The greatest of `values` (by original index) in every node; NaN counts as absent.
    pub fn node_max_of(&self, values: &[f64]) -> Vec<f64> {
        self.folded_max(|range| self.order[range].iter().map(|&i| values[i as usize]))
    }

    fn folded_max<I: Iterator<Item = f64>>(&self, values: impl Fn(Range<usize>) -> I + Sync) -> Vec<f64> {
        let greatest = |a: f64, b: f64| if b > a { b } else { a };
        let lowest = f64::NEG_INFINITY;
        self.folded(lowest, |range| values(range).fold(lowest, greatest), |&a, &b| greatest(a, b))
    }

    /// Branch and bound: visits the leaves whose `bound` is under the limit, the more promising child first. `visit` gets
    /// the node and its leaf positions and returns the new limit. A node whose points all share one location is
    /// visited whole, whatever its size: many copies of a point cost no more than one.
    #[inline]
    pub fn search(
        &self,
        mut limit: f64,
        mut bound: impl FnMut(usize) -> f64,
        mut visit: impl FnMut(usize, Range<usize>) -> f64,
    ) {
        let mut stack = [(0.0, 0); 40];
        let mut top = 0;
        let mut node = 1;
        let mut open = bound(node) < limit;
        loop {
            if open && !self.is_end(node) {
                let (left, right) = (2 * node, 2 * node + 1);
                let (left_bound, right_bound) = (bound(left), bound(right));
                let (near, near_bound, far, far_bound) = if right_bound < left_bound {
                    (right, right_bound, left, left_bound)
                } else {
                    (left, left_bound, right, right_bound)
                };
                if far_bound < limit {
                    stack[top] = (far_bound, far);
                    top += 1;
                }
                (node, open) = (near, near_bound < limit);
                continue;
            }
            if open {
                limit = visit(node, self.range(node));
            }
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                let (waiting_bound, waiting) = stack[top];
                if waiting_bound < limit {
                    (node, open) = (waiting, true);
                    break;
                }
            }
        }
    }

    /// Visits every leaf, or larger node of one location, that can be reached through nodes where `enter` holds.
    #[inline(always)]
    pub fn descend(&self, enter: impl FnMut(usize) -> bool, visit: impl FnMut(usize, Range<usize>)) {
        self.descend_from(1, enter, visit);
    }

    /// [`KdTree::descend`] that begins at the node `start` and goes up from there: the siblings on the way to the root
    /// hold all the rest. Where `enter` gets narrower by what was visited, a near start saves most of the way down, and no
    /// look at a sibling waits for the one before.
    #[inline(always)]
    pub fn descend_from(
        &self,
        start: usize,
        mut enter: impl FnMut(usize) -> bool,
        mut visit: impl FnMut(usize, Range<usize>),
    ) {
        let mut stack = [0; 40];
        let mut above = start;
        let mut node = start;
        let mut open = enter(node);
        loop {
            let mut top = 0;
            loop {
                if open && !self.is_end(node) {
                    let (left, right) = (2 * node, 2 * node + 1);
                    let (left_open, right_open) = (enter(left), enter(right));
                    if left_open && right_open {
                        stack[top] = right;
                        top += 1;
                    }
                    (node, open) = (if left_open { left } else { right }, left_open || right_open);
                    continue;
                }
                if open {
                    visit(node, self.range(node));
                }
                if top == 0 {
                    break;
                }
                top -= 1;
                (node, open) = (stack[top], true);
            }
            open = false;
            while !open {
                if above == 1 {
                    return;
                }
                node = above ^ 1;
                above /= 2;
                open = enter(node);
            }
        }
    }

    /// The leaf (or larger node of one location) that is reached by the nearer child at every step.
    #[inline]
    pub fn leaf_near(&self, around: &Bounds<D>) -> usize {
        let mut node = 1;
        while !self.is_end(node) {
            let left = self.bounds[2 * node].gap_2(around);
            let right = self.bounds[2 * node + 1].gap_2(around);
            node = 2 * node + usize::from(right < left);
        }
        node
    }

    /// The point nearest to `x` among those at a distance over 0 from `apart` (all of them where that is `None`): squared
    /// distance and leaf position, the least original index of equals. Infinite and `None` where there is none.
    pub fn nearest(&self, x: &Point<D>, apart: Option<&Point<D>>) -> (f64, Option<usize>) {
        let mut best = (f64::INFINITY, u32::MAX, None);
        self.search(
            f64::INFINITY,
            |node| {
                let bounds = &self.bounds[node];
                let excluded = bounds.is_location() && apart.is_some_and(|a| distance_2(&bounds.lo, a) == 0.0);
                if excluded { f64::INFINITY } else { bounds.distance_2(x) }
            },
            |_, range| {
                for position in range {
                    let found = (distance_2(&self.points[position], x), self.order[position]);
                    let allowed = apart.is_none_or(|a| distance_2(&self.points[position], a) > 0.0);
                    if allowed && (found.0 < best.0 || (found.0 == best.0 && found.1 < best.1)) {
                        best = (found.0, found.1, Some(position));
                    }
                }
                best.0.next_up() // equal distances must be visited, for the index decides
            },
        );
        (best.0, best.2)
    }

    /// Calls `found` with the leaf position and squared distance of every point nearer to `x` than `radius`.
    pub fn ball(&self, x: &Point<D>, radius: f64, mut found: impl FnMut(usize, f64)) {
        let radius_2 = (radius * radius).next_up();
        self.descend(
            |node| self.bounds[node].distance_2(x) < radius_2,
            |_, range| {
                for position in range {
                    let d_2 = distance_2(&self.points[position], x);
                    if d_2.sqrt() < radius {
                        found(position, d_2);
                    }
                }
            },
        );
    }
}

/// Leaf positions of `node` in a tree of `n` points.
#[inline(always)]
pub(crate) fn range(node: usize, n: usize) -> Range<usize> {
    let depth = node.ilog2();
    let j = node - (1 << depth);
    (j * n) >> depth..((j + 1) * n) >> depth
}
