//! A change of a level, made and taken back.

use super::Work;
use crate::domain::Chord;
use crate::kdtree::Bounds;
use crate::level::{Choice, Triangulated, each_in};
use crate::point::{NONE, distance, orient};
use crate::triangulation::counted;
use rayon::prelude::*;
use std::collections::HashMap;

/// Where a facet vertex is taken away, all others that the new chord spans stay within this many times the distance at which
/// they would be in conflict with an end of it: no gap grows out of proportion.
const SPAN: f64 = 1.4;

/// A site that goes, a candidate that comes, and the chord that this splits; [`NONE`] for none.
#[derive(Clone, Copy)]
pub(super) struct Change {
    gone: u32,
    new: u32,
    chord: u32,
}

impl Change {
    pub(super) fn remove(v: u32) -> Change {
        Change { gone: v, new: NONE, chord: NONE }
    }

    pub(super) fn exchange(v: u32, k: u32) -> Change {
        Change { gone: v, new: k, chord: NONE }
    }

    pub(super) fn insert(k: u32) -> Change {
        Change { gone: NONE, new: k, chord: NONE }
    }

    pub(super) fn split(chord: u32, v: u32) -> Change {
        Change { gone: NONE, new: v, chord }
    }
}

impl Work<'_> {
    /// Makes a change at a cell, after those at hand; false, and nothing changed, where it can't be made.
    pub(super) fn apply(&mut self, change: Change, t: u32) -> bool {
        self.patch.begin();
        self.chords_before.push(self.chords.len());
        let mut from = t;
        if change.gone != NONE {
            // where a walk starts must not depend on how cells are numbered
            let is_gone = self.leave(change.gone);
            let made = if is_gone { self.patch.numbers().1 } else { Vec::new() };
            let Some(made) = made.into_iter().min_by_key(|&t| self.patch.sorted_names(t)) else {
                self.roll_back();
                return false;
            };
            from = made;
        }
        if change.new != NONE && !self.join(change, from) {
            self.roll_back();
            self.forget();
            return false;
        }
        if change.gone != NONE {
            let k = self.candidate[change.gone as usize];
            self.taken[k as usize] = false;
            self.gone.push(k);
            self.added -= self.weight(k);
        }
        true
    }

    /// Undoes the last of the changes at hand, which was this one.
    pub(super) fn undo(&mut self, change: Change) {
        self.roll_back();
        if change.new != NONE {
            self.forget();
            self.taken[change.new as usize] = false;
            self.added -= self.weight(change.new);
        }
        if change.gone != NONE {
            let k = self.candidate[change.gone as usize];
            self.taken[k as usize] = true;
            self.gone.pop();
            self.added += self.weight(k);
        }
    }

    /// Keeps the changes at hand for good.
    pub(super) fn keep(&mut self) {
        self.patch.keep();
        self.chords_before.clear();
        self.gone.clear();
        self.sites_before = self.candidate.len();
    }

    /// Undoes the last change in the patch and the chords.
    fn roll_back(&mut self) {
        self.patch.roll_back();
        let before = self.chords_before.pop().unwrap_or(self.chords.len());
        // two new chords took the place of one, or one that of two
        if let Some(last) = self.chords.last().filter(|_| self.chords.len() > before) {
            let sides = &mut self.sides[last.chain as usize];
            *sides = if self.chords.len() == before + 1 { *sides + 1 } else { *sides - 1 };
        }
        for _ in before..self.chords.len() {
            self.chords.pop();
            self.patch.forget_chord();
        }
    }

    /// Forgets the last site.
    fn forget(&mut self) {
        self.patch.forget();
        self.candidate.pop();
        self.is_free.pop();
    }

    /// Nodes that a candidate stands for.
    fn weight(&self, k: u32) -> i64 {
        let facets = self.scene.domain.len();
        if (k as usize) < facets { self.scene.domain.copies(k).len() as i64 } else { 1 }
    }

    /// Makes a candidate a site; false, with the site added to the patch but to no cell, where it does not fit.
    fn join(&mut self, change: Change, from: u32) -> bool {
        let (scene, guard, k) = (self.scene, self.guard, change.new);
        let (p, f) = (*scene.candidates.point(k), scene.f[k as usize]);
        let v = self.patch.add(p, scene.candidates.nodes[k as usize]);
        self.candidate.push(k);
        self.is_free.push(true);
        if change.chord != NONE && !self.split_chord(change.chord, k) {
            return false;
        }
        let candidate = &self.candidate;
        let room = if self.is_last { 0.0 } else { guard.room };
        let fits = |w: u32| {
            let other = candidate[w as usize];
            let near = (f + scene.f[other as usize]) / guard.beta;
            distance(&p, scene.candidates.point(other)) >= room * near
        };
        let is_there = if change.chord == NONE {
            self.patch.insert(v, from, fits)
        } else {
            let last = self.chords.len() as u32;
            self.patch.split(v, change.chord, [last - 2, last - 1], fits)
        };
        if is_there {
            self.taken[k as usize] = true;
            self.added += self.weight(k);
        }
        is_there
    }

    /// Adds the two chords that a vertex splits a chord into; false where either is not valid.
    fn split_chord(&mut self, chord: u32, v: u32) -> bool {
        let domain = self.scene.domain;
        let old = self.chords[chord as usize];
        let chain = &domain.chains[old.chain as usize];
        let Some(at) = (old.from + 1..old.to).find(|&at| chain.vertex(at) == v) else { return false };
        let [a, b] = old.vertices.map(|v| &domain.points[v as usize]);
        let is_fresh = self.patch.is_fresh(chord) || orient(a, b, &domain.points[v as usize]) != 0.0;
        self.add_chord(old.chain, old.from, at, is_fresh);
        self.add_chord(old.chain, at, old.to, is_fresh);
        self.sides[old.chain as usize] += 1;
        let last = self.chords.len();
        self.is_clear(last - 1, v) && self.is_clear(last - 2, v)
    }

    /// Takes a site out of the cells; false where it can't be.
    fn leave(&mut self, v: u32) -> bool {
        let k = self.candidate[v as usize];
        let domain = self.scene.domain;
        if k as usize >= domain.len() {
            return self.patch.remove(v);
        }
        let Some(ends) = self.chords_of(v) else { return false };
        let [one, two] = ends.map(|c| self.chords[c as usize]);
        let chain = &domain.chains[one.chain as usize];
        let is_loop = chain.closed || chain.vertices[0] == chain.vertices[chain.vertices.len() - 1];
        if is_loop && self.sides[one.chain as usize] < 4 {
            return false;
        }
        let [a, p, b] = [one.vertices[0], k, two.vertices[1]].map(|v| &domain.points[v as usize]);
        let is_fresh = orient(a, p, b) != 0.0 || ends.into_iter().any(|c| self.patch.is_fresh(c));
        self.add_chord(one.chain, one.from, one.to + two.to - two.from, is_fresh);
        self.sides[one.chain as usize] -= 1;
        let last = self.chords.len() - 1;
        let is_valid = self.is_dense(last) && !domain.is_joined(&self.chords[last]) && self.is_clear(last, k);
        is_valid && self.patch.merge(v, ends, last as u32)
    }

    /// The chord that ends at a facet site and the one that begins there, of one chain.
    fn chords_of(&self, v: u32) -> Option<[u32; 2]> {
        let k = self.candidate[v as usize];
        let mut ends = self.patch.chords_of(v)?;
        if self.chords[ends[0] as usize].vertices[0] == k {
            ends.swap(0, 1);
        }
        let [one, two] = ends.map(|c| self.chords[c as usize]);
        (one.chain == two.chain && one.vertices[1] == k && two.vertices[0] == k).then_some(ends)
    }

    fn add_chord(&mut self, chain: u32, from: u32, to: u32, is_fresh: bool) {
        let length = self.scene.domain.chains[chain as usize].vertices.len() as u32;
        let turns = if from < length { 0 } else { length };
        self.chords.push(self.scene.domain.chord(chain, from - turns, to - turns));
        self.patch.add_chord(is_fresh);
    }

    /// Whether the vertices that a chord spans are near enough to either end.
    fn is_dense(&self, chord: usize) -> bool {
        let (domain, f, chord) = (self.scene.domain, self.scene.f, &self.chords[chord]);
        let is_near = |v: u32, end: u32| {
            let near = (f[v as usize] + f[end as usize]) / self.guard.beta;
            distance(&domain.points[v as usize], &domain.points[end as usize]) <= SPAN * near
        };
        domain.piece(chord).all(|v| chord.vertices.into_iter().any(|end| is_near(v, end)))
    }

    /// Whether the region between a chord and its piece of chain holds no kept point, one vertex left aside.
    fn is_clear(&self, chord: usize, but: u32) -> bool {
        let (domain, candidates, chord) = (self.scene.domain, self.scene.candidates, &self.chords[chord]);
        if chord.deviation_2 == 0.0 {
            return true;
        }
        let tree = &candidates.tree;
        let piece = Bounds::of(domain.piece(chord).map(|v| &domain.points[v as usize]));
        let mut is_clear = true;
        each_in(
            tree,
            |node| tree.bounds(node).gap_2(&piece) == 0.0,
            |k, x| {
                let is_kept = self.taken[k] && k as u32 != but && !chord.vertices.contains(&(k as u32));
                is_clear &= !is_kept || !domain.holds(chord, x);
            },
        );
        is_clear
    }

    /// Sites and cells as they are now; the choice follows.
    pub(super) fn finish(self, choice: &mut Choice) -> Triangulated {
        let facets = self.scene.domain.len();
        let (before, mut sites) = (self.sites.len(), self.sites);
        let site =
            |k: u32| if (k as usize) < facets { k } else { facets as u32 + self.scene.candidates.nodes[k as usize] };
        sites.extend(self.candidate[before..].iter().map(|&k| site(k)));
        // a site is there where its candidate is taken, and by this site: the last to take it
        let mut stays = vec![false; sites.len()];
        let mut taken = self.taken;
        for s in (before..sites.len()).rev() {
            stays[s] = std::mem::replace(&mut taken[self.candidate[s] as usize], false);
        }
        let (old, new) = stays.split_at_mut(before);
        old.par_iter_mut().zip(&self.candidate).for_each(|(stays, &k)| *stays = taken[k as usize]);
        for (&k, _) in self.candidate[before..].iter().zip(new).filter(|(_, stays)| **stays) {
            taken[k as usize] = true;
        }
        let (_, index) = counted(sites.len(), |s| stays[s]);
        let (mut points, mut cells) = self.patch.into_parts();
        cells.par_iter_mut().for_each(|cell| cell.corners = cell.corners.map(|s| index[s as usize]));
        let mut of_points = stays.iter();
        points.retain(|_| of_points.next().is_some_and(|&stays| stays));
        let mut of_sites = stays.iter();
        sites.retain(|_| of_sites.next().is_some_and(|&stays| stays));
        choice.interior = sites.iter().filter_map(|&site| site.checked_sub(facets as u32)).collect();
        if self.chords.len() > choice.chords.len() {
            choice.kept.copy_from_slice(&taken[..facets]);
            choice.chords = self.scene.domain.chords(&choice.kept);
            // of a closed chain the first chord may be another one now
            let length = |chain: u32| self.scene.domain.chains[chain as usize].vertices.len() as u32;
            let place = |chord: &Chord| (chord.chain, chord.from % length(chord.chain));
            let number: HashMap<(u32, u32), u32> =
                (0..).zip(&choice.chords).map(|(c, chord)| (place(chord), c)).collect();
            for c in cells.iter_mut().flat_map(|cell| &mut cell.constraints).filter(|c| **c != NONE) {
                *c = 2 * number.get(&place(&self.chords[*c as usize / 2])).copied().unwrap_or(NONE) + *c % 2;
            }
        }
        Triangulated { sites, points, cells }
    }
}
