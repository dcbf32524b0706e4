//! Conflict graph (Miller, Talmor, Teng 1997, Definition 3.5) and greedy maximal independent sets.
//!
//! Two points conflict where `0 < |p - q| < (f(p) + f(q)) / beta`, strictly and exactly so in floats: the rounded
//! distance against the rounded quotient of the rounded sum. Points at a (rounded) distance of 0 count as one: they
//! don't conflict with each other (the two sides of a slit stay or go together).
//!
//! The greedy set needs no graph: each *selected* point asks once for the ball that holds its conflicts and blocks
//! them. Nodes of the tree are left out by their greatest f, so the answer is right for any f, Lipschitz or not.

use crate::error::Error;
use crate::kdtree::{GRAIN, KdTree};
use crate::point::{Point, distance_2};
use crate::progress::Progress;
use rayon::prelude::*;

/// The edge rule, with the sum f(p) + f(q) and squared distances.
#[derive(Clone, Copy)]
struct Rule {
    beta: f64,
}

impl Rule {
    #[inline(always)]
    fn conflict(self, d_2: f64, sum: f64) -> bool {
        d_2 > 0.0 && d_2.sqrt() < sum / self.beta
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
    let rule = Rule { beta };
    let weights: Vec<f64> = tree.order().iter().map(|&i| f[i as usize]).collect();
    let most = tree.node_max(&weights);
    let positions: Vec<usize> = (0..tree.len()).collect();
    let rows: Vec<Vec<[u32; 2]>> = positions
        .par_chunks(GRAIN)
        .map(|positions| {
            progress.check()?;
            let mut edges = Vec::new();
            for &p in positions {
                let i = tree.order()[p];
                around(tree, &most, rule, &tree.points()[p], weights[p], |q, d_2| {
                    let j = tree.order()[q];
                    if i < j && rule.conflict(d_2, weights[p] + weights[q]) {
                        edges.push([i, j]);
                    }
                });
            }
            Ok(edges)
        })
        .collect::<Result<_, Error>>()?;
    let mut edges = rows.concat();
    edges.par_sort_unstable();
    Ok(edges)
}

/// Calls `meet` with the leaf position and squared distance of every point that may conflict with x.
#[inline(always)]
fn around<const D: usize>(
    tree: &KdTree<D>,
    most: &[f64],
    rule: Rule,
    x: &Point<D>,
    f: f64,
    mut meet: impl FnMut(usize, f64),
) {
    // a node is entered where bound < 1: there some q may have distance < (f + f(q)) / beta
    tree.search(
        1.0,
        |node| {
            let reach = (f + most[node]) / rule.beta;
            let bounds = tree.bounds(node);
            let d_2 = bounds.distance_2(x);
            let only_here = d_2 == 0.0 && bounds.is_location();
            if d_2.sqrt() < reach && !only_here { 0.0 } else { 1.0 }
        },
        |_, range| {
            for q in range {
                meet(q, distance_2(&tree.points()[q], x));
            }
            1.0
        },
    );
}

/// Greedy maximal independent set of the conflict graph on `keep` and `order`: `keep` stays whatever its members'
/// conflicts, then each of `order` joins unless it conflicts with one that is in. Returns those of `order` that joined, in
/// order. `f` is by original index and read at these points only; points in neither list take no part.
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
    const OUT: u8 = 0;
    const FREE: u8 = 1;
    let rule = Rule { beta };
    let positions = tree.positions();
    let mut weights = vec![f64::NAN; tree.len()];
    let mut state = vec![OUT; tree.len()];
    for &i in order {
        let p = positions[i as usize] as usize;
        weights[p] = f[i as usize];
        state[p] = FREE;
    }
    for &i in keep {
        state[positions[i as usize] as usize] = OUT;
    }
    let most = tree.node_max(&weights);
    let mut selected = Vec::new();
    for (count, &i) in keep.iter().chain(order).enumerate() {
        if count % GRAIN == 0 {
            progress.check()?;
        }
        let p = positions[i as usize] as usize;
        if count >= keep.len() {
            if state[p] == OUT {
                continue;
            }
            selected.push(i);
            state[p] = OUT;
        }
        around(tree, &most, rule, &tree.points()[p], f[i as usize], |q, d_2| {
            if state[q] == FREE && rule.conflict(d_2, f[i as usize] + weights[q]) {
                state[q] = OUT;
            }
        });
    }
    Ok(selected)
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
