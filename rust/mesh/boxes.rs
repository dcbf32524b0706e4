//! A static tree of boxes around line segments: which segments come near a segment, a ray, a point.
//!
//! Median splits along the wider side, at most [`LEAF`] segments in a leaf, nodes in heap order: children of node `k` are
//! `2k` and `2k + 1`, and node `j` of depth `k` holds the positions `j*n >> k .. (j+1)*n >> k`.

use crate::kdtree::Bounds;
use crate::point::Point;
use std::ops::Range;

const LEAF: usize = 4;

/// A tree of boxes.
pub struct Boxes {
    /// Segments in leaf order.
    pub order: Vec<u32>,
    bounds: Vec<Bounds<2>>,
    nodes: Vec<Bounds<2>>,
    depth: u32,
}

/// Whether two closed boxes meet.
pub fn meet(a: &Bounds<2>, b: &Bounds<2>) -> bool {
    (0..2).all(|k| a.lo[k] <= b.hi[k] && b.lo[k] <= a.hi[k])
}

impl Boxes {
    /// Builds the tree. Runtime: O(n log n).
    pub fn new(segments: impl Iterator<Item = [Point<2>; 2]>) -> Boxes {
        let given: Vec<Bounds<2>> = segments.map(|ends| Bounds::of(&ends)).collect();
        let n = given.len();
        let mut depth = 0;
        while n >> depth > LEAF {
            depth += 1;
        }
        let mut order: Vec<u32> = (0..n as u32).collect();
        let mut nodes = vec![Bounds::EMPTY; 2 << depth];
        build(&given, &mut order, &mut nodes, 1, depth);
        let bounds = order.iter().map(|&k| given[k as usize]).collect();
        Boxes { order, bounds, nodes, depth }
    }

    fn range(&self, node: usize) -> Range<usize> {
        let (n, k) = (self.order.len(), node.ilog2());
        let j = node - (1 << k);
        (j * n) >> k..((j + 1) * n) >> k
    }

    /// Box of the segment at a position of the leaf order.
    pub fn bounds(&self, position: usize) -> &Bounds<2> {
        &self.bounds[position]
    }

    /// Calls `visit` with the positions of all segments in nodes, and with boxes, that `wanted` holds for.
    #[inline]
    pub fn visit(&self, wanted: impl Fn(&Bounds<2>) -> bool, mut visit: impl FnMut(usize)) {
        let mut stack = vec![1usize];
        while let Some(node) = stack.pop() {
            if !wanted(&self.nodes[node]) {
                continue;
            }
            if node >> self.depth == 0 {
                stack.push(2 * node + 1);
                stack.push(2 * node);
            } else {
                for position in self.range(node) {
                    if wanted(&self.bounds[position]) {
                        visit(position);
                    }
                }
            }
        }
    }
}

fn build(given: &[Bounds<2>], order: &mut [u32], nodes: &mut [Bounds<2>], node: usize, depth: u32) {
    // iterative over the heap: every node's range is known from its place
    let n = order.len();
    let last = 1usize << depth;
    for at in node..last {
        let k = at.ilog2();
        let j = at - (1 << k);
        let (from, to) = ((j * n) >> k, ((j + 1) * n) >> k);
        let middle = ((2 * j + 1) * n) >> (k + 1);
        let part = &mut order[from..to];
        let hull = part.iter().fold(Bounds::EMPTY, |hull: Bounds<2>, &s| hull.merged(&given[s as usize]));
        let axis = hull.widest();
        let center = |s: &u32| given[*s as usize].lo[axis] * 0.5 + given[*s as usize].hi[axis] * 0.5;
        if middle > from && middle - from < part.len() {
            part.select_nth_unstable_by(middle - from, |a, b| center(a).total_cmp(&center(b)).then(a.cmp(b)));
        }
    }
    for at in (1..2 * last).rev() {
        nodes[at] = if at < last {
            nodes[2 * at].merged(&nodes[2 * at + 1])
        } else {
            let j = at - last;
            order[(j * n) >> depth..((j + 1) * n) >> depth]
                .iter()
                .fold(Bounds::EMPTY, |hull: Bounds<2>, &s| hull.merged(&given[s as usize]))
        };
    }
}
