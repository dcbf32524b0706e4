//! Points of a patch: inserted, or taken away and their hole filled.

use super::{DEAD, MOST_GONE, MOST_STEPS, Patch, Rim};
use crate::point::{NONE, Point, orient};
use crate::triangulation::Cell;

impl Patch {
    /// The cell that holds a point, walking from a cell; `None` where a wall is in the way.
    fn locate(&self, p: &Point<2>, from: u32) -> Option<u32> {
        let mut t = from;
        for step in 0..MOST_STEPS {
            let cell = &self.cells[t as usize];
            // from the lowest name on: the way must not depend on where a cell begins
            let name = |k: usize| self.names[cell.corners[k] as usize];
            let first = (1..3).fold(0, |least, k| if name(k) < name(least) { k } else { least });
            let out = (0..3)
                .map(|k| (first + k + step) % 3)
                .find(|&k| orient(self.point(cell.corners[k]), self.point(cell.corners[(k + 1) % 3]), p) < 0.0);
            match out {
                None => return Some(t),
                Some(k) if cell.neighbours[k] == NONE || cell.constraints[k] != NONE => return None,
                Some(k) => t = cell.neighbours[k],
            }
        }
        None
    }

    /// Inserts a point that was added, walking from a cell. `fits` is asked for every point it would be joined to. False,
    /// and nothing changed by this call, where it can't be.
    pub fn insert(&mut self, v: u32, from: u32, fits: impl Fn(u32) -> bool) -> bool {
        let p = self.points[v as usize];
        let Some(first) = self.locate(&p, from) else { return false };
        let (cavity, rims) = self.cavity(v, first);
        let is_seen = |rim: &Rim| orient(self.point(rim.ends[0]), self.point(rim.ends[1]), &p) > 0.0;
        if rims.len() != cavity.len() + 2 || !rims.iter().all(|rim| is_seen(rim) && fits(rim.ends[0])) {
            return false;
        }
        self.fill(v, cavity, &rims, NONE, NONE);
        true
    }

    /// Cells in whose circle a point lies, from one of them on, and the edges around them; no edges where the cells are too
    /// many.
    pub(super) fn cavity(&mut self, v: u32, first: u32) -> (Vec<u32>, Vec<Rim>) {
        self.marks += 1;
        self.mark[first as usize] = self.marks;
        let mut cavity = vec![first];
        let mut rims: Vec<Rim> = Vec::with_capacity(12);
        let mut next = 0;
        while next < cavity.len() {
            if cavity.len() > MOST_GONE {
                return (cavity, Vec::new());
            }
            let cell = self.cells[cavity[next] as usize];
            next += 1;
            for k in 0..3 {
                let behind = cell.neighbours[k];
                let is_free = behind != NONE && cell.constraints[k] == NONE;
                if is_free && self.mark[behind as usize] == self.marks {
                    continue;
                }
                if is_free && self.in_circle(self.cells[behind as usize].corners, v) {
                    self.mark[behind as usize] = self.marks;
                    cavity.push(behind);
                } else {
                    rims.push(Rim {
                        ends: [cell.corners[k], cell.corners[(k + 1) % 3]],
                        behind,
                        constraint: cell.constraints[k],
                    });
                }
            }
        }
        // a cell may join the cavity after an edge to it was taken for rim
        rims.retain(|rim| rim.behind == NONE || rim.constraint != NONE || self.mark[rim.behind as usize] != self.marks);
        (cavity, rims)
    }

    /// Joins a point to the edges around a cavity. Where these leave a gap, constraint `to` leads to the point and `from`
    /// away from it; returns the cells beside these.
    pub(super) fn fill(&mut self, v: u32, cavity: Vec<u32>, rims: &[Rim], to: u32, from: u32) -> (u32, u32) {
        let mut ids = cavity;
        while ids.len() < rims.len() {
            ids.push(self.push(DEAD));
        }
        let mut ends = (NONE, NONE);
        for (k, rim) in rims.iter().enumerate() {
            let [a, b] = rim.ends;
            let after = rims.iter().position(|other| other.ends[0] == b).map_or(NONE, |i| ids[i]);
            let before = rims.iter().position(|other| other.ends[1] == a).map_or(NONE, |i| ids[i]);
            let mut cell = Cell {
                corners: [a, b, v],
                neighbours: [rim.behind, after, before],
                constraints: [rim.constraint, NONE, NONE],
            };
            if after == NONE {
                cell.constraints[1] = to;
                ends.0 = ids[k];
                self.set_at(b, ids[k]);
            }
            if before == NONE {
                cell.constraints[2] = from;
                ends.1 = ids[k];
            }
            self.set(ids[k], cell);
            self.face(rim.behind, b, ids[k]);
            self.set_at(a, ids[k]);
        }
        self.set_at(v, ids[0]);
        ends
    }

    /// Removes a point with no constraint at it. False where it can't be; the change at hand must then be rolled back.
    pub fn remove(&mut self, v: u32) -> bool {
        let first = self.at[v as usize];
        let (mut star, mut rims): (Vec<u32>, Vec<Rim>) = (Vec::with_capacity(8), Vec::with_capacity(8));
        let mut t = first;
        loop {
            let cell = self.cells[t as usize];
            let Some(k) = (0..3).find(|&k| cell.corners[k] == v) else { return false };
            let rim = (k + 1) % 3;
            star.push(t);
            rims.push(Rim {
                ends: [cell.corners[rim], cell.corners[(rim + 1) % 3]],
                behind: cell.neighbours[rim],
                constraint: cell.constraints[rim],
            });
            // counter-clockwise: across the edge that ends at v
            let across = (k + 2) % 3;
            if cell.constraints[across] != NONE || cell.neighbours[across] == NONE || star.len() > MOST_GONE {
                return false;
            }
            t = cell.neighbours[across];
            if t == first {
                break;
            }
        }
        star.iter().for_each(|&t| self.set(t, DEAD));
        self.set_at(v, NONE);
        self.clip(star, rims)
    }

    /// Fills the hole that some edges surround, with cells whose numbers are given.
    pub(super) fn clip(&mut self, mut ids: Vec<u32>, mut rims: Vec<Rim>) -> bool {
        while rims.len() > 2 {
            let count = rims.len();
            let ear = (0..count).find(|&i| {
                let (one, two) = (rims[i], rims[(i + 1) % count]);
                let corners = [one.ends[0], one.ends[1], two.ends[1]];
                let p = corners.map(|v| self.points[v as usize]);
                let others = || rims.iter().map(|rim| rim.ends[0]).filter(|v| !corners.contains(v));
                orient(&p[0], &p[1], &p[2]) > 0.0 && others().all(|d| !self.in_circle(corners, d))
            });
            let (Some(i), Some(t)) = (ear, ids.pop()) else { return false };
            let (one, two) = (rims[i], rims[(i + 1) % count]);
            let [a, b, c] = [one.ends[0], one.ends[1], two.ends[1]];
            // of three edges the last is the third side, else the new edge waits for its other cell
            let third =
                if count == 3 { rims[(i + 2) % 3] } else { Rim { ends: [c, a], behind: NONE, constraint: NONE } };
            let cell = Cell {
                corners: [a, b, c],
                neighbours: [one.behind, two.behind, third.behind],
                constraints: [one.constraint, two.constraint, third.constraint],
            };
            self.set(t, cell);
            self.face(one.behind, b, t);
            self.face(two.behind, c, t);
            self.face(third.behind, a, t);
            [a, b, c].into_iter().for_each(|v| self.set_at(v, t));
            if count == 3 {
                break;
            }
            rims[i] = Rim { ends: [a, c], behind: t, constraint: NONE };
            rims.remove((i + 1) % count);
        }
        true
    }
}
