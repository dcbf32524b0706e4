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

/// What is taken out: the places of the blocks between the nodes i, j, k, l of two triangles, and the weights of these over
/// the root of that of i and j.
struct Weak {
    places: [[u32; 4]; 4],
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
    /// Norms of the blocks over the roots of those of both diagonal blocks.
    strengths: Vec<f64>,
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
    let starts: Vec<usize> = (0..n).step_by(CHUNK).collect();
    let row = |i: usize| {
        let (columns, values) = a.row(i);
        let entries = columns.iter().copied().zip(values.iter().copied());
        let stays = |&(j, _): &(i32, f64)| place[i].is_none() || place[j as usize].is_none();
        let mut row: Vec<(i32, f64)> = entries.filter(stays).collect();
        if let Some((node, k)) = place[i] {
            for at in blocks.row(node).filter(|&at| !gone[at]) {
                let values = &blocks.data[(at * size + k) * size..][..size];
                let start = first[blocks.columns[at] as usize] as i32;
                row.extend((start..).zip(values.iter().copied()).filter(|entry| entry.1 != 0.0));
            }
            // of what has one order the sort only makes sure
            row.sort_by_key(|entry| entry.0);
        }
        row
    };
    let rows = starts.into_par_iter().map(|start| {
        let mut made = Block::default();
        for row in (start..(start + CHUNK).min(n)).map(row) {
            made.counts.push(row.len() as u32);
            made.indices.extend(row.iter().map(|entry| entry.0));
            made.data.extend(row.iter().map(|entry| entry.1));
        }
        made
    });
    Rows::stacked(n, rows.collect())
}

impl Blocks {
    fn new(a: RowsRef<'_>, first: &[i64], place: &[Option<(u32, usize)>], size: usize) -> Self {
        // columns and values of the blocks of a node
        let blocks = |&start: &i64| {
            let rows = || (0..size).map(|k| a.row(start as usize + k));
            let nodes = rows().flat_map(|(columns, _)| columns).filter_map(|&j| place[j as usize]).map(|place| place.0);
            let mut nodes: Vec<u32> = nodes.collect();
            nodes.sort_unstable();
            nodes.dedup();
            let mut data = vec![0.0; nodes.len() * size * size];
            for (k, (columns, values)) in rows().enumerate() {
                let mut at = 0;
                for (&j, &value) in columns.iter().zip(values) {
                    if let Some((other, l)) = place[j as usize] {
                        if nodes[at] != other {
                            at = nodes.partition_point(|&column| column < other);
                        }
                        data[(at * size + k) * size + l] += value;
                    }
                }
            }
            (nodes, data)
        };
        let found: Vec<(Vec<u32>, Vec<f64>)> = first.par_iter().with_min_len(CHUNK).map(blocks).collect();
        let mut made = Self { size, starts: vec![0], columns: vec![], data: vec![], strengths: vec![] };
        for (mut nodes, mut data) in found {
            made.columns.append(&mut nodes);
            made.data.append(&mut data);
            made.starts.push(made.columns.len());
        }
        let nodes = 0..first.len() as u32;
        let own: Vec<f64> = nodes.clone().map(|i| made.find(i, i).map_or(0.0, |at| made.norm(at))).collect();
        let strengths = nodes.flat_map(|i| made.row(i).map(move |at| (i, at)));
        let scale = |i: u32, j: u32| (own[i as usize] * own[j as usize]).sqrt();
        made.strengths = strengths.map(|(i, at)| made.norm(at) / scale(i, made.columns[at])).collect();
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

    /// The weak blocks between i and nodes after it that two triangles can do without.
    fn weak(&self, points: &[Point<2>], i: u32, least: f64) -> Vec<Weak> {
        let twice = |a: u32, b: u32, c: u32| {
            let [a, b, c] = [a, b, c].map(|node| points[node as usize]);
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let is_strong = |at: usize| self.strengths[at] >= least;
        let mut found = Vec::new();
        for at in self.row(i) {
            let (j, strength) = (self.columns[at], self.strengths[at]);
            // neither a strong one nor none at all
            if j <= i || !(strength > 0.0 && strength < least) {
                continue;
            }
            let most = SKEW * self.norm(at) / strength;
            let symmetric = |&back: &usize| self.strengths[back] < least && self.is_symmetric(at, back, most);
            let Some(back) = self.find(j, i).filter(symmetric) else { continue };
            // the neighbours of both on the left and on the right that are coupled most
            let mut sides: [Option<(f64, u32)>; 2] = [None; 2];
            for at in self.row(i).filter(|&at| is_strong(at)) {
                let k = self.columns[at];
                let Some(other) = self.find(j, k).filter(|&other| k != i && k != j && is_strong(other)) else {
                    continue;
                };
                let (strength, area) = (self.strengths[at].min(self.strengths[other]), twice(i, j, k));
                let side = &mut sides[usize::from(area < 0.0)];
                if area != 0.0 && side.is_none_or(|best| strength > best.0) {
                    *side = Some((strength, k));
                }
            }
            let [Some((_, k)), Some((_, l))] = sides else { continue };
            let weights = [twice(j, k, l), -twice(i, k, l), twice(i, j, l), -twice(i, j, k)];
            let most = weights.iter().fold(0.0f64, |most, weight| most.max(weight.abs()));
            let weights = weights.map(|weight| weight / most);
            let product = weights[0] * weights[1];
            if !(product > 0.0 && weights.iter().all(|weight| weight * weight <= MOST * product)) {
                continue;
            }
            let nodes = [i, j, k, l];
            let places = nodes.map(|a| nodes.map(|b| self.find(a, b)));
            let is_kept =
                |&place: &Option<usize>| place.is_some_and(|place| place == at || place == back || is_strong(place));
            if places.iter().flatten().all(is_kept) {
                let places = places.map(|row| row.map(|place| place.map_or(0, |place| place as u32)));
                let root = product.sqrt();
                found.push(Weak { places, weights: weights.map(|weight| weight / root) });
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

    /// Takes the block between the first two nodes out of the matrix.
    fn take_out(&mut self, weak: &Weak, gone: &mut [bool]) {
        let size = self.size;
        let (at, back) = (weak.places[0][1] as usize, weak.places[1][0] as usize);
        // whatever else is taken out changes strong blocks only
        let mean = |k: usize| {
            let turned = k % size * size + k / size;
            let (one, two) = (self.block(at), self.block(back));
            (one[k] + one[turned] + two[k] + two[turned]) / 4.0
        };
        let mean: Vec<f64> = (0..size * size).map(mean).collect();
        for (places, weight) in weak.places.iter().zip(weak.weights) {
            for (&place, other) in places.iter().zip(weak.weights) {
                let block = &mut self.data[place as usize * size * size..][..size * size];
                block.iter_mut().zip(&mean).for_each(|(value, mean)| *value -= weight * other * mean);
            }
        }
        (gone[at], gone[back]) = (true, true);
    }
}
