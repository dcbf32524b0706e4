//! Chords and corners where the domain need not be kept in all its features.
//!
//! Instead of putting vertices back (see `chords`), chords that would make an invalid domain are given up: those that
//! cross another, that have a kept point between them and their piece of chain, or whose piece changes its kind.

use super::{Chain, Chord, Domain, segment_distance_2};
use crate::kdtree::Bounds;
use crate::point::{Point, distance};
use std::collections::HashSet;

impl Domain {
    /// The valid ones among the chords of the kept vertices that leave their chain by no more than the spacing `f`.
    /// `obstacles` are kept points that are no facet vertices. The chords `known` are valid, and none but fewer vertices and
    /// obstacles are kept since.
    pub fn valid_chords(&self, kept: &[bool], f: &[f64], obstacles: &[Point<2>], known: &[Chord]) -> Vec<Chord> {
        let place = |chord: &Chord| {
            let n = self.chains[chord.chain as usize].vertices.len() as u32;
            (chord.chain, chord.from % n, chord.to % n)
        };
        let known: HashSet<(u32, u32, u32)> = known.iter().map(place).collect();
        let mut chords = self.chords(kept);
        chords.retain(|chord| {
            let [a, b] = chord.vertices;
            let reach = f[a as usize].max(f[b as usize]);
            a != b && chord.deviation_2 <= reach * reach && self.is_uniform(chord)
        });
        self.drop_flat(&mut chords);
        loop {
            let bad = self.offending(&chords, kept, obstacles, |i| !known.contains(&place(&chords[i as usize])));
            if bad.is_empty() {
                return chords;
            }
            let mut bad = bad.into_iter().peekable();
            let mut at = 0;
            chords.retain(|_| {
                at += 1;
                bad.next_if_eq(&(at - 1)).is_none()
            });
        }
    }

    /// Chains of their own (loops, slits inside) that are no larger than the spacing `f`.
    pub fn specks(&self, f: &[f64]) -> Vec<bool> {
        let is_tip = |v: u32| self.ends.get(&v).is_none_or(|ends| ends.len() == 1);
        let is_speck = |chain: &Chain| {
            let ends = [chain.vertices[0], chain.vertices[chain.vertices.len() - 1]];
            let most = || chain.vertices.iter().map(|&v| f[v as usize]).fold(0.0, f64::max);
            (chain.closed || ends.into_iter().all(is_tip)) && self.extent(chain) <= most()
        };
        self.chains.iter().map(is_speck).collect()
    }

    /// Whether a chain has cells on one side only.
    pub fn is_outer(&self, c: u32) -> bool {
        self.chains[c as usize].edges[0].is_outer()
    }

    /// Area of the domain.
    pub fn area(&self) -> f64 {
        let walls = self.chains.iter().flat_map(|chain| &chain.edges);
        let origin = self.points.first().copied().unwrap_or_default();
        let at = |v: u32| [0, 1].map(|k| self.points[v as usize][k] - origin[k]);
        walls
            .map(|edge| {
                let [[ax, ay], [bx, by]] = edge.vertices.map(at);
                let sign = f64::from(edge.sides[0].is_inside() as i8 - edge.sides[1].is_inside() as i8);
                sign * (ax * by - ay * bx) / 2.0
            })
            .sum()
    }

    /// The first chain that a vertex is on.
    pub fn chain_of(&self, v: u32) -> u32 {
        self.place[v as usize].0
    }

    /// Whether a closed chain bounds a hole.
    pub fn is_hole(&self, c: u32) -> bool {
        let chain = &self.chains[c as usize];
        let [left, right] = chain.edges[0].sides.map(|side| side.is_inside());
        // the domain lies on the right of a hole that is run through counter-clockwise
        chain.closed && left != right && (self.area_2(chain.vertices.iter().copied()) > 0.0) == right
    }

    /// Longest side of the box of a chain.
    fn extent(&self, chain: &Chain) -> f64 {
        let bounds = Bounds::of(chain.vertices.iter().map(|&v| &self.points[v as usize]));
        (0..2).map(|k| bounds.hi[k] - bounds.lo[k]).fold(0.0, f64::max)
    }

    /// Whether the piece of chain is of one kind: boundary, slit or interface, with cells on the same sides.
    fn is_uniform(&self, chord: &Chord) -> bool {
        let chain = &self.chains[chord.chain as usize];
        let kind = |k: u32| {
            let edge = chain.edge(k);
            (edge.interior, edge.sides.map(|side| side.is_inside()), edge.sides.map(|side| side.cell_tag))
        };
        (chord.from + 1..chord.to).all(|k| kind(k) == kind(chord.from))
    }

    /// Takes out the chords of closed chains with only two kept vertices or turned the other way round.
    fn drop_flat(&self, chords: &mut Vec<Chord>) {
        let mut out: Vec<Chord> = Vec::with_capacity(chords.len());
        for run in chords.chunk_by(|a, b| a.chain == b.chain) {
            let flat = self.chains[run[0].chain as usize].closed && run.len() < 3;
            if !flat && !self.is_flipped(run) {
                out.extend(run);
            }
        }
        *chords = out;
    }

    /// How far a vertex stands out of the boundary, where that bends by more than the feature angle when looked at with
    /// steps of length `reach`, a quarter of the chain at most: its distance from the line between the points a step
    /// before and a step after, in steps. Junctions and changes of attributes always stand out by a half.
    pub fn stands_out(&self, v: u32, reach: f64, cos_feature: f64) -> Option<f64> {
        let (c, k) = self.place[v as usize];
        let chain = &self.chains[c as usize];
        let arc = chain.arc[k as usize];
        let fixed = self.fixed[v as usize].then_some(0.5);
        if self.ends.contains_key(&v) {
            return fixed;
        }
        let reach = reach.min(chain.length() / 4.0);
        let p = &self.points[v as usize];
        let (a, b) = (self.point_along(chain, arc - reach), self.point_along(chain, arc + reach));
        let (da, db) = (distance(&a, p), distance(p, &b));
        let cosine = ((p[0] - a[0]) * (b[0] - p[0]) + (p[1] - a[1]) * (b[1] - p[1])) / (da * db);
        let height = segment_distance_2(p, &a, &b).sqrt() / reach;
        if cosine < cos_feature { Some(height.max(fixed.unwrap_or(0.0))) } else { fixed }
    }

    /// The point of a chain at an arc length, which runs on around a closed chain and stops at the ends of an open one.
    fn point_along(&self, chain: &Chain, arc: f64) -> Point<2> {
        let arc = if chain.closed { arc.rem_euclid(chain.length()) } else { arc.clamp(0.0, chain.length()) };
        let k = chain.arc.partition_point(|&a| a <= arc).clamp(1, chain.edges.len()) - 1;
        let [a, b] = chain.edges[k].vertices.map(|v| self.points[v as usize]);
        let t = (arc - chain.arc[k]) / (chain.arc[k + 1] - chain.arc[k]);
        [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
    }

    /// Where a vertex lies: chain and position, for each chain that it is on.
    pub fn places(&self, v: u32) -> Vec<(u32, u32)> {
        let at_end = |&(c, at_end): &(u32, bool)| {
            (c, if at_end { self.chains[c as usize].vertices.len() as u32 - 1 } else { 0 })
        };
        self.ends.get(&v).map_or_else(|| vec![self.place[v as usize]], |ends| ends.iter().map(at_end).collect())
    }

    /// Area between a chord and its piece of chain, where the chain lies left and where it lies right of the chord.
    pub fn strips(&self, chord: &Chord) -> [f64; 2] {
        let [a, b] = chord.vertices.map(|v| self.points[v as usize]);
        let length = distance(&a, &b);
        let (ux, uy) = ((b[0] - a[0]) / length, (b[1] - a[1]) / length);
        let (mut left, mut right) = (0.0, 0.0);
        let mut last = (0.0, 0.0);
        for v in self.piece(chord).skip(1) {
            let p = self.points[v as usize];
            let (s, h) = ((p[0] - a[0]) * ux + (p[1] - a[1]) * uy, (p[1] - a[1]) * ux - (p[0] - a[0]) * uy);
            let step = s - last.0;
            let mean = |from: f64, to: f64| {
                let (f, t) = (from.max(0.0), to.max(0.0));
                let share = if (from > 0.0) == (to > 0.0) { 1.0 } else { (f - t).abs() / (from - to).abs() };
                step * share * (f + t) / 2.0
            };
            left += mean(last.1, h);
            right += mean(-last.1, -h);
            last = (s, h);
        }
        [left.max(0.0), right.max(0.0)]
    }
}
