//! Walks down the tree of sites for the C-coarsening at some points.
//!
//! Queries go in blocks of neighbours: one walk serves a block, with its box in place of the point, and starts from what
//! is known already: C g at the query itself, and the site that won at the query before.

use super::CoarseSpacing;
use super::cap::{Cap, veiled};
use super::few::Few;
use crate::kdtree::Bounds;
use crate::lanes;
use crate::point::{Point, distance};
use std::cell::Cell;
use std::ops::Range;
use std::slice;

/// Queries walk down the tree together while their box is at most so many times as wide as g at the site that won last.
const WIDTHS_TOGETHER: f64 = 32.0;

/// A spacing with factors, ascending, and the least weights of every node.
pub(super) struct Level<'s, 'a, const D: usize, const K: usize> {
    pub(super) spacing: &'s CoarseSpacing<'a, D>,
    pub(super) factors: [f64; K],
    pub(super) least: Vec<[f64; K]>,
}

/// The site that won last.
pub(super) type Winner = Option<usize>;

/// A few neighbours to find f at.
#[derive(Clone, Copy)]
pub(super) struct Queries<'q, const D: usize> {
    pub(super) points: &'q [Point<D>],
    /// No site but at a query itself is nearer to it than this.
    pub(super) apart: &'q [f64],
    pub(super) home: Option<Home>,
}

/// Where queries are that are sites themselves.
#[derive(Clone, Copy)]
pub(super) struct Home {
    pub(super) leaf: usize,
    /// Leaf position of the first.
    pub(super) first: usize,
    /// Whether a site of their leaf may lie at one of them.
    pub(super) has_copies: bool,
}

impl<const D: usize, const K: usize> Level<'_, '_, D, K> {
    #[inline(always)]
    pub(super) fn weights(&self, position: usize) -> [f64; K] {
        let (g, cap) = (self.spacing.g[position], self.spacing.cap.as_ref().map(|cap| cap.at(position)));
        self.factors.map(|factor| {
            let grown = factor * g;
            cap.filter(|&cap| cap < grown).unwrap_or(grown)
        })
    }

    #[inline(always)]
    pub(super) fn cones(&self, position: usize, x: &Point<D>) -> [f64; K] {
        let way = self.spacing.gradation * distance(&self.spacing.tree.points()[position], x);
        self.weights(position).map(|weight| weight + way)
    }

    /// What holds sites of a node down, if anything.
    #[inline(always)]
    pub(super) fn cap_in(&self, node: usize) -> Option<&Cap> {
        self.spacing.cap.as_ref().filter(|cap| cap.least[node] < f64::INFINITY)
    }

    /// The least cones of a leaf at x; some sites that follow it may take part.
    ///
    /// Written for vector units: whole lanes without a branch, then their minimum.
    #[inline(always)]
    pub(super) fn least_cones(&self, node: usize, range: Range<usize>, x: &Point<D>) -> [f64; K] {
        let (tree, factors, slope) = (&*self.spacing.tree, self.factors, self.spacing.gradation);
        let range = lanes::whole(&range, tree.len());
        let (points, g) = (&tree.points()[range.clone()], &self.spacing.g[range.clone()]);
        match self.cap_in(node) {
            Some(cap) => lanes::least_of(points, [g, &cap.veiled[range]], |p, [g, cap]| {
                let (way, cap) = (slope * distance(p, x), veiled(cap));
                factors.map(|factor| {
                    let grown = factor * g;
                    (if cap < grown { cap } else { grown }) + way
                })
            }),
            None => lanes::least_of(points, [g], |p, [g]| {
                let way = slope * distance(p, x);
                factors.map(|factor| factor * g + way)
            }),
        }
    }

    /// f at a few neighbours.
    pub(super) fn block(&self, queries: Queries<'_, D>, best: &mut [[f64; K]], winner: &mut Winner) {
        let Queries { points, apart, home } = queries;
        let around = Bounds::of(points);
        let start = |around: &Bounds<D>| home.map_or_else(|| self.spacing.tree.leaf_near(around), |home| home.leaf);
        // a walk for all looks at sites that win nowhere, within about the box's width of the winner: no loss where few
        // sites are there, but a bad one where a far cluster of much finer ones wins
        let together = winner.is_some_and(|p| around.width() <= WIDTHS_TOGETHER * self.spacing.g[p]);
        if together {
            self.walk(start(&around), queries, &around, best, winner);
        } else {
            for (k, ((x, apart), best)) in points.iter().zip(apart).zip(best).enumerate() {
                let home = home.map(|home| Home { first: home.first + k, ..home });
                let query = Queries { points: slice::from_ref(x), apart: slice::from_ref(apart), home };
                let around = Bounds::of([x]);
                self.walk(start(&around), query, &around, slice::from_mut(best), winner);
            }
        }
    }

    /// One walk over the tree for a few queries in the box `around`, from a node near them.
    #[inline(always)]
    fn walk(
        &self,
        start: usize,
        Queries { points, apart, home }: Queries<'_, D>,
        around: &Bounds<D>,
        best: &mut [[f64; K]],
        winner: &mut Winner,
    ) {
        let (tree, slope) = (&*self.spacing.tree, self.spacing.gradation);
        let mut few = Few::new(points);
        for (k, x) in points.iter().enumerate() {
            let own = home.map_or([f64::INFINITY; K], |home| self.weights(home.first + k));
            let known = winner.map_or([f64::INFINITY; K], |p| self.cones(p, x));
            for kind in 0..K {
                *few.best_mut(kind, k) = if known[kind] < own[kind] { known[kind] } else { own[kind] };
            }
            few.set_apart(k, apart[k]);
        }
        // what is known of the leaf of the queries holds for it too
        let lone_home = home.filter(|home| !home.has_copies).map_or(0, |home| home.leaf);
        let steep = slope * slope;
        let limit = Cell::new(few.greatest().map(lifted));
        // in none of the kinds may a node be passed over
        let is_in = |way_2: f64, limits: [f64; K], least: &[f64; K]| {
            (0..K).fold(false, |is_in, kind| is_in | (over(way_2, limits[kind], least[kind]) <= VANISHING))
        };
        // the leaf that won last, and the query there: which of its sites it was is asked once, at the end
        let mut last = None;
        tree.descend_from(
            start,
            |node| is_in(steep * tree.bounds(node).gap_2(around), limit.get(), &self.least[node]),
            |node, range| {
                let (bounds, least) = (tree.bounds(node), &self.least[node]);
                // copies of one point: a minimum of rounded sums is the rounded sum with the minimum
                let lone = bounds.is_location();
                let asked = few.asked(|x, apart_2, best| {
                    let near = bounds.distance_2(x);
                    // at no distance there may be a copy of the query
                    let is_apart = (near > 0.0) | (node == lone_home);
                    let near = if is_apart & (near < apart_2) { apart_2 } else { near };
                    is_in(steep * near, best.map(lifted), least)
                });
                for k in lanes::ones(asked) {
                    let x = few.at(k);
                    let values = if lone {
                        let way = slope * bounds.distance_2(x).sqrt();
                        least.map(|least| least + way)
                    } else {
                        self.least_cones(node, range.clone(), x)
                    };
                    for (kind, value) in values.into_iter().enumerate() {
                        let best = few.best_mut(kind, k);
                        if value < *best {
                            *best = value;
                            last = Some((node, k, kind));
                        }
                    }
                }
                limit.set(few.greatest().map(lifted));
            },
        );
        for kind in 0..K {
            best.iter_mut().zip(few.best(kind)).for_each(|(all, &own)| all[kind] = own);
        }
        if let Some((node, k, kind)) = last {
            let range = tree.range(node);
            let (first, looked_at) = (range.start, if tree.bounds(node).is_location() { 1 } else { range.len() });
            let has_won = |&p: &usize| self.cones(p, &points[k])[kind] == best[k][kind];
            *winner = range.take(looked_at).find(has_won).or(Some(first));
        } else if let Some(home) = home {
            *winner = Some(home.first + points.len() - 1);
        }
    }
}

/// Squares under this may be nothing but what rounding left of them.
const VANISHING: f64 = f64::MIN_POSITIVE;

/// How far the square of a way is over that of what a weight leaves under a limit. At most [`VANISHING`] wherever weight and
/// way together are less than what was [`lifted`], whatever rounding does; spares a root.
#[inline(always)]
fn over(way_2: f64, lifted: f64, weight: f64) -> f64 {
    let room = lifted - weight;
    let over = way_2 - room * room;
    if room > 0.0 { over } else { f64::INFINITY }
}

/// A little more than a limit.
#[inline(always)]
fn lifted(limit: f64) -> f64 {
    const LIFT: f64 = 1.0 + 1e-12;
    LIFT * limit
}

#[cfg(test)]
mod tests {
    use super::{VANISHING, lifted, over};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_site_under_the_limit_is_passed_over(
            weight in 0.0..4.0f64, way in 0.0..4.0f64, slope in 0.0..1.0f64, size in -330..150, ulps in 0..4u64,
        ) {
            let size = 10f64.powi(size);
            let (weight, way) = (weight * size, way * size);
            let way_2 = way * way;
            // the least limit, and a few beyond
            let limit = f64::from_bits((weight + slope * way_2.sqrt()).to_bits() + 1 + ulps);
            prop_assert!(over(slope * slope * way_2, lifted(limit), weight) <= VANISHING);
        }
    }

    #[test]
    fn what_is_far_over_the_limit_is_passed_over() {
        assert!(over(1.0, lifted(1.5), 0.6) > VANISHING);
        assert!(over(0.0, lifted(0.5), 0.6) > VANISHING);
        assert!(over(0.0, lifted(f64::INFINITY), 0.6) <= VANISHING);
    }
}
