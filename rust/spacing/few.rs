//! A few neighbours that ask together, in whole lanes.

use crate::kdtree::LEAF;
use crate::lanes::{self, LANES};
use crate::point::Point;

/// So many lanes hold the queries of a leaf.
const MOST: usize = LEAF / LANES;
const _: () = assert!(LEAF.is_multiple_of(LANES) && LEAF <= u32::BITS as usize);

/// Up to [`LEAF`] queries, and the best answers to each so far, of `K` kinds. Lanes are filled up with copies that ask for
/// nothing.
pub(super) struct Few<const D: usize, const K: usize> {
    count: usize,
    at: [[Point<D>; LANES]; MOST],
    apart_2: [[f64; LANES]; MOST],
    best: [[[f64; LANES]; MOST]; K],
}

impl<const D: usize, const K: usize> Few<D, K> {
    /// Queries without an answer.
    #[inline(always)]
    pub(super) fn new(points: &[Point<D>]) -> Self {
        let mut few = Few {
            count: points.len(),
            at: [[points[0]; LANES]; MOST],
            apart_2: [[0.0; LANES]; MOST],
            best: [[[f64::INFINITY; LANES]; MOST]; K],
        };
        few.at.as_flattened_mut()[..points.len()].copy_from_slice(points);
        few
    }

    #[inline(always)]
    pub(super) fn at(&self, k: usize) -> &Point<D> {
        &self.at.as_flattened()[k]
    }

    /// The answers of a kind.
    #[inline(always)]
    pub(super) fn best(&self, kind: usize) -> &[f64] {
        &self.best[kind].as_flattened()[..self.count]
    }

    #[inline(always)]
    pub(super) fn best_mut(&mut self, kind: usize, k: usize) -> &mut f64 {
        &mut self.best[kind].as_flattened_mut()[k]
    }

    /// Tells that no site but at the query itself is nearer to it than this.
    #[inline(always)]
    pub(super) fn set_apart(&mut self, k: usize, apart: f64) {
        self.apart_2.as_flattened_mut()[k] = apart * apart;
    }

    /// The queries, as bits, for which something holds; it is told their places, what other sites are apart from them at
    /// least, squared, and their best answers.
    #[inline(always)]
    pub(super) fn asked(&self, asks: impl Fn(&Point<D>, f64, [f64; K]) -> bool) -> u32 {
        let mut asked = 0;
        for c in 0..self.count.div_ceil(LANES) {
            let (at, apart_2, best) = (&self.at[c], &self.apart_2[c], self.best.each_ref().map(|best| &best[c]));
            for k in 0..LANES {
                asked |= u32::from(asks(&at[k], apart_2[k], best.map(|best| best[k]))) << (c * LANES + k);
            }
        }
        asked & (u32::MAX >> (u32::BITS as usize - self.count))
    }

    /// The greatest of the answers of each kind.
    #[inline(always)]
    pub(super) fn greatest(&self) -> [f64; K] {
        std::array::from_fn(|kind| lanes::greatest(self.best(kind)))
    }
}
