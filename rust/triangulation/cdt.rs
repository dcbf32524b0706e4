//! One constrained Delaunay triangulation, made by spade.

use super::Cells;
use crate::error::Error;
use crate::point::{NONE, Point};
use rayon::prelude::*;
use spade::handles::{FixedFaceHandle, FixedVertexHandle, InnerTag};
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};

type Cdt = ConstrainedDelaunayTriangulation<Point2<f64>>;

/// Smallest magnitude that spade takes but for zero.
const LEAST: f64 = spade::MIN_ALLOWED_VALUE;

/// Exponent of the largest power of two that spade takes.
const MOST_EXPONENT: i32 = 200;

/// Cells that one thread writes in one go.
const GRAIN: usize = 4096;

/// All cells of the constrained Delaunay triangulation of the convex hull, neighbours across constraints too, and the
/// constraints that could not be added. `name` is what messages call a point.
pub(super) fn triangulated(
    points: &[Point<2>],
    ends: &[[u32; 2]],
    name: impl Fn(usize) -> u32,
) -> Result<(Cells, Vec<u32>), Error> {
    let mut cdt = insert_all(points, name)?;
    let failed = constrain(&mut cdt, ends.iter().copied());
    let mut on_edge = vec![NONE; cdt.num_directed_edges()];
    for (c, &[a, b]) in ends.iter().enumerate() {
        let Some(edge) = cdt.get_edge_from_neighbors(vertex(a), vertex(b)) else { continue };
        on_edge[edge.fix().index()] = 2 * c as u32;
        on_edge[edge.rev().fix().index()] = 2 * c as u32 + 1;
    }
    // spade counts the outer face first
    let cell_of = |face: usize| face.checked_sub(1).map_or(NONE, |t| t as u32);
    let cell = |face: FixedFaceHandle<InnerTag>| {
        let edges = cdt.face(face).adjacent_edges();
        let corners = edges.map(|e| e.from().fix().index() as u32);
        let beyond = edges.map(|e| cell_of(e.rev().face().fix().index()));
        (corners, (beyond, edges.map(|e| on_edge[e.fix().index()])))
    };
    let faces: Vec<_> = cdt.fixed_inner_faces().collect();
    let (cells, (neighbours, constraints)) = faces.into_par_iter().with_min_len(GRAIN).map(cell).unzip();
    Ok((Cells { cells, neighbours, constraints }, failed))
}

/// Inserts the points in their order.
fn insert_all(points: &[Point<2>], name: impl Fn(usize) -> u32) -> Result<Cdt, Error> {
    let mut cdt = Cdt::with_capacity(points.len(), points.len() * 3, points.len() * 2);
    let scale = scale(points);
    for (i, p) in points.iter().enumerate() {
        // what vanishes beside the largest coordinate is taken for zero
        let [x, y] = p.map(|c| c * scale).map(|c| if c.abs() < LEAST { 0.0 } else { c });
        let handle =
            cdt.insert(Point2::new(x, y)).map_err(|e| Error::Argument(format!("point {} at {p:?}: {e}", name(i))))?;
        if handle.index() != i {
            return Err(Error::Argument(format!("point {} repeats point {} at {p:?}", name(i), name(handle.index()))));
        }
    }
    Ok(cdt)
}

/// A power of two that brings all coordinates into the range of spade: 1 where they are, or else one that brings the largest to
/// its upper end. No sign of a determinant changes by it.
fn scale(points: &[Point<2>]) -> f64 {
    let sizes = || points.iter().flatten().map(|c| c.abs());
    let most = sizes().fold(0.0, f64::max);
    let is_small = |c: f64| c > 0.0 && c < LEAST;
    if most < power_of_two(MOST_EXPONENT) && !sizes().any(is_small) {
        return 1.0;
    }
    let exponent = (most.to_bits() >> 52) as i32 - 1023;
    power_of_two((MOST_EXPONENT - 1 - exponent).clamp(-1022, 1023))
}

fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

fn vertex(i: u32) -> FixedVertexHandle {
    FixedVertexHandle::from_index(i as usize)
}

/// Adds the constraints; returns those that can't be: they cross one that is there, or pass through a point.
fn constrain(cdt: &mut Cdt, ends: impl Iterator<Item = [u32; 2]>) -> Vec<u32> {
    let mut failed = Vec::new();
    for (c, [a, b]) in ends.enumerate() {
        if cdt.can_add_constraint(vertex(a), vertex(b)) {
            cdt.add_constraint(vertex(a), vertex(b));
        }
        let there = cdt.get_edge_from_neighbors(vertex(a), vertex(b));
        if !there.is_some_and(|edge| edge.is_constraint_edge()) {
            failed.push(c as u32);
        }
    }
    failed
}
