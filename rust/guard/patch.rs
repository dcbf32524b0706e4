//! A constrained Delaunay triangulation that is changed locally, and changed back.
//!
//! Ties of cocircular points are broken as if the lifting of the point with the lowest name were raised a little, so the
//! triangulation is unique: a quadrilateral on a circle has the diagonal that avoids its lowest name. Predicates are exact.

use crate::point::{NONE, Point, orient};
use crate::triangulation::Cells;
use rayon::prelude::*;

/// Steps of a walk after which a point counts as not found.
const MOST_STEPS: usize = 256;

#[derive(Clone, Copy, PartialEq)]
struct Cell {
    corners: [u32; 3],
    neighbours: [u32; 3],
    constraints: [u32; 3],
}

const DEAD: Cell = Cell { corners: [NONE; 3], neighbours: [NONE; 3], constraints: [NONE; 3] };

/// An edge of a cavity or hole, seen from inside: ends, cell behind it, constraint on it.
#[derive(Clone, Copy)]
struct Rim {
    ends: [u32; 2],
    behind: u32,
    constraint: u32,
}

/// The triangulation (see the module).
pub struct Patch {
    points: Vec<Point<2>>,
    names: Vec<u32>,
    cells: Vec<Cell>,
    /// A cell at each point.
    at: Vec<u32>,
    /// Cells as they were before the change at hand, and their number then.
    saved: Vec<(u32, Cell)>,
    saved_at: Vec<(u32, u32)>,
    first_new: usize,
    /// Whether a cell is in `saved`, by the number of the change.
    stamp: Vec<u32>,
    change: u32,
    mark: Vec<u32>,
    marks: u32,
}

impl Patch {
    /// Takes over cells; `names` break ties.
    pub fn new(points: Vec<Point<2>>, names: Vec<u32>, cells: &Cells) -> Patch {
        let count = cells.cells.len();
        let cell = |t: usize| Cell {
            corners: cells.cells[t],
            neighbours: cells.neighbours[t],
            constraints: cells.constraints[t],
        };
        let mut at = vec![NONE; points.len()];
        for (t, corners) in cells.cells.iter().enumerate() {
            corners.iter().for_each(|&v| at[v as usize] = t as u32);
        }
        let mut patch = Patch {
            points,
            names,
            cells: (0..count).into_par_iter().map(cell).collect(),
            at,
            saved: Vec::new(),
            saved_at: Vec::new(),
            first_new: count,
            stamp: vec![0; count],
            change: 0,
            mark: vec![0; count],
            marks: 0,
        };
        patch.begin();
        patch.break_ties();
        patch
    }

    /// The cells, without those that are gone.
    pub fn into_cells(self) -> Cells {
        let alive: Vec<u32> = (0..self.cells.len() as u32).filter(|&t| self.cells[t as usize] != DEAD).collect();
        let mut index = vec![NONE; self.cells.len()];
        alive.iter().zip(0..).for_each(|(&t, new)| index[t as usize] = new);
        let neighbour = |t: u32| if t == NONE { NONE } else { index[t as usize] };
        let cell = |&t: &u32| {
            let cell = &self.cells[t as usize];
            (cell.corners, (cell.neighbours.map(neighbour), cell.constraints))
        };
        let (cells, (neighbours, constraints)) = alive.par_iter().map(cell).unzip();
        Cells { cells, neighbours, constraints }
    }

    /// Number of cells ever made.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Corners of a cell, `None` once it is gone.
    pub fn corners(&self, t: u32) -> Option<[u32; 3]> {
        let cell = self.cells[t as usize];
        (cell != DEAD).then_some(cell.corners)
    }

    /// The point across the edge of a cell that starts at a corner, [`NONE`] where that is a constraint.
    pub fn across(&self, t: u32, corner: u32) -> u32 {
        let cell = &self.cells[t as usize];
        let Some(k) = (0..3).find(|&k| cell.corners[k] == corner) else { return NONE };
        if cell.constraints[k] != NONE || cell.neighbours[k] == NONE {
            return NONE;
        }
        let other = &self.cells[cell.neighbours[k] as usize];
        (0..3).find(|&j| other.neighbours[j] == t).map_or(NONE, |j| other.corners[(j + 2) % 3])
    }

    /// Names of a cell's corners, ascending.
    pub fn sorted_names(&self, t: u32) -> [u32; 3] {
        let mut names = self.cells[t as usize].corners.map(|v| self.names[v as usize]);
        names.sort_unstable();
        names
    }

    /// Coordinates of a point.
    pub fn point(&self, v: u32) -> &Point<2> {
        &self.points[v as usize]
    }

    /// Adds a point, not yet in any cell.
    pub fn add(&mut self, point: Point<2>, name: u32) -> u32 {
        self.points.push(point);
        self.names.push(name);
        self.at.push(NONE);
        self.points.len() as u32 - 1
    }

    /// Takes back the last point added.
    pub fn forget(&mut self) {
        self.points.pop();
        self.names.pop();
        self.at.pop();
    }

    /// Starts a change.
    pub fn begin(&mut self) {
        self.saved.clear();
        self.saved_at.clear();
        self.first_new = self.cells.len();
        self.change += 1;
    }

    /// Undoes the change at hand.
    pub fn roll_back(&mut self) {
        for &(t, cell) in self.saved.iter().rev() {
            self.cells[t as usize] = cell;
        }
        for &(v, t) in self.saved_at.iter().rev() {
            self.at[v as usize] = t;
        }
        self.cells.truncate(self.first_new);
        self.stamp.truncate(self.first_new);
        self.mark.truncate(self.first_new);
        self.begin();
    }

    /// Cells that the change at hand made, or made anew.
    pub fn made(&self) -> impl Iterator<Item = u32> {
        let changed =
            self.saved.iter().filter(|(t, old)| self.cells[*t as usize].corners != old.corners).map(|&(t, _)| t);
        changed.chain(self.first_new as u32..self.cells.len() as u32).filter(|&t| self.cells[t as usize] != DEAD)
    }

    /// The greatest cosine (the smallest angle) among the cells that the change took away, and among those it made.
    pub fn before_and_after(&self) -> (f64, f64) {
        let gone = self.saved.iter().filter(|(t, old)| self.cells[*t as usize].corners != old.corners);
        let before = gone.map(|(_, old)| self.sharpness_of(old)).fold(-1.0, f64::max);
        let after = self.made().map(|t| self.sharpness(t)).fold(-1.0, f64::max);
        (before, after)
    }

    /// Cosine of the smallest angle of a cell, angles between two constraints left aside.
    pub fn sharpness(&self, t: u32) -> f64 {
        self.sharpness_of(&self.cells[t as usize])
    }

    fn sharpness_of(&self, cell: &Cell) -> f64 {
        let p = cell.corners.map(|v| self.points[v as usize]);
        let edge = |k: usize| [p[(k + 1) % 3][0] - p[k][0], p[(k + 1) % 3][1] - p[k][1]];
        let edges = [edge(0), edge(1), edge(2)];
        let length = edges.map(|e| (e[0] * e[0] + e[1] * e[1]).sqrt());
        let mut most = -1.0;
        for k in 0..3 {
            let j = (k + 2) % 3;
            if cell.constraints[k] != NONE && cell.constraints[j] != NONE {
                continue;
            }
            let cosine = -(edges[k][0] * edges[j][0] + edges[k][1] * edges[j][1]) / (length[k] * length[j]);
            if cosine > most {
                most = cosine;
            }
        }
        most
    }

    fn set(&mut self, t: u32, cell: Cell) {
        let k = t as usize;
        if k < self.first_new && self.stamp[k] != self.change {
            self.stamp[k] = self.change;
            self.saved.push((t, self.cells[k]));
        }
        self.cells[k] = cell;
    }

    fn push(&mut self, cell: Cell) -> u32 {
        self.cells.push(cell);
        self.stamp.push(0);
        self.mark.push(0);
        self.cells.len() as u32 - 1
    }

    fn set_at(&mut self, v: u32, t: u32) {
        self.saved_at.push((v, self.at[v as usize]));
        self.at[v as usize] = t;
    }

    /// Makes `t` the neighbour of the cell `behind` across the edge that starts at `from` there.
    fn face(&mut self, behind: u32, from: u32, t: u32) {
        if behind != NONE {
            let mut cell = self.cells[behind as usize];
            if let Some(k) = (0..3).find(|&k| cell.corners[k] == from) {
                cell.neighbours[k] = t;
                self.set(behind, cell);
            }
        }
    }

    /// Whether `d` lies in the circle through `a`, `b`, `c` (counter-clockwise), ties broken by name.
    fn in_circle(&self, [a, b, c]: [u32; 3], d: u32) -> bool {
        let p = |v: u32| robust::Coord { x: self.points[v as usize][0], y: self.points[v as usize][1] };
        let det = robust::incircle(p(a), p(b), p(c), p(d));
        if det != 0.0 {
            return det > 0.0;
        }
        let Some(lowest) = [a, b, c, d].into_iter().min_by_key(|&v| self.names[v as usize]) else { return false };
        if lowest == d {
            return false;
        }
        // raising the lowest lifts the plane at d where d's barycentric coordinate for it is positive
        let (v, w) = if lowest == a {
            (b, c)
        } else if lowest == b {
            (c, a)
        } else {
            (a, b)
        };
        orient(self.point(v), self.point(w), self.point(d)) > 0.0
    }

    /// Flips edges until the triangulation is the one that the tie rule asks for.
    fn break_ties(&mut self) {
        // few cells have a tie, and who has one is seen without changing any
        let has_tie = |&t: &u32| (0..3).any(|k| self.wrong_diagonal(t, k).is_some());
        let mut waiting: Vec<u32> = (0..self.cells.len() as u32).into_par_iter().filter(has_tie).collect();
        waiting.reverse();
        while let Some(t) = waiting.pop() {
            for k in 0..3 {
                if let Some((other, j)) = self.wrong_diagonal(t, k)
                    && self.flip(t, k, other, j)
                {
                    waiting.extend([other, t]);
                    break;
                }
            }
        }
    }

    /// The cell across the edge k of a cell, and the number of that edge there, where the edge is not the one to have.
    fn wrong_diagonal(&self, t: u32, k: usize) -> Option<(u32, usize)> {
        let cell = &self.cells[t as usize];
        let other = cell.neighbours[k];
        if other == NONE || cell.constraints[k] != NONE {
            return None;
        }
        let across = &self.cells[other as usize];
        let j = (0..3).find(|&j| across.neighbours[j] == t)?;
        self.in_circle(cell.corners, across.corners[(j + 2) % 3]).then_some((other, j))
    }

    /// Replaces the edge between two cells by the other diagonal, where they form a convex quadrilateral.
    fn flip(&mut self, t: u32, k: usize, other: u32, j: usize) -> bool {
        let (one, two) = (self.cells[t as usize], self.cells[other as usize]);
        let (a, b, c) = (one.corners[k], one.corners[(k + 1) % 3], one.corners[(k + 2) % 3]);
        let d = two.corners[(j + 2) % 3];
        if orient(self.point(c), self.point(a), self.point(d)) <= 0.0
            || orient(self.point(d), self.point(b), self.point(c)) <= 0.0
        {
            return false;
        }
        let side = |cell: &Cell, k: usize| (cell.neighbours[k % 3], cell.constraints[k % 3]);
        let (bc, ca) = (side(&one, k + 1), side(&one, k + 2));
        let (ad, db) = (side(&two, j + 1), side(&two, j + 2));
        let cell = |corners, around: [(u32, u32); 3]| Cell {
            corners,
            neighbours: around.map(|s| s.0),
            constraints: around.map(|s| s.1),
        };
        self.set(t, cell([c, a, d], [ca, ad, (other, NONE)]));
        self.set(other, cell([d, b, c], [db, bc, (t, NONE)]));
        self.face(ad.0, d, t);
        self.face(bc.0, c, other);
        for (v, t) in [(a, t), (b, other), (c, t), (d, t)] {
            self.set_at(v, t);
        }
        true
    }

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
        self.marks += 1;
        self.mark[first as usize] = self.marks;
        let mut cavity = vec![first];
        let mut rims: Vec<Rim> = Vec::with_capacity(12);
        let mut next = 0;
        while next < cavity.len() {
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
        let is_seen = |rim: &Rim| orient(self.point(rim.ends[0]), self.point(rim.ends[1]), &p) > 0.0;
        if rims.len() != cavity.len() + 2 || !rims.iter().all(|rim| is_seen(rim) && fits(rim.ends[0])) {
            return false;
        }
        let ids: Vec<u32> =
            (0..rims.len()).map(|k| cavity.get(k).copied().unwrap_or_else(|| self.push(DEAD))).collect();
        for (k, rim) in rims.iter().enumerate() {
            let [a, b] = rim.ends;
            let after = rims.iter().position(|other| other.ends[0] == b).map_or(NONE, |i| ids[i]);
            let before = rims.iter().position(|other| other.ends[1] == a).map_or(NONE, |i| ids[i]);
            let cell = Cell {
                corners: [a, b, v],
                neighbours: [rim.behind, after, before],
                constraints: [rim.constraint, NONE, NONE],
            };
            self.set(ids[k], cell);
            self.face(rim.behind, b, ids[k]);
            self.set_at(a, ids[k]);
        }
        self.set_at(v, ids[0]);
        true
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
            if cell.constraints[across] != NONE || cell.neighbours[across] == NONE || star.len() > MOST_STEPS {
                return false;
            }
            t = cell.neighbours[across];
            if t == first {
                break;
            }
        }
        let mut ids = star.clone();
        star.iter().for_each(|&t| self.set(t, DEAD));
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
        self.set_at(v, NONE);
        true
    }
}
