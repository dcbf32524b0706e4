//! What holds a spacing down: nothing but at a few sites, mostly.

use crate::kdtree::KdTree;
use rayon::prelude::*;

/// Bounds of the spacing at the sites, and the least of them by node.
#[derive(Debug)]
pub(super) struct Cap {
    /// In leaf order, [`veiled`].
    pub(super) veiled: Vec<f64>,
    pub(super) least: Vec<f64>,
}

/// A bound that is only kept, and never calculated with (it may be no number), or what it stands for: its bits that differ from those of infinity. Where nothing
/// holds the spacing down these are zero, as fresh memory is, which takes no room before it is written to.
#[inline(always)]
pub(super) fn veiled(cap: f64) -> f64 {
    f64::from_bits(cap.to_bits() ^ f64::INFINITY.to_bits())
}

impl Cap {
    /// From bounds by original index, infinite or left out at the end where there are none.
    pub(super) fn new<const D: usize>(tree: &KdTree<D>, cap: &[f64]) -> Self {
        let mut all = vec![0.0; tree.len()];
        let held = cap.iter().zip(tree.positions()).filter(|(cap, _)| **cap < f64::INFINITY);
        held.for_each(|(&cap, &p)| all[p as usize] = veiled(cap));
        Self::of_veiled(tree, all)
    }

    fn of_veiled<const D: usize>(tree: &KdTree<D>, veiled: Vec<f64>) -> Self {
        let least = tree.folded_min(|range| veiled[range].iter().map(|&cap| self::veiled(cap)));
        Cap { veiled, least }
    }

    /// Those of some sites (leaf positions), which are those of a tree in leaf order.
    pub(super) fn subset<const D: usize>(&self, tree: &KdTree<D>, sites: &[u32]) -> Self {
        Self::of_veiled(tree, sites.par_iter().map(|&p| self.veiled[p as usize]).collect())
    }

    /// The bound at a leaf position.
    #[inline(always)]
    pub(super) fn at(&self, position: usize) -> f64 {
        veiled(self.veiled[position])
    }
}
