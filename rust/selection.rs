//! Conflict graph (Miller, Talmor, Teng 1997, Definition 3.5) and greedy maximal independent sets.
//!
//! Two points conflict where `0 < |p - q| < (f(p) + f(q)) / beta`, strictly and exactly so in floats: the rounded
//! distance against the rounded quotient of the rounded sum. Points at a (rounded) distance of 0 count as one: they
//! don't conflict with each other (the two sides of a slit stay or go together).
//!
//! The greedy set needs no graph: each *selected* point asks once for the ball that holds its conflicts and blocks
//! them. Nodes of the tree are left out by their greatest f, so the answer is right for any f, Lipschitz or not.

mod known;
mod tiles;

pub use known::{Known, conflicting, greedy_after};
pub use tiles::{greedy_in_tiles, rank};

use crate::error::Error;
use crate::kdtree::{GRAIN, KdTree, LEAF};
use crate::point::{Point, distance_2};
use crate::progress::Progress;
use rayon::prelude::*;
use std::borrow::Cow;
use std::sync::atomic::{AtomicU32, Ordering};

/// Where candidates are fewer than one in so many points of the tree, they get a tree of their own.
const FEW: usize = 4;

/// Balls that one thread asks for in one go.
const ASKED_AT_ONCE: usize = 32;

/// The most balls asked for before their answers are used.
const LARGEST_BATCH: usize = 512;

/// The edge rule on squared distances and sums f(p) + f(q).
#[derive(Clone, Copy)]
struct Rule {
    beta: f64,
    over_beta: f64,
}

/// Relative room for the rounding of `(sum * (1 / beta))^2` and of the square root it stands in for.
const ROOM: f64 = 1.0 + 1e-14;

impl Rule {
    fn new(beta: f64) -> Self {
        Rule { beta, over_beta: 1.0 / beta }
    }

    /// False only where [`Rule::conflict`] is; needs neither root nor division.
    #[inline(always)]
    fn possible(self, d_2: f64, sum: f64) -> bool {
        let reach = sum * self.over_beta;
        // the least normal number stands for what is lost where squares underflow
        (reach > 0.0) & (d_2 <= reach * reach * ROOM + f64::MIN_POSITIVE)
    }

    /// True only where [`Rule::conflict`] is.
    #[inline(always)]
    fn certain(self, d_2: f64, sum: f64) -> bool {
        let reach = sum * self.over_beta;
        (d_2 > 0.0) & (d_2 * ROOM < reach * reach - f64::MIN_POSITIVE)
    }

    #[inline(always)]
    fn conflict(self, d_2: f64, sum: f64) -> bool {
        d_2 > 0.0 && self.possible(d_2, sum) && d_2.sqrt() < sum / self.beta
    }
}

/// Every edge (i, j), i < j, of the conflict graph, sorted. `f` by original index.
///
/// Runtime: O(n log n + e log e) for bounded density, in parallel.
pub fn conflict_graph<const D: usize>(
    tree: &KdTree<D>,
    f: &[f64],
    beta: f64,
    progress: &Progress,
) -> Result<Vec<[u32; 2]>, Error> {
    let rule = Rule::new(beta);
    let weights: Vec<f64> = tree.order().iter().map(|&i| f[i as usize]).collect();
    let most = tree.node_max(&weights);
    let positions: Vec<usize> = (0..tree.len()).collect();
    let rows: Vec<Vec<[u32; 2]>> = positions
        .par_chunks(GRAIN)
        .map(|positions| {
            progress.check()?;
            let mut edges = Vec::new();
            for &p in positions {
                let (x, i) = (&tree.points()[p], tree.order()[p]);
                tree.descend(
                    |node| may_conflict(tree, rule, node, x, weights[p] + most[node]),
                    |_, range| {
                        for q in range {
                            let j = tree.order()[q];
                            if i < j && rule.conflict(distance_2(&tree.points()[q], x), weights[p] + weights[q]) {
                                edges.push([i, j]);
                            }
                        }
                    },
                );
            }
            Ok(edges)
        })
        .collect::<Result<_, Error>>()?;
    let mut edges = rows.concat();
    edges.par_sort_unstable();
    Ok(edges)
}

/// Whether the node may hold a point that conflicts with x, for the greatest sum of both spacings.
#[inline(always)]
fn may_conflict<const D: usize>(tree: &KdTree<D>, rule: Rule, node: usize, x: &Point<D>, sum: f64) -> bool {
    let bounds = tree.bounds(node);
    let d_2 = bounds.distance_2(x);
    // copies of x itself are no conflict, and may be many
    rule.possible(d_2, sum) && !(d_2 == 0.0 && bounds.is_location())
}

/// The candidates that are still free.
///
/// Threads may block at once: whoever looks at a candidate sees it as it was or as blocked.
struct Free<'a, const D: usize> {
    tree: &'a KdTree<D>,
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
type Bits = u32;
const _: () = assert!(LEAF <= Bits::BITS as usize);

/// A leaf and some of its points.
type Found = (usize, Bits);

impl<'a, const D: usize> Free<'a, D> {
    /// `f` in leaf order, NaN for points that are no candidates.
    fn new(tree: &'a KdTree<D>, rule: Rule, f: Vec<f64>) -> Self {
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

    /// The f of a candidate if it is free.
    #[inline(always)]
    fn f(&self, position: usize) -> Option<f64> {
        self.free(position).map(|_| self.f[position])
    }

    #[inline(always)]
    fn block(&self, leaf: usize, bits: Bits) {
        self.open(leaf).fetch_and(!bits, Ordering::Relaxed);
    }

    /// The f of a candidate that is free, which it then is no more.
    #[inline(always)]
    fn take(&self, position: usize) -> Option<f64> {
        self.free(position).map(|(leaf, bit)| {
            self.block(leaf, bit);
            self.f[position]
        })
    }

    /// Blocks all that conflicts with some points.
    fn block_conflicts(&self, kept: &[(Point<D>, f64)], progress: &Progress) -> Result<(), Error> {
        kept.par_chunks(ASKED_AT_ONCE).try_for_each(|kept| {
            progress.check()?;
            kept.iter().for_each(|(x, f)| self.conflicts(1, x, *f, |leaf, bits| self.block(leaf, bits)));
            Ok(())
        })
    }

    /// Calls `found` with the leaves that have free candidates in conflict with x, and which; looks for them from the node
    /// `start` on.
    #[inline(always)]
    fn conflicts(&self, start: usize, x: &Point<D>, f: f64, mut found: impl FnMut(usize, Bits)) {
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
    fn conflicts_in(&self, leaf: usize, mut open: Bits, x: &Point<D>, f: f64) -> Bits {
        let start = self.tree.range(leaf).start;
        let of = |lane: u32| {
            let q = start + lane as usize;
            (distance_2(&self.tree.points()[q], x), f + self.f[q])
        };
        let (mut bits, mut doubtful) = (0, 0);
        while open != 0 {
            let lane = open.trailing_zeros();
            open &= open - 1;
            let (d_2, sum) = of(lane);
            let certain = self.rule.certain(d_2, sum);
            bits |= Bits::from(certain) << lane;
            doubtful |= Bits::from(self.rule.possible(d_2, sum) & !certain) << lane;
        }
        while doubtful != 0 {
            let lane = doubtful.trailing_zeros();
            doubtful &= doubtful - 1;
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

/// Greedy maximal independent set of the conflict graph on `keep` and `order`: `keep` stays whatever its members'
/// conflicts, then each of `order` (distinct indices) joins unless it conflicts with one that is in. Returns those of
/// `order` that joined, in order. `f` is by original index and read at these points only; points in neither list take
/// no part.
///
/// Runtime: O(k log k + conflicts) for k = |order| + |keep|.
pub fn greedy<const D: usize>(
    tree: &KdTree<D>,
    f: &[f64],
    beta: f64,
    order: &[u32],
    keep: &[u32],
    progress: &Progress,
) -> Result<Vec<u32>, Error> {
    let board = prepared(tree, f, order, keep);
    let free = Free::new(&board.tree, Rule::new(beta), board.weights);
    free.block_conflicts(&board.kept, progress)?;
    Ok(pass(&free, &board.positions, progress)?.into_iter().map(|k| order[k]).collect())
}

/// What a greedy pass works on.
struct Board<'a, const D: usize> {
    /// Of all points, or of the candidates only where they are few.
    tree: Cow<'a, KdTree<D>>,
    /// f in its leaf order, NaN but for the candidates.
    weights: Vec<f64>,
    /// Leaf positions of the candidates.
    positions: Vec<u32>,
    /// Points that stay, and their f.
    kept: Vec<(Point<D>, f64)>,
}

fn prepared<'a, const D: usize>(tree: &'a KdTree<D>, f: &[f64], order: &[u32], keep: &[u32]) -> Board<'a, D> {
    let all = tree.positions();
    let point = |i: &u32| tree.points()[all[*i as usize] as usize];
    let kept = keep.iter().map(|i| (point(i), f[*i as usize])).collect();
    if order.len() * FEW < tree.len() {
        let points: Vec<Point<D>> = order.iter().map(point).collect();
        let own = KdTree::new(&points);
        let mut is_kept = vec![false; tree.len()];
        keep.iter().for_each(|&i| is_kept[i as usize] = true);
        let weight = |i: &u32| if is_kept[*i as usize] { f64::NAN } else { f[*i as usize] };
        let weights = own.order().iter().map(|&k| weight(&order[k as usize])).collect();
        Board { positions: own.positions().to_vec(), tree: Cow::Owned(own), weights, kept }
    } else {
        let positions: Vec<u32> = order.par_iter().map(|&i| all[i as usize]).collect();
        let mut is_candidate = vec![false; tree.len()];
        order.iter().for_each(|&i| is_candidate[i as usize] = true);
        keep.iter().for_each(|&i| is_candidate[i as usize] = false);
        let weight = |&i: &u32| if is_candidate[i as usize] { f[i as usize] } else { f64::NAN };
        let weights = tree.order().par_iter().map(weight).collect();
        Board { tree: Cow::Borrowed(tree), weights, positions, kept }
    }
}

/// The greedy pass: takes the leaf positions of `order` that are free in turn. Returns their numbers in `order`.
///
/// The balls are asked for in parallel, a batch of candidates at a time, and blocked in order: an answer is wasted where
/// the candidate is blocked by an earlier one of its batch, and batches are as large as that stays rare. The result is
/// the sequential one.
fn pass<const D: usize>(free: &Free<'_, D>, order: &[u32], progress: &Progress) -> Result<Vec<usize>, Error> {
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

/// Greedy maximal independent set of all points by (rank, index) after `keep`, ascending, `keep` included.
pub fn independent_set<const D: usize>(
    tree: &KdTree<D>,
    f: &[f64],
    beta: f64,
    rank: Option<&[i64]>,
    keep: &[u32],
    progress: &Progress,
) -> Result<Vec<u32>, Error> {
    let mut order: Vec<u32> = (0..tree.len() as u32).collect();
    if let Some(rank) = rank {
        order.sort_by_key(|&i| rank[i as usize]);
    }
    let mut set = greedy(tree, f, beta, &order, keep, progress)?;
    set.extend(keep);
    set.sort_unstable();
    set.dedup();
    Ok(set)
}

/// Greedy maximal independent set by index on the edges of a mesh with `n` nodes: the baseline of Table 2.
pub fn skeleton_independent_set<const K: usize>(n: usize, cells: &[[u32; K]]) -> Vec<u32> {
    let mut start = vec![0usize; n + 1];
    for cell in cells {
        for &node in cell {
            start[node as usize + 1] += 1;
        }
    }
    for node in 0..n {
        start[node + 1] += start[node];
    }
    let mut next = start.clone();
    let mut cells_of = vec![0u32; cells.len() * K];
    for (c, cell) in cells.iter().enumerate() {
        for &node in cell {
            cells_of[next[node as usize]] = c as u32;
            next[node as usize] += 1;
        }
    }
    let mut blocked = vec![false; n];
    let mut selected = Vec::new();
    for node in 0..n {
        if blocked[node] {
            continue;
        }
        selected.push(node as u32);
        for &c in &cells_of[start[node]..start[node + 1]] {
            for &neighbour in &cells[c as usize] {
                blocked[neighbour as usize] = true;
            }
        }
    }
    selected
}

#[cfg(test)]
mod tests {
    use super::Rule;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_certain_is_a_conflict_and_a_conflict_is_possible(
            sum in 0.0..4.0f64, beta in 1.0..4.0f64, share in 0.0..2.0f64, size in -330..150, ulps in -40..40i64,
        ) {
            let (rule, sum) = (Rule::new(beta), sum * 10f64.powi(size));
            let reach = sum / beta;
            let at_reach = (reach * reach).to_bits().saturating_add_signed(ulps);
            for d_2 in [0.0, share * reach * reach, f64::from_bits(at_reach)] {
                let conflict = d_2 > 0.0 && d_2.sqrt() < sum / beta;
                prop_assert_eq!(rule.conflict(d_2, sum), conflict);
                prop_assert!(!rule.certain(d_2, sum) || conflict);
                prop_assert!(!conflict || rule.possible(d_2, sum));
            }
        }
    }
}
