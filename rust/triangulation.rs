//! Constrained Delaunay triangulation; its files alone name spade.
//!
//! Points are inserted in the order given (callers give a spatial one: a walk from the last point is then short).
//! Cells outside the domain are found by flooding up to its walls, not by spade's parity rule, which takes a loop of
//! interior facets for a hole.

mod cdt;
mod order;
mod strips;
#[cfg(test)]
mod tests;

pub use order::sort_spatially;

use crate::error::Error;
use crate::point::{NONE, Point};
use rayon::prelude::*;

/// A constrained edge and what may be flooded across it.
#[derive(Debug, Clone, Copy)]
pub struct Constraint {
    /// Its ends.
    pub ends: [u32; 2],
    /// Whether cells lie on its left.
    pub left: bool,
    /// Whether cells lie on its right.
    pub right: bool,
    /// Whether a flood stops here (boundary, slit), rather than passing (interface).
    pub wall: bool,
}

/// A cell of a triangulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell {
    /// Its corner points, counter-clockwise.
    pub corners: [u32; 3],
    /// The cell across the edge that starts at each corner, [`NONE`] at a wall.
    pub neighbours: [u32; 3],
    /// Constraint on that edge times two, plus one where the cell lies on its right; [`NONE`] where it is no constraint.
    pub constraints: [u32; 3],
}

/// Numbers that one thread goes through in one go.
const GRAIN: usize = 16_384;

/// Those of the first `n` numbers that stay, and the place of each among them, [`NONE`] for others.
pub(crate) fn counted(n: usize, stays: impl Fn(usize) -> bool + Sync) -> (Vec<u32>, Vec<u32>) {
    let kept: Vec<u32> = (0..n as u32).into_par_iter().filter(|&t| stays(t as usize)).collect();
    let mut places = vec![NONE; n];
    places.par_chunks_mut(GRAIN).enumerate().for_each(|(chunk, places)| {
        let first = chunk * GRAIN;
        let start = kept.partition_point(|&t| (t as usize) < first);
        let own = kept[start..].iter().zip(start as u32..).take_while(|&(&t, _)| (t as usize) < first + GRAIN);
        own.for_each(|(&t, place)| places[t as usize - first] = place);
    });
    (kept, places)
}

/// Delaunay triangulation of the convex hull, with given edges kept; points in any order are inserted along a Hilbert curve.
///
/// # Errors
/// [`Error::Argument`] where points repeat, or where an edge names no point, crosses another or passes through a point.
pub fn delaunay(points: &[Point<2>], edges: &[[u32; 2]]) -> Result<Vec<[u32; 3]>, Error> {
    for (row, ends) in edges.iter().enumerate() {
        if let Some(&i) = ends.iter().find(|&&i| i as usize >= points.len()) {
            return Err(Error::Argument(format!("'facets' row {row} names point {i} of {}", points.len())));
        }
    }
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    sort_spatially(&mut order, |i| points[i as usize]);
    let mut place = vec![0; points.len()];
    order.iter().enumerate().for_each(|(k, &i)| place[i as usize] = k as u32);
    let sorted: Vec<Point<2>> = order.iter().map(|&i| points[i as usize]).collect();
    let moved: Vec<[u32; 2]> = edges.iter().map(|ends| ends.map(|i| place[i as usize])).collect();
    let (cells, failed) = whole(&sorted, &moved, |k| order[k])?;
    if let Some(&bad) = failed.first() {
        let [a, b] = edges[bad as usize];
        return Err(Error::Argument(format!(
            "'facets' row {bad} (points {a} and {b}) crosses another facet or passes through a point"
        )));
    }
    Ok(cells.par_iter().map(|cell| cell.corners.map(|k| order[k as usize])).collect())
}

/// All cells of the constrained Delaunay triangulation of the convex hull, neighbours across constraints too, and the
/// constraints that could not be added.
pub fn hull(points: &[Point<2>], constraints: &[Constraint]) -> Result<(Vec<Cell>, Vec<u32>), Error> {
    let ends: Vec<[u32; 2]> = constraints.iter().map(|c| c.ends).collect();
    whole(points, &ends, |k| k as u32)
}

/// [`hull`] by the ends of its constraints; `name` is what messages call a point.
fn whole(points: &[Point<2>], ends: &[[u32; 2]], name: impl Fn(usize) -> u32) -> Result<(Vec<Cell>, Vec<u32>), Error> {
    match strips::in_strips(points, ends, strips::COLUMNS) {
        Ok(Some(cells)) => Ok((cells, Vec::new())),
        // what is wrong with the points, if anything, is said in their own names
        _ => cdt::triangulated(points, ends, name),
    }
}

/// Outcome of [`inside`].
pub enum Inside {
    /// The cells of the domain.
    Cells(Vec<Cell>),
    /// Constraints that could not be added.
    Failed(Vec<u32>),
}

/// Cells of the constrained Delaunay triangulation that lie inside the walls.
///
/// What lies outside is flooded, from the hull and from the sides of walls that have no cells: mostly a small part.
pub fn inside(points: &[Point<2>], constraints: &[Constraint]) -> Result<Inside, Error> {
    let (mut all, failed) = hull(points, constraints)?;
    if !failed.is_empty() {
        return Ok(Inside::Failed(failed));
    }
    let is_wall = |code: u32| code != NONE && constraints[code as usize / 2].wall;
    let has_cells = |code: u32| {
        let constraint = &constraints[code as usize / 2];
        if code.is_multiple_of(2) { constraint.left } else { constraint.right }
    };
    let is_edge = |&t: &usize| (0..3).any(|k| all[t].constraints[k] != NONE || all[t].neighbours[k] == NONE);
    let at_edges: Vec<usize> = (0..all.len()).into_par_iter().filter(is_edge).collect();
    let (mut is_out, mut reached, mut within) = (vec![false; all.len()], Vec::new(), Vec::new());
    for &t in &at_edges {
        for (&next, &code) in all[t].neighbours.iter().zip(&all[t].constraints) {
            if code != NONE && has_cells(code) {
                within.push(t);
            } else if is_wall(code) || (code == NONE && next == NONE) {
                reached.push(t);
            }
        }
    }
    reached.iter().for_each(|&t| is_out[t] = true);
    while let Some(t) = reached.pop() {
        for (&next, &code) in all[t].neighbours.iter().zip(&all[t].constraints) {
            if next != NONE && !is_wall(code) && !is_out[next as usize] {
                is_out[next as usize] = true;
                reached.push(next as usize);
            }
        }
    }
    if within.iter().any(|&t| is_out[t]) {
        return Err(Error::Internal("the flood of the outside came into the domain".into()));
    }
    for &t in &at_edges {
        let cell = &mut all[t];
        for k in (0..3).filter(|&k| is_wall(cell.constraints[k])) {
            cell.neighbours[k] = NONE;
        }
    }
    Ok(Inside::Cells(staying(all, |t, _| !is_out[t])))
}

/// The cells that stay, neighbours counted among them.
pub(crate) fn staying(mut cells: Vec<Cell>, stays: impl Fn(usize, &Cell) -> bool + Sync) -> Vec<Cell> {
    if cells.par_iter().enumerate().all(|(t, cell)| stays(t, cell)) {
        return cells;
    }
    let (_, place) = counted(cells.len(), |t| stays(t, &cells[t]));
    let number = |t: u32| if t == NONE { NONE } else { place[t as usize] };
    cells.par_iter_mut().for_each(|cell| cell.neighbours = cell.neighbours.map(number));
    let mut places = place.iter();
    cells.retain(|_| places.next().is_some_and(|&place| place != NONE));
    cells
}
