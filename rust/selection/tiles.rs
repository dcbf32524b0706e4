//! The greedy pass over the interior candidates of a level, tile by tile.
//!
//! The order is descending f in steps of about an eighth of an octave. Within a step, candidates that lie inside their
//! *tile* by more than their own share f / beta of a conflict's reach come before the others: two such ones of different
//! tiles never conflict, so that all tiles can be worked on at once, and the result is that of one thread. The others,
//! a few in a hundred, follow. Ties go by tile, then by candidate; candidates are numbered along a space-filling curve, so
//! that neighbours in the order are neighbours in the plane, which is several times faster than descending f alone.
//!
//! Tiles are subtrees of the k-d tree of all candidates, each with its tight box; boxes of one depth meet in their sides
//! at most. Up to [`TILE`] candidates there is a single tile, and the order is that of [`rank`].

use super::free::Free;
use super::{Rule, conflicting, prepared};
use crate::error::Error;
use crate::kdtree::KdTree;
use crate::progress::Progress;
use crate::scatter::scattered;
use rayon::prelude::*;
use std::ops::Range;

/// The most points of a tile, until there are [`MOST_TILES`] of them.
const TILE: usize = 16_384;

/// No more tiles than these: bounds the table of the counting sort.
const MOST_TILES: usize = 256;

/// Room for rounding in "inside its tile by more than f / beta".
const ROOM: f64 = 1.0 + 1e-9;

/// Candidates that one thread sorts in one go, at least, and how many for each bucket that it counts.
const SORTED_AT_ONCE: usize = 32_768;
const COUNTED: usize = 8;

/// Steps of an order with fewer candidates are worked on by one thread.
const WORTH_SHARING: usize = 1024;

/// The step of a spacing: exponent and the first three bits of the mantissa, greatest first.
#[inline(always)]
fn step(f: f64) -> u16 {
    (!f.to_bits() >> 49) as u16
}

/// Sorts ascending candidates by descending f in steps of about an eighth of an octave, ties by candidate.
pub fn rank(order: &mut [u32], f: &[f64]) {
    let keys: Vec<u16> = order.iter().map(|&k| step(f[k as usize])).collect();
    let (sorted, _) = sorted_by_step(&keys, |i| (0, order[i]), 1);
    order.copy_from_slice(&sorted);
}

/// A maximal independent set among `order` (ascending) after all of `keep`, in the order of the module; ascending.
///
/// `f` is by original index; points in neither list take no part.
pub fn greedy_in_tiles<const D: usize>(
    tree: &KdTree<D>,
    f: &[f64],
    beta: f64,
    order: &[u32],
    keep: &[u32],
    progress: &Progress,
) -> Result<Vec<u32>, Error> {
    let mut near;
    let keep = if order.len() < keep.len() {
        // only what conflicts with one of these matters, and what is one of them
        let mut is_kept = vec![false; tree.len()];
        keep.iter().for_each(|&i| is_kept[i as usize] = true);
        near = conflicting(tree, f, beta, order, |i| is_kept[i as usize], progress)?;
        near.extend(order.iter().filter(|&&i| is_kept[i as usize]));
        &near
    } else {
        keep
    };
    let board = prepared(tree, f, order, keep);
    let free = Free::new(&board.tree, Rule::new(beta), board.weights);
    free.block_conflicts(&board.kept, progress)?;
    let all = tree.positions();
    let candidate = |i: usize| Candidate {
        f: f[order[i] as usize],
        position: all[order[i] as usize],
        own_position: board.positions[i],
    };
    let has_joined = in_tiles(tree, &free, beta, order.len(), candidate, progress)?;
    let joined = order.par_iter().zip(&board.positions).filter(|&(_, &p)| has_joined[p as usize]);
    Ok(joined.map(|(&k, _)| k).collect())
}

/// The same among all points from index `first` (of at most their number) on, with nothing kept, for f in leaf order.
pub fn greedy_from<const D: usize>(
    tree: &KdTree<D>,
    mut f: Vec<f64>,
    beta: f64,
    first: u32,
    progress: &Progress,
) -> Result<Vec<u32>, Error> {
    let (left_out, positions) = tree.positions().split_at(first as usize);
    left_out.iter().for_each(|&p| f[p as usize] = f64::NAN);
    let free = Free::new(tree, Rule::new(beta), f);
    let candidate = |i: usize| {
        let position = positions[i];
        Candidate { f: free.spacing(position as usize), position, own_position: position }
    };
    let has_joined = in_tiles(tree, &free, beta, positions.len(), candidate, progress)?;
    let joined = (first..tree.len() as u32).into_par_iter().zip(positions).filter(|&(_, &p)| has_joined[p as usize]);
    Ok(joined.map(|(k, _)| k).collect())
}

/// What a greedy pass is told of a candidate.
struct Candidate {
    f: f64,
    /// In the tree of the tiles.
    position: u32,
    /// In the tree of those that are free.
    own_position: u32,
}

/// The greedy pass over candidates that are numbered along a space-filling curve: whether a leaf position has joined.
fn in_tiles<const D: usize>(
    tree: &KdTree<D>,
    free: &Free<'_, D>,
    beta: f64,
    count: usize,
    candidate: impl Fn(usize) -> Candidate + Sync,
    progress: &Progress,
) -> Result<Vec<bool>, Error> {
    let tiles = Tiles::new(tree, beta);
    let last = tiles.count();
    let (steps, places): (Vec<u16>, Vec<u16>) = (0..count)
        .into_par_iter()
        .map(|i| {
            let Candidate { f, position, .. } = candidate(i);
            (step(f), tiles.place(position as usize, f))
        })
        .unzip();
    let place = |i: usize| (places[i] as usize, candidate(i).own_position);
    let (sorted, starts) = sorted_by_step(&steps, place, last + 1);
    let take = |range: Range<usize>, joined: &mut Vec<u32>| {
        for &position in &sorted[range] {
            let p = position as usize;
            if let Some(f) = free.take(p) {
                let (start, x) = (free.tree.leaf_of(p), &free.tree.points()[p]);
                free.conflicts(start, x, f, |leaf, bits| free.block(leaf, bits));
                joined.push(position);
            }
        }
    };
    let mut joined = Vec::new();
    for bounds in starts.chunks(last + 1) {
        progress.check()?;
        let end = |tile: usize| bounds[tile].1;
        if end(last - 1) - bounds[0].0 < WORTH_SHARING {
            take(bounds[0].0..end(last), &mut joined);
            continue;
        }
        let inner = bounds[..last].par_iter().map(|&(start, end)| {
            let mut joined = Vec::new();
            if progress.check().is_ok() {
                take(start..end, &mut joined);
            }
            joined
        });
        inner.collect::<Vec<_>>().iter().for_each(|some| joined.extend(some));
        progress.check()?;
        take(bounds[last].0..bounds[last].1, &mut joined);
    }
    let mut has_joined = vec![false; free.tree.len()];
    joined.iter().for_each(|&p| has_joined[p as usize] = true);
    Ok(has_joined)
}

/// Subtrees of one depth.
struct Tiles<'a, const D: usize> {
    tree: &'a KdTree<D>,
    /// Nodes of the tree.
    nodes: Range<usize>,
    beta: f64,
}

impl<'a, const D: usize> Tiles<'a, D> {
    fn new(tree: &'a KdTree<D>, beta: f64) -> Self {
        Tiles { tree, nodes: tree.parts(TILE.max(tree.len().div_ceil(MOST_TILES))), beta }
    }

    fn count(&self) -> usize {
        self.nodes.len()
    }

    /// The tile of the point at a leaf position where it lies deep enough inside, [`Tiles::count`] where it doesn't.
    fn place(&self, position: usize, f: f64) -> u16 {
        let count = self.count();
        let node = self.tree.node_of(position, self.nodes.start);
        let (own, all) = (self.tree.bounds(node), self.tree.bounds(1));
        let x = &self.tree.points()[position];
        let is_deep = |room: f64| room * self.beta > f * ROOM;
        let is_inner = (0..D).all(|k| {
            (own.lo[k] == all.lo[k] || is_deep(x[k] - own.lo[k]))
                && (own.hi[k] == all.hi[k] || is_deep(own.hi[k] - x[k]))
        });
        if is_inner { (node - self.nodes.start) as u16 } else { count as u16 }
    }
}

/// Stable counting sort by (step, place): `at` gives the place and what is sorted. Also start and end of each place
/// (`places` of them) in each step there is.
fn sorted_by_step(
    steps: &[u16],
    at: impl Fn(usize) -> (usize, u32) + Sync,
    places: usize,
) -> (Vec<u32>, Vec<(usize, usize)>) {
    let n = steps.len();
    let (least, most) = steps.iter().fold((u16::MAX, 0), |(a, b), &s| (a.min(s), b.max(s)));
    let buckets = places * (usize::from(most) + 1).saturating_sub(usize::from(least));
    let bucket = |i: usize, place: usize| usize::from(steps[i] - least) * places + place;
    // where f has a great range, counts of many portions would be more than what is sorted
    let size = SORTED_AT_ONCE.max(COUNTED * buckets);
    let portion = |first: usize| first..n.min(first + size);
    let firsts: Vec<usize> = (0..n).step_by(size).collect();
    let count = |&first: &usize| {
        let mut counts = vec![0; buckets];
        portion(first).for_each(|i| counts[bucket(i, at(i).0)] += 1);
        counts
    };
    // counts become the places where each portion begins in a bucket
    let mut starts: Vec<Vec<usize>> = firsts.par_iter().map(count).collect();
    let (mut bounds, mut start) = (Vec::with_capacity(buckets), 0);
    for bucket in 0..buckets {
        let first = start;
        for own in &mut starts {
            start += std::mem::replace(&mut own[bucket], start);
        }
        bounds.push((first, start));
    }
    let (at, bucket) = (&at, &bucket);
    let places = firsts.into_par_iter().zip(starts).flat_map_iter(|(first, mut next)| {
        portion(first).map(move |i| {
            let (place, value) = at(i);
            let next = &mut next[bucket(i, place)];
            *next += 1;
            (*next - 1, value)
        })
    });
    (scattered(vec![0; n], places), bounds)
}
