//! The gap of the domain at its facet vertices.
//!
//! The gap at `p` is the distance to the nearest facet vertex `q` that is near in space but not along the facets:
//! `|p - q| < GAMMA * length`, where `length` is measured along their common chain, through a junction that their chains
//! share, or is infinite. At a vertex of class P0 the nearest other such vertex bounds the gap too, however near it is
//! along the chain: both stay on every level, and the edge between them with them.
//!
//! A closed chain bounds it by a quarter of its length: three vertices stay on it, whatever the spacing.
//!
//! The search descends a tree of the places of all vertices along chains. A node of one chain alone at distance `d` can hold no
//! such `q` where `d >= GAMMA * (longest way along the facets into it)`, so a straight wall costs O(log s) a vertex, not O(s).
//! Runtime: O(s log s) for s facet vertices.

use super::{Chain, Domain};
use crate::kdtree::KdTree;
use crate::point::{NONE, Point, distance};
use rayon::prelude::*;

/// How much shorter than along the facets the way through space must be.
pub const GAMMA: f64 = 0.65;

/// A loop is held to spacings under this part of its length, so that it keeps a shape.
pub const LOOP: f64 = 4.0;

/// Places of one chain: arcs from `low` to `high`. The chain is [`NONE`] where there are several.
#[derive(Clone, Copy)]
struct Run {
    chain: u32,
    low: f64,
    high: f64,
}

impl Run {
    const EMPTY: Run = Run { chain: NONE, low: f64::INFINITY, high: f64::NEG_INFINITY };

    fn joined(&self, other: &Run) -> Run {
        if self.low > self.high {
            return *other;
        }
        let chain = if self.chain == other.chain { self.chain } else { NONE };
        Run { chain, low: self.low.min(other.low), high: self.high.max(other.high) }
    }
}

/// The places of all vertices along chains; a junction has several.
struct Places<'a> {
    domain: &'a Domain,
    tree: KdTree<2>,
    /// Chain and position of each, in leaf order.
    places: Vec<(u32, u32)>,
    /// By node of the tree.
    runs: Vec<Run>,
}

impl<'a> Places<'a> {
    fn new(domain: &'a Domain) -> Places<'a> {
        let positions = |(chain, c): (&Chain, u32)| (0..chain.vertices.len() as u32).map(move |k| (c, k));
        let all: Vec<(u32, u32)> = domain.chains.iter().zip(0..).flat_map(positions).collect();
        let at = |&(c, k): &(u32, u32)| domain.points[domain.chains[c as usize].vertices[k as usize] as usize];
        let tree = KdTree::new(&all.iter().map(at).collect::<Vec<Point<2>>>());
        let places: Vec<(u32, u32)> = tree.order().iter().map(|&i| all[i as usize]).collect();
        let run = |&(c, k): &(u32, u32)| {
            let arc = domain.chains[c as usize].arc[k as usize];
            Run { chain: c, low: arc, high: arc }
        };
        let leaf =
            |range: std::ops::Range<usize>| places[range].iter().map(run).fold(Run::EMPTY, |all, one| all.joined(&one));
        let runs = tree.folded(Run::EMPTY, leaf, Run::joined);
        Places { domain, tree, places, runs }
    }

    fn gap(&self, v: u32) -> f64 {
        let p = self.domain.points[v as usize];
        let ways = self.domain.ways(v);
        let mut best = f64::INFINITY;
        let bound = |node: usize| {
            let (near, run) = (self.tree.bounds(node).distance_2(&p).sqrt(), &self.runs[node]);
            let is_along = run.chain != NONE && near >= GAMMA * self.domain.longest_way(&ways, run);
            if is_along { f64::INFINITY } else { near }
        };
        self.tree.search(f64::INFINITY, bound, |_, range| {
            for &(c, k) in &self.places[range] {
                let q = self.domain.chains[c as usize].vertices[k as usize];
                let d = distance(&p, &self.domain.points[q as usize]);
                if q != v && d < best && d < GAMMA * self.domain.way_length(&ways, c, k) {
                    best = d;
                }
            }
            best
        });
        best
    }
}

impl Domain {
    /// Gap at every facet vertex, infinite where there is none.
    pub fn gaps(&self) -> Vec<f64> {
        if self.is_empty() {
            return Vec::new();
        }
        let places = Places::new(self);
        let mut gaps: Vec<f64> =
            (0..self.len() as u32).into_par_iter().with_min_len(64).map(|v| places.gap(v)).collect();
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

/// The ways along the facets from a vertex.
struct Ways {
    /// Along its own chain: that, and the arc of the vertex.
    own: Option<(u32, f64)>,
    /// Through the junctions at the ends of it: the junction, [`NONE`] where there is none, and the length up to it.
    through: [(u32, f64); 2],
}

impl Domain {
    /// Ways along the facets from a vertex into its own chain and into those that share a junction with it.
    fn ways(&self, v: u32) -> Ways {
        let (c, k) = self.place[v as usize];
        let chain = &self.chains[c as usize];
        let arc = chain.arc[k as usize];
        let none = (NONE, 0.0);
        if self.ends.contains_key(&v) {
            return Ways { own: None, through: [(v, 0.0), none] };
        }
        let ends = [(chain.vertices[0], arc), (chain.vertices[chain.vertices.len() - 1], chain.length() - arc)];
        Ways { own: Some((c, arc)), through: if chain.closed { [none; 2] } else { ends } }
    }

    /// Length of the shortest of these ways to a position of a chain.
    fn way_length(&self, ways: &Ways, c: u32, position: u32) -> f64 {
        let arc = self.chains[c as usize].arc[position as usize];
        self.longest_way(ways, &Run { chain: c, low: arc, high: arc })
    }

    /// The longest way along the facets into a run, or more.
    fn longest_way(&self, ways: &Ways, run: &Run) -> f64 {
        let chain = &self.chains[run.chain as usize];
        let far = |arc: f64| (arc - run.low).abs().max((arc - run.high).abs());
        let mut longest = f64::INFINITY;
        if let Some((c, arc)) = ways.own
            && c == run.chain
        {
            longest = if chain.closed { around(chain.length(), arc, run) } else { far(arc) };
        }
        if !chain.closed {
            let ends = [(chain.vertices[0], 0.0), (chain.vertices[chain.vertices.len() - 1], chain.length())];
            for (junction, before) in ways.through {
                for (end, arc) in ends {
                    if end == junction {
                        longest = longest.min(before + far(arc));
                    }
                }
            }
        }
        longest
    }
}

/// The longest of the shorter ways around a loop into a run.
fn around(length: f64, arc: f64, run: &Run) -> f64 {
    let [one, two] = [run.low, run.high].map(|end| (end - arc).abs());
    let nearest = if run.low <= arc && arc <= run.high { 0.0 } else { one.min(two) };
    if nearest <= length / 2.0 && length / 2.0 <= one.max(two) {
        return length / 2.0;
    }
    let shorter = |along: f64| along.min(length - along);
    shorter(one).max(shorter(two))
}
