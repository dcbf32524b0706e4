//! Chords of the facet chains, and what makes a choice of facet vertices a valid coarse domain.
//!
//! A chord joins two kept vertices that follow each other along a chain. The coarse domain is valid where no two chords
//! cross or overlap and where the region between a chord and its piece of chain holds no other kept point: the coarse
//! facets are then the fine ones drawn straight, in the same order around every loop and junction.
//!
//! ```text
//!         chain      x   kept point inside: invalid
//!      ___---^---___
//!     a-------------b     chord
//! ```
//!
//! Where levels shall be well shaped (`wide`), chords may not narrow the domain either: where two of them meet inside it
//! under less than [`NARROW`] degrees, the farthest vertex of one is put back if that widens the angle.
//!
//! Repair goes in rounds: every offending chord gets back the vertex of its piece that is farthest from it. It ends, at
//! the latest, with the input's own facets.

use super::{Domain, segment_distance_2, segments_cross};
use crate::point::{Point, orient};
use crate::segments::Segments;
use rayon::prelude::*;
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering};

/// A chord of a chain, from one kept position to the next; positions of closed chains run on past the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chord {
    /// The chain.
    pub chain: u32,
    /// Position where it leaves the chain.
    pub from: u32,
    /// Position where it meets the chain again.
    pub to: u32,
    /// Facet vertices there.
    pub vertices: [u32; 2],
    /// The vertex between them that is farthest from the chord, and its squared distance; 0.0 where the chord is the chain.
    pub farthest: u32,
    /// Squared distance of that vertex.
    pub deviation_2: f64,
}

/// Tangent of the angle (20 degrees) under which two chords may meet inside the domain only where the chains do.
const NARROW: f64 = 0.363_970_234_266_202_4;

/// Chords or points that one thread looks at in one go.
const AT_ONCE: usize = 64;

/// With more chord ends at a vertex, neighbours are found by sorting.
const FEW: usize = 8;

/// Directions that differ by less may be in either order, in radians.
const LEVEL: f64 = 1e-13;

type Boxed = GeomWithData<Rectangle<Point<2>>, u32>;

impl Domain {
    /// Adds to `kept` the vertices that make it a valid coarse domain, and returns its chords. `obstacles` are kept
    /// points that are no facet vertices.
    pub fn repair(&self, kept: &mut [bool], obstacles: &[Point<2>], wide: bool) -> Vec<Chord> {
        self.keep_enough(kept);
        loop {
            let chords = self.chords(kept);
            let mut bad = self.offending(&chords, kept, obstacles, |_| true);
            bad.extend(self.joined(&chords));
            if bad.is_empty() && wide {
                bad = self.narrow(&chords);
            }
            if bad.is_empty() {
                return chords;
            }
            for chord in bad {
                kept[chords[chord as usize].farthest as usize] = true;
            }
        }
    }

    /// A loop needs three vertices, an open chain its ends, and a slit whose sides share both ends one between.
    fn keep_enough(&self, kept: &mut [bool]) {
        for chain in &self.chains {
            let last = chain.vertices.len() - 1;
            if !chain.closed && chain.vertices[0] != chain.vertices[last] {
                kept[chain.vertices[0] as usize] = true;
                kept[chain.vertices[last] as usize] = true;
                let ([left, right], [left_end, right_end]) = (chain.edges[0].sides, chain.edges[last - 1].sides);
                let is_closed_slit =
                    !chain.edges[0].interior && left.tail == right.tail && left_end.head == right_end.head;
                if is_closed_slit && last > 1 && !chain.vertices[1..last].iter().any(|&v| kept[v as usize]) {
                    let middle = chain.arc.partition_point(|&arc| arc < chain.length() / 2.0).clamp(1, last - 1);
                    kept[chain.vertices[middle] as usize] = true;
                }
                continue;
            }
            kept[chain.vertices[last] as usize] |= !chain.closed;
            // the junction at both ends of a loop counts once
            let distinct = &chain.vertices[usize::from(!chain.closed)..];
            let mut held: Vec<u32> = distinct.iter().copied().filter(|&v| kept[v as usize]).take(3).collect();
            while held.len() < 3 {
                let far = match held[..] {
                    [] => chain.vertices[0],
                    [a] => self.farthest(&chain.vertices, a, a).0,
                    _ => self.farthest(&chain.vertices, held[0], held[1]).0,
                };
                kept[far as usize] = true;
                held.push(far);
            }
        }
    }

    /// The vertex of a list that is farthest from the segment between two vertices (the first of equals).
    fn farthest(&self, vertices: &[u32], a: u32, b: u32) -> (u32, f64) {
        let (p, q) = (&self.points[a as usize], &self.points[b as usize]);
        let mut best = (vertices[0], -1.0);
        for &v in vertices.iter().filter(|&&v| v != a && v != b) {
            let d = segment_distance_2(&self.points[v as usize], p, q);
            if d > best.1 {
                best = (v, d);
            }
        }
        best
    }

    /// The chords between consecutive kept vertices.
    pub fn chords(&self, kept: &[bool]) -> Vec<Chord> {
        let mut chords = Vec::new();
        for (c, chain) in self.chains.iter().enumerate() {
            let positions: Vec<u32> =
                (0..chain.vertices.len() as u32).filter(|&k| kept[chain.vertices[k as usize] as usize]).collect();
            let wrap = positions.first().map(|&k| k + chain.vertices.len() as u32).filter(|_| chain.closed);
            for pair in positions.iter().copied().chain(wrap).collect::<Vec<_>>().windows(2) {
                chords.push(self.chord(c as u32, pair[0], pair[1]));
            }
        }
        chords
    }

    /// The chord of a chain between two positions.
    pub(crate) fn chord(&self, c: u32, from: u32, to: u32) -> Chord {
        let chain = &self.chains[c as usize];
        let vertices = [chain.vertex(from), chain.vertex(to)];
        let (a, b) = (&self.points[vertices[0] as usize], &self.points[vertices[1] as usize]);
        let (mut farthest, mut deviation_2) = (vertices[0], 0.0);
        for k in from + 1..to {
            let v = chain.vertex(k);
            let d = segment_distance_2(&self.points[v as usize], a, b);
            if d > deviation_2 || k == from + 1 {
                (farthest, deviation_2) = (v, d);
            }
        }
        Chord { chain: c, from, to, vertices, farthest, deviation_2 }
    }

    /// Chords to be split, ascending. Those that are not `fresh` are known to be valid among themselves.
    pub(super) fn offending(
        &self,
        chords: &[Chord],
        kept: &[bool],
        obstacles: &[Point<2>],
        fresh: impl Fn(u32) -> bool + Sync,
    ) -> Vec<u32> {
        let bad: Vec<AtomicBool> = chords.iter().map(|_| AtomicBool::new(false)).collect();
        let is_bad = |i: u32| bad[i as usize].load(Ordering::Relaxed);
        let condemn = |i: u32| bad[i as usize].store(true, Ordering::Relaxed);
        let splits = |i: u32| chords[i as usize].to > chords[i as usize].from + 1 && fresh(i);
        let ends: Vec<[u32; 2]> = chords.iter().map(|chord| chord.vertices).collect();
        let tree = Segments::new(&self.points, &ends);
        let in_order = tree.order().par_iter().enumerate().with_min_len(AT_ONCE);
        in_order.filter(|&(_, &i)| splits(i)).for_each(|(position, &i)| {
            tree.crossing(position, 0, |j| {
                // a pair of chords that both split is met twice
                if j == i || (j < i && splits(j)) || !self.cross(&chords[i as usize], &chords[j as usize]) {
                    return;
                }
                let later = splits(j) && chords[j as usize].deviation_2 > chords[i as usize].deviation_2;
                condemn(if later { j } else { i });
            });
        });
        let regions: Vec<Boxed> = (0..chords.len() as u32)
            .filter(|&i| splits(i) && chords[i as usize].deviation_2 > 0.0 && !is_bad(i))
            .map(|i| {
                let envelope = AABB::from_points(self.piece(&chords[i as usize]).map(|v| &self.points[v as usize]));
                GeomWithData::new(Rectangle::from_corners(envelope.lower(), envelope.upper()), i)
            })
            .collect();
        if !regions.is_empty() {
            let tree = RTree::bulk_load(regions);
            let look = |p: &Point<2>, vertex: Option<u32>| {
                for region in tree.locate_all_at_point(*p) {
                    let i = region.data;
                    let chord = &chords[i as usize];
                    let is_end = vertex.is_some_and(|v| chord.vertices.contains(&v));
                    if !is_end && !is_bad(i) && self.holds(chord, p) {
                        condemn(i);
                    }
                }
            };
            let vertices = (0..self.len() as u32).into_par_iter().with_min_len(AT_ONCE);
            vertices.filter(|&v| kept[v as usize]).for_each(|v| look(&self.points[v as usize], Some(v)));
            obstacles.par_iter().with_min_len(AT_ONCE).for_each(|p| look(p, None));
        }
        let mut bad: Vec<bool> = bad.into_iter().map(AtomicBool::into_inner).collect();
        self.flipped(chords, &mut bad);
        (0..chords.len() as u32).filter(|&i| bad[i as usize]).collect()
    }

    /// Chords that meet another one inside the domain under a narrow angle, and whose farthest vertex would widen it.
    fn narrow(&self, chords: &[Chord]) -> Vec<u32> {
        // (vertex, chord, whether it ends there): chord ends around each vertex
        let mut ends: Vec<(u32, u32, bool)> = Vec::with_capacity(2 * chords.len());
        for (c, chord) in (0..).zip(chords) {
            ends.extend([(chord.vertices[0], c, false), (chord.vertices[1], c, true)]);
        }
        ends.sort_unstable();
        let mut bad = Vec::new();
        for around in ends.chunk_by_mut(|a, b| a.0 == b.0) {
            if around.len() > FEW {
                self.narrow_among_many(chords, around, &mut bad);
                continue;
            }
            for one in &*around {
                for two in around.iter().filter(|two| *two != one) {
                    bad.extend(self.narrower(chords, *one, *two, around));
                }
            }
        }
        bad.sort_unstable();
        bad.dedup();
        bad
    }

    /// The same at a vertex of many chords: only those of about the same direction as one, or as the next, can be next to it.
    fn narrow_among_many(&self, chords: &[Chord], around: &mut [(u32, u32, bool)], bad: &mut Vec<u32>) {
        let p = self.points[around[0].0 as usize];
        let direction = |&(_, c, ends): &(u32, u32, bool)| {
            let q = self.points[chords[c as usize].vertices[usize::from(!ends)] as usize];
            (q[1] - p[1]).atan2(q[0] - p[0])
        };
        around.sort_by(|a, b| direction(a).total_cmp(&direction(b)));
        let directions: Vec<f64> = around.iter().map(direction).collect();
        let n = around.len();
        let turn = |from: usize, to: usize| (directions[to % n] - directions[from]).rem_euclid(TAU);
        for i in 0..n {
            let is_level = |k: usize| turn(i, k) < LEVEL || turn(i, k) > TAU - LEVEL;
            let behind = (1..n).take_while(|&back| is_level(i + n - back)).count();
            let next = (i + 1..i + n).find(|&k| !is_level(k)).unwrap_or(i + n);
            let last = (next..i + n).take_while(|&k| turn(i, k) - turn(i, next) < LEVEL).last().unwrap_or(next);
            let near: Vec<(u32, u32, bool)> =
                (n - behind..=n + last - i).take(n).map(|k| around[(i + k) % n]).collect();
            for two in near.iter().filter(|two| **two != around[i]) {
                bad.extend(self.narrower(chords, around[i], *two, &near));
            }
        }
    }

    /// The chord to split where `two` is next to `one` counter-clockwise, cells lie between them, and the angle is narrow.
    fn narrower(
        &self,
        chords: &[Chord],
        one: (u32, u32, bool),
        two: (u32, u32, bool),
        around: &[(u32, u32, bool)],
    ) -> Option<u32> {
        let p = self.points[one.0 as usize];
        let to = |v: u32| [self.points[v as usize][0] - p[0], self.points[v as usize][1] - p[1]];
        let other_end = |end: (u32, u32, bool)| chords[end.1 as usize].vertices[usize::from(!end.2)];
        let (d, e) = (to(other_end(one)), to(other_end(two)));
        let tangent = angle_tangent(d, e)?;
        let chord = &chords[one.1 as usize];
        let edge = self.chains[chord.chain as usize].edge(chord.from);
        // seen from the vertex, the counter-clockwise side of a chord that ends here is its right
        if tangent >= NARROW || !edge.sides[usize::from(one.2)].is_inside() {
            return None;
        }
        let between = |end: &(u32, u32, bool)| {
            let f = to(other_end(*end));
            *end != one && *end != two && cross(d, f) > 0.0 && cross(f, e) > 0.0
        };
        if around.iter().any(between) {
            return None;
        }
        let widened = |end: (u32, u32, bool), new: &dyn Fn(Point<2>) -> Option<f64>| {
            let chord = &chords[end.1 as usize];
            let splits = chord.to > chord.from + 1;
            // beyond a right angle there is no tangent: wide enough
            splits.then(|| new(to(chord.farthest)).unwrap_or(f64::INFINITY)).filter(|&wider| wider > tangent)
        };
        let first = widened(one, &|f| if cross(f, e) > 0.0 { angle_tangent(f, e) } else { Some(0.0) });
        let second = widened(two, &|f| if cross(d, f) > 0.0 { angle_tangent(d, f) } else { Some(0.0) });
        match (first, second) {
            (Some(a), Some(b)) => Some(if a >= b { one.1 } else { two.1 }),
            (Some(_), None) => Some(one.1),
            (None, Some(_)) => Some(two.1),
            (None, None) => None,
        }
    }

    /// Chords of slits that have the same nodes on both sides: the slit would be an edge like any other.
    ///
    /// ```text
    ///          a'
    ///     u --------- v    u, v have one copy each: a, a' must stay
    ///          a
    /// ```
    fn joined(&self, chords: &[Chord]) -> impl Iterator<Item = u32> {
        (0u32..).zip(chords).filter(|(_, chord)| self.is_joined(chord)).map(|(i, _)| i)
    }

    /// Whether a chord of a slit has the same nodes on both sides.
    pub(crate) fn is_joined(&self, chord: &Chord) -> bool {
        let chain = &self.chains[chord.chain as usize];
        let (first, last) = (chain.edge(chord.from), chain.edge(chord.to - 1));
        let [a, b] = [first.sides[0].tail, last.sides[0].head];
        !first.interior && a == first.sides[1].tail && b == last.sides[1].head
    }

    /// Closed chains whose chords run the other way round: their most deviating chord is split.
    fn flipped(&self, chords: &[Chord], bad: &mut [bool]) {
        let mut at = 0;
        for run in chords.chunk_by(|a, b| a.chain == b.chain) {
            let range = at..at + run.len();
            at = range.end;
            let chain = &self.chains[run[0].chain as usize];
            if !chain.closed || bad[range.clone()].iter().any(|&b| b) {
                continue;
            }
            if self.is_flipped(run) {
                let widest =
                    range.max_by(|&i, &j| chords[i].deviation_2.total_cmp(&chords[j].deviation_2).then(j.cmp(&i)));
                widest.into_iter().filter(|&i| chords[i].to > chords[i].from + 1).for_each(|i| bad[i] = true);
            }
        }
    }

    /// Whether the chords of a closed chain are all there and run the other way round than the chain.
    pub(super) fn is_flipped(&self, chords: &[Chord]) -> bool {
        let chain = &self.chains[chords[0].chain as usize];
        let round = chords[0].from + chain.vertices.len() as u32;
        let whole = chords.windows(2).all(|pair| pair[0].to == pair[1].from) && chords[chords.len() - 1].to == round;
        if !chain.closed || !whole {
            return false;
        }
        let chord_area = self.area_2(chords.iter().map(|chord| chord.vertices[0]));
        let chain_area = self.area_2(chain.vertices.iter().copied());
        (chord_area > 0.0) != (chain_area > 0.0)
    }

    /// Twice the signed area of a loop of vertices, measured from its first.
    pub(super) fn area_2(&self, mut vertices: impl Iterator<Item = u32>) -> f64 {
        let Some(first) = vertices.next() else { return 0.0 };
        let origin = self.points[first as usize];
        let mut last = origin;
        let mut sum = 0.0;
        for v in vertices {
            let p = self.points[v as usize];
            sum += (last[0] - origin[0]) * (p[1] - origin[1]) - (last[1] - origin[1]) * (p[0] - origin[0]);
            last = p;
        }
        sum
    }

    /// Facet vertices of the piece of chain that a chord spans, both ends included.
    pub fn piece(&self, chord: &Chord) -> impl Iterator<Item = u32> {
        let chain = &self.chains[chord.chain as usize];
        (chord.from..=chord.to).map(|k| chain.vertex(k))
    }

    /// Whether a point lies in the region between a chord and its piece of chain, or on the chord.
    pub fn holds(&self, chord: &Chord, p: &Point<2>) -> bool {
        let [a, b] = chord.vertices.map(|v| self.points[v as usize]);
        if orient(&a, &b, p) == 0.0 && segment_distance_2(p, &a, &b) == 0.0 {
            return true;
        }
        let mut odd = crosses_ray(&b, &a, p);
        let mut last = a;
        for v in self.piece(chord).skip(1) {
            let next = self.points[v as usize];
            odd ^= crosses_ray(&last, &next, p);
            last = next;
        }
        odd
    }

    fn cross(&self, one: &Chord, other: &Chord) -> bool {
        let [a, b, c, d] =
            [one.vertices[0], one.vertices[1], other.vertices[0], other.vertices[1]].map(|v| self.points[v as usize]);
        segments_cross(&a, &b, &c, &d)
    }
}

/// Whether the ray from `p` to the right crosses the edge `a b` (upper end excluded); exact.
fn crosses_ray(a: &Point<2>, b: &Point<2>, p: &Point<2>) -> bool {
    if (a[1] > p[1]) == (b[1] > p[1]) {
        return false;
    }
    let o = orient(a, b, p);
    if b[1] > a[1] { o > 0.0 } else { o < 0.0 }
}

fn cross(a: Point<2>, b: Point<2>) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Tangent of the angle from `a` counter-clockwise to `b`, `None` where that is not under a right angle.
fn angle_tangent(a: Point<2>, b: Point<2>) -> Option<f64> {
    let (sine, cosine) = (cross(a, b), a[0] * b[0] + a[1] * b[1]);
    (sine > 0.0 && cosine > 0.0).then(|| sine / cosine)
}
