//! Walks down the tree of sites for the C-coarsening at some points.
//!
//! Queries go in blocks of neighbours: one walk serves a block, with its box in place of the point, and starts from what
//! is known already: C g at the query itself, and the site that won at the query before.

use super::{CoarseSpacing, greatest, least_of};
use crate::kdtree::{Bounds, LEAF};
use crate::point::{Point, distance};
use std::cell::Cell;
use std::ops::Range;
use std::slice;

/// Queries walk down the tree together while their box is at most so many times as wide as g at the site that won last.
const WIDTHS_TOGETHER: f64 = 32.0;

/// A spacing with its factor, and the least weight of every node.
pub(super) struct Level<'s, 'a, const D: usize> {
    pub(super) spacing: &'s CoarseSpacing<'a, D>,
    pub(super) factor: f64,
    pub(super) least: Vec<f64>,
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

impl<const D: usize> Level<'_, '_, D> {
    #[inline(always)]
    pub(super) fn weight(&self, position: usize) -> f64 {
        let grown = self.factor * self.spacing.g[position];
        match &self.spacing.cap {
            Some(cap) if cap.at[position] < grown => cap.at[position],
            _ => grown,
        }
    }

    #[inline(always)]
    pub(super) fn cone(&self, position: usize, x: &Point<D>) -> f64 {
        self.weight(position) + self.spacing.gradation * distance(&self.spacing.tree.points()[position], x)
    }

    /// The least cone of a leaf at x.
    ///
    /// Written for vector units: the cones one by one without a branch, then their minimum.
    #[inline(always)]
    pub(super) fn least_cone(&self, node: usize, range: Range<usize>, x: &Point<D>) -> f64 {
        let has_cap = self.spacing.cap.as_ref().is_some_and(|cap| cap.least[node] < f64::INFINITY);
        let mut least = f64::INFINITY;
        for start in range.clone().step_by(LEAF) {
            let some = self.least_of_few(has_cap, start..range.end.min(start + LEAF), x);
            least = if some < least { some } else { least };
        }
        least
    }

    /// The least cone of up to [`LEAF`] sites at x.
    #[inline(always)]
    fn least_of_few(&self, has_cap: bool, range: Range<usize>, x: &Point<D>) -> f64 {
        let slope = self.spacing.gradation;
        let mut cones = [f64::INFINITY; LEAF];
        let cones_of =
            cones.iter_mut().zip(&self.spacing.tree.points()[range.clone()]).zip(&self.spacing.g[range.clone()]);
        match &self.spacing.cap {
            Some(cap) if has_cap => {
                for (((cone, p), g), &cap) in cones_of.zip(&cap.at[range]) {
                    let grown = self.factor * g;
                    *cone = (if cap < grown { cap } else { grown }) + slope * distance(p, x);
                }
            }
            _ => {
                for ((cone, p), g) in cones_of {
                    *cone = self.factor * g + slope * distance(p, x);
                }
            }
        }
        least_of(&cones)
    }

    /// f at a few neighbours.
    pub(super) fn block(&self, queries: Queries<'_, D>, best: &mut [f64], winner: &mut Winner) {
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
        best: &mut [f64],
        winner: &mut Winner,
    ) {
        let (tree, slope) = (&*self.spacing.tree, self.spacing.gradation);
        for (k, (x, best)) in points.iter().zip(best.iter_mut()).enumerate() {
            let own = home.map_or(f64::INFINITY, |home| self.weight(home.first + k));
            let known = winner.map_or(f64::INFINITY, |p| self.cone(p, x));
            *best = if known < own { known } else { own };
        }
        // what is known of the leaf of the queries holds for it too
        let lone_home = home.filter(|home| !home.has_copies).map_or(0, |home| home.leaf);
        let limit = Cell::new(greatest(best));
        // the leaf that won last, and the query there: which of its sites it was is asked once, at the end
        let mut last = None;
        tree.descend_from(
            start,
            |node| self.least[node] + slope * tree.bounds(node).gap_2(around).sqrt() < limit.get(),
            |node, range| {
                let (bounds, least) = (tree.bounds(node), self.least[node]);
                // copies of one point: a minimum of rounded sums is the rounded sum with the minimum
                let lone = bounds.is_location();
                let mut bound = [0.0; LEAF];
                for ((x, &apart), bound) in points.iter().zip(apart).zip(&mut bound) {
                    let near = bounds.distance_2(x).sqrt();
                    // at no distance there may be a copy of the query
                    let is_apart = near > 0.0 || node == lone_home;
                    let near = if is_apart && near < apart { apart } else { near };
                    *bound = least + slope * near;
                }
                for (k, ((x, &bound), best)) in points.iter().zip(&bound).zip(best.iter_mut()).enumerate() {
                    if bound < *best {
                        let value = if lone { bound } else { self.least_cone(node, range.clone(), x) };
                        if value < *best {
                            *best = value;
                            last = Some((if lone { range.start..range.start + 1 } else { range.clone() }, k));
                        }
                    }
                }
                limit.set(greatest(best));
            },
        );
        if let Some((mut range, k)) = last {
            let any = range.start;
            *winner = range.find(|&p| self.cone(p, &points[k]) == best[k]).or(Some(any));
        } else if let Some(home) = home {
            *winner = Some(home.first + points.len() - 1);
        }
    }
}
