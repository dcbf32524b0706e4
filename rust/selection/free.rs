//! Candidates that are free yet, and the pass that takes them in turn.

use super::{Rule, may_conflict};
use crate::error::Error;
use crate::kdtree::{KdTree, LEAF};
use crate::lanes;
use crate::point::{Point, distance_2};
use crate::progress::Progress;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Balls that one thread asks for in one go.
const ASKED_AT_ONCE: usize = 32;

/// The most balls asked for before their answers are used.
const LARGEST_BATCH: usize = 512;

/// The candidates that are still free.
///
/// Threads may block at once: whoever looks at a candidate sees it as it was or as blocked.
pub(super) struct Free<'a, const D: usize> {
    pub(super) tree: &'a KdTree<D>,
    rule: Rule,
    /// f in leaf order.
    f: Vec<f64>,
    /// The greatest f of a candidate by node.
    most: Vec<f64>,
    /// A bit for each point of a leaf that is free.
    open: Vec<AtomicU32>,
    first_leaf: usize,
}

/// Some points of a leaf, as bits.
pub(super) type Bits = u32;
const _: () = assert!(LEAF <= Bits::BITS as usize);

/// A leaf and some of its points.
type Found = (usize, Bits);

impl<'a, const D: usize> Free<'a, D> {
    /// `f` in leaf order, NaN for points that are no candidates.
    pub(super) fn new(tree: &'a KdTree<D>, rule: Rule, f: Vec<f64>) -> Self {
        let most = tree.node_max(&f);
        let leaves = tree.leaves(1);
        let bits = |own: &[f64]| own.iter().rev().fold(0, |bits, f| bits << 1 | Bits::from(!f.is_nan()));
        let open = leaves.clone().into_par_iter().map(|leaf| AtomicU32::new(bits(&f[tree.range(leaf)]))).collect();
        Free { tree, rule, f, most, open, first_leaf: leaves.start }
    }

    /// The leaf of a candidate that is free, and its bit there.
    #[inline(always)]
    fn free(&self, position: usize) -> Option<Found> {
        let leaf = self.tree.leaf_of(position);
        let bit = 1 << (position - self.tree.range(leaf).start);
        (self.open(leaf).load(Ordering::Relaxed) & bit != 0).then_some((leaf, bit))
    }

    #[inline(always)]
    fn open(&self, leaf: usize) -> &AtomicU32 {
        &self.open[leaf - self.first_leaf]
    }

    /// The f of a candidate.
    #[inline(always)]
    pub(super) fn spacing(&self, position: usize) -> f64 {
        self.f[position]
    }

    /// The f of a candidate if it is free.
    #[inline(always)]
    fn f(&self, position: usize) -> Option<f64> {
        self.free(position).map(|_| self.f[position])
    }

    #[inline(always)]
    pub(super) fn block(&self, leaf: usize, bits: Bits) {
        self.open(leaf).fetch_and(!bits, Ordering::Relaxed);
    }

    /// The f of a candidate that is free, which it then is no more.
    #[inline(always)]
    pub(super) fn take(&self, position: usize) -> Option<f64> {
        self.free(position).map(|(leaf, bit)| {
            self.block(leaf, bit);
            self.f[position]
        })
    }

    /// Blocks all that conflicts with some points.
    pub(super) fn block_conflicts(&self, kept: &[(Point<D>, f64)], progress: &Progress) -> Result<(), Error> {
        kept.par_chunks(ASKED_AT_ONCE).try_for_each(|kept| {
            progress.check()?;
            kept.iter().for_each(|(x, f)| self.conflicts(1, x, *f, |leaf, bits| self.block(leaf, bits)));
            Ok(())
        })
    }

    /// Calls `found` with the leaves that have free candidates in conflict with x, and which; looks for them from the node
    /// `start` on.
    #[inline(always)]
    pub(super) fn conflicts(&self, start: usize, x: &Point<D>, f: f64, mut found: impl FnMut(usize, Bits)) {
        self.tree.descend_from(
            start,
            |node| may_conflict(self.tree, self.rule, node, x, f + self.most[node]),
            |node, _| {
                for leaf in self.tree.leaves(node) {
                    let open = self.open(leaf).load(Ordering::Relaxed);
                    if open != 0 {
                        let bits = self.conflicts_in(leaf, open, x, f);
                        if bits != 0 {
                            found(leaf, bits);
                        }
                    }
                }
            },
        );
    }

    /// Which of some points of a leaf conflict with x.
    #[inline(always)]
    fn conflicts_in(&self, leaf: usize, open: Bits, x: &Point<D>, f: f64) -> Bits {
        let start = self.tree.range(leaf).start;
        let of = |lane: usize| {
            let q = start + lane;
            (distance_2(&self.tree.points()[q], x), f + self.f[q])
        };
        let (mut bits, mut doubtful) = (0, 0);
        for lane in lanes::ones(open) {
            let (d_2, sum) = of(lane);
            let certain = self.rule.certain(d_2, sum);
            bits |= Bits::from(certain) << lane;
            doubtful |= Bits::from(self.rule.possible(d_2, sum) & !certain) << lane;
        }
        for lane in lanes::ones(doubtful) {
            let (d_2, sum) = of(lane);
            bits |= Bits::from(self.rule.conflict(d_2, sum)) << lane;
        }
        bits
    }

    /// The conflicts of several at once: for each of `asked` the end of its run in the list of its chunk.
    fn all_conflicts(&self, asked: &[(Point<D>, f64)]) -> Vec<(Vec<Found>, Vec<usize>)> {
        let chunk = |asked: &[(Point<D>, f64)]| {
            let (mut found, mut ends) = (Vec::with_capacity(16 * asked.len()), Vec::with_capacity(asked.len()));
            for (x, f) in asked {
                self.conflicts(1, x, *f, |leaf, bits| found.push((leaf, bits)));
                ends.push(found.len());
            }
            (found, ends)
        };
        asked.par_chunks(ASKED_AT_ONCE).map(chunk).collect()
    }
}

/// The greedy pass: takes the leaf positions of `order` that are free in turn. Returns their numbers in `order`.
///
/// The balls are asked for in parallel, a batch of candidates at a time, and blocked in order: an answer is wasted where
/// the candidate is blocked by an earlier one of its batch, and batches are as large as that stays rare. The result is
/// the sequential one.
pub(super) fn pass<const D: usize>(
    free: &Free<'_, D>,
    order: &[u32],
    progress: &Progress,
) -> Result<Vec<usize>, Error> {
    let mut joined = Vec::new();
    let (mut next, mut batch) = (0, 1);
    let (mut members, mut asked) = (Vec::new(), Vec::new());
    while next < order.len() {
        progress.check()?;
        members.clear();
        asked.clear();
        while next < order.len() && members.len() < batch {
            let p = order[next] as usize;
            if let Some(f) = free.f(p) {
                members.push(next);
                asked.push((free.tree.points()[p], f));
            }
            next += 1;
        }
        let before = joined.len();
        let answers = free.all_conflicts(&asked);
        for (members, (blocked, ends)) in members.chunks(ASKED_AT_ONCE).zip(&answers) {
            let mut start = 0;
            for (&k, &end) in members.iter().zip(ends) {
                if free.take(order[k] as usize).is_some() {
                    blocked[start..end].iter().for_each(|&(leaf, bits)| free.block(leaf, bits));
                    joined.push(k);
                }
                start = end;
            }
        }
        let wasted = members.len() - (joined.len() - before);
        batch = if 8 * wasted > members.len() { batch / 2 } else { 2 * batch }.clamp(1, LARGEST_BATCH);
    }
    Ok(joined)
}
