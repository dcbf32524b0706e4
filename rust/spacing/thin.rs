//! Sites that win nowhere any more.
//!
//! Where the cone of z lies under that of y at y itself, it does so everywhere, for all cones have one slope; and for
//! every greater factor, which lifts y's more than z's. So the coarser a level, the fewer sites there are to look at. A
//! site with a cap may come back when the cap begins to hold it, so all of these stay: facet vertices, which are few.

use super::CoarseSpacing;
use crate::kdtree::{GRAIN, LEAF};
use crate::lanes;
use crate::point::distance;
use rayon::prelude::*;
use std::borrow::Cow;

/// A site goes where another beats it by this part of all the values at which it could win: far more than rounding does.
const CLEARLY: f64 = 1e-12;

/// What squares of distances may lose to underflow.
const VANISHING: f64 = 1e-150;

impl<const D: usize> CoarseSpacing<'_, D> {
    /// The same spacing, bit for bit, for `factor` and greater ones, over fewer sites. `known` has a lesser factor and f
    /// for it at the points of the tree, by original index.
    ///
    /// Sites that another of their leaf beats for `factor` go, and those that any site beats for the known one.
    pub fn thinned(&self, factor: f64, known: Option<(f64, &[f64])>) -> CoarseSpacing<'static, D> {
        let tree = &*self.tree;
        let whole = tree.bounds(1);
        let far = self.gradation * distance(&whole.lo, &whole.hi) + self.gradation * VANISHING + VANISHING;
        // what a site is beaten by is less than this
        let enough = |weight: f64| weight - CLEARLY * (weight + far);
        let level = self.level([factor]);
        let weight = |p: usize| level.weights(p)[0];
        let least_cone = |leaf: usize, range, x: &_| level.least_cones(leaf, range, x)[0];
        let leaves: Vec<usize> = tree.leaves(1).collect();
        let sites: Vec<Vec<u32>> = leaves
            .par_chunks(GRAIN / LEAF)
            .map(|leaves| {
                let mut sites = Vec::with_capacity(GRAIN);
                for &leaf in leaves {
                    let all = tree.range(leaf);
                    let is_beaten = |p: usize| {
                        known.is_some_and(|(factor, f)| f[tree.order()[p] as usize] < enough(factor * self.g[p]))
                            || least_cone(leaf, all.clone(), &tree.points()[p]) < enough(weight(p))
                    };
                    let has_cap = |p: usize| self.cap.as_ref().is_some_and(|cap| cap.at(p) < f64::INFINITY);
                    let lightest = all.clone().find(|&p| level.weights(p) == level.least[leaf]);
                    for first in all.clone().step_by(LEAF) {
                        let range = first..all.end.min(first + LEAF);
                        // most are beaten by the lightest
                        let beaten = lightest.filter(|_| level.cap_in(leaf).is_none()).map_or(0, |lightest| {
                            let (points, g) = (&tree.points()[range.clone()], &self.g[range.clone()]);
                            lanes::bits(points, g, |x, g| level.cones(lightest, x)[0] < enough(factor * g))
                        });
                        let left = |p: &usize| beaten >> (p - first) & 1 == 0 && (has_cap(*p) || !is_beaten(*p));
                        sites.extend(range.filter(left).map(|p| p as u32));
                    }
                }
                sites
            })
            .collect();
        let sites = sites.concat();
        // the points of a subset are numbered in leaf order
        let (tree, g) = (tree.subset(&sites), sites.par_iter().map(|&p| self.g[p as usize]).collect());
        let cap = self.cap.as_ref().map(|cap| cap.subset(&tree, &sites));
        CoarseSpacing::over(Cow::Owned(tree), Cow::Owned(g), cap, self.gradation)
    }
}
