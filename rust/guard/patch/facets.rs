//! Chords of a patch: split at a point, or two of them joined.

use super::{DEAD, MOST_GONE, MOST_STEPS, Patch, Rim};
use crate::point::{NONE, orient};

/// Cells, and the edges around them.
type Hole = (Vec<u32>, Vec<Rim>);

impl Patch {
    /// Adds a chord, yet without cells.
    pub fn add_chord(&mut self, is_fresh: bool) {
        self.beside.extend([NONE; 2]);
        self.is_fresh.push(is_fresh);
    }

    /// Takes back the last chord added.
    pub fn forget_chord(&mut self) {
        self.beside.truncate(self.beside.len() - 2);
        self.is_fresh.pop();
    }

    /// Whether a chord runs where the level had none before.
    pub fn is_fresh(&self, chord: u32) -> bool {
        self.is_fresh[chord as usize]
    }

    /// Chords at the edges of a cell, then at those of its neighbours.
    pub fn chords_near(&self, t: u32, first: u32) -> Vec<u32> {
        let mut chords = Vec::new();
        let mut add = |t: u32, first: u32| {
            let cell = &self.cells[t as usize];
            let start = (0..3).find(|&k| cell.corners[k] == first).unwrap_or(0);
            for k in (0..3).map(|k| (start + k) % 3) {
                let chord = cell.constraints[k] / 2;
                if cell.constraints[k] != NONE && !chords.contains(&chord) {
                    chords.push(chord);
                }
            }
        };
        add(t, first);
        let cell = self.cells[t as usize];
        let start = (0..3).find(|&k| cell.corners[k] == first).unwrap_or(0);
        for k in (0..3).map(|k| (start + k) % 3) {
            if cell.constraints[k] == NONE && cell.neighbours[k] != NONE {
                add(cell.neighbours[k], cell.corners[k]);
            }
        }
        chords
    }

    /// Splits a chord at a point that was added, into the chords that were made last. `fits` is asked for every point it
    /// would be joined to. False, and nothing changed by this call, where it can't be.
    pub fn split(&mut self, v: u32, chord: u32, into: [u32; 2], fits: impl Fn(u32) -> bool) -> bool {
        let sides = [2 * chord, 2 * chord + 1].map(|side| (side, self.beside[side as usize]));
        let mut fans = Vec::with_capacity(2);
        for (side, t) in sides.into_iter().filter(|&(_, t)| t != NONE) {
            match self.fan(v, t, side, &fits) {
                Some(fan) => fans.push((side, fan)),
                None => return false,
            }
        }
        let Some(&(side, t)) = sides.iter().find(|&&(_, t)| t != NONE) else { return false };
        let cell = self.cells[t as usize];
        let Some(k) = (0..3).find(|&k| cell.constraints[k] == side) else { return false };
        let is_shared = cell.neighbours[k] != NONE;
        let mut ends = Vec::with_capacity(2);
        for (side, (cavity, rims)) in fans {
            if cavity.is_empty() {
                let t = self.beside[side as usize];
                let mut cell = self.cells[t as usize];
                cell.constraints = cell.constraints.map(|c| if c == side { NONE } else { c });
                self.set(t, cell);
            }
            let [to, from] =
                if side % 2 == 0 { [2 * into[0], 2 * into[1]] } else { [2 * into[1] + 1, 2 * into[0] + 1] };
            ends.push(self.fill(v, cavity, &rims, to, from));
        }
        if let (true, [left, right]) = (is_shared, &ends[..]) {
            // (cell whose chord leads to v, cell whose chord leads away from it)
            for (one, other, way) in
                [(left.0, right.1, 1), (right.1, left.0, 2), (left.1, right.0, 2), (right.0, left.1, 1)]
            {
                let mut cell = self.cells[one as usize];
                cell.neighbours[way] = other;
                self.set(one, cell);
            }
        }
        true
    }

    /// The cells that a point on or near a chord takes away on one side, and what is left around them but the chord.
    fn fan(&mut self, v: u32, t: u32, side: u32, fits: &impl Fn(u32) -> bool) -> Option<Hole> {
        let cell = self.cells[t as usize];
        let k = (0..3).find(|&k| cell.constraints[k] == side)?;
        let p = self.points[v as usize];
        let [from, to] = [cell.corners[k], cell.corners[(k + 1) % 3]];
        let takes = self.in_circle(cell.corners, v);
        if orient(self.point(from), self.point(to), &p) > 0.0 && !takes {
            return None;
        }
        let (cavity, mut rims) = if takes { self.cavity(v, t) } else { (Vec::new(), Vec::new()) };
        if takes {
            rims.retain(|rim| rim.constraint != side);
        } else {
            rims.push(Rim { ends: [to, from], behind: t, constraint: NONE });
        }
        let is_seen = |rim: &Rim| orient(self.point(rim.ends[0]), self.point(rim.ends[1]), &p) > 0.0;
        let is_fan = rims.len() == cavity.len() + 1 && rims.iter().all(is_seen);
        (is_fan && rims.iter().all(|rim| fits(rim.ends[0]) && fits(rim.ends[1]))).then_some((cavity, rims))
    }

    /// The chords at a point, of which one must end there and one begin.
    pub fn chords_of(&self, v: u32) -> Option<[u32; 2]> {
        let mut found = [NONE; 2];
        for (way, found) in found.iter_mut().enumerate() {
            let mut t = self.at[v as usize];
            for _ in 0..MOST_STEPS {
                let cell = self.cells[t as usize];
                let k = (0..3).find(|&k| cell.corners[k] == v)?;
                let edge = if way == 0 { k } else { (k + 2) % 3 };
                if cell.constraints[edge] != NONE {
                    *found = cell.constraints[edge] / 2;
                    break;
                }
                t = cell.neighbours[edge];
            }
        }
        (!found.contains(&NONE)).then_some(found)
    }

    /// Takes away a point at which a chord ends and another begins, and joins these into the chord that was made last.
    /// False where it can't be; the change at hand must then be rolled back.
    pub fn merge(&mut self, v: u32, [one, two]: [u32; 2], into: u32) -> bool {
        let mut beside = [NONE; 2];
        let mut is_shared = true;
        let mut made = Vec::new();
        let sides = [[2 * two, 2 * one, 2 * into], [2 * one + 1, 2 * two + 1, 2 * into + 1]];
        for (side, [first, last, closing]) in sides.into_iter().enumerate() {
            if self.beside[first as usize] == NONE {
                is_shared = false;
                continue;
            }
            match self.half_star(v, first, last) {
                Some(((star, mut rims), is_open)) => {
                    is_shared &= is_open;
                    let [from, to] = [rims[rims.len() - 1].ends[1], rims[0].ends[0]];
                    let (a, b) = (self.points[from as usize], self.points[to as usize]);
                    let inner = rims.iter().skip(1).map(|rim| rim.ends[0]);
                    if rims.len() == 1 || !inner.into_iter().all(|w| orient(&a, &b, self.point(w)) > 0.0) {
                        return false;
                    }
                    star.iter().for_each(|&t| self.set(t, DEAD));
                    rims.push(Rim { ends: [from, to], behind: NONE, constraint: closing });
                    made.extend(&star);
                    if !self.clip(star, rims) {
                        return false;
                    }
                    beside[side] = self.beside[closing as usize];
                }
                None => return false,
            }
        }
        self.set_at(v, NONE);
        if is_shared {
            for (t, other, side) in [(beside[0], beside[1], 2 * into), (beside[1], beside[0], 2 * into + 1)] {
                let mut cell = self.cells[t as usize];
                let Some(k) = (0..3).find(|&k| cell.constraints[k] == side) else { return false };
                cell.neighbours[k] = other;
                self.set(t, cell);
            }
        }
        // where the domain grew, the cells around may no longer be Delaunay
        made.into_iter().all(|t| self.is_delaunay(t))
    }

    /// Cells around a point from one constraint to another counter-clockwise, the edges across from it, and whether there
    /// are cells beyond the first constraint that know of these.
    fn half_star(&self, v: u32, first: u32, last: u32) -> Option<(Hole, bool)> {
        let (mut star, mut rims) = (Vec::with_capacity(8), Vec::with_capacity(8));
        let mut t = self.beside[first as usize];
        let start = self.cells[t as usize];
        let is_open = (0..3).any(|k| start.constraints[k] == first && start.neighbours[k] != NONE);
        while star.len() < MOST_GONE {
            let cell = self.cells[t as usize];
            let k = (0..3).find(|&k| cell.corners[k] == v)?;
            let (rim, across) = ((k + 1) % 3, (k + 2) % 3);
            star.push(t);
            rims.push(Rim {
                ends: [cell.corners[rim], cell.corners[(rim + 1) % 3]],
                behind: cell.neighbours[rim],
                constraint: cell.constraints[rim],
            });
            if cell.constraints[across] == last {
                return Some(((star, rims), is_open));
            }
            if cell.constraints[across] != NONE || cell.neighbours[across] == NONE {
                return None;
            }
            t = cell.neighbours[across];
        }
        None
    }

    fn is_delaunay(&self, t: u32) -> bool {
        let cell = self.cells[t as usize];
        cell == DEAD
            || (0..3).filter(|&k| cell.constraints[k] == NONE && cell.neighbours[k] != NONE).all(|k| {
                let other = &self.cells[cell.neighbours[k] as usize];
                let across = (0..3).find(|&j| other.neighbours[j] == t).map(|j| other.corners[(j + 2) % 3]);
                across.is_some_and(|d| !self.in_circle(cell.corners, d))
            })
    }
}
