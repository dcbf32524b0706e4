//! Searches of the tree.

use super::{Bounds, KdTree};
use crate::point::{Point, distance_2};
use std::ops::Range;

impl<const D: usize> KdTree<D> {
    /// Branch and bound: visits the leaves whose `bound` is under the limit, the more promising child first. `visit` gets
    /// the node and its leaf positions and returns the new limit. A node whose points all share one location is
    /// visited whole, whatever its size: many copies of a point cost no more than one.
    #[inline]
    pub fn search(
        &self,
        mut limit: f64,
        mut bound: impl FnMut(usize) -> f64,
        mut visit: impl FnMut(usize, Range<usize>) -> f64,
    ) {
        let mut stack = [(0.0, 0); 40];
        let mut top = 0;
        let mut node = 1;
        let mut open = bound(node) < limit;
        loop {
            if open && !self.is_end(node) {
                let (left, right) = (2 * node, 2 * node + 1);
                let (left_bound, right_bound) = (bound(left), bound(right));
                let (near, near_bound, far, far_bound) = if right_bound < left_bound {
                    (right, right_bound, left, left_bound)
                } else {
                    (left, left_bound, right, right_bound)
                };
                if far_bound < limit {
                    stack[top] = (far_bound, far);
                    top += 1;
                }
                (node, open) = (near, near_bound < limit);
                continue;
            }
            if open {
                limit = visit(node, self.range(node));
            }
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                let (waiting_bound, waiting) = stack[top];
                if waiting_bound < limit {
                    (node, open) = (waiting, true);
                    break;
                }
            }
        }
    }

    /// Visits every leaf, or larger node of one location, that can be reached through nodes where `enter` holds.
    #[inline(always)]
    pub fn descend(&self, enter: impl FnMut(usize) -> bool, visit: impl FnMut(usize, Range<usize>)) {
        self.descend_from(1, enter, visit);
    }

    /// [`KdTree::descend`] that begins at the node `start` and goes up from there: the siblings on the way to the root
    /// hold all the rest. Where `enter` gets narrower by what was visited, a near start saves most of the way down, and no
    /// look at a sibling waits for the one before.
    #[inline(always)]
    pub fn descend_from(
        &self,
        start: usize,
        mut enter: impl FnMut(usize) -> bool,
        mut visit: impl FnMut(usize, Range<usize>),
    ) {
        let mut stack = [0; 40];
        let mut above = start;
        let mut node = start;
        let mut open = enter(node);
        loop {
            let mut top = 0;
            loop {
                if open && !self.is_end(node) {
                    let (left, right) = (2 * node, 2 * node + 1);
                    let (left_open, right_open) = (enter(left), enter(right));
                    if left_open && right_open {
                        stack[top] = right;
                        top += 1;
                    }
                    (node, open) = (if left_open { left } else { right }, left_open || right_open);
                    continue;
                }
                if open {
                    visit(node, self.range(node));
                }
                if top == 0 {
                    break;
                }
                top -= 1;
                (node, open) = (stack[top], true);
            }
            open = false;
            while !open {
                if above == 1 {
                    return;
                }
                node = above ^ 1;
                above /= 2;
                open = enter(node);
            }
        }
    }

    /// The leaf (or larger node of one location) that is reached by the nearer child at every step.
    #[inline]
    pub fn leaf_near(&self, around: &Bounds<D>) -> usize {
        let mut node = 1;
        while !self.is_end(node) {
            let left = self.bounds[2 * node].gap_2(around);
            let right = self.bounds[2 * node + 1].gap_2(around);
            node = 2 * node + usize::from(right < left);
        }
        node
    }

    /// The point nearest to `x` among those at a distance over 0 from `apart` (all of them where that is `None`): squared
    /// distance and leaf position, the least original index of equals. Infinite and `None` where there is none.
    pub fn nearest(&self, x: &Point<D>, apart: Option<&Point<D>>) -> (f64, Option<usize>) {
        let mut best = (f64::INFINITY, u32::MAX, None);
        self.search(
            f64::INFINITY,
            |node| {
                let bounds = &self.bounds[node];
                let excluded = bounds.is_location() && apart.is_some_and(|a| distance_2(&bounds.lo, a) == 0.0);
                if excluded { f64::INFINITY } else { bounds.distance_2(x) }
            },
            |_, range| {
                for position in range {
                    let found = (distance_2(&self.points[position], x), self.order[position]);
                    let allowed = apart.is_none_or(|a| distance_2(&self.points[position], a) > 0.0);
                    if allowed && (found.0 < best.0 || (found.0 == best.0 && found.1 < best.1)) {
                        best = (found.0, found.1, Some(position));
                    }
                }
                best.0.next_up() // equal distances must be visited, for the index decides
            },
        );
        (best.0, best.2)
    }

    /// Calls `found` with the leaf position and squared distance of every point nearer to `x` than `radius`.
    pub fn ball(&self, x: &Point<D>, radius: f64, mut found: impl FnMut(usize, f64)) {
        let radius_2 = (radius * radius).next_up();
        self.descend(
            |node| self.bounds[node].distance_2(x) < radius_2,
            |_, range| {
                for position in range {
                    let d_2 = distance_2(&self.points[position], x);
                    if d_2.sqrt() < radius {
                        found(position, d_2);
                    }
                }
            },
        );
    }
}
