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
//! Median splits of the segments' middles, along or across the segments (see [`best_split`]), at most [`LEAF`] segments in a leaf,
//! nodes in heap order and their positions as in `kdtree`.
//! Segments at a vertex of many are split by their directions instead (see [`fans`]).
//! Boxes are rounded, and so are wider than they need be by [`SLACK`]: what is found may be near only, what is not found isn't.

mod fans;

use crate::kdtree::{Bounds, range};
use crate::point::Point;
use fans::Fans;
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
    /// Their ends as vertices.
    vertices: Vec<[u32; 2]>,
    nodes: Vec<Oriented>,
    fans: Option<Fans>,
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
        let along = principal(moments);
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

    /// Squared distance from a point to the box.
    fn distance_2(&self, p: &Point<2>) -> f64 {
        let p = self.framed(p);
        let [u, v] = [0, 1].map(|k| (p[k].abs() - self.half[k]).max(0.0));
        u * u + v * v
    }

    /// Whether the box may come as near to a point as `reach`.
    fn is_within(&self, p: &Point<2>, reach: f64) -> bool {
        self.distance_2(p) <= reach * reach
    }
}

/// Squared distance from a point to a segment.
fn distance_2_to([a, b]: &[Point<2>; 2], p: &Point<2>) -> f64 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length_2 = dot(along, along);
    let t = if length_2 > 0.0 { (dot(to, along) / length_2).clamp(0.0, 1.0) } else { 0.0 };
    let off = [0, 1].map(|k| to[k] - t * along[k]);
    dot(off, off)
}

/// The unit vector of a direction, given by a vector of double its angle.
fn principal([level, slant]: [f64; 2]) -> Point<2> {
    let length = (level * level + slant * slant).sqrt();
    if length == 0.0 {
        return Oriented::EMPTY.along;
    }
    let [x, y] = if level > 0.0 { [length + level, slant] } else { [slant, length - level] };
    let norm = (x * x + y * y).sqrt();
    [x / norm, y / norm]
}

/// The direction along which segments are best split by their middles: theirs or the one across, where their middles spread over
/// more than they are long.
fn best_split(segments: impl Iterator<Item = ([Point<2>; 2], Point<2>)> + Clone) -> Point<2> {
    let step = |[a, b]: [Point<2>; 2]| [b[0] - a[0], b[1] - a[1]];
    let double = |[x, y]: Point<2>| [(x - y) * (x + y), 2.0 * x * y];
    let sum = segments.clone().map(|(ends, _)| double(step(ends))).fold([0.0; 2], |s, t| [s[0] + t[0], s[1] + t[1]]);
    let along = principal(sum);
    let across = [-along[1], along[0]];
    let [one, other] = [along, across].map(|u| {
        let (mut low, mut high, mut length, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
        for (ends, middle) in segments.clone() {
            let at = dot(middle, u);
            (low, high) = (at.min(low), at.max(high));
            length += dot(step(ends), u).abs();
            count += 1.0;
        }
        high - low - length / count
    });
    if one >= other { along } else { across }
}

fn dot(a: Point<2>, b: Point<2>) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

impl Segments {
    /// Builds the tree of segments between vertices. Runtime: O(n log n).
    pub fn new(points: &[Point<2>], segments: &[[u32; 2]]) -> Segments {
        let n = segments.len();
        let place = |v: u32| points[v as usize];
        let bounds = Bounds::of(segments.iter().flatten().map(|&v| &points[v as usize]));
        let extent = if n > 0 && bounds.width() > 0.0 { bounds.width() } else { 1.0 };
        // relative to one of their ends: differences are rounded once
        let origin = segments.first().map_or([0.0; 2], |ends| place(ends[0]));
        let mut depth = 0;
        while n >> depth > LEAF {
            depth += 1;
        }
        let mut tree = Segments {
            order: (0..n as u32).collect(),
            ends: Vec::new(),
            vertices: Vec::new(),
            nodes: Vec::new(),
            fans: Fans::find(points, segments),
            depth,
            origin,
            extent,
        };
        let given: Vec<[Point<2>; 2]> =
            segments.iter().map(|ends| ends.map(|v| tree.scaled(&points[v as usize]))).collect();
        let middle = |[a, b]: &[Point<2>; 2]| [0, 1].map(|k| 0.5 * (a[k] + b[k]));
        let mut middles: Vec<Point<2>> = given.iter().map(middle).collect();
        if let Some(fans) = &tree.fans {
            for (s, middle) in (0..).zip(&mut middles) {
                fans.hub(s).into_iter().for_each(|hub| *middle = tree.scaled(hub));
            }
        }
        for node in 1..1usize << depth {
            let split = range(2 * node, n).len();
            let part = &mut tree.order[range(node, n)];
            if split > 0 && split < part.len() {
                let axis = best_split(part.iter().map(|&s| (given[s as usize], middles[s as usize])));
                let middle = |s: &u32| dot(middles[*s as usize], axis);
                let rank = |s: &u32| tree.fans.as_ref().map_or(*s, |fans| fans.rank(*s));
                part.select_nth_unstable_by(split, |a, b| {
                    middle(a).total_cmp(&middle(b)).then_with(|| rank(a).cmp(&rank(b)))
                });
            }
        }
        tree.ends = tree.order.iter().map(|&s| given[s as usize]).collect();
        tree.vertices = tree.order.iter().map(|&s| segments[s as usize]).collect();
        let node = |node: usize| if node == 0 { Oriented::EMPTY } else { Oriented::of(&tree.ends[tree.range(node)]) };
        tree.nodes = (0..2usize << depth).into_par_iter().with_min_len(GRAIN).map(node).collect();
        if let Some(fans) = &mut tree.fans {
            for node in 0..2usize << depth {
                fans.push(if node == 0 { &[] } else { &tree.order[range(node, n)] }, segments);
            }
        }
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
        self.visit([a, b].map(|p| self.scaled(p)), 0, |_| true, visit);
    }

    /// Calls `visit` with every segment from the position `first` of the leaf order on that meets the one at `position` anywhere
    /// but at an end of both, and some more.
    pub fn crossing(&self, position: usize, first: usize, visit: impl FnMut(u32)) {
        let vertices = self.vertices[position];
        let may_meet = |node: usize| self.fans.as_ref().is_none_or(|fans| fans.may_meet(node, vertices));
        self.visit(self.ends[position], first, may_meet, visit);
    }

    /// Of those from a position of the leaf order on, in the nodes that `enter` admits.
    fn visit(&self, [a, b]: [Point<2>; 2], first: usize, enter: impl Fn(usize) -> bool, mut visit: impl FnMut(u32)) {
        let size = [a, b].iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
        let slack = SLACK * (1.0 + size);
        let [low, high] = [f64::min, f64::max].map(|of: fn(f64, f64) -> f64| [of(a[0], b[0]), of(a[1], b[1])]);
        let apart =
            |[p, q]: &[Point<2>; 2], k: usize| p[k].min(q[k]) > high[k] + slack || p[k].max(q[k]) < low[k] - slack;
        self.descend(
            |node| self.range(node).end > first && self.nodes[node].meets(&[a, b], slack) && enter(node),
            |position| {
                if position >= first && !apart(&self.ends[position], 0) && !apart(&self.ends[position], 1) {
                    visit(self.order[position]);
                }
            },
        );
    }

    /// The highest segment between `x` and the point below it of this y, of those that `is_below` admits, which cross nowhere.
    /// `is_higher` compares two of them.
    pub fn highest_below(
        &self,
        x: &Point<2>,
        floor: f64,
        is_below: impl Fn(u32) -> bool,
        is_higher: impl Fn(u32, u32) -> bool,
    ) -> Option<u32> {
        let p = self.scaled(x);
        let slack = SLACK * (1.0 + p[0].abs().max(p[1].abs()));
        let (mut best, mut from) = (None, self.scaled(&[x[0], floor])[1]);
        let mut stack = vec![1usize];
        while let Some(node) = stack.pop() {
            if self.range(node).is_empty() || !self.nodes[node].meets(&[[p[0], from], p], slack) {
                continue;
            }
            if node >> self.depth == 0 {
                stack.extend(self.children(node, &p));
                continue;
            }
            for position in self.range(node) {
                let s = self.order[position];
                if is_below(s) && best.is_none_or(|best| is_higher(s, best)) {
                    let [a, b] = self.ends[position];
                    let t = (p[0] - a[0]) / (b[0] - a[0]);
                    let y = if t.is_finite() { a[1] + t * (b[1] - a[1]) } else { a[1].min(b[1]) };
                    (best, from) = (Some(s), y.clamp(a[1].min(b[1]), a[1].max(b[1])).min(p[1]));
                }
            }
        }
        best
    }

    /// A segment that is at most twice as far from `x` as the nearest one, and how near none comes.
    pub fn nearby(&self, x: &Point<2>) -> Option<(u32, f64)> {
        let p = self.scaled(x);
        let (mut found, mut least) = (None, f64::INFINITY);
        let mut stack = vec![1usize];
        while let Some(node) = stack.pop() {
            // squared distances
            if 4.0 * self.nodes[node].distance_2(&p) >= least {
                continue;
            }
            if node >> self.depth == 0 {
                stack.extend(self.children(node, &p));
                continue;
            }
            for position in self.range(node) {
                let away = distance_2_to(&self.ends[position], &p);
                if away < least {
                    (found, least) = (Some(self.order[position]), away);
                }
            }
        }
        let rounding = 8.0 * SLACK * (1.0 + p[0].abs().max(p[1].abs()));
        found.map(|segment| (segment, (0.5 * least.sqrt() - rounding) * self.extent))
    }

    /// The children of a node, the nearer one to a point last.
    fn children(&self, node: usize, p: &Point<2>) -> [usize; 2] {
        let children = [2 * node, 2 * node + 1];
        let [one, two] = children.map(|child| self.nodes[child].distance_2(p));
        if one < two { [children[1], children[0]] } else { children }
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
