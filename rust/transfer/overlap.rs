//! Areas that the cells of a finer mesh share with the cells of a coarser one.
//!
//! From a node that was located, a walk leads to the middle of the finer cell; from the coarse cell there the search
//! floods over the coarse edges as long as cells are cut. It does not cross the boundary, so a finer cell is cut with cells
//! of its own side only. Triangles are cut by half-planes (Sutherland and Hodgman 1974).

use super::halfedges::HalfEdges;
use super::prolongation::Located;
use super::rows::{Block, Rows};
use super::walk::walk;
use crate::error::Error;
use crate::point::{NONE, Point};
use rayon::prelude::*;

/// Less than this share of a finer cell's area is taken for a touch.
const TOUCH: f64 = 1e-13;

/// Finer cells that one thread cuts at a time.
const CHUNK: usize = 1024;

/// The areas by finer cell (rows) and coarse cell (columns); a finer cell that lies outside has one entry, 0, at the
/// coarse cell next to it. Runtime: O(pairs of cells that meet).
pub fn areas(
    points: &[Point<2>],
    cells: &[[u32; 3]],
    coarse: &HalfEdges<'_>,
    located: &Located<'_>,
) -> Result<Rows, Error> {
    let starts: Vec<usize> = (0..cells.len()).step_by(CHUNK).collect();
    let blocks = starts.into_par_iter().map(|start| {
        let mut block = Block::default();
        let mut flood = Vec::new();
        for cell in &cells[start..(start + CHUNK).min(cells.len())] {
            cut(points, cell, coarse, located, &mut flood)?;
            flood.sort_unstable_by_key(|entry: &(u32, f64)| entry.0);
            block.counts.push(flood.len() as u32);
            block.indices.extend(flood.iter().map(|entry| entry.0 as i32));
            block.data.extend(flood.drain(..).map(|entry| entry.1));
        }
        Ok(block)
    });
    Rows::stacked(coarse.cells.len(), blocks.collect::<Result<_, Error>>()?)
}

/// Gathers the coarse cells that a finer cell shares area with.
fn cut(
    points: &[Point<2>],
    cell: &[u32; 3],
    coarse: &HalfEdges<'_>,
    located: &Located<'_>,
    flood: &mut Vec<(u32, f64)>,
) -> Result<(), Error> {
    let places = &located.places;
    let corners = cell.map(|i| points[i as usize]);
    let middle = [0, 1].map(|d| (corners[0][d] + corners[1][d] + corners[2][d]) / 3.0);
    let whole = area(&corners);
    let is_tip = |i: u32| places[i as usize].node(coarse).is_some_and(|node| coarse.is_tip(node));
    // a walk may start in the wrong cell of a tip only
    let order = |&i: &u32| (is_tip(i), places[i as usize].is_outside(), i);
    let from = cell.iter().copied().min_by_key(order).unwrap_or(cell[0]) as usize;
    let home = walk(coarse, &located.walls, &points[from], &places[from], NONE, &middle)?;
    let mut seen: Vec<u32> = vec![home.cell];
    if home.is_outside() {
        // the middle is outside: what lies inside is found from the nodes there
        seen.extend(cell.iter().map(|&i| places[i as usize].cell));
        seen.sort_unstable();
        seen.dedup();
    }
    let starts = seen.len();
    let mut at = 0;
    while at < seen.len() {
        let other = seen[at];
        let shared = common(&corners, &coarse.cells[other as usize].map(|i| coarse.points[i as usize]));
        let cuts = shared > TOUCH * whole.abs();
        if cuts {
            flood.push((other, shared));
        }
        if cuts || at < starts {
            for h in 3 * other..3 * other + 3 {
                let across = coarse.twin(h);
                if across != NONE && !seen.contains(&(across / 3)) {
                    seen.push(across / 3);
                }
            }
        }
        at += 1;
    }
    if flood.is_empty() {
        flood.push((home.cell, 0.0));
    }
    Ok(())
}

/// The area of a polygon, with respect to its first corner (so that far from the origin nothing cancels).
fn area(polygon: &[Point<2>]) -> f64 {
    let Some(o) = polygon.first() else { return 0.0 };
    let cross =
        |pair: &[Point<2>]| (pair[0][0] - o[0]) * (pair[1][1] - o[1]) - (pair[0][1] - o[1]) * (pair[1][0] - o[0]);
    polygon.windows(2).map(cross).sum::<f64>() / 2.0
}

/// The area that two triangles share.
fn common(one: &[Point<2>; 3], other: &[Point<2>; 3]) -> f64 {
    for d in 0..2 {
        let (low, high) = (one.iter().map(|p| p[d]), other.iter().map(|p| p[d]));
        let ends = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
        };
        let (a, b) = (ends(&mut low.into_iter()), ends(&mut high.into_iter()));
        if a.1 <= b.0 || b.1 <= a.0 {
            return 0.0;
        }
    }
    // three cuts of a triangle leave six corners at most
    let mut polygon = [[0.0; 2]; 8];
    polygon[..3].copy_from_slice(one);
    let mut n = 3;
    for k in 0..3 {
        let (a, b) = (other[k], other[(k + 1) % 3]);
        let side = |p: &Point<2>| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
        let mut kept = [[0.0; 2]; 8];
        let mut m = 0;
        for i in 0..n {
            let (p, q) = (polygon[i], polygon[(i + 1) % n]);
            let (s, t) = (side(&p), side(&q));
            if s >= 0.0 && m < 8 {
                kept[m] = p;
                m += 1;
            }
            if (s > 0.0 && t < 0.0 || s < 0.0 && t > 0.0) && m < 8 {
                let share = s / (s - t);
                kept[m] = [p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])];
                m += 1;
            }
        }
        (polygon, n) = (kept, m);
        if n < 3 {
            return 0.0;
        }
    }
    area(&polygon[..n])
}
