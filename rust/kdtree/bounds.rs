//! Boxes around points, whose bounds hold in floating point too.

// coordinates of several points are walked together; an iterator over one of them hides the formula
#![allow(clippy::needless_range_loop)]

use crate::point::Point;

#[inline(always)]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// A closed axis-parallel box; empty where `lo > hi`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds<const D: usize> {
    /// Least coordinates.
    pub lo: Point<D>,
    /// Greatest coordinates.
    pub hi: Point<D>,
}

impl<const D: usize> Bounds<D> {
    /// Holds nothing.
    pub const EMPTY: Self = Bounds { lo: [f64::INFINITY; D], hi: [f64::NEG_INFINITY; D] };

    /// The tight box of some points.
    #[inline]
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Point<D>>) -> Self {
        let mut bounds = Self::EMPTY;
        for p in points {
            for k in 0..D {
                bounds.lo[k] = if p[k] < bounds.lo[k] { p[k] } else { bounds.lo[k] };
                bounds.hi[k] = if p[k] > bounds.hi[k] { p[k] } else { bounds.hi[k] };
            }
        }
        bounds
    }

    /// The tight box of both.
    #[inline]
    pub fn merged(&self, other: &Self) -> Self {
        let mut bounds = *self;
        for k in 0..D {
            bounds.lo[k] = if other.lo[k] < bounds.lo[k] { other.lo[k] } else { bounds.lo[k] };
            bounds.hi[k] = if other.hi[k] > bounds.hi[k] { other.hi[k] } else { bounds.hi[k] };
        }
        bounds
    }

    /// Whether all that is inside lies at one location.
    #[inline(always)]
    pub fn is_location(&self) -> bool {
        self.lo == self.hi
    }

    /// The axis of the longest side, the first of equals.
    #[inline]
    pub fn widest(&self) -> usize {
        let mut axis = 0;
        for k in 1..D {
            if self.hi[k] - self.lo[k] > self.hi[axis] - self.lo[axis] {
                axis = k;
            }
        }
        axis
    }

    /// The length of the longest side.
    #[inline]
    pub fn width(&self) -> f64 {
        let axis = self.widest();
        self.hi[axis] - self.lo[axis]
    }

    /// Squared distance to a point; at most [`distance_2`] to any point inside, in floats too.
    #[inline(always)]
    pub fn distance_2(&self, x: &Point<D>) -> f64 {
        let mut sum = 0.0;
        for k in 0..D {
            let d = greater(greater(self.lo[k] - x[k], x[k] - self.hi[k]), 0.0);
            sum += d * d;
        }
        sum
    }

    /// Squared distance to another box; at most [`distance_2`] of any two points inside them, in floats too.
    #[inline(always)]
    pub fn gap_2(&self, other: &Self) -> f64 {
        let mut sum = 0.0;
        for k in 0..D {
            let d = greater(greater(self.lo[k] - other.hi[k], other.lo[k] - self.hi[k]), 0.0);
            sum += d * d;
        }
        sum
    }
}
