//! A maximal independent set that is known already, and what becomes of it beside points that stay.
//!
//! Level 1 is drawn from all nodes, of which a maximal independent set under its spacing was made before, for the first
//! pool. It begins with that set: only near what the set loses, to points that stay or to the rim of the domain, are
//! others to be asked.

use super::{Rule, greedy_from, greedy_in_tiles, may_conflict};
use crate::error::Error;
use crate::kdtree::KdTree;
use crate::point::distance_2;
use crate::progress::Progress;
use rayon::prelude::*;

/// A maximal independent set among some points of a tree.
#[derive(Debug)]
pub struct Known {
    /// Original indices, ascending.
    pub set: Vec<u32>,
    /// The spacing that it was made with, at all points.
    pub f: Vec<f64>,
}

impl Known {
    /// That of [`greedy_from`] from index `first` on, for f in leaf order.
    pub fn new<const D: usize>(
        tree: &KdTree<D>,
        f: Vec<f64>,
        beta: f64,
        first: u32,
        progress: &Progress,
    ) -> Result<Known, Error> {
        Ok(Known { f: tree.by_index(&f), set: greedy_from(tree, f, beta, first, progress)? })
    }
}

/// Points whose conflicts one thread looks for in one go.
const ASKED_AT_ONCE: usize = 256;

/// What may have become of a point.
const ASKED: u8 = 1;
const MEMBER: u8 = 2;
const STAYS: u8 = 4;
const LOWERED: u8 = 8;

/// A maximal independent set among the points that are asked after all of `keep`, which takes the members of a known set
/// first: [`greedy_in_tiles`] of what is asked and in the set, then of the others. `f` is nowhere greater than that of the
/// known set, which was made among all that is asked and maybe others.
///
/// Runtime: O(n), and that of [`greedy_in_tiles`] for what lies near lost members and where f is smaller.
pub fn greedy_after<const D: usize>(
    tree: &KdTree<D>,
    f: &[f64],
    beta: f64,
    is_asked: impl Fn(u32) -> bool + Sync,
    keep: &[u32],
    known: &Known,
    progress: &Progress,
) -> Result<Vec<u32>, Error> {
    let begin = |(i, (f, known)): (usize, (&f64, &f64))| {
        (if f < known { LOWERED } else { 0 }) | if is_asked(i as u32) { ASKED } else { 0 }
    };
    let mut state: Vec<u8> = f.par_iter().zip(&known.f).enumerate().map(begin).collect();
    known.set.iter().for_each(|&i| state[i as usize] |= MEMBER);
    keep.iter().for_each(|&i| state[i as usize] = state[i as usize] & !ASKED | STAYS);
    let is = |i: u32, bits: u8| state[i as usize] & bits == bits;

    // members conflict with none of each other: what is kept of them asks for nothing
    let others: Vec<u32> = keep.iter().copied().filter(|&i| !is(i, MEMBER)).collect();
    let blocked = conflicting(tree, f, beta, &others, |i| is(i, ASKED | MEMBER), progress)?;
    let mut chosen: Vec<u32> = known.set.par_iter().copied().filter(|&i| is(i, ASKED)).collect();
    let mut left = blocked.iter().peekable();
    chosen.retain(|i| left.next_if_eq(&i).is_none());

    let is_changed = |&i: &u32| is(i, LOWERED) || !is(i, ASKED) && !is(i, STAYS);
    let mut changed: Vec<u32> = known.set.par_iter().copied().filter(is_changed).collect();
    changed.extend(blocked);
    let is_other = |i: u32| is(i, ASKED) && !is(i, MEMBER);
    let mut asked = conflicting(tree, &known.f, beta, &changed, is_other, progress)?;
    asked.par_extend((0..f.len() as u32).into_par_iter().filter(|&i| is(i, LOWERED) && is_other(i)));
    asked.sort_unstable();
    asked.dedup();
    if asked.is_empty() {
        return Ok(chosen);
    }
    let stay: Vec<u32> = keep.iter().chain(&chosen).copied().collect();
    chosen.extend(greedy_in_tiles(tree, f, beta, &asked, &stay, progress)?);
    // two runs: a stable sort merges them
    chosen.sort();
    Ok(chosen)
}

/// The points that are wanted and conflict with one of `of`, ascending.
pub fn conflicting<const D: usize>(
    tree: &KdTree<D>,
    f: &[f64],
    beta: f64,
    of: &[u32],
    is_wanted: impl Fn(u32) -> bool + Sync,
    progress: &Progress,
) -> Result<Vec<u32>, Error> {
    if of.is_empty() {
        return Ok(Vec::new());
    }
    let rule = Rule::new(beta);
    let positions = tree.positions();
    let most = tree.node_max_of(f);
    let found: Vec<Vec<u32>> = of
        .par_chunks(ASKED_AT_ONCE)
        .map(|of| {
            progress.check()?;
            let mut found = Vec::new();
            for &i in of {
                let (x, own) = (&tree.points()[positions[i as usize] as usize], f[i as usize]);
                tree.descend(
                    |node| may_conflict(tree, rule, node, x, own + most[node]),
                    |_, range| {
                        for q in range {
                            let j = tree.order()[q];
                            if is_wanted(j) && rule.conflict(distance_2(&tree.points()[q], x), own + f[j as usize]) {
                                found.push(j);
                            }
                        }
                    },
                );
            }
            Ok(found)
        })
        .collect::<Result<_, Error>>()?;
    let mut found = found.concat();
    found.par_sort_unstable();
    found.dedup();
    Ok(found)
}
