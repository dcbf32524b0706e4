//! The triangulation of a level once more, where few of its sites or chords went since.
//!
//! ```text
//!       o-------o                 o-------o
//!      / \     / \               / \       \
//!     /   \   /   \             /   \       \
//!    o-----  s  ---o     to    o     \       o
//!     \   /   \   /             \     \     /
//!      \ /     \ /               \     \   /
//!       o-------o                 o-------o
//! ```
//!
//! A constrained Delaunay triangulation stays one outside the star of a site that goes, and a chord that goes leaves an edge to
//! be looked at. A chord that comes is made an edge by flips (Sloan 1993). As ties are broken by the names of sites there
//! is but one such triangulation, so that what is mended here is what would be made anew.

use super::trim::Trimmed;
use crate::domain::Chord;
use crate::point::{NONE, Point, orient};
use crate::triangulation::Cell;
use std::collections::{HashMap, VecDeque};

/// With a larger share of the sites gone all is triangulated anew.
const MOST_GONE: f64 = 1.0 / 16.0;

/// Stars with more cells are not filled.
const MOST_CELLS: usize = 64;

/// Looks at edges that cross a new chord, by the square of their number, at most.
const MOST_FLIPS: usize = 8;

impl Trimmed {
    /// What is left of a triangulation in order, made for `old` chords and not labelled, with the sites `left` (ascending)
    /// for the chords `new`. `None` where that is better made anew.
    pub(super) fn again(mut self, left: &[u32], old: &[Chord], new: &[Chord]) -> Option<Trimmed> {
        let mut place = vec![NONE; self.sites.len()];
        let mut count = 0;
        for (s, site) in self.sites.iter().enumerate() {
            if left.get(count as usize) == Some(site) {
                place[s] = count;
                count += 1;
            }
        }
        let gone = self.sites.len() - left.len().min(self.sites.len());
        if (count as usize) < left.len() || gone as f64 > MOST_GONE * self.sites.len() as f64 {
            return None;
        }
        let name = |chord: &Chord| (chord.chain, chord.from, chord.to);
        let mut number: HashMap<(u32, u32, u32), u32> = new.iter().map(name).zip(0..).collect();
        let renamed: Vec<u32> = old.iter().map(|chord| number.remove(&name(chord)).unwrap_or(NONE)).collect();
        let mut stack = Vec::new();
        let mut cell_at = vec![NONE; self.sites.len()];
        for t in 0..self.cells.len() {
            for k in 0..3 {
                cell_at[self.cells[t].corners[k] as usize] = t as u32;
                let code = &mut self.cells[t].constraints[k];
                if *code != NONE {
                    let chord = renamed[*code as usize / 2];
                    *code = if chord == NONE { NONE } else { 2 * chord + *code % 2 };
                    stack.extend((chord == NONE).then_some((t, k)));
                }
            }
        }
        for s in (0..place.len() as u32).filter(|&s| place[s as usize] == NONE) {
            let made = self.fill(cell_at[s as usize] as usize, s, &mut cell_at)?;
            stack.extend(made.into_iter().flat_map(|t| (0..3).map(move |k| (t, k))));
        }
        for c in number.into_values() {
            let [Ok(a), Ok(b)] = new[c as usize].vertices.map(|v| self.sites.binary_search(&v)) else { return None };
            self.force([a as u32, b as u32], c, &mut cell_at, &mut stack)?;
        }
        stack.retain(|&(t, _)| self.cells[t].corners[0] != NONE);
        self.settle(stack, |trimmed, t, k| trimmed.cells[t].constraints[k] == NONE);
        self.sites = left.to_vec();
        self.points = self.points.iter().zip(&place).filter(|&(_, &s)| s != NONE).map(|(&point, _)| point).collect();
        self.cells
            .iter_mut()
            .flat_map(|cell| &mut cell.corners)
            .filter(|s| **s != NONE)
            .for_each(|s| *s = place[*s as usize]);
        self.put_in_order();
        Some(self)
    }

    /// Takes a site out that is around a cell, and returns the cells that fill its star. `cell_at` has a cell of every site.
    fn fill(&mut self, t: usize, s: u32, cell_at: &mut [u32]) -> Option<Vec<usize>> {
        let star: Vec<usize> = self.around(t, s).take(MOST_CELLS + 1).collect();
        let is_open = self.cells[star[0]].neighbours[self.corner(star[0], s)] == NONE;
        if star.len() > MOST_CELLS || (star.len() < 3 && !is_open) {
            return None;
        }
        // (where an edge of the star starts, the cell beyond it, its constraint), counter-clockwise
        let mut rim: Vec<(u32, u32, u32)> = Vec::with_capacity(star.len() + 1);
        for &t in &star {
            let k = (self.corner(t, s) + 1) % 3;
            rim.push((self.cells[t].corners[k], self.cells[t].neighbours[k], self.cells[t].constraints[k]));
        }
        let last = star[star.len() - 1];
        if is_open {
            // a site of the hull: its star has two ends
            rim.push((self.cells[last].corners[(self.corner(last, s) + 2) % 3], NONE, NONE));
        }
        let mut made = Vec::with_capacity(star.len());
        for &t in &star {
            let n = rim.len();
            let mut corners = if is_open { 1..n - 1 } else { 0..n };
            let ear = corners.find(|&i| self.is_ear(&rim, i));
            let Some(ear) = ear.filter(|_| is_open || n > 2) else { break };
            let (before, after) = ((ear + n - 1) % n, (ear + 1) % n);
            let [a, b, c] = [rim[before], rim[ear], rim[after]];
            // three edges are left of the last cell
            let last = if n == 3 && !is_open { c } else { (c.0, NONE, NONE) };
            self.cells[t].corners = [a.0, b.0, c.0];
            self.cells[t].neighbours = [a.1, b.1, last.1];
            self.cells[t].constraints = [a.2, b.2, last.2];
            for k in 0..3 {
                self.meet(t, k);
            }
            self.renewed(t);
            [a, b, c].iter().for_each(|corner| cell_at[corner.0 as usize] = t as u32);
            made.push(t);
            rim[before] = (a.0, t as u32, NONE);
            rim.remove(ear);
        }
        if !is_open && made.len() + 2 < star.len() {
            return None;
        }
        star[made.len()..].iter().for_each(|&t| self.cells[t].corners = [NONE; 3]);
        for edge in rim.windows(2).filter(|_| is_open) {
            let [(start, beyond, _), (end, ..)] = [edge[0], edge[1]];
            // an edge without any cell
            let beyond = (beyond != NONE).then_some(beyond as usize)?;
            let back = (0..3).find(|&k| self.cells[beyond].corners[k] == end)?;
            self.cells[beyond].neighbours[back] = NONE;
            [start, end].iter().for_each(|&s| cell_at[s as usize] = beyond as u32);
        }
        Some(made)
    }

    /// Makes a chord between two sites an edge by flips, and adds those of the cells that it makes to `stack`. `None` where it
    /// passes through a site or crosses a chord.
    fn force(
        &mut self,
        ends: [u32; 2],
        chord: u32,
        cell_at: &mut [u32],
        stack: &mut Vec<(usize, usize)>,
    ) -> Option<()> {
        let [a, b] = ends;
        let mut crossed = self.crossed(cell_at[a as usize] as usize, ends)?;
        let most = MOST_FLIPS * (1 + crossed.len() * crossed.len());
        let mut tries = 0;
        while let Some([u, v]) = crossed.pop_front() {
            tries += 1;
            let t = self.around(cell_at[u as usize] as usize, u).find(|&t| self.beside(t, u, 1) == v)?;
            let k = self.corner(t, u);
            let other = self.cells[t].neighbours[k] as usize;
            let back = self.edge_to(other, t);
            let (w, x) = (self.cells[t].corners[(k + 2) % 3], self.cells[other].corners[(back + 2) % 3]);
            let turn = |corners: [u32; 3]| {
                let [p, q, r] = corners.map(|s| &self.points[s as usize]);
                orient(p, q, r)
            };
            if turn([u, x, w]) <= 0.0 || turn([x, v, w]) <= 0.0 {
                // not convex: later
                crossed.push_back([u, v]);
                (tries <= most).then_some(())?;
                continue;
            }
            let meets = ![w, x].iter().any(|s| ends.contains(s)) && (turn([a, b, w]) > 0.0) != (turn([a, b, x]) > 0.0);
            crossed.extend(meets.then_some([w, x]));
            self.flip((t, k), (other, back));
            [u, x, w].iter().for_each(|&s| cell_at[s as usize] = t as u32);
            cell_at[v as usize] = other as u32;
            stack.extend([t, other].into_iter().flat_map(|t| (0..3).map(move |k| (t, k))));
        }
        let (mut found, mut is_free) = (false, true);
        let star: Vec<usize> = self.around(cell_at[a as usize] as usize, a).collect();
        for t in star {
            let k = self.corner(t, a);
            for (step, k, code) in [(1, k, 2 * chord), (2, (k + 2) % 3, 2 * chord + 1)] {
                if self.beside(t, a, step) == b {
                    is_free &= self.cells[t].constraints[k] == NONE;
                    found = true;
                    self.cells[t].constraints[k] = code;
                }
            }
        }
        (found && is_free).then_some(())
    }

    /// The edges that a line between two sites crosses, from a cell of the first on, each with its end on the right first. `None`
    /// where it passes through a site or crosses a chord.
    fn crossed(&self, t: usize, [a, b]: [u32; 2]) -> Option<VecDeque<[u32; 2]>> {
        let side = |s: u32| orient(&self.points[a as usize], &self.points[b as usize], &self.points[s as usize]);
        let mut first = None;
        for t in self.around(t, a) {
            let (right, left) = (self.beside(t, a, 1), self.beside(t, a, 2));
            if right == b || left == b {
                return Some(VecDeque::new());
            }
            if side(right) < 0.0 && side(left) > 0.0 {
                first = Some((t, right, left));
            }
        }
        let (mut t, mut right, mut left) = first?;
        let mut crossed = VecDeque::new();
        loop {
            let k = self.corner(t, right);
            if self.cells[t].constraints[k] != NONE || self.cells[t].neighbours[k] == NONE {
                return None;
            }
            crossed.push_back([right, left]);
            t = self.cells[t].neighbours[k] as usize;
            let next = self.beside(t, right, 1);
            let turn = side(next);
            if next == b {
                return Some(crossed);
            }
            *(if turn > 0.0 { &mut left } else { &mut right }) = next;
            (turn != 0.0).then_some(())?;
        }
    }

    /// The corner of a cell some steps after a site, counter-clockwise.
    fn beside(&self, t: usize, s: u32, steps: usize) -> u32 {
        self.cells[t].corners[(self.corner(t, s) + steps) % 3]
    }

    /// Tells the cell beyond an edge of a cell that this one is there.
    fn meet(&mut self, t: usize, k: usize) {
        let (next, start, end) =
            (self.cells[t].neighbours[k], self.cells[t].corners[k], self.cells[t].corners[(k + 1) % 3]);
        if let Some(&Cell { corners, .. }) = self.cells.get(next as usize) {
            let back = (0..3).find(|&j| corners[j] == end && corners[(j + 1) % 3] == start);
            back.into_iter().for_each(|j| self.cells[next as usize].neighbours[j] = t as u32);
        }
    }

    /// Whether a corner of a polygon can be cut off.
    fn is_ear(&self, rim: &[(u32, u32, u32)], i: usize) -> bool {
        let n = rim.len();
        let corners = [rim[(i + n - 1) % n].0, rim[i].0, rim[(i + 1) % n].0];
        let [a, b, c] = corners.map(|s| &self.points[s as usize]);
        let is_within = |p: &Point<2>| orient(a, b, p) >= 0.0 && orient(b, c, p) >= 0.0 && orient(c, a, p) >= 0.0;
        let mut others = rim.iter().filter(|(s, ..)| !corners.contains(s));
        orient(a, b, c) > 0.0 && !others.any(|(s, ..)| is_within(&self.points[*s as usize]))
    }
}

#[cfg(test)]
mod tests {
    use super::super::order::sort_sites;
    use super::super::trim::{Trimmed, least_angle};
    use crate::domain::Chord;
    use crate::point::{NONE, Point};
    use crate::triangulation::{Cell, Constraint, hull, sort_spatially};

    /// Numbers below a bound, the same ones every time.
    fn numbers(mut state: u64) -> impl FnMut(usize) -> usize {
        move |bound| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) as usize % bound
        }
    }

    fn chord(name: u32, vertices: [u32; 2]) -> Chord {
        Chord { chain: name, from: 0, to: 1, vertices, farthest: 0, deviation_2: 0.0 }
    }

    /// The triangulation of some points, in order, and the chords that are no edges of it.
    fn anew(points: &[Point<2>], sites: &[u32], chords: &[Chord]) -> (Trimmed, Vec<u32>) {
        let mut sites = sites.to_vec();
        sort_spatially(&mut sites, |s| points[s as usize]);
        let mut points: Vec<Point<2>> = sites.iter().map(|&s| points[s as usize]).collect();
        let place = |v: u32| sites.iter().position(|&s| s == v).expect("an end of a chord is a site") as u32;
        let constraint = |c: &Chord| Constraint { ends: c.vertices.map(place), left: true, right: true, wall: true };
        let constraints: Vec<Constraint> = chords.iter().map(constraint).collect();
        let (mut cells, failed) = hull(&points, &constraints).expect("no points repeat");
        sort_sites(&mut sites, &mut points, &mut cells);
        let angle = cells.iter().map(|cell| least_angle(&cell.corners.map(|s| points[s as usize]))).collect();
        let (label, part, parts_at, is_slit) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut trimmed = Trimmed { label, part, parts_at, is_slit, sites, points, cells, angle };
        trimmed.sort_cells();
        (trimmed, failed)
    }

    #[test]
    fn what_is_mended_is_what_would_be_made_anew() {
        let (mut mended, mut forced, mut from_hull) = (0, 0, 0);
        for seed in 0..4000 {
            let mut next = numbers(seed);
            // on a small grid, where many points lie on one circle, and on a large one
            let side = if seed % 2 == 0 { 12 } else { 1 << 20 };
            let mut points: Vec<Point<2>> = (0..100).map(|_| [next(side) as f64, next(side) as f64]).collect();
            points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
            points.dedup();
            let n = points.len();
            (1..n).rev().for_each(|k| points.swap(k, next(k + 1)));
            let all: Vec<u32> = (0..n as u32).collect();
            // edges of the triangulation, some of them as chords, and some that are no edges yet
            let free = anew(&points, &all, &[]).0;
            let mut pairs: Vec<[u32; 2]> =
                (0..12).map(|_| free.cells[next(free.cells.len())].corners).map(|[a, b, _]| [a, b]).collect();
            pairs.extend((0..4).map(|_| [next(n) as u32, next(n) as u32]).filter(|[a, b]| a != b));
            pairs.iter_mut().for_each(|pair| pair.sort_unstable());
            pairs.sort_unstable();
            pairs.dedup();
            let mut old: Vec<Chord> = (0..).zip(&pairs).map(|(k, &pair)| chord(k, pair)).collect();
            let failed = anew(&points, &all, &old).1;
            let mut at = 0;
            old.retain(|_| {
                at += 1;
                !failed.contains(&(at - 1))
            });
            let (before, failed) = anew(&points, &all, &old);
            if !failed.is_empty() {
                continue;
            }
            let gone: Vec<u32> = (0..1 + next(4)).map(|_| next(n) as u32).collect();
            let left: Vec<u32> = all.into_iter().filter(|s| !gone.contains(s)).collect();
            let mut new: Vec<Chord> =
                old.iter().filter(|c| !c.vertices.iter().any(|v| gone.contains(v))).copied().collect();
            new.retain(|_| next(4) > 0);
            (1..new.len()).rev().for_each(|k| new.swap(k, next(k + 1)));
            // an edge becomes a chord, or what is none yet
            let cells: Vec<[u32; 3]> = free.cells.iter().map(|cell| cell.corners).collect();
            let [a, b, c] = cells[next(cells.len())];
            let farther = cells
                .iter()
                .flatten()
                .copied()
                .find(|s| cells.iter().any(|cell| cell.contains(s) && cell.contains(&c)));
            let b = if next(2) == 0 { b } else { farther.unwrap_or(b) };
            let is_new = !pairs.contains(&[a.min(b), a.max(b)]) && left.contains(&a) && left.contains(&b) && a != b;
            if is_new {
                new.push(chord(1000, [b, a]));
            }
            let (made, failed) = anew(&points, &left, &new);
            let Some(again) = before.clone().again(&left, &old, &new) else { continue };
            assert!(failed.is_empty(), "{seed}");
            let has = |trimmed: &Trimmed, ends: [u32; 2]| {
                let place = ends.map(|s| trimmed.sites.iter().position(|&site| site == s).unwrap_or(0) as u32);
                trimmed.cells.iter().any(|cell| place.iter().all(|s| cell.corners.contains(s)))
            };
            forced += usize::from(is_new && !has(&before, [a, b]));
            let at_hull =
                |&cell: &Cell| (0..3).filter(move |&k| cell.neighbours[k] == NONE).map(move |k| cell.corners[k]);
            let mut on_hull = before.cells.iter().flat_map(at_hull);
            from_hull += usize::from(on_hull.any(|s| gone.contains(&before.sites[s as usize])));
            assert_eq!((&again.sites, &again.points), (&made.sites, &made.points), "{seed}");
            assert_eq!(again.cells, made.cells, "{seed}");
            assert_eq!(again.angle, made.angle, "{seed}");
            mended += 1;
        }
        assert!(mended > 1000 && forced > 100 && from_hull > 100, "{mended} {forced} {from_hull}");
    }
}
