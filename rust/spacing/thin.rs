//! Sites that win nowhere any more.
//!
//! Where the cone of z lies under that of y at y itself, it does so everywhere, for all cones have one slope; and for
//! every greater factor, which lifts y's more than z's. So the coarser a level, the fewer sites there are to look at. A
//! site with a cap may come back when the cap begins to hold it, so all of these stay: facet vertices, which are few.

use super::CoarseSpacing;
use crate::kdtree::{GRAIN, LEAF};
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
        let is_beaten = |weight: f64, by: f64| weight - by > CLEARLY * (weight + far);
        let level = self.level(factor);
        let leaves: Vec<usize> = tree.leaves(1).collect();
        let sites: Vec<Vec<u32>> = leaves
            .par_chunks(GRAIN / LEAF)
            .map(|leaves| {
                let mut sites = Vec::with_capacity(GRAIN);
                for (leaf, range) in leaves.iter().map(|&leaf| (leaf, tree.range(leaf))) {
                    // most are beaten by the lightest
                    let lightest = range.clone().min_by(|&p, &q| level.weight(p).total_cmp(&level.weight(q)));
                    for p in range.clone() {
                        let is_beaten_before = || {
                            known.is_some_and(|(factor, f)| is_beaten(factor * self.g[p], f[tree.order()[p] as usize]))
                        };
                        let (weight, x) = (level.weight(p), &tree.points()[p]);
                        let is_beaten_here = || {
                            lightest.is_some_and(|lightest| is_beaten(weight, level.cone(lightest, x)))
                                || is_beaten(weight, level.least_cone(leaf, range.clone(), x))
                        };
                        let has_cap = self.cap.as_ref().is_some_and(|cap| cap.at[p] < f64::INFINITY);
                        if has_cap || !(is_beaten_before() || is_beaten_here()) {
                            sites.push(p as u32);
                        }
                    }
                }
                sites
            })
            .collect();
        let sites = sites.concat();
        let at_sites = |values: &[f64]| -> Vec<f64> { sites.par_iter().map(|&p| values[p as usize]).collect() };
        let cap = self.cap.as_ref().map(|cap| at_sites(&cap.at));
        CoarseSpacing::over(Cow::Owned(tree.subset(&sites)), &at_sites(&self.g), cap.as_deref(), self.gradation)
    }
}
