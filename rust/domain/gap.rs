//! The gap of the domain at its facet vertices.
//!
//! The gap at `p` is the distance to the nearest facet vertex `q` that is near in space but not along the facets:
//! `|p - q| < GAMMA * length`, where `length` is measured along their common chain, through a junction that their chains
//! share, or is infinite. At a vertex of class P0 the nearest other such vertex bounds the gap too, however near it is
//! along the chain: both stay on every level, and the edge between them with them.
//!
//! A closed chain bounds it by a quarter of its length: three vertices stay on it, whatever the spacing.
//!
//! The search descends trees over runs of consecutive chain vertices. A run at distance `d` can hold no such `q` where
//! `d >= GAMMA * (longest way along the facets into the run)`, so a straight wall costs O(log s) a vertex, not O(s).
//! Runtime: O(s log s) for s facet vertices.

use super::{Chain, Domain};
use crate::kdtree::KdTree;
use crate::point::{Point, distance};
use rayon::prelude::*;

/// How much shorter than along the facets the way through space must be.
pub const GAMMA: f64 = 0.65;

/// A loop is held to spacings under this part of its length, so that it keeps a shape.
pub const LOOP: f64 = 4.0;

const LEAF: usize = 8;

#[derive(Clone, Copy)]
struct Bounds {
    low: Point<2>,
    high: Point<2>,
}

impl Bounds {
    const EMPTY: Bounds = Bounds { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };

    fn add(&mut self, other: &Bounds) {
        for k in 0..2 {
            self.low[k] = self.low[k].min(other.low[k]);
            self.high[k] = self.high[k].max(other.high[k]);
        }
    }

    fn distance(&self, p: &Point<2>) -> f64 {
        let [dx, dy] = [0, 1].map(|k| (self.low[k] - p[k]).max(p[k] - self.high[k]).max(0.0));
        (dx * dx + dy * dy).sqrt()
    }
}

/// A node of the tree: a run of positions of one chain, or several chains.
struct Run {
    bounds: Bounds,
    /// Chain of the run; `u32::MAX` where it spans several.
    chain: u32,
    first: u32,
    last: u32,
    /// Children, 0 at a leaf (the root is nobody's child).
    children: [u32; 2],
}

struct Tree<'a> {
    domain: &'a Domain,
    runs: Vec<Run>,
}

impl Tree<'_> {
    fn bounds(&self, chain: &Chain, first: u32, last: u32) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for k in first..=last {
            let p = self.domain.points[chain.vertices[k as usize] as usize];
            bounds.add(&Bounds { low: p, high: p });
        }
        bounds
    }

    fn grow_chain(&mut self, c: u32, first: u32, last: u32) -> u32 {
        let at = self.runs.len() as u32;
        let chain = &self.domain.chains[c as usize];
        let bounds = if last - first < LEAF as u32 { self.bounds(chain, first, last) } else { Bounds::EMPTY };
        self.runs.push(Run { bounds, chain: c, first, last, children: [0; 2] });
        if last - first >= LEAF as u32 {
            let middle = first + (last - first) / 2;
            let children = [self.grow_chain(c, first, middle), self.grow_chain(c, middle + 1, last)];
            self.adopt(at, children);
        }
        at
    }

    fn grow_chains(&mut self, chains: &mut [(u32, Point<2>)], axis: usize) -> u32 {
        if let [(c, _)] = *chains {
            return self.grow_chain(c, 0, self.domain.chains[c as usize].vertices.len() as u32 - 1);
        }
        let at = self.runs.len() as u32;
        self.runs.push(Run { bounds: Bounds::EMPTY, chain: u32::MAX, first: 0, last: 0, children: [0; 2] });
        chains.sort_unstable_by(|a, b| a.1[axis].total_cmp(&b.1[axis]).then(a.0.cmp(&b.0)));
        let (low, high) = chains.split_at_mut(chains.len() / 2);
        let children = [self.grow_chains(low, 1 - axis), self.grow_chains(high, 1 - axis)];
        self.adopt(at, children);
        at
    }

    fn adopt(&mut self, parent: u32, children: [u32; 2]) {
        let mut bounds = self.runs[children[0] as usize].bounds;
        bounds.add(&self.runs[children[1] as usize].bounds);
        self.runs[parent as usize].bounds = bounds;
        self.runs[parent as usize].children = children;
    }
}

impl Domain {
    /// Gap at every facet vertex, infinite where there is none.
    pub fn gaps(&self) -> Vec<f64> {
        if self.is_empty() {
            return Vec::new();
        }
        let mut tree = Tree { domain: self, runs: Vec::new() };
        let first = |chain: &Chain| self.points[chain.vertices[0] as usize];
        let mut chains: Vec<(u32, Point<2>)> = (0u32..).zip(self.chains.iter().map(first)).collect();
        tree.grow_chains(&mut chains, 0);
        let mut gaps: Vec<f64> = (0..self.len() as u32)
            .into_par_iter()
            .with_min_len(64)
            .map_init(Vec::new, |stack, v| tree.gap(v, stack))
            .collect();
        let corners: Vec<usize> = (0..self.len()).filter(|&v| self.corner[v]).collect();
        let corner_points: Vec<Point<2>> = corners.iter().map(|&v| self.points[v]).collect();
        let corner_tree = KdTree::new(&corner_points);
        for (&v, p) in corners.iter().zip(&corner_points) {
            gaps[v] = gaps[v].min(corner_tree.nearest(p, Some(p)).0.sqrt());
        }
        for chain in self.chains.iter().filter(|chain| chain.closed) {
            for &v in &chain.vertices {
                gaps[v as usize] = gaps[v as usize].min(chain.length() / LOOP);
            }
        }
        gaps
    }
}

impl Tree<'_> {
    fn gap(&self, v: u32, stack: &mut Vec<(f64, u32)>) -> f64 {
        let p = self.domain.points[v as usize];
        let ways = self.domain.ways(v);
        let mut best = f64::INFINITY;
        stack.clear();
        stack.push((self.runs[0].bounds.distance(&p), 0));
        while let Some((near, at)) = stack.pop() {
            let run = &self.runs[at as usize];
            if near >= best || (run.chain != u32::MAX && near >= GAMMA * self.longest(&ways, run)) {
                continue;
            }
            if run.children[0] == 0 {
                let chain = &self.domain.chains[run.chain as usize];
                for k in run.first..=run.last {
                    let q = chain.vertices[k as usize];
                    let d = distance(&p, &self.domain.points[q as usize]);
                    if q != v && d < best && d < GAMMA * self.domain.way_length(&ways, run.chain, k) {
                        best = d;
                    }
                }
                continue;
            }
            let mut pair = run.children.map(|c| (self.runs[c as usize].bounds.distance(&p), c));
            if pair[0].0 < pair[1].0 {
                pair.swap(0, 1);
            }
            stack.extend(pair);
        }
        best
    }

    /// The longest way along the facets into a run, or more.
    fn longest(&self, ways: &[Way], run: &Run) -> f64 {
        let chain = &self.domain.chains[run.chain as usize];
        let (low, high) = (chain.arc[run.first as usize], chain.arc[run.last as usize]);
        let mut longest = f64::INFINITY;
        for way in ways.iter().filter(|way| way.chain == run.chain) {
            let far = (way.arc - low).abs().max((way.arc - high).abs()) + way.before;
            longest = longest.min(if way.closed { far.min(chain.length() / 2.0) } else { far });
        }
        longest
    }
}

/// A way from a vertex into a chain: the length before it, and the arc at which it enters.
pub struct Way {
    chain: u32,
    arc: f64,
    before: f64,
    closed: bool,
}

impl Domain {
    /// Ways along the facets from a vertex into its own chain and into those that share a junction with it.
    pub fn ways(&self, v: u32) -> Vec<Way> {
        let mut ways = Vec::new();
        let (c, k) = self.place[v as usize];
        let chain = &self.chains[c as usize];
        if chain.closed {
            ways.push(Way { chain: c, arc: chain.arc[k as usize], before: 0.0, closed: true });
            return ways;
        }
        let arc = chain.arc[k as usize];
        if !self.ends.contains_key(&v) {
            ways.push(Way { chain: c, arc, before: 0.0, closed: false });
            self.enter(chain.vertices[0], arc, &mut ways);
            self.enter(chain.vertices[chain.vertices.len() - 1], chain.length() - arc, &mut ways);
        } else {
            self.enter(v, 0.0, &mut ways);
        }
        ways
    }

    fn enter(&self, junction: u32, before: f64, ways: &mut Vec<Way>) {
        for &(chain, at_end) in self.ends.get(&junction).map_or(&[][..], |ends| ends) {
            let arc = if at_end { self.chains[chain as usize].length() } else { 0.0 };
            ways.push(Way { chain, arc, before, closed: false });
        }
    }

    /// Length of the shortest of these ways to a position of a chain.
    pub fn way_length(&self, ways: &[Way], chain: u32, position: u32) -> f64 {
        let arcs = &self.chains[chain as usize];
        let mut shortest = f64::INFINITY;
        for way in ways.iter().filter(|way| way.chain == chain) {
            let along = (arcs.arc[position as usize] - way.arc).abs();
            let along = if way.closed { along.min(arcs.length() - along) } else { along };
            shortest = shortest.min(way.before + along);
        }
        shortest
    }
}
