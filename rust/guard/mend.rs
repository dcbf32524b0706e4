//! Which changes are tried where, and which are kept.

use super::change::Change;
use super::patch::Patch;
use super::{BUDGET, Guard, Outcome, Scene, Work};
use crate::level::{Choice, Place, Triangulated};
use crate::point::{Point, distance};
use rayon::prelude::*;
use std::collections::HashSet;

/// Candidates that are tried around one place, and vertices of one chord.
const TRIED: usize = 8;

/// Rounds over the cells that are under the bound.
const MOST_ROUNDS: usize = 12;

/// How many of the changes tried at a cell are followed by others, for chains of two and of three.
const FOLLOWED: [&[usize]; 2] = [&[16], &[8, 4]];

/// Changes that are tried in chains on any level, and those that each node allows more.
const TRIES: (usize, usize) = (5000, 5);

/// The angle that matters most, in radians: cells still under it are gone over again.
const LEAST: f64 = 15.0 * std::f64::consts::PI / 180.0;

/// Nodes of the budget that are left for these.
const RESERVE: i64 = 2;

/// How much further away nodes are exchanged then.
const WIDER: f64 = 3.0;

/// How much wider than the bound the angle is under which an inserted node shall see the shortest edge.
const COMFORT: f64 = 1.25;

/// A change that takes a cell away and leaves others under the bound.
struct Found {
    /// How many.
    bad: usize,
    /// Cosine of the smallest angle it leaves.
    after: f64,
    change: Change,
}

/// Changes that leave the worst cell they touch better than it was.
pub(super) struct Best {
    /// Cosine of the smallest angle they leave, and how many cells under the bound.
    after: (f64, usize),
    /// The changes, and the cells at which they are made.
    steps: Vec<(Change, u32)>,
}

impl<'a> Work<'a> {
    /// Begins work on a level; facets are left as they are unless `bends`.
    pub(super) fn new(
        scene: &'a Scene<'a>,
        guard: Guard,
        level: Triangulated,
        choice: &Choice,
        candidate_of: impl Fn(u32) -> u32 + Sync,
        bends: bool,
    ) -> Work<'a> {
        let domain = scene.domain;
        let candidate: Vec<u32> = level.sites.par_iter().map(|&site| candidate_of(site)).collect();
        let mut taken = vec![false; scene.candidates.nodes.len()];
        candidate.iter().for_each(|&k| taken[k as usize] = true);
        let mut may_go = vec![true; taken.len()];
        for (v, may_go) in may_go.iter_mut().enumerate().take(domain.len()) {
            *may_go = bends && !domain.corner[v] && !scene.kept[v];
        }
        scene.seeds.iter().for_each(|&k| may_go[k as usize] = false);
        let mut sides = vec![0; domain.chains.len()];
        choice.chords.iter().for_each(|chord| sides[chord.chain as usize] += 1);
        let names = candidate.par_iter().map(|&k| scene.candidates.nodes[k as usize]).collect();
        let budget = (BUDGET * (candidate.len() as i64 - scene.surplus) as f64) as i64 - scene.surplus;
        Work {
            patch: Patch::new(level.points, names, level.cells, choice.chords.len()),
            sites: level.sites,
            chords: choice.chords.clone(),
            chords_before: Vec::new(),
            sides,
            is_free: candidate.par_iter().map(|&k| may_go[k as usize]).collect(),
            bends,
            gone: Vec::new(),
            sites_before: candidate.len(),
            added: 0,
            budget,
            tries_left: TRIES.0 + TRIES.1 * candidate.len(),
            sharp: guard.min_angle.cos(),
            is_last: false,
            steps: Vec::new(),
            best: None,
            scene,
            guard,
            candidate,
            taken,
        }
    }

    /// Does the work; `choice` becomes that of the level returned.
    pub(super) fn done(mut self, choice: &mut Choice) -> (Triangulated, Outcome) {
        self.lift(self.guard.min_angle);
        self.is_last = true;
        self.tries_left += TRIES.0;
        self.lift(self.guard.min_angle.min(LEAST));
        let outcome = Outcome { crowded: self.crowded(), surplus: (self.scene.surplus + self.added).max(0) };
        (self.finish(choice), outcome)
    }

    /// Goes over the cells under a bound until none is left, or nothing helps.
    fn lift(&mut self, bound: f64) {
        self.sharp = bound.cos();
        let (patch, sharp) = (&self.patch, self.sharp);
        let is_under = |&t: &u32| patch.may_be_sharper(t, sharp) && patch.sharpness(t) > sharp;
        let mut bad: Vec<u32> = (0..patch.len() as u32).into_par_iter().filter(is_under).collect();
        for _ in 0..MOST_ROUNDS {
            if bad.is_empty() {
                break;
            }
            bad = self.round(bad);
        }
    }

    /// Whether the budget allows one more node.
    fn may_add(&self) -> bool {
        self.added < self.budget - if self.is_last { 0 } else { RESERVE }
    }

    fn is_bad(&self, t: u32) -> bool {
        self.patch.sharpness(t) > self.sharp
    }

    fn name(&self, site: u32) -> u32 {
        self.scene.candidates.nodes[self.candidate[site as usize] as usize]
    }

    /// One pass over the cells under the bound, worst first; returns those that the pass made.
    fn round(&mut self, bad: Vec<u32>) -> Vec<u32> {
        let mut queue: Vec<(f64, [u32; 3], [u32; 3], u32)> = Vec::with_capacity(bad.len());
        for t in bad {
            // a cell's number may since have gone to another cell
            if let Some(corners) = self.patch.corners(t).filter(|_| self.is_bad(t)) {
                queue.push((self.patch.sharpness(t), self.patch.sorted_names(t), corners, t));
            }
        }
        queue.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut made = Vec::new();
        // what a change took away and brought back waits for the next round
        let mut touched = HashSet::new();
        for (_, _, corners, t) in queue {
            if !touched.contains(&t) && self.mend(t, corners) {
                let (gone, new) = self.patch.numbers();
                touched.extend(gone);
                made.extend(new.into_iter().filter(|&t| self.is_bad(t)));
                self.keep();
            }
        }
        made.sort_unstable();
        made.dedup();
        made
    }

    /// Tries to better one cell; the changes that are kept are left at hand.
    fn mend(&mut self, t: u32, corners: [u32; 3]) -> bool {
        let mut found = Vec::new();
        self.best = None;
        if self.try_each(t, corners, &mut found) {
            return true;
        }
        found.sort_by(|a: &Found, b: &Found| a.bad.cmp(&b.bad).then(a.after.total_cmp(&b.after)));
        if FOLLOWED.into_iter().any(|widths| self.follow(t, &found, widths)) {
            return true;
        }
        let Some(best) = self.best.take() else { return false };
        best.steps.into_iter().all(|(change, t)| self.apply(change, t))
    }

    /// Follows the most promising changes by one that mends the worst cell they leave, and so on.
    fn follow(&mut self, t: u32, found: &[Found], widths: &[usize]) -> bool {
        for one in found.iter().take(widths[0]) {
            if self.tries_left == 0 || !self.apply(one.change, t) {
                continue;
            }
            self.steps.push((one.change, t));
            let left =
                self.patch.difference().1.into_iter().map(|t| (self.patch.sharpness(t), self.patch.sorted_names(t), t));
            let worst = left.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))).map(|(_, _, t)| t);
            if let Some((worst, corners)) = worst.and_then(|t| Some((t, self.patch.corners(t)?))) {
                let mut next = Vec::new();
                if self.try_each(worst, corners, &mut next) {
                    self.steps.clear();
                    return true;
                }
                next.sort_by(|a, b| a.bad.cmp(&b.bad).then(a.after.total_cmp(&b.after)));
                if widths.len() > 1 && self.follow(worst, &next, &widths[1..]) {
                    return true;
                }
            }
            self.steps.pop();
            self.undo(one.change);
        }
        false
    }

    /// Tries each change at a cell; those that take it away but leave others under the bound are added to `found`.
    fn try_each(&mut self, t: u32, corners: [u32; 3], found: &mut Vec<Found>) -> bool {
        // the lowest name first: what is tried, and how it is rounded, must not depend on where the cell begins
        let first =
            (1..3).fold(0, |least, k| if self.name(corners[k]) < self.name(corners[least]) { k } else { least });
        let corners = [0, 1, 2].map(|k| corners[(first + k) % 3]);
        let across = corners.map(|corner| self.patch.across(t, corner));
        if self.try_nodes(&corners, t, found) || self.try_nodes(&across, t, found) {
            return true;
        }
        if self.may_add() {
            let (centre, reach) = self.off_centre(corners);
            for k in self.near(&centre, reach) {
                if self.attempt(Change::insert(k), t, found) {
                    return true;
                }
            }
        }
        self.bends && self.may_add() && self.try_chords(t, corners[0], found)
    }

    /// Tries to take away or exchange the free ones among some nodes.
    fn try_nodes(&mut self, nodes: &[u32; 3], t: u32, found: &mut Vec<Found>) -> bool {
        // what a chain of changes has brought stays
        let is_free = |v: &u32| (*v as usize) < self.sites_before && self.is_free[*v as usize];
        let free: Vec<u32> = nodes.iter().copied().filter(is_free).collect();
        for &v in &free {
            if self.attempt(Change::remove(v), t, found) {
                return true;
            }
        }
        for &v in &free {
            let k = self.candidate[v as usize] as usize;
            if k < self.scene.domain.len() {
                continue;
            }
            let wider = if self.is_last { WIDER } else { 1.0 };
            for k in self.near(self.patch.point(v), wider * self.scene.f[k] / self.guard.beta) {
                if self.attempt(Change::exchange(v, k), t, found) {
                    return true;
                }
            }
        }
        false
    }

    /// Tries to put back vertices between the ends of the chords near a cell: all of a few, else a few that lie evenly.
    fn try_chords(&mut self, t: u32, first: u32, found: &mut Vec<Found>) -> bool {
        for c in self.patch.chords_near(t, first) {
            let chord = self.chords[c as usize];
            let chain = &self.scene.domain.chains[chord.chain as usize];
            let spanned = chord.to - chord.from;
            let count = (spanned - 1).min(TRIED as u32);
            for j in 1..=count {
                let v = chain.vertex(chord.from + spanned * j / (count + 1));
                let is_there = self.taken[v as usize] || self.gone.contains(&v);
                if !is_there && self.attempt(Change::split(c, v), t, found) {
                    return true;
                }
            }
        }
        false
    }

    /// Makes a change; keeps it where it takes the cell away and no cell made is under the bound, else undoes it and
    /// remembers it.
    fn attempt(&mut self, change: Change, t: u32, found: &mut Vec<Found>) -> bool {
        let corners = self.patch.corners(t);
        if !self.gone.is_empty() || self.candidate.len() > self.sites_before {
            self.tries_left = self.tries_left.saturating_sub(1);
        }
        if !self.apply(change, t) {
            return false;
        }
        if self.patch.corners(t) != corners {
            let (before, made) = self.patch.difference();
            let after = made.iter().map(|&t| self.patch.sharpness(t)).fold(-1.0, f64::max);
            if after <= self.sharp {
                return true;
            }
            let bad = made.iter().filter(|&&t| self.is_bad(t)).count();
            let is_best = self.best.as_ref().is_none_or(|best| (after, bad) < best.after);
            if after < before && is_best && (self.is_last || self.steps.is_empty()) {
                let steps = self.steps.iter().copied().chain([(change, t)]).collect();
                self.best = Some(Best { after: (after, bad), steps });
            }
            found.push(Found { bad, after, change });
        }
        self.undo(change);
        false
    }

    /// Allowed candidates nearest to a place, nearest first, ties by node.
    fn near(&self, place: &Point<2>, reach: f64) -> Vec<u32> {
        let (tree, facets) = (&self.scene.candidates.tree, self.scene.domain.len());
        let mut found: Vec<(f64, u32, u32)> = Vec::new();
        tree.ball(place, reach, |position, d_2| {
            let k = tree.order()[position];
            if k as usize >= facets
                && !self.taken[k as usize]
                && self.scene.places[k as usize - facets] != Place::CutOff
                && !self.gone.contains(&k)
            {
                found.push((d_2, self.scene.candidates.nodes[k as usize], k));
            }
        });
        let nearer = |a: &(f64, u32, u32), b: &(f64, u32, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if found.len() > TRIED {
            found.select_nth_unstable_by(TRIED, nearer);
            found.truncate(TRIED);
        }
        found.sort_unstable_by(nearer);
        found.into_iter().map(|(_, _, k)| k).collect()
    }

    /// Where a node would mend a cell, and how far from there one is still looked for.
    fn off_centre(&self, corners: [u32; 3]) -> (Point<2>, f64) {
        let p = corners.map(|v| *self.patch.point(v));
        let length = |k: usize| distance(&p[k], &p[(k + 1) % 3]);
        let lengths = [length(0), length(1), length(2)];
        let mut k = 0;
        for j in 1..3 {
            if lengths[j] < lengths[k] {
                k = j;
            }
        }
        let (a, b, c) = (p[k], p[(k + 1) % 3], p[(k + 2) % 3]);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let (ex, ey) = (c[0] - a[0], c[1] - a[1]);
        let double_area = dx * ey - dy * ex;
        let (short, long) = (dx * dx + dy * dy, ex * ex + ey * ey);
        // circumcentre relative to the middle of the shortest edge lies on its bisector
        let (ux, uy) = ((ey * short - dy * long) / (2.0 * double_area), (dx * long - ex * short) / (2.0 * double_area));
        let height = (ux * -dy + uy * dx) / short.sqrt();
        let comfortable = 0.5 * short.sqrt() / (0.5 * COMFORT * self.guard.min_angle).tan();
        let height = height.min(comfortable);
        let place = [a[0] + 0.5 * dx - dy / short.sqrt() * height, a[1] + 0.5 * dy + dx / short.sqrt() * height];
        if self.is_last {
            let (radius, longest) = ((ux * ux + uy * uy).sqrt(), lengths.into_iter().fold(0.0, f64::max));
            return (place, if radius < longest { radius } else { longest });
        }
        (place, height.max(0.5 * short.sqrt()))
    }

    /// Inserted candidates and those that they conflict with.
    fn crowded(&self) -> Vec<(u32, f64)> {
        let (scene, guard) = (self.scene, self.guard);
        let mut room = std::collections::BTreeMap::new();
        for &k in self.candidate[self.sites.len()..].iter().filter(|&&k| self.taken[k as usize]) {
            let (p, f) = (*scene.candidates.point(k), scene.f[k as usize]);
            scene.candidates.tree.ball(&p, 2.0 * f / (guard.beta - guard.slope), |position, d_2| {
                let other = scene.candidates.tree.order()[position];
                let d = d_2.sqrt();
                if other != k && self.taken[other as usize] && d < (f + scene.f[other as usize]) / guard.beta {
                    for k in [k, other] {
                        let least: &mut f64 = room.entry(k).or_insert(f64::INFINITY);
                        *least = least.min(guard.beta / 2.0 * d);
                    }
                }
            });
        }
        room.into_iter().filter(|&(k, room)| room < scene.f[k as usize]).collect()
    }
}
