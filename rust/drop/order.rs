//! One order of sites and cells, and one triangulation where points lie on one circle, whoever made it.
//!
//! What is done to a level goes by angles and areas, and by the order of cells where those are equal; on a grid many are.
//! So that levels are a matter of the input alone, sites are ascending, a cell begins with its lowest corner, cells are
//! sorted, and of points on one circle it is as if the lifting of the lowest were raised a little.

use super::trim::{Trimmed, least_angle};
use crate::point::{NONE, Point, encloses_by_name, in_circle};
use crate::triangulation::Cell;

/// Sorts sites, their points, and the corners of cells with them.
pub fn sort_sites(sites: &mut [u32], points: &mut [Point<2>], cells: &mut [Cell]) {
    let mut order: Vec<u32> = (0..sites.len() as u32).collect();
    order.sort_unstable_by_key(|&s| sites[s as usize]);
    let mut place = vec![0; order.len()];
    (0u32..).zip(&order).for_each(|(k, &s)| place[s as usize] = k);
    let sorted: Vec<(u32, Point<2>)> = order.iter().map(|&s| (sites[s as usize], points[s as usize])).collect();
    for (k, (site, point)) in sorted.into_iter().enumerate() {
        (sites[k], points[k]) = (site, point);
    }
    cells.iter_mut().flat_map(|cell| &mut cell.corners).for_each(|s| *s = place[*s as usize]);
}

impl Trimmed {
    /// Puts the cells of a Delaunay triangulation in order.
    pub(super) fn sort_cells(&mut self) {
        (0..self.cells.len()).for_each(|t| self.turn_to_lowest(t));
        let all = (0..self.cells.len()).flat_map(|t| (0..3).map(move |k| (t, k))).collect();
        self.settle(all, |trimmed, t, k| trimmed.cells[t].constraints[k] == NONE);
        self.put_in_order();
    }

    /// Sorts the cells; those without corners are left out.
    pub(super) fn put_in_order(&mut self) {
        let cells = &self.cells;
        let is_cell = |(corners, _): &([u32; 3], u32)| corners[0] != NONE;
        let mut order: Vec<([u32; 3], u32)> = cells.iter().map(|cell| cell.corners).zip(0..).filter(is_cell).collect();
        order.sort_unstable();
        let mut place = vec![0; cells.len()];
        (0u32..).zip(&order).for_each(|(k, &(_, t))| place[t as usize] = k);
        let moved = |t: u32| if t == NONE { NONE } else { place[t as usize] };
        let cell = |&(_, t): &([u32; 3], u32)| {
            let cell = cells[t as usize];
            Cell { neighbours: cell.neighbours.map(moved), ..cell }
        };
        self.cells = order.iter().map(cell).collect();
        self.angle = order.iter().map(|&(_, t)| self.angle[t as usize]).collect();
    }

    /// Has a cell begin with its lowest corner.
    pub(super) fn turn_to_lowest(&mut self, t: usize) {
        let cell = self.cells[t].corners;
        let k = (0..3).min_by_key(|&k| cell[k]).unwrap_or(0);
        self.cells[t].corners.rotate_left(k);
        self.cells[t].neighbours.rotate_left(k);
        self.cells[t].constraints.rotate_left(k);
    }

    /// Puts a cell that was made anew in order, and takes its angle.
    pub(super) fn renewed(&mut self, t: usize) {
        self.turn_to_lowest(t);
        self.angle[t] = least_angle(&self.cells[t].corners.map(|s| self.points[s as usize]));
    }

    /// Whether a site lies in the circle of a cell.
    pub(super) fn encloses(&self, t: usize, site: u32) -> bool {
        let cell = self.cells[t].corners;
        let ([a, b, c], d) = (cell.map(|s| &self.points[s as usize]), &self.points[site as usize]);
        let sign = in_circle(a, b, c, d);
        if sign == 0.0 { encloses_by_name([a, b, c, d], [cell[0], cell[1], cell[2], site]) } else { sign > 0.0 }
    }
}
