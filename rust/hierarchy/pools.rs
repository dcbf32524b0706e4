//! Pools: what levels draw their interior nodes from (see the module above).

use super::{Builder, LEAST_RATIO, Spacing};
use crate::error::Error;
use crate::kdtree::KdTree;
use crate::level::Candidates;
use crate::selection::{Known, conflicting, greedy_in_tiles};
use crate::spacing::{CoarseSpacing, threshold};
use rayon::prelude::*;
use std::borrow::Cow;

/// The set that the first pool is made of is dense enough but where f_{1+m} / C^m is less than this share of f_1.
const STEEP: f64 = 0.7;

pub(crate) struct Pool<'a> {
    pub(crate) candidates: Candidates<'a>,
    /// Number among all candidates, by candidate of this pool; `None` where it holds all.
    members: Option<Vec<u32>>,
    /// f at the candidates, by levels that it is known of.
    pub(crate) f: Vec<(usize, Vec<f64>)>,
    /// Candidates looked at to make it.
    pub(crate) visits: usize,
}

impl<'a> Pool<'a> {
    /// That of all candidates.
    pub(super) fn finest(candidates: Candidates<'a>) -> Self {
        Pool { candidates, members: None, f: Vec::new(), visits: 0 }
    }

    /// How many candidates there are.
    pub(crate) fn len(&self) -> usize {
        self.candidates.nodes.len()
    }

    /// The number of a candidate among all.
    fn member(&self, k: u32) -> u32 {
        self.members.as_ref().map_or(k, |members| members[k as usize])
    }

    /// Some of the candidates (ascending, all facet vertices among them) as a pool, without f.
    pub(crate) fn subset(&self, picked: &[u32], visits: usize) -> Pool<'static> {
        let candidates = Candidates {
            tree: Cow::Owned(KdTree::of(picked.len(), |i| *self.candidates.point(picked[i]))),
            nodes: picked.iter().map(|&k| self.candidates.nodes[k as usize]).collect(),
        };
        let members = Some(picked.iter().map(|&k| self.member(k)).collect());
        Pool { candidates, members, f: Vec::new(), visits }
    }
}

impl Builder<'_> {
    /// f_i at the candidates of a pool.
    pub(crate) fn spacing_in(&self, i: usize, pool: &Pool<'_>) -> Result<Vec<f64>, Error> {
        Ok(pool.candidates.tree.by_index(&self.spacing_by_leaves(i, pool)?))
    }

    /// The same in leaf order.
    fn spacing_by_leaves(&self, i: usize, pool: &Pool<'_>) -> Result<Vec<f64>, Error> {
        let (factor, tree) = (self.factor(i), &pool.candidates.tree);
        match self.spacing {
            Spacing::Function(all) => self.sites(all, factor).at_leaves_of(factor, tree, self.progress),
            Spacing::Threshold { g, held } => {
                let members = tree.order().iter().map(|&k| pool.member(k));
                Ok(under_threshold(g, held, factor, members))
            }
        }
    }

    /// f of some levels, ascending, at some candidates of the finest pool, ascending, which is a spatial order.
    fn spacing_at<const K: usize>(&self, levels: [usize; K], picked: &[u32]) -> Result<Vec<[f64; K]>, Error> {
        let (factors, finest) = (levels.map(|i| self.factor(i)), &self.pools[0]);
        match self.spacing {
            Spacing::Function(all) => {
                let points: Vec<_> = picked.par_iter().map(|&k| *finest.candidates.point(k)).collect();
                all.at_sorted(factors, &points, self.progress)
            }
            Spacing::Threshold { g, held } => {
                // the finest pool may be what a level left of it
                let members = || picked.iter().map(|&k| finest.member(k));
                let all = factors.map(|factor| under_threshold(g, held, factor, members()));
                Ok((0..picked.len()).map(|k| all.each_ref().map(|f| f[k])).collect())
            }
        }
    }

    /// The spacing over as few sites as a factor allows.
    fn sites<'s>(&'s self, all: &'s CoarseSpacing<'_, 2>, factor: f64) -> &'s CoarseSpacing<'s, 2> {
        match &self.thin {
            Some((least, thin)) if factor >= *least => thin,
            _ => all,
        }
    }

    /// Makes pools up to the one that level i draws from, and returns its number.
    pub(super) fn pool_for(&mut self, i: usize) -> Result<usize, Error> {
        if !self.options.pool {
            return Ok(0);
        }
        self.find_first_set()?;
        let is_fine = self.factor(i) < LEAST_RATIO * self.factor(1);
        let wanted = if is_fine { 0 } else { i.saturating_sub(self.lag).max(1) };
        while self.pools.len() <= wanted {
            self.progress.check()?;
            let pool = if self.pools.len() == 1 {
                match self.lag {
                    1 => self.first_pool([2])?,
                    lag => self.first_pool([lag, lag + 1])?,
                }
            } else {
                self.thin_sites(self.pools.len() + self.lag);
                self.next_pool()?
            };
            self.pools.push(pool);
        }
        Ok(wanted)
    }

    /// What is known of level 1 where it is drawn from the pool at hand.
    pub(crate) fn known_at(&self, i: usize) -> Option<&Known> {
        self.known.as_ref().filter(|_| i == 1 && self.at_hand == 0)
    }

    /// The maximal independent set of all interior candidates under f_1.
    fn find_first_set(&mut self) -> Result<(), Error> {
        if self.known.is_none() {
            let all = &self.pools[0];
            let tree: &KdTree<2> = &all.candidates.tree;
            let f = self.spacing_by_leaves(1, all)?;
            let known = Known::new(tree, f, self.options.rules.beta, self.domain.len() as u32, self.progress)?;
            self.known = Some(known);
        }
        Ok(())
    }

    /// The pool of level 1 + m, the last of `levels` to draw from it: the first set, and more where that set is too thin.
    fn first_pool<const K: usize>(&self, levels: [usize; K]) -> Result<Pool<'static>, Error> {
        let (all, facets) = (&self.pools[0], self.domain.len());
        let (tree, n) = (&all.candidates.tree, all.len());
        let (beta, finer) = (self.options.rules.beta, self.factor(self.lag));
        let Some(known) = &self.known else { return Err(Error::Internal("the first set is not there".into())) };
        let mut picked: Vec<u32> = (0..facets as u32).chain(known.set.iter().copied()).collect();
        let mut f = self.spacing_at(levels, &picked)?;
        let is_steep = |&(&k, f): &(&u32, &[f64; K])| f[K - 1] / finer < STEEP * known.f[k as usize];
        let steep: Vec<u32> = picked.par_iter().zip(&f).skip(facets).filter(is_steep).map(|(&k, _)| k).collect();
        let mut is_out = vec![true; n];
        picked.iter().for_each(|&k| is_out[k as usize] = false);
        let around = conflicting(tree, &known.f, beta, &steep, |k| is_out[k as usize], self.progress)?;
        if !around.is_empty() {
            let at_around = self.spacing_at(levels, &around)?;
            let mut scaled = vec![f64::NAN; n];
            let values = picked.iter().zip(&f).chain(around.iter().zip(&at_around));
            values.for_each(|(&k, f)| scaled[k as usize] = f[K - 1] / finer);
            let more = greedy_in_tiles(tree, &scaled, beta, &around, &known.set, self.progress)?;
            let mut left = more.iter().peekable();
            let joined = around.iter().zip(&at_around).filter(|(k, _)| left.next_if_eq(k).is_some());
            (picked, f) = merged(picked.iter().zip(&f), joined);
        }
        let f = (0..K).map(|k| (levels[k], f.par_iter().map(|f| f[k]).collect())).collect();
        Ok(Pool { f, ..all.subset(&picked, known.set.len() + around.len()) })
    }

    /// The pool after the last: a maximal independent set of that one, under the spacing of its level over C^m.
    fn next_pool(&self) -> Result<Pool<'static>, Error> {
        let last = &self.pools[self.pools.len() - 1];
        let (facets, finer) = (self.domain.len() as u32, self.factor(self.lag));
        let level = self.pools.len() + self.lag;
        let f = self.spacing_in(level, last)?;
        let scaled: Vec<f64> = f.par_iter().map(|value| value / finer).collect();
        let order: Vec<u32> = (facets..last.len() as u32).collect();
        // ascending, so that the spatial order of the finest pool stays
        let chosen =
            greedy_in_tiles(&last.candidates.tree, &scaled, self.options.rules.beta, &order, &[], self.progress)?;
        let picked: Vec<u32> = (0..facets).chain(chosen).collect();
        let f = picked.iter().map(|&k| f[k as usize]).collect();
        Ok(Pool { f: vec![(level, f)], ..last.subset(&picked, order.len()) })
    }

    /// Leaves out the sites that win nowhere from level i on, where f is to be found at few candidates.
    fn thin_sites(&mut self, i: usize) {
        let Spacing::Function(all) = self.spacing else { return };
        let factor = self.factor(i);
        let thin = match &self.thin {
            Some((_, thin)) => thin.thinned(factor, None),
            None => {
                let is_over = all.is_over(&self.pools[0].candidates.tree);
                let known = self.known.as_ref().filter(|_| is_over);
                all.thinned(factor, known.map(|known| (self.factor(1), &known.f[..])))
            }
        };
        self.thin = Some((factor, thin));
    }
}

/// Two lists of candidates with what is known of them, both ascending, as one.
fn merged<'a, T: Copy + 'a>(
    one: impl Iterator<Item = (&'a u32, &'a T)>,
    other: impl Iterator<Item = (&'a u32, &'a T)>,
) -> (Vec<u32>, Vec<T>) {
    let (mut one, mut other) = (one.peekable(), other.peekable());
    let next = || match (one.peek(), other.peek()) {
        (Some((k, _)), Some((j, _))) if j < k => other.next(),
        (None, _) => other.next(),
        _ => one.next(),
    };
    std::iter::from_fn(next).map(|(&k, &value)| (k, value)).unzip()
}

/// The threshold at some of all candidates, held under the gaps of the domain.
fn under_threshold(g: &[f64], held: &[f64], factor: f64, members: impl Iterator<Item = u32>) -> Vec<f64> {
    let own = threshold(g, factor);
    members.map(|k| own[k as usize].min(held[k as usize])).collect()
}
