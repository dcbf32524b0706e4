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

mod bounds;
mod build;
mod search;

use crate::point::Point;
use crate::remaining::remaining_from;
pub use bounds::Bounds;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::OnceLock;

/// The most points in a leaf: 13 to 24 of them in a large tree. Going down to half as many costs more in branches that
/// nobody can foretell than it saves in distances, which vector units take several at once.
pub const LEAF: usize = 24;

/// Below this many points a subtree is built, or a block of queries answered, by one thread.
pub const GRAIN: usize = 8192;

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
        let (points, order) = build::arranged(n, point, first_leaf);
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
        self.folded_min(|range| values[range].iter().copied())
    }

    /// The least of what leaf positions have in every node; NaN counts as absent.
    pub fn folded_min<I: Iterator<Item = f64>>(&self, values: impl Fn(Range<usize>) -> I + Sync) -> Vec<f64> {
        let least = |a: f64, b: f64| if b < a { b } else { a };
        let most = f64::INFINITY;
        self.folded(most, |range| values(range).fold(most, least), |&a, &b| least(a, b))
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
}

/// Leaf positions of `node` in a tree of `n` points.
#[inline(always)]
pub(crate) fn range(node: usize, n: usize) -> Range<usize> {
    let depth = node.ilog2();
    let j = node - (1 << depth);
    (j * n) >> depth..((j + 1) * n) >> depth
}
