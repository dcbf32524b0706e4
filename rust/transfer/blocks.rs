//! Weak couplings of a coarse operator of several unknowns a node, left out.
//!
//! What `filter` does for one unknown a node would cost too much here: an elastic body turns without energy, and whatever
//! of its couplings is handed on to a way round a corner does not. So nothing may change for linear functions, row by row.
//! Of two triangles at an edge, the four nodes have one relation that all linear functions keep:
//!
//! ```text
//!      k
//!     / \      c_i u_i + c_j u_j + c_k u_k + c_l u_l = 0, each c twice the area of the triangle of the other three;
//!    i   j
//!     \ /      with δ the left-hand side of it, the block M of u_i and u_j is taken out by
//!      l
//!                  a(u, u)  becomes  a(u, u) - δ · M δ / (c_i c_j)
//! ```
//!
//! That M is symmetric is needed; the other part of a block is rounding but at free boundaries, and there it stays whole.

use super::rows::{Block, Rows, RowsRef};
use crate::error::Error;
use crate::point::Point;
use rayon::prelude::*;

/// Nodes that one thread looks at at a time.
const CHUNK: usize = 256;

/// Skew parts of this share of the diagonals are left out.
const SKEW: f64 = 1e-3;

/// The square of a weight, relative to those of i and j, is at most this: flat pairs of triangles amplify.
const MOST: f64 = 16.0;

/// What is taken out: the nodes i, j, k, l of two triangles, and their weights over the root of that of i and j.
struct Weak {
    nodes: [u32; 4],
    weights: [f64; 4],
}

/// The blocks of a matrix.
struct Blocks {
    /// Unknowns of a node.
    size: usize,
    starts: Vec<usize>,
    columns: Vec<u32>,
    /// Rows of each block, one after the other.
    data: Vec<f64>,
    /// Norms of the diagonal blocks.
    own: Vec<f64>,
}

/// The square matrix without its weak blocks.
///
/// `first` has the first unknown of each node whose `size` unknowns stand together, ascending, `points` its place; all
/// other unknowns stay as they are. Blocks between nodes are weak where their norms are under `least` times the roots of
/// those of both diagonal blocks. Runtime: O(entries + weak blocks · blocks of a node).
pub fn filtered(a: RowsRef<'_>, first: &[i64], points: &[Point<2>], size: usize, least: f64) -> Result<Rows, Error> {
    let n = a.len();
    let apart =
        first.windows(2).all(|pair| pair[0] >= 0 && (pair[0] as usize).saturating_add(size) <= pair[1] as usize);
    let end = first.last().map_or(0, |&last| (last.max(0) as usize).saturating_add(size));
    if a.columns != n || size == 0 || first.len() != points.len() || !apart || first.iter().any(|&i| i < 0) || end > n {
        return Err(Error::Argument(format!("'first' names no {size} unknowns for each of {} nodes", points.len())));
    }
    // node and number in its block of each unknown, if it is one of a node
    let mut place = vec![None; n];
    for (node, &i) in first.iter().enumerate() {
        (0..size).for_each(|k| place[i as usize + k] = Some((node as u32, k)));
    }
    let mut blocks = Blocks::new(a, first, &place, size);
    let starts: Vec<usize> = (0..first.len()).step_by(CHUNK).collect();
    let found: Vec<Vec<Weak>> = starts
        .into_par_iter()
        .map(|start| {
            let nodes = start..(start + CHUNK).min(first.len());
            nodes.flat_map(|i| blocks.weak(points, i as u32, least)).collect()
        })
        .collect();
    let mut gone = vec![false; blocks.columns.len()];
    for weak in found.into_iter().flatten() {
        blocks.take_out(&weak, &mut gone);
    }
    let mut made = Block::default();
    for i in 0..n {
        let (columns, values) = a.row(i);
        let mut row: Vec<(i32, f64)> = columns
            .iter()
            .zip(values)
            .filter(|&(&j, _)| place[i].is_none() || place[j as usize].is_none())
            .map(|(&j, &value)| (j, value))
            .collect();
        if let Some((node, k)) = place[i] {
            for at in blocks.row(node).filter(|&at| !gone[at]) {
                let values = &blocks.data[(at * size + k) * size..][..size];
                let start = first[blocks.columns[at] as usize] as i32;
                row.extend((start..).zip(values.iter().copied()).filter(|entry| entry.1 != 0.0));
            }
            row.sort_unstable_by_key(|entry| entry.0);
        }
        made.counts.push(row.len() as u32);
        made.indices.extend(row.iter().map(|entry| entry.0));
        made.data.extend(row.iter().map(|entry| entry.1));
    }
    Rows::stacked(n, vec![made])
}

impl Blocks {
    fn new(a: RowsRef<'_>, first: &[i64], place: &[Option<(u32, usize)>], size: usize) -> Self {
        let mut made = Self { size, starts: vec![0], columns: vec![], data: vec![], own: vec![] };
        for (node, &start) in first.iter().enumerate() {
            let begin = made.columns.len();
            let rows = || (0..size).map(|k| a.row(start as usize + k));
            let nodes = rows().flat_map(|(columns, _)| columns).filter_map(|&j| place[j as usize]).map(|place| place.0);
            let mut nodes: Vec<u32> = nodes.collect();
            nodes.sort_unstable();
            nodes.dedup();
            made.columns.append(&mut nodes);
            made.data.resize(made.columns.len() * size * size, 0.0);
            for (k, (columns, values)) in rows().enumerate() {
                for (&j, &value) in columns.iter().zip(values) {
                    if let Some((other, l)) = place[j as usize] {
                        let at = begin + made.columns[begin..].partition_point(|&column| column < other);
                        made.data[(at * size + k) * size + l] += value;
                    }
                }
            }
            made.starts.push(made.columns.len());
            made.own.push(made.find(node as u32, node as u32).map_or(0.0, |at| made.norm(at)));
        }
        made
    }

    fn row(&self, i: u32) -> std::ops::Range<usize> {
        self.starts[i as usize]..self.starts[i as usize + 1]
    }

    fn find(&self, i: u32, j: u32) -> Option<usize> {
        self.columns[self.row(i)].binary_search(&j).ok().map(|k| self.starts[i as usize] + k)
    }

    fn block(&self, at: usize) -> &[f64] {
        &self.data[at * self.size * self.size..][..self.size * self.size]
    }

    fn norm(&self, at: usize) -> f64 {
        self.block(at).iter().map(|value| value * value).sum::<f64>().sqrt()
    }

    /// The norm of the block of row i and column j, and what norms there are measured with.
    fn strength(&self, i: u32, at: usize) -> (f64, f64) {
        (self.norm(at), (self.own[i as usize] * self.own[self.columns[at] as usize]).sqrt())
    }

    /// The relative norm of a block that is not weak.
    fn strong(&self, i: u32, j: u32, least: f64) -> Option<f64> {
        let (norm, scale) = self.strength(i, self.find(i, j)?);
        (norm >= least * scale && scale > 0.0).then(|| norm / scale)
    }

    /// The weak blocks between i and nodes after it that two triangles can do without.
    fn weak(&self, points: &[Point<2>], i: u32, least: f64) -> Vec<Weak> {
        let twice = |a: u32, b: u32, c: u32| {
            let [a, b, c] = [a, b, c].map(|node| points[node as usize]);
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let mut found = Vec::new();
        for at in self.row(i) {
            let j = self.columns[at];
            let (norm, scale) = self.strength(i, at);
            if j <= i || norm >= least * scale {
                continue;
            }
            let Some(back) = self.find(j, i).filter(|&back| self.is_symmetric(at, back, SKEW * scale)) else {
                continue;
            };
            if self.norm(back) >= least * scale {
                continue;
            }
            // the neighbours of both on the left and on the right that are coupled most
            let mut sides: [Option<(f64, u32)>; 2] = [None; 2];
            for k in self.row(i).map(|at| self.columns[at]).filter(|&k| k != i && k != j) {
                let Some(strength) = self.strong(i, k, least).zip(self.strong(j, k, least)) else { continue };
                let (strength, area) = (strength.0.min(strength.1), twice(i, j, k));
                let side = &mut sides[usize::from(area < 0.0)];
                if area != 0.0 && side.is_none_or(|best| strength > best.0) {
                    *side = Some((strength, k));
                }
            }
            let [Some((_, k)), Some((_, l))] = sides else { continue };
            if self.strong(k, l, least).is_none() {
                continue;
            }
            let weights = [twice(j, k, l), -twice(i, k, l), twice(i, j, l), -twice(i, j, k)];
            let most = weights.iter().fold(0.0f64, |most, weight| most.max(weight.abs()));
            let weights = weights.map(|weight| weight / most);
            let product = weights[0] * weights[1];
            if product > 0.0 && weights.iter().all(|weight| weight * weight <= MOST * product) {
                let root = product.sqrt();
                found.push(Weak { nodes: [i, j, k, l], weights: weights.map(|weight| weight / root) });
            }
        }
        found
    }

    /// Whether two blocks across the diagonal are one symmetric block, up to `most`.
    fn is_symmetric(&self, at: usize, back: usize, most: f64) -> bool {
        let (one, two, size) = (self.block(at), self.block(back), self.size);
        (0..size * size).all(|k| {
            let turned = k % size * size + k / size;
            [one[turned], two[k], two[turned]].iter().all(|other| (one[k] - other).abs() <= 2.0 * most)
        })
    }

    fn take_out(&mut self, weak: &Weak, gone: &mut [bool]) {
        let (size, [i, j, ..]) = (self.size, weak.nodes);
        let (Some(at), Some(back)) = (self.find(i, j), self.find(j, i)) else { return };
        let mean = |k: usize| {
            let turned = k % size * size + k / size;
            let (one, two) = (self.block(at), self.block(back));
            (one[k] + one[turned] + two[k] + two[turned]) / 4.0
        };
        let mean: Vec<f64> = (0..size * size).map(mean).collect();
        for (&a, weight) in weak.nodes.iter().zip(weak.weights) {
            for (&b, other) in weak.nodes.iter().zip(weak.weights) {
                if let Some(place) = self.find(a, b) {
                    let block = &mut self.data[place * size * size..][..size * size];
                    block.iter_mut().zip(&mean).for_each(|(value, mean)| *value -= weight * other * mean);
                }
            }
        }
        (gone[at], gone[back]) = (true, true);
    }
}
