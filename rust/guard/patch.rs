//! A constrained Delaunay triangulation that is changed locally, and changed back.
//!
//! Ties of cocircular points are broken as if the lifting of the point with the lowest name were raised a little, so the
//! triangulation is unique: a quadrilateral on a circle has the diagonal that avoids its lowest name. Predicates are exact.

mod facets;
mod points;

use crate::point::{NONE, Point, encloses_by_name, in_circle, orient};
use crate::triangulation::{Cell, staying};
use rayon::prelude::*;

/// Steps of a walk after which a point counts as not found.
const MOST_STEPS: usize = 256;

/// Cells that a change takes away on one side of a chord, at the most: filling a hole takes time cubic in them, and where
/// needles gather around a node no single change helps.
const MOST_GONE: usize = 24;

/// Room for the rounding of a squared cosine, relative.
const ROOM: f64 = 1e-12;

/// Products of squares under this may have lost digits to underflow.
const VANISHING: f64 = 1e-290;

/// One point for so many is expected to be added.
const ADDED: usize = 32;

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
    /// Cells as they were before the changes at hand.
    saved: Vec<(u32, Cell)>,
    saved_at: Vec<(u32, u32)>,
    /// What `saved`, `saved_at` and `cells` held before each of the changes at hand.
    before: Vec<[usize; 3]>,
    /// Whether a cell is in `saved`, by the number of the change.
    stamp: Vec<u32>,
    change: u32,
    mark: Vec<u32>,
    marks: u32,
    /// The cell on each side of each chord: 2 c is left of chord c, 2 c + 1 right of it.
    beside: Vec<u32>,
    /// Whether a chord runs where the level had none before: its angles count.
    is_fresh: Vec<bool>,
}

impl Patch {
    /// Takes over cells beside a number of chords; `names` break ties.
    pub fn new(mut points: Vec<Point<2>>, mut names: Vec<u32>, mut cells: Vec<Cell>, chords: usize) -> Patch {
        let count = cells.len();
        // a few more of all without taking all to another place
        let (more_points, more_cells) = (points.len() / ADDED, 3 * count / ADDED);
        points.reserve_exact(more_points);
        names.reserve_exact(more_points);
        cells.reserve_exact(more_cells);
        let [stamp, mark] = [(); 2].map(|()| {
            let mut zeros = vec![0; count + more_cells];
            zeros.truncate(count);
            zeros
        });
        let mut at = Vec::with_capacity(points.len() + more_points);
        at.resize(points.len(), NONE);
        for (t, cell) in cells.iter().enumerate() {
            cell.corners.iter().for_each(|&v| at[v as usize] = t as u32);
        }
        let mut patch = Patch {
            points,
            names,
            cells,
            at,
            saved: Vec::new(),
            saved_at: Vec::new(),
            before: Vec::new(),
            stamp,
            change: 0,
            mark,
            marks: 0,
            beside: vec![NONE; 2 * chords],
            is_fresh: vec![false; chords],
        };
        let has_chord = |&t: &u32| patch.cells[t as usize].constraints != [NONE; 3];
        let at_chords: Vec<u32> = (0..count as u32).into_par_iter().filter(has_chord).collect();
        at_chords.into_iter().for_each(|t| patch.register(t));
        patch.break_ties();
        patch
    }

    /// The points, and the cells without those that are gone.
    pub fn into_parts(self) -> (Vec<Point<2>>, Vec<Cell>) {
        (self.points, staying(self.cells, |_, cell| *cell != DEAD))
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

    /// Keeps the changes at hand for good.
    pub fn keep(&mut self) {
        self.saved.clear();
        self.saved_at.clear();
        self.before.clear();
    }

    /// Starts a change, after those at hand.
    pub fn begin(&mut self) {
        self.before.push([self.saved.len(), self.saved_at.len(), self.cells.len()]);
        self.change += 1;
    }

    /// Undoes the last of the changes at hand.
    pub fn roll_back(&mut self) {
        let Some([saved, saved_at, cells]) = self.before.pop() else { return };
        while self.saved.len() > saved
            && let Some((t, cell)) = self.saved.pop()
        {
            self.cells[t as usize] = cell;
            self.register(t);
        }
        for (v, t) in self.saved_at.drain(saved_at..).rev() {
            self.at[v as usize] = t;
        }
        self.cells.truncate(cells);
        self.stamp.truncate(cells);
        self.mark.truncate(cells);
        self.change += 1;
    }

    /// Cells that the changes at hand took away, as they were, and those they made. One that was taken away and made again
    /// is both.
    fn touched(&self) -> (Vec<(u32, Cell)>, Vec<u32>) {
        let first_new = self.before.first().map_or(self.cells.len(), |before| before[2]);
        let differs = |one: &Cell, two: &Cell| one.corners != two.corners || one.constraints != two.constraints;
        let mut gone: Vec<(u32, Cell, bool)> = Vec::with_capacity(12);
        for &(t, old) in self.saved.iter().filter(|(t, _)| (*t as usize) < first_new) {
            // only a chain of changes saves a cell more than once
            match gone.iter_mut().find(|one| self.before.len() > 1 && one.0 == t) {
                Some(one) => one.2 |= differs(&one.1, &old),
                None => gone.push((t, old, differs(&old, &self.cells[t as usize]))),
            }
        }
        let gone: Vec<(u32, Cell)> = gone.into_iter().filter(|one| one.2).map(|(t, old, _)| (t, old)).collect();
        let mut made: Vec<u32> =
            gone.iter().map(|&(t, _)| t).chain(first_new as u32..self.cells.len() as u32).collect();
        made.retain(|&t| self.cells[t as usize] != DEAD);
        (gone, made)
    }

    /// Numbers of the cells that the changes at hand took away, and of those they made.
    pub fn numbers(&self) -> (Vec<u32>, Vec<u32>) {
        let (gone, made) = self.touched();
        (gone.into_iter().map(|(t, _)| t).collect(), made)
    }

    /// Cosine of the smallest angle among the cells that the changes at hand took away, and the cells they made; those
    /// that are there as before are left out.
    pub fn difference(&self) -> (f64, Vec<u32>) {
        let (mut gone, mut made) = self.touched();
        let key = |cell: &Cell| {
            let mut corners = cell.corners;
            corners.sort_unstable();
            (corners, self.sharpness_of(cell).to_bits())
        };
        let keys_gone: Vec<_> = gone.iter().map(|(_, old)| key(old)).collect();
        let keys_made: Vec<_> = made.iter().map(|&t| key(&self.cells[t as usize])).collect();
        let mut is_old = keys_made.iter().map(|key| keys_gone.contains(key));
        made.retain(|_| !is_old.next().unwrap_or(false));
        let mut is_back = keys_gone.iter().map(|key| keys_made.contains(key));
        gone.retain(|_| !is_back.next().unwrap_or(false));
        (gone.iter().map(|(_, old)| self.sharpness_of(old)).fold(-1.0, f64::max), made)
    }

    /// Cosine of the smallest angle of a cell, angles between two chords that were there before left aside.
    pub fn sharpness(&self, t: u32) -> f64 {
        self.sharpness_of(&self.cells[t as usize])
    }

    /// False where the cell is gone, and where [`Patch::sharpness`] is not over `sharp` (not negative); needs no root.
    pub fn may_be_sharper(&self, t: u32, sharp: f64) -> bool {
        let cell = &self.cells[t as usize];
        if *cell == DEAD {
            return false;
        }
        let edges = self.edges(cell);
        let square = edges.map(|e| e[0] * e[0] + e[1] * e[1]);
        let least = sharp * sharp * (1.0 - ROOM);
        (0..3).any(|k| {
            let j = (k + 2) % 3;
            let scalar = -(edges[k][0] * edges[j][0] + edges[k][1] * edges[j][1]);
            let product = square[k] * square[j];
            // what is no number, vanishes or overflows in floats is left to the roots
            let is_plain = (VANISHING..f64::INFINITY).contains(&product);
            !(is_plain && (scalar < 0.0 || scalar * scalar < least * product))
        })
    }

    /// The edges of a cell as vectors.
    fn edges(&self, cell: &Cell) -> [Point<2>; 3] {
        let p = cell.corners.map(|v| self.points[v as usize]);
        let edge = |k: usize| [p[(k + 1) % 3][0] - p[k][0], p[(k + 1) % 3][1] - p[k][1]];
        [edge(0), edge(1), edge(2)]
    }

    fn sharpness_of(&self, cell: &Cell) -> f64 {
        let edges = self.edges(cell);
        let length = edges.map(|e| (e[0] * e[0] + e[1] * e[1]).sqrt());
        let mut most = -1.0;
        for k in 0..3 {
            let j = (k + 2) % 3;
            let is_old = |c: u32| c != NONE && !self.is_fresh[c as usize / 2];
            if is_old(cell.constraints[k]) && is_old(cell.constraints[j]) {
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
        let is_old = self.before.last().is_some_and(|before| k < before[2]);
        if is_old && self.stamp[k] != self.change {
            self.stamp[k] = self.change;
            self.saved.push((t, self.cells[k]));
        }
        self.cells[k] = cell;
        self.register(t);
    }

    /// Notes the chords that a cell lies beside.
    fn register(&mut self, t: u32) {
        for c in self.cells[t as usize].constraints {
            if c != NONE {
                self.beside[c as usize] = t;
            }
        }
    }

    fn push(&mut self, cell: Cell) -> u32 {
        self.cells.push(cell);
        self.stamp.push(0);
        self.mark.push(0);
        self.cells.len() as u32 - 1
    }

    fn set_at(&mut self, v: u32, t: u32) {
        if !self.before.is_empty() {
            self.saved_at.push((v, self.at[v as usize]));
        }
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
        let det = in_circle(self.point(a), self.point(b), self.point(c), self.point(d));
        if det != 0.0 {
            return det > 0.0;
        }
        let all = [a, b, c, d];
        encloses_by_name(all.map(|v| self.point(v)), all.map(|v| self.names[v as usize]))
    }

    /// Flips edges until the triangulation is the one that the tie rule asks for.
    fn break_ties(&mut self) {
        // few edges have a tie, and which is seen without changing any, from the first of the two cells beside each
        let has_tie =
            |&t: &u32| (0..3).any(|k| self.cells[t as usize].neighbours[k] > t && self.wrong_diagonal(t, k).is_some());
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
}

#[cfg(test)]
mod tests {
    use super::{Cell, NONE, Patch};
    use proptest::prelude::*;

    /// A cell alone, two of its edges given by length and turn.
    fn lone(size: f64, turn: f64, angle: f64, ratio: f64) -> Patch {
        let place = |length: f64, turn: f64| [size * length * turn.cos(), size * length * turn.sin()];
        let points = vec![[0.0; 2], place(1.0, turn), place(ratio, turn + angle)];
        let cell = Cell { corners: [0, 1, 2], neighbours: [NONE; 3], constraints: [NONE; 3] };
        Patch::new(points, vec![0, 1, 2], vec![cell], 0)
    }

    #[test]
    fn no_cell_is_passed_over_where_products_of_squares_overflow() {
        let patch = lone(1e77, 0.0, 1.94, 0.66);
        assert!(patch.may_be_sharper(0, patch.sharpness(0).next_down()));
    }

    proptest! {
        #[test]
        fn no_cell_over_a_bound_is_passed_over(
            turn in 0.0..7.0f64, angle in 1e-4..3.1f64, ratio in 1.0..10.0f64, orders in -12..0, size in -170..150,
            ulps in 1..40u64,
        ) {
            let size = 10f64.powi(size);
            let patch = lone(size, turn, angle, 10f64.powi(orders) * ratio);
            let sharpness = patch.sharpness(0);
            prop_assert!(patch.may_be_sharper(0, f64::from_bits(sharpness.to_bits() - ulps)));
            let plain = if orders < -3 { 1e-60..1e60 } else { 1e-70..1e70 };
            prop_assert!(!plain.contains(&size) || !patch.may_be_sharper(0, sharpness * (1.0 + 1e-9)));
        }
    }
}
