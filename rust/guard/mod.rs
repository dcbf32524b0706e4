//! The quality guard: no angle of a level under a bound, with nodes of the input only.
//!
//! Cells with an angle under the bound are taken worst first. For each, in this order: take away one of its free nodes
//! (interior, and not a node of a coarser level); exchange it for a candidate nearby; insert a candidate near the cell's
//! off-centre (the point on the bisector of its shortest edge that sees it under a comfortable angle, or the circumcentre where
//! that is nearer); take away or exchange a free node across one of its edges; put one
//! candidate in the place of two free nodes. The first change that takes the cell away
//! and leaves no new cell under the bound is kept, else the best one that betters
//! the worst cell it touches; so a level never gets worse, and the guard ends. A candidate is allowed inside the
//! coarse domain, also nearer to its facets than delta * f (angles are measured here, not feared), where its distance to
//! every neighbour leaves it independent on the next finer level. All triangulation is local, Delaunay throughout, ties broken by node.
//!
//! What it guarantees: nestedness, no worse angle, at most `BUDGET` more nodes. What it usually reaches is told in the
//! documentation. Angles between two facets are left aside.

mod patch;

use crate::domain::Domain;
use crate::level::{Candidates, Place, Triangulated};
use crate::point::{NONE, Point, distance};
use crate::triangulation::Cells;
use patch::Patch;
use rayon::prelude::*;

/// Share of nodes that the guard may add to a level.
pub const BUDGET: f64 = 0.10;

/// Candidates that are tried around one place.
const TRIED: usize = 8;

/// Rounds over the cells that are under the bound.
const MOST_ROUNDS: usize = 12;

/// Cells of a small level for which pairs of nodes are tried; a large one has a share more.
const MOST_PAIRS: usize = 100;

/// How much wider than the bound the angle is under which an inserted node shall see the shortest edge.
const COMFORT: f64 = 1.25;

/// What the guard may do.
#[derive(Debug, Clone, Copy)]
pub struct Guard {
    /// The bound in radians.
    pub min_angle: f64,
    /// beta of the conflict graph.
    pub beta: f64,
    /// Lipschitz constant of f.
    pub slope: f64,
    /// Share of the conflict distance that an inserted node must keep: 1/C leaves the next finer level independent.
    pub room: f64,
}

/// The level at hand, as the guard sees it.
pub struct Scene<'a> {
    /// The domain.
    pub domain: &'a Domain,
    /// Candidates of the level.
    pub candidates: &'a Candidates<'a>,
    /// f by candidate.
    pub f: &'a [f64],
    /// Places of the interior candidates.
    pub places: &'a [Place],
    /// Candidates that coarser levels hold.
    pub seeds: &'a [u32],
}

struct Work<'a> {
    scene: &'a Scene<'a>,
    guard: Guard,
    patch: Patch,
    /// Candidate of each site.
    candidate: Vec<u32>,
    /// Whether a candidate is a site now.
    taken: Vec<bool>,
    /// Whether a site may go.
    is_free: Vec<bool>,
    added: i64,
    most_added: i64,
    /// Cells for which pairs may still be tried: it is dear, and on some domains many cells can't be helped.
    pairs_left: usize,
    /// Cosine of the bound.
    sharp: f64,
}

/// Sites that go and a candidate that comes, [`NONE`] for none.
#[derive(Clone, Copy)]
struct Change {
    gone: [u32; 2],
    new: u32,
}

impl Change {
    fn remove(v: u32) -> Change {
        Change { gone: [v, NONE], new: NONE }
    }

    fn exchange(v: u32, k: u32) -> Change {
        Change { gone: [v, NONE], new: k }
    }

    fn insert(k: u32) -> Change {
        Change { gone: [NONE; 2], new: k }
    }

    fn gone(self) -> impl Iterator<Item = u32> {
        self.gone.into_iter().filter(|&v| v != NONE)
    }
}

/// Betters a level. Also returns the candidates that conflict since, and beta/2 of the distance to the nearest such.
pub fn better(
    scene: &Scene<'_>,
    guard: Guard,
    level: Triangulated,
    candidate_of: impl Fn(u32) -> u32,
) -> (Triangulated, Vec<(u32, f64)>) {
    let facets = scene.domain.len();
    let candidate: Vec<u32> = level.sites.iter().map(|&site| candidate_of(site)).collect();
    let mut taken = vec![false; scene.candidates.nodes.len()];
    let mut is_free: Vec<bool> = candidate.iter().map(|&k| k as usize >= facets).collect();
    candidate.iter().for_each(|&k| taken[k as usize] = true);
    let mut is_seed = vec![false; taken.len()];
    scene.seeds.iter().for_each(|&k| is_seed[k as usize] = true);
    is_free.iter_mut().zip(&candidate).for_each(|(free, &k)| *free &= !is_seed[k as usize]);
    let names = candidate.iter().map(|&k| scene.candidates.nodes[k as usize]).collect();
    let most_added = (BUDGET * level.sites.len() as f64) as i64;
    let patch = Patch::new(level.points, names, &level.cells);
    let sharp = guard.min_angle.cos();
    let pairs_left = MOST_PAIRS + level.sites.len() / MOST_PAIRS;
    let mut work = Work { scene, guard, patch, candidate, taken, is_free, added: 0, most_added, pairs_left, sharp };
    let patch = &work.patch;
    let is_bad = |&t: &u32| patch.sharpness(t) > sharp;
    let mut bad: Vec<u32> = (0..patch.len() as u32).into_par_iter().filter(is_bad).collect();
    for _ in 0..MOST_ROUNDS {
        bad = work.round(bad);
        if bad.is_empty() {
            break;
        }
    }
    let crowded = work.crowded(level.sites.len());
    (work.finish(level.sites), crowded)
}

impl Work<'_> {
    /// One pass over the cells under the bound, worst first; returns those that the pass made.
    fn round(&mut self, bad: Vec<u32>) -> Vec<u32> {
        let name = |v: u32| self.scene.candidates.nodes[self.candidate[v as usize] as usize];
        let mut queue: Vec<(f64, [u32; 3], [u32; 3], u32)> = Vec::with_capacity(bad.len());
        for t in bad {
            // a cell's number may since have gone to another cell
            if let Some(corners) = self.patch.corners(t).filter(|_| self.patch.sharpness(t) > self.sharp) {
                let mut names = corners.map(name);
                names.sort_unstable();
                queue.push((self.patch.sharpness(t), names, corners, t));
            }
        }
        queue.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut made = Vec::new();
        for (_, _, corners, t) in queue {
            if self.patch.corners(t) == Some(corners) && self.mend(t, corners) {
                made.extend(self.patch.made().filter(|&t| self.patch.sharpness(t) > self.sharp));
                self.patch.begin();
            }
        }
        made.sort_unstable();
        made.dedup();
        made
    }

    /// Tries to better one cell; the change that is kept is left at hand.
    fn mend(&mut self, t: u32, corners: [u32; 3]) -> bool {
        // the lowest name first: what is tried, and how it is rounded, must not depend on where the cell begins
        let name = |k: usize| self.scene.candidates.nodes[self.candidate[corners[k] as usize] as usize];
        let first = (1..3).fold(0, |least, k| if name(k) < name(least) { k } else { least });
        let corners = [0, 1, 2].map(|k| corners[(first + k) % 3]);
        let mut best: Option<(f64, Change)> = None;
        if self.try_nodes(&corners, t, &mut best) {
            return true;
        }
        if self.added < self.most_added {
            let (centre, reach) = self.off_centre(corners);
            for k in self.near(&centre, reach) {
                if self.attempt(Change::insert(k), t, &mut best) {
                    return true;
                }
            }
        }
        let across = [0, 1, 2].map(|k| self.patch.across(t, corners[k]));
        if self.try_nodes(&across, t, &mut best) {
            return true;
        }
        if self.pairs_left > 0 {
            self.pairs_left -= 1;
            if self.try_pairs(&[corners, across].concat(), t, &mut best) {
                return true;
            }
        }
        match best {
            Some((_, change)) => self.apply(change, t),
            None => false,
        }
    }

    /// Tries to take away or exchange the free ones among some nodes.
    fn try_nodes(&mut self, nodes: &[u32; 3], t: u32, best: &mut Option<(f64, Change)>) -> bool {
        let is_free = |v: &u32| self.is_free.get(*v as usize).copied().unwrap_or(false);
        let free: Vec<u32> = nodes.iter().copied().filter(is_free).collect();
        for &v in &free {
            if self.attempt(Change::remove(v), t, best) {
                return true;
            }
        }
        for &v in &free {
            let f = self.scene.f[self.candidate[v as usize] as usize];
            for k in self.near(self.patch.point(v), f / self.guard.beta) {
                if self.attempt(Change::exchange(v, k), t, best) {
                    return true;
                }
            }
        }
        false
    }

    /// Tries to put one candidate in the place of two free nodes.
    fn try_pairs(&mut self, nodes: &[u32], t: u32, best: &mut Option<(f64, Change)>) -> bool {
        let is_free = |v: &u32| self.is_free.get(*v as usize).copied().unwrap_or(false);
        let free: Vec<u32> = nodes.iter().copied().filter(is_free).collect();
        for (i, &v) in free.iter().enumerate() {
            for &w in free[i + 1..].iter().filter(|&&w| w != v) {
                let (p, q) = (*self.patch.point(v), *self.patch.point(w));
                let middle = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
                for k in self.near(&middle, 0.5 * distance(&p, &q)) {
                    if self.attempt(Change { gone: [v, w], new: k }, t, best) {
                        return true;
                    }
                }
            }
        }
        false
    }

    /// Makes a change; keeps it where it takes the cell away and all its new cells are above the bound, else undoes it and remembers it where it is
    /// the best so far.
    fn attempt(&mut self, change: Change, t: u32, best: &mut Option<(f64, Change)>) -> bool {
        let corners = self.patch.corners(t);
        if !self.apply(change, t) {
            return false;
        }
        if self.patch.corners(t) != corners {
            let (before, after) = self.patch.before_and_after();
            if after <= self.sharp {
                return true;
            }
            if after < before && best.is_none_or(|(least, _)| after < least) {
                *best = Some((after, change));
            }
        }
        self.undo(change);
        false
    }

    fn apply(&mut self, change: Change, t: u32) -> bool {
        self.patch.begin();
        let mut from = t;
        for v in change.gone() {
            // where a walk starts must not depend on how cells are numbered
            let least = |patch: &Patch| patch.made().min_by_key(|&t| patch.sorted_names(t));
            let made = if self.patch.remove(v) { least(&self.patch) } else { None };
            let Some(made) = made else {
                self.patch.roll_back();
                return false;
            };
            from = made;
        }
        if change.new != NONE && !self.join(change.new, from) {
            self.patch.roll_back();
            self.patch.forget();
            return false;
        }
        for v in change.gone() {
            self.taken[self.candidate[v as usize] as usize] = false;
            self.added -= 1;
        }
        true
    }

    /// Makes a candidate a site; false, with the site added to the patch but to no cell, where it does not fit.
    fn join(&mut self, k: u32, from: u32) -> bool {
        let (scene, guard) = (self.scene, self.guard);
        let (p, f) = (scene.candidates.points[k as usize], scene.f[k as usize]);
        let v = self.patch.add(p, scene.candidates.nodes[k as usize]);
        let candidate = &self.candidate;
        let fits = |w: u32| {
            let other = candidate[w as usize] as usize;
            let near = (f + scene.f[other]) / guard.beta;
            distance(&p, &scene.candidates.points[other]) >= guard.room * near
        };
        if !self.patch.insert(v, from, fits) {
            return false;
        }
        self.candidate.push(k);
        self.is_free.push(true);
        self.taken[k as usize] = true;
        self.added += 1;
        true
    }

    fn undo(&mut self, change: Change) {
        self.patch.roll_back();
        if change.new != NONE {
            self.patch.forget();
            self.candidate.pop();
            self.is_free.pop();
            self.taken[change.new as usize] = false;
            self.added -= 1;
        }
        for v in change.gone() {
            self.taken[self.candidate[v as usize] as usize] = true;
            self.added += 1;
        }
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
        (place, height.max(0.5 * short.sqrt()))
    }

    /// Inserted candidates and those that they conflict with.
    fn crowded(&self, old_sites: usize) -> Vec<(u32, f64)> {
        let (scene, guard) = (self.scene, self.guard);
        let mut room = std::collections::BTreeMap::new();
        for &k in self.candidate[old_sites..].iter().filter(|&&k| self.taken[k as usize]) {
            let (p, f) = (scene.candidates.points[k as usize], scene.f[k as usize]);
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

    /// Sites and cells as they are now.
    fn finish(self, mut sites: Vec<u32>) -> Triangulated {
        let facets = self.scene.domain.len();
        let added = self.candidate[sites.len()..].iter();
        sites.extend(added.map(|&k| facets as u32 + self.scene.candidates.nodes[k as usize]));
        // a site is there where its candidate is taken, and by this site: the last to take it
        let mut holder = vec![NONE; self.taken.len()];
        for (s, &k) in self.candidate.iter().enumerate().filter(|&(_, &k)| self.taken[k as usize]) {
            holder[k as usize] = s as u32;
        }
        let mut index = vec![NONE; sites.len()];
        let (mut kept, mut points) = (Vec::new(), Vec::new());
        for (s, &k) in self.candidate.iter().enumerate().filter(|&(s, &k)| holder[k as usize] == s as u32) {
            index[s] = kept.len() as u32;
            kept.push(sites[s]);
            points.push(self.scene.candidates.points[k as usize]);
        }
        let mut cells: Cells = self.patch.into_cells();
        cells.cells.iter_mut().flatten().for_each(|v| *v = index[*v as usize]);
        Triangulated { sites: kept, points, cells }
    }
}
