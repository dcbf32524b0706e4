//! The cells of a level among all of a triangulation: which lie inside, and what is peeled off.

use super::order::sort_sites;
use super::{Ground, area, centroid, sides};
use crate::domain::{Chord, Seen};
use crate::error::Error;
use crate::level::{Choice, constraints_of, sites_of};
use crate::point::{NONE, Point};
use crate::triangulation::{Cell, hull};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A part of fewer cells than this is dropped where there is a larger one.
const CRUMB: usize = 4;

/// What one round of a level leaves to the next: few cells change between them.
#[derive(Default)]
pub struct Memory {
    /// What lies at cells by their sample points, a matter of the cell alone: corners as sites, ascending, and the tag.
    sampled: Sampled,
    /// The last triangulation, not labelled, and the chords it was made for.
    last: Option<(Vec<Chord>, Trimmed)>,
    /// Chords that are no edges of it.
    failed: Vec<u32>,
}

impl Memory {
    /// The triangulation of a choice made from the last, where that is possible.
    fn again(&mut self, ground: &Ground<'_>, choice: &Choice) -> Option<Trimmed> {
        let (chords, last) = self.last.take().filter(|_| self.failed.is_empty())?;
        let facets = ground.domain.len() as u32;
        let mut left: Vec<u32> = (0..facets).filter(|&v| choice.kept[v as usize]).collect();
        left.extend(choice.interior.iter().map(|&node| facets + node));
        left[..].sort_unstable();
        let mut trimmed = last.again(&left, &chords, &choice.chords)?;
        trimmed.is_slit = ground.slits(choice, &[]);
        Some(trimmed)
    }
}

type Sampled = Vec<([u32; 3], Option<i64>)>;

/// All cells of a triangulation, and which of them belong to the level.
#[derive(Clone)]
pub struct Trimmed {
    /// Facet vertices (as they are) and interior nodes (offset by the number of facet vertices).
    pub sites: Vec<u32>,
    /// Their coordinates.
    pub points: Vec<Point<2>>,
    /// All cells of the convex hull, corners as sites.
    pub cells: Vec<Cell>,
    /// Tag of each cell of the level, `None` for the others.
    pub label: Vec<Option<i64>>,
    /// Part of each cell, 0 where there is but one.
    pub part: Vec<u32>,
    /// Parts that each site may belong to; empty where there is but one.
    pub parts_at: Vec<Vec<u32>>,
    /// Whether cells on both sides of a constraint end at it.
    pub is_slit: Vec<bool>,
    /// Smallest angle of each cell in degrees.
    pub angle: Vec<f64>,
}

impl Ground<'_> {
    /// Triangulates a choice and tells inside from outside. `None` where there is no cell at all.
    pub fn triangulate(
        &self,
        choice: &Choice,
        f: &[f64],
        is_allowed: impl Fn(u32) -> bool,
        memory: &mut Memory,
    ) -> Result<Option<Trimmed>, Error> {
        let mut trimmed = match memory.again(self, choice) {
            Some(trimmed) => trimmed,
            None => self.anew(choice, memory)?,
        };
        trimmed.label = vec![None; trimmed.cells.len()];
        trimmed.part = vec![0; trimmed.cells.len()];
        memory.last = Some((choice.chords.clone(), trimmed.clone()));
        self.label(choice, f, &memory.failed, &mut trimmed, &mut memory.sampled);
        self.part(choice, &mut trimmed, is_allowed);
        let is_empty = trimmed.label.iter().all(|label| label.is_none());
        Ok((!is_empty).then_some(trimmed))
    }

    /// Triangulates a choice, without labels.
    fn anew(&self, choice: &Choice, memory: &mut Memory) -> Result<Trimmed, Error> {
        let (mut sites, mut points) = sites_of(self.domain, self.input.points, choice);
        let constraints = constraints_of(self.domain, choice, &sites, |chord| sides(self.domain, chord));
        let (mut cells, failed) = hull(&points, &constraints)?;
        sort_sites(&mut sites, &mut points, &mut cells);
        let angle = cells.par_iter().map(|cell| least_angle(&cell.corners.map(|s| points[s as usize]))).collect();
        let is_slit = self.slits(choice, &failed);
        memory.failed = failed;
        let (label, part, parts_at) = (Vec::new(), Vec::new(), Vec::new());
        let mut trimmed = Trimmed { label, part, parts_at, sites, points, cells, is_slit, angle };
        trimmed.sort_cells();
        Ok(trimmed)
    }

    /// Whether cells on both sides of each chord end at it.
    fn slits(&self, choice: &Choice, failed: &[u32]) -> Vec<bool> {
        let is_wall = |chord: &Chord| !self.domain.chains[chord.chain as usize].edge(chord.from).interior;
        let is_slit = |chord: &Chord| is_wall(chord) && sides(self.domain, chord) == [true, true];
        let mut is_slit: Vec<bool> = choice.chords.iter().map(is_slit).collect();
        failed.iter().for_each(|&c| is_slit[c as usize] = false);
        is_slit
    }

    /// Labels cells: beside a valid chord as the chord says, from there over the cells without loose corners up to the
    /// next chord, and by sample points where nothing or more than one thing is said.
    fn label(&self, choice: &Choice, f: &[f64], failed: &[u32], trimmed: &mut Trimmed, sampled: &mut Sampled) {
        let domain = self.domain;
        let facets = domain.len() as u32;
        let mut missing = self.degree.clone();
        let mut is_valid = vec![true; choice.chords.len()];
        failed.iter().for_each(|&c| is_valid[c as usize] = false);
        for (chord, _) in choice.chords.iter().zip(&is_valid).filter(|&(_, &valid)| valid) {
            chord.vertices.iter().for_each(|&v| missing[v as usize] -= 1);
        }
        let cells = &trimmed.cells;
        let n = cells.len();
        let is_loose = |s: u32| trimmed.sites[s as usize] < facets && missing[trimmed.sites[s as usize] as usize] > 0;
        let says = |c: u32| {
            let chord = &choice.chords[c as usize / 2];
            let side = domain.chains[chord.chain as usize].edge(chord.from).sides[c as usize % 2];
            side.is_inside().then_some(side.cell_tag)
        };
        let is_gone: Vec<bool> =
            domain.specks(f).into_iter().zip(0..).map(|(speck, c)| speck && domain.is_hole(c)).collect();
        let mut said: Vec<Option<Option<i64>>> = vec![None; n];
        let mut unsure = vec![false; n];
        for t in 0..n {
            let loose = cells[t].corners.iter().any(|&s| is_loose(s));
            let mut votes = cells[t].constraints.iter().filter(|&&c| c != NONE).map(|&c| says(c));
            said[t] = votes.next();
            // beyond a wall is outside for sure, but what is inside at one chord may lie beyond another, given up
            unsure[t] = said[t].map_or(loose, |first| (loose && first.is_some()) || votes.any(|vote| vote != first));
        }
        let mut seen = unsure.clone();
        for first in 0..n {
            if seen[first] {
                continue;
            }
            seen[first] = true;
            let mut region = vec![first];
            let (mut vote, mut mixed) = (said[first], false);
            let mut at = 0;
            while at < region.len() {
                let t = region[at];
                at += 1;
                for k in 0..3 {
                    let next = cells[t].neighbours[k];
                    if next == NONE || cells[t].constraints[k] != NONE || seen[next as usize] {
                        continue;
                    }
                    seen[next as usize] = true;
                    region.push(next as usize);
                    let other = said[next as usize];
                    mixed |= vote.is_some() && other.is_some() && vote != other;
                    vote = vote.or(other);
                }
            }
            let sure = vote.filter(|_| !mixed);
            for t in region {
                match (said[t], sure) {
                    (Some(own), _) => said[t] = Some(own),
                    (None, Some(vote)) => said[t] = Some(vote),
                    (None, None) => unsure[t] = true,
                }
            }
        }
        let (mut asked, mut label) = (Vec::new(), vec![None; n]);
        for t in 0..n {
            match said[t] {
                Some(said) if !unsure[t] => label[t] = said,
                _ => asked.push(t),
            }
        }
        let ask = |last: &mut Seen, &t: &usize| {
            let cell = cells[t].corners.map(|s| trimmed.sites[s as usize]);
            let before = sampled.binary_search_by_key(&cell, |old| old.0);
            (cell, before.map_or_else(|_| self.sample(trimmed, t, &is_gone, last), |k| sampled[k].1))
        };
        let seen = asked.par_iter().map_init(Seen::default, ask);
        *sampled = seen.collect();
        asked.into_iter().zip(sampled).for_each(|(t, seen)| label[t] = seen.1);
        trimmed.label = label;
    }

    /// The tag of most sample points of a cell, `None` where not most of them lie inside.
    fn sample(&self, trimmed: &Trimmed, t: usize, is_gone: &[bool], last: &mut Seen) -> Option<i64> {
        let cell = trimmed.cells[t].corners;
        let corners = cell.map(|s| trimmed.points[s as usize]);
        let facets = self.domain.len() as u32;
        // an interior node's cells see farther than those of a facet vertex
        let site = cell.iter().map(|&s| trimmed.sites[s as usize]).max().unwrap_or(0);
        let node = site.checked_sub(facets).unwrap_or_else(|| self.domain.copies(site)[0]);
        let eye = self.eye(node);
        let middle = centroid(&corners);
        let towards = |p: &Point<2>| [(middle[0] + p[0]) / 2.0, (middle[1] + p[1]) / 2.0];
        let samples = [middle, towards(&corners[0]), towards(&corners[1]), towards(&corners[2])];
        let mut look = |x: &Point<2>| self.sight.look(&eye, x, |c| is_gone[c as usize], last);
        let tags: Vec<i64> = samples.iter().filter_map(&mut look).collect();
        let count = |tag: i64| tags.iter().filter(|&&other| other == tag).count();
        let most = tags.iter().map(|&tag| count(tag)).max()?;
        tags.iter().copied().find(|&tag| tags.len() >= 3 && count(tag) == most)
    }
}

impl Trimmed {
    /// Cells of the level.
    pub fn alive(&self) -> impl Iterator<Item = usize> {
        (0..self.label.len()).filter(|&t| self.label[t].is_some())
    }

    /// The cell of the level across an edge of a cell; [`NONE`] where there is none, a slit between, or another part.
    pub fn across(&self, t: usize, k: usize) -> u32 {
        let (next, constraint) = (self.cells[t].neighbours[k], self.cells[t].constraints[k]);
        let is_slit = constraint != NONE && self.is_slit[constraint as usize / 2];
        let ends = |next: usize| self.label[next].is_none() || self.part[next] != self.part[t];
        if next == NONE || is_slit || ends(next as usize) { NONE } else { next }
    }

    /// Which corner of a cell a site is.
    pub fn corner(&self, t: usize, s: u32) -> usize {
        (0..3).find(|&k| self.cells[t].corners[k] == s).unwrap_or(0)
    }

    /// The cells of the level around a site that are met from one of them without crossing rim or slit, counter-clockwise.
    pub fn sector(&self, t: usize, s: u32) -> Vec<usize> {
        self.sector_within(t, s, usize::MAX).unwrap_or_default()
    }

    /// The same, `None` where there are more than `most` cells.
    pub fn sector_within(&self, t: usize, s: u32, most: usize) -> Option<Vec<usize>> {
        let (mut first, mut count) = (t, 1);
        loop {
            let next = self.across(first, self.corner(first, s));
            if next == NONE || next as usize == t {
                break;
            }
            (first, count) = (next as usize, count + 1);
            if count > most {
                return None;
            }
        }
        let mut sector = vec![first];
        loop {
            let last = sector[sector.len() - 1];
            let next = self.across(last, (self.corner(last, s) + 2) % 3);
            if next == NONE || next as usize == first {
                return Some(sector);
            }
            sector.push(next as usize);
            if sector.len() > most {
                return None;
            }
        }
    }

    /// All cells of the hull around a site, from one of them.
    pub fn around(&self, t: usize, s: u32) -> impl Iterator<Item = usize> {
        let turn = move |t: usize, k: usize| self.cells[t].neighbours[(self.corner(t, s) + k) % 3];
        let mut first = t;
        loop {
            let next = turn(first, 0);
            if next == NONE || next as usize == t {
                break;
            }
            first = next as usize;
        }
        std::iter::successors(Some(first), move |&t| {
            let next = turn(t, 2);
            (next != NONE && next as usize != first).then_some(next as usize)
        })
    }

    /// Takes cells under `limit_deg`, and no larger than `most_area`, off the rim, the worst first: ears (two rim edges),
    /// and cells with one rim edge whose opposite corner is not on the rim, or is where that `severs` what the cell holds
    /// together. The level is never emptied.
    pub fn peel(&mut self, limit_deg: f64, most_area: f64, severs: bool) {
        let mut rim = vec![0u32; self.sites.len()];
        let mut left = 0;
        for t in self.alive() {
            left += 1;
            for k in (0..3).filter(|&k| self.across(t, k) == NONE) {
                rim[self.cells[t].corners[k] as usize] += 1;
                rim[self.cells[t].corners[(k + 1) % 3] as usize] += 1;
            }
        }
        // angles are positive, so that their bits are in their order
        let entry = |angle: f64, t: usize| Reverse((angle.to_bits(), t as u32));
        let mut heap: BinaryHeap<Reverse<(u64, u32)>> =
            self.alive().filter(|&t| self.angle[t] < limit_deg).map(|t| entry(self.angle[t], t)).collect();
        while let Some(Reverse((_, t))) = heap.pop() {
            let t = t as usize;
            if self.label[t].is_none() || left == 1 {
                continue;
            }
            let cell = self.cells[t].corners;
            let is_rim = [0, 1, 2].map(|k| self.across(t, k) == NONE);
            let goes = match is_rim.iter().filter(|&&r| r).count() {
                0 => false,
                1 => {
                    let k = is_rim.iter().position(|&r| r).unwrap_or(0);
                    severs || rim[cell[(k + 2) % 3] as usize] == 0
                }
                _ => true,
            };
            if !goes || self.area_of(t) > most_area {
                continue;
            }
            self.label[t] = None;
            left -= 1;
            for k in 0..3 {
                let ends = [cell[k], cell[(k + 1) % 3]];
                for s in ends {
                    if is_rim[k] { rim[s as usize] -= 1 } else { rim[s as usize] += 1 }
                }
                let next = self.cells[t].neighbours[k];
                if !is_rim[k] && self.angle[next as usize] < limit_deg {
                    heap.push(entry(self.angle[next as usize], next as usize));
                }
            }
        }
    }

    /// Drops parts of hardly any cells where there is a larger part.
    pub fn drop_crumbs(&mut self) {
        let mut part = vec![NONE; self.label.len()];
        let mut parts: Vec<Vec<u32>> = Vec::new();
        for first in self.alive() {
            if part[first] != NONE {
                continue;
            }
            let p = parts.len() as u32;
            part[first] = p;
            let mut members = vec![first as u32];
            let mut at = 0;
            while at < members.len() {
                let t = members[at] as usize;
                at += 1;
                for k in 0..3 {
                    let next = self.across(t, k);
                    if next != NONE && part[next as usize] == NONE {
                        part[next as usize] = p;
                        members.push(next);
                    }
                }
            }
            parts.push(members);
        }
        let largest = parts.iter().map(|members| members.len()).max().unwrap_or(0);
        for members in parts.iter().filter(|members| members.len() < CRUMB.min(largest)) {
            members.iter().for_each(|&t| self.label[t as usize] = None);
        }
    }

    /// Number of cells under a limit, and the smallest angle.
    pub fn shape(&self, limit_deg: f64) -> (usize, f64) {
        let least = self.alive().map(|t| self.angle[t]).fold(f64::INFINITY, f64::min);
        (self.alive().filter(|&t| self.angle[t] < limit_deg).count(), least)
    }

    /// Area of the level.
    pub fn area(&self) -> f64 {
        self.alive().map(|t| self.area_of(t)).sum()
    }

    /// Area of a cell.
    pub fn area_of(&self, t: usize) -> f64 {
        area(&self.cells[t].corners.map(|s| self.points[s as usize]))
    }
}

/// The smallest angle of a triangle in degrees.
pub fn least_angle(p: &[Point<2>; 3]) -> f64 {
    angles(p).into_iter().fold(f64::INFINITY, f64::min)
}

/// Angles of a triangle in degrees.
pub fn angles(p: &[Point<2>; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| {
        let [a, b, c] = [p[k], p[(k + 1) % 3], p[(k + 2) % 3]];
        let (ux, uy, vx, vy) = (b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]);
        (ux * vy - uy * vx).abs().atan2(ux * vx + uy * vy).to_degrees()
    })
}
