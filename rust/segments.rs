//! A static tree of line segments: which of them come near a segment, whatever their directions.
//!
//! Boxes along the axes are no help among long slanted segments, each of which covers most of the others with its box. So the box
//! of every node lies along the principal direction of the segments in it:
//!
//! ```text
//!      +-------+            /\/
//!      |  // / |           / //
//!      | / //  |          / / /
//!      |//  /  |          // /
//!      +-------+          \//
//! ```
//!
//! Median splits along the wider side of the segments' middles, at most [`LEAF`] segments in a leaf, nodes in heap order
//! and their positions as in `kdtree`.
//! Boxes are rounded, and so are wider than they need be by [`SLACK`]: what is found may be near only, what is not found isn't.

use crate::kdtree::{Bounds, range};
use crate::point::Point;
use rayon::prelude::*;
use std::ops::Range;

const LEAF: usize = 4;

/// Room for rounding, in extents of all segments.
const SLACK: f64 = 1e-13;

/// Nodes that one thread makes in one go.
const GRAIN: usize = 256;

/// A tree of line segments.
pub struct Segments {
    /// Segments in leaf order.
    order: Vec<u32>,
    /// Their ends, relative to `origin` and divided by `extent`.
    ends: Vec<[Point<2>; 2]>,
    nodes: Vec<Oriented>,
    depth: u32,
    origin: Point<2>,
    extent: f64,
}

/// A box along any direction.
#[derive(Debug, Clone, Copy)]
struct Oriented {
    /// Unit vector.
    along: Point<2>,
    /// Middle, in the frame of that vector.
    middle: Point<2>,
    half: Point<2>,
}

impl Oriented {
    const EMPTY: Oriented = Oriented { along: [1.0, 0.0], middle: [0.0; 2], half: [f64::NEG_INFINITY; 2] };

    /// The box of some segments, along the principal direction of their ends.
    fn of(segments: &[[Point<2>; 2]]) -> Oriented {
        let ends = || segments.iter().flatten();
        let n = 2.0 * segments.len() as f64;
        let mean = [0, 1].map(|k| ends().map(|p| p[k]).sum::<f64>() / n);
        let moments = ends().fold([0.0; 2], |[level, slant], p| {
            let [x, y] = [p[0] - mean[0], p[1] - mean[1]];
            [level + (x - y) * (x + y), slant + 2.0 * x * y]
        });
        // the double of its angle
        let [level, slant] = moments;
        let length = (level * level + slant * slant).sqrt();
        let along = if length > 0.0 {
            let [x, y] = if level > 0.0 { [length + level, slant] } else { [slant, length - level] };
            let norm = (x * x + y * y).sqrt();
            [x / norm, y / norm]
        } else {
            Oriented::EMPTY.along
        };
        let frame = Oriented { along, ..Oriented::EMPTY };
        let bounds = ends().fold(Bounds::EMPTY, |all: Bounds<2>, p| all.merged(&Bounds::of([&frame.framed(p)])));
        let middle = [0, 1].map(|k| 0.5 * (bounds.lo[k] + bounds.hi[k]));
        let half = [0, 1].map(|k| 0.5 * (bounds.hi[k] - bounds.lo[k]) + SLACK);
        Oriented { along, middle, half }
    }

    /// A point in the frame of the box.
    fn framed(&self, p: &Point<2>) -> Point<2> {
        let [ux, uy] = self.along;
        [p[0] * ux + p[1] * uy - self.middle[0], p[1] * ux - p[0] * uy - self.middle[1]]
    }

    /// Whether a segment may meet the box.
    fn meets(&self, [a, b]: &[Point<2>; 2], slack: f64) -> bool {
        let ([au, av], [bu, bv]) = (self.framed(a), self.framed(b));
        let [hu, hv] = self.half.map(|half| half + slack);
        if au.min(bu) > hu || au.max(bu) < -hu || av.min(bv) > hv || av.max(bv) < -hv {
            return false;
        }
        let (du, dv) = (bu - au, bv - av);
        (du * av - dv * au).abs() <= du.abs() * hv + dv.abs() * hu
    }

    /// Whether the box may come as near to a point as `reach`.
    fn is_within(&self, p: &Point<2>, reach: f64) -> bool {
        let p = self.framed(p);
        let [u, v] = [0, 1].map(|k| (p[k].abs() - self.half[k]).max(0.0));
        u * u + v * v <= reach * reach
    }
}

impl Segments {
    /// Builds the tree. Runtime: O(n log n).
    pub fn new(segments: &[[Point<2>; 2]]) -> Segments {
        let n = segments.len();
        let bounds = Bounds::of(segments.iter().flatten());
        let extent = if n > 0 && bounds.width() > 0.0 { bounds.width() } else { 1.0 };
        // relative to one of their ends: differences are rounded once
        let origin = segments.first().map_or([0.0; 2], |ends| ends[0]);
        let mut depth = 0;
        while n >> depth > LEAF {
            depth += 1;
        }
        let mut tree =
            Segments { order: (0..n as u32).collect(), ends: Vec::new(), nodes: Vec::new(), depth, origin, extent };
        let given: Vec<[Point<2>; 2]> = segments.iter().map(|ends| ends.map(|p| tree.scaled(&p))).collect();
        let middles: Vec<Point<2>> = given.iter().map(|[a, b]| [0, 1].map(|k| 0.5 * (a[k] + b[k]))).collect();
        for node in 1..1usize << depth {
            let split = range(2 * node, n).len();
            let part = &mut tree.order[range(node, n)];
            let axis = Bounds::of(part.iter().map(|&s| &middles[s as usize])).widest();
            if split > 0 && split < part.len() {
                let middle = |s: &u32| middles[*s as usize][axis];
                part.select_nth_unstable_by(split, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
            }
        }
        tree.ends = tree.order.iter().map(|&s| given[s as usize]).collect();
        let node = |node: usize| if node == 0 { Oriented::EMPTY } else { Oriented::of(&tree.ends[tree.range(node)]) };
        tree.nodes = (0..2usize << depth).into_par_iter().with_min_len(GRAIN).map(node).collect();
        tree
    }

    fn scaled(&self, p: &Point<2>) -> Point<2> {
        [0, 1].map(|k| (p[k] - self.origin[k]) / self.extent)
    }

    fn range(&self, node: usize) -> Range<usize> {
        range(node, self.order.len())
    }

    /// The segments in leaf order.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Calls `visit` with every segment that meets the segment from `a` to `b`, and some more.
    pub fn meeting(&self, a: &Point<2>, b: &Point<2>, visit: impl FnMut(u32)) {
        self.meeting_from(0, a, b, visit);
    }

    /// The same, of those from a position of the leaf order on.
    pub fn meeting_from(&self, first: usize, a: &Point<2>, b: &Point<2>, mut visit: impl FnMut(u32)) {
        let [a, b] = [a, b].map(|p| self.scaled(p));
        let size = [a, b].iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
        let slack = SLACK * (1.0 + size);
        let [low, high] = [f64::min, f64::max].map(|of: fn(f64, f64) -> f64| [of(a[0], b[0]), of(a[1], b[1])]);
        let apart =
            |[p, q]: &[Point<2>; 2], k: usize| p[k].min(q[k]) > high[k] + slack || p[k].max(q[k]) < low[k] - slack;
        self.descend(
            |node| self.range(node).end > first && self.nodes[node].meets(&[a, b], slack),
            |position| {
                if position >= first && !apart(&self.ends[position], 0) && !apart(&self.ends[position], 1) {
                    visit(self.order[position]);
                }
            },
        );
    }

    /// Calls `visit` with every segment that comes as near to `x` as `reach`, and some more.
    pub fn near(&self, x: &Point<2>, reach: f64, mut visit: impl FnMut(u32)) {
        let (p, reach) = (self.scaled(x), reach / self.extent);
        let size = p[0].abs().max(p[1].abs());
        let reach = reach + SLACK * (1.0 + size + reach);
        self.descend(|node| self.nodes[node].is_within(&p, reach), |position| visit(self.order[position]));
    }

    fn descend(&self, enter: impl Fn(usize) -> bool, mut visit: impl FnMut(usize)) {
        let mut stack = vec![1usize];
        while let Some(node) = stack.pop() {
            if !enter(node) {
                continue;
            }
            if node >> self.depth == 0 {
                stack.extend([2 * node + 1, 2 * node]);
            } else {
                self.range(node).for_each(&mut visit);
            }
        }
    }
}
