//! Conflict graph (Miller, Talmor, Teng 1997, Definition 3.5) and greedy maximal independent sets.
//!
//! Two points conflict where `0 < |p - q| < (f(p) + f(q)) / beta`, strictly and exactly so in floats: the rounded
//! distance against the rounded quotient of the rounded sum. Points at a (rounded) distance of 0 count as one: they
//! don't conflict with each other (the two sides of a slit stay or go together).
//!
//! The greedy set needs no graph: each *selected* point asks once for the ball that holds its conflicts and blocks
//! them. Nodes of the tree are left out by their greatest f, so the answer is right for any f, Lipschitz or not.

mod free;
mod known;
mod tiles;

pub use known::{Known, conflicting, greedy_after};
pub use tiles::{greedy_from, greedy_in_tiles, rank};

use crate::error::Error;
use crate::kdtree::{GRAIN, KdTree};
use crate::point::{Point, distance_2};
use crate::progress::Progress;
use free::{Free, pass};
use rayon::prelude::*;
use std::borrow::Cow;

/// Where candidates are fewer than one in so many points of the tree, they get a tree of their own.
const FEW: usize = 4;

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
    let weights = tree.in_leaf_order(f);
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
