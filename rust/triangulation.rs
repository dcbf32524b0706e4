//! Constrained Delaunay triangulation; the only file that names spade.
//!
//! Points are inserted in the order given (callers give a spatial one: a walk from the last point is then short).
//! Cells outside the domain are found by flooding up to its walls, not by spade's parity rule, which takes a loop of
//! interior facets for a hole.

use crate::error::Error;
use crate::point::{NONE, Point};
use rayon::prelude::*;
use spade::handles::{DirectedEdgeHandle, FixedVertexHandle};
use spade::{CdtEdge, ConstrainedDelaunayTriangulation, Point2, Triangulation as _};

type Cdt = ConstrainedDelaunayTriangulation<Point2<f64>>;
type Edge<'a> = DirectedEdgeHandle<'a, Point2<f64>, (), CdtEdge<()>, ()>;

/// Smallest magnitude that spade takes; what is nearer to zero is taken for zero.
const TINY: f64 = spade::MIN_ALLOWED_VALUE;

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

/// Cells of a triangulation.
#[derive(Debug, Clone, Default)]
pub struct Cells {
    /// Corner points of each cell, counter-clockwise.
    pub cells: Vec<[u32; 3]>,
    /// Neighbour across the edge that starts at each corner, [`NONE`] at a wall.
    pub neighbours: Vec<[u32; 3]>,
    /// Constraint on that edge times two, plus one where the cell lies on its right; [`NONE`] where it is no constraint.
    pub constraints: Vec<[u32; 3]>,
}

/// Inserts the points in their order; `name` is what messages call a point.
fn insert_all(points: &[Point<2>], name: impl Fn(usize) -> u32) -> Result<Cdt, Error> {
    let mut cdt = Cdt::with_capacity(points.len(), points.len() * 3, points.len() * 2);
    for (i, p) in points.iter().enumerate() {
        let [x, y] = p.map(|c| if c.abs() < TINY { 0.0 } else { c });
        let handle =
            cdt.insert(Point2::new(x, y)).map_err(|e| Error::Argument(format!("point {} at {p:?}: {e}", name(i))))?;
        if handle.index() != i {
            return Err(Error::Argument(format!("point {} repeats point {} at {p:?}", name(i), name(handle.index()))));
        }
    }
    Ok(cdt)
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
    let mut cdt = insert_all(&sorted, |k| order[k])?;
    if let Some(&bad) = constrain(&mut cdt, moved.iter().copied()).first() {
        let [a, b] = edges[bad as usize];
        return Err(Error::Argument(format!(
            "'facets' row {bad} (points {a} and {b}) crosses another facet or passes through a point"
        )));
    }
    Ok(cdt.inner_faces().map(|face| face.vertices().map(|v| order[v.fix().index()])).collect())
}

/// Outcome of [`inside`].
pub enum Inside {
    /// The cells of the domain.
    Cells(Cells),
    /// Constraints that could not be added.
    Failed(Vec<u32>),
}

/// Cells of the constrained Delaunay triangulation that lie inside the walls.
///
/// What lies outside is flooded, from the hull and from the sides of walls that have no cells: mostly a small part.
pub fn inside(points: &[Point<2>], constraints: &[Constraint]) -> Result<Inside, Error> {
    let mut cdt = insert_all(points, |k| k as u32)?;
    let failed = constrain(&mut cdt, constraints.iter().map(|c| c.ends));
    if !failed.is_empty() {
        return Ok(Inside::Failed(failed));
    }
    let mut on_edge = vec![NONE; cdt.num_directed_edges()];
    let (mut within, mut outside) = (Vec::new(), Outside::new(&cdt));
    for (c, constraint) in constraints.iter().enumerate() {
        let [a, b] = constraint.ends;
        let Some(edge) = cdt.get_edge_from_neighbors(vertex(a), vertex(b)) else { continue };
        on_edge[edge.fix().index()] = 2 * c as u32;
        on_edge[edge.rev().fix().index()] = 2 * c as u32 + 1;
        for (edge, is_inside) in [(edge, constraint.left), (edge.rev(), constraint.right)] {
            if is_inside {
                within.push(edge.face());
            } else if constraint.wall {
                outside.visit(edge);
            }
        }
    }
    let is_wall = |edge: Edge<'_>| {
        let c = on_edge[edge.fix().index()];
        c != NONE && constraints[c as usize / 2].wall
    };
    for edge in cdt.convex_hull() {
        [edge, edge.rev()].into_iter().filter(|&edge| !is_wall(edge)).for_each(|edge| outside.visit(edge));
    }
    outside.flood(&cdt, is_wall);
    if within.iter().any(|face| face.is_outer() || outside.is_in[face.fix().index()]) {
        return Err(Error::Internal("the flood of the outside came into the domain".into()));
    }
    let faces: Vec<FaceHandle> = cdt.fixed_inner_faces().filter(|face| !outside.is_in[face.index()]).collect();
    let mut cell_of = vec![NONE; cdt.num_all_faces()];
    faces.iter().zip(0..).for_each(|(face, t)| cell_of[face.index()] = t);
    let cell = |&face: &FaceHandle| {
        let edges = cdt.face(face).adjacent_edges();
        let beyond = |edge: Edge<'_>| if is_wall(edge) { NONE } else { cell_of[edge.rev().face().fix().index()] };
        let corners = edges.map(|e| e.from().fix().index() as u32);
        (corners, (edges.map(beyond), edges.map(|e| on_edge[e.fix().index()])))
    };
    let (cells, (neighbours, constraints)) = faces.par_iter().map(cell).unzip();
    Ok(Inside::Cells(Cells { cells, neighbours, constraints }))
}

/// The faces outside of a domain.
struct Outside {
    is_in: Vec<bool>,
    reached: Vec<FaceHandle>,
}

impl Outside {
    fn new(cdt: &Cdt) -> Self {
        Outside { is_in: vec![false; cdt.num_all_faces()], reached: Vec::new() }
    }

    /// Takes in the face on the left of an edge.
    fn visit(&mut self, edge: Edge<'_>) {
        if let Some(face) = edge.face().as_inner().map(|face| face.fix())
            && !self.is_in[face.index()]
        {
            self.is_in[face.index()] = true;
            self.reached.push(face);
        }
    }

    fn flood(&mut self, cdt: &Cdt, is_wall: impl Fn(Edge<'_>) -> bool) {
        let mut at = 0;
        while at < self.reached.len() {
            for edge in cdt.face(self.reached[at]).adjacent_edges() {
                if !is_wall(edge) {
                    self.visit(edge.rev());
                }
            }
            at += 1;
        }
    }
}

/// All cells of the constrained Delaunay triangulation of the convex hull, neighbours across constraints too, and the
/// constraints that could not be added.
pub fn hull(points: &[Point<2>], constraints: &[Constraint]) -> Result<(Cells, Vec<u32>), Error> {
    let mut cdt = insert_all(points, |k| k as u32)?;
    let failed = constrain(&mut cdt, constraints.iter().map(|c| c.ends));
    let mut on_edge = vec![NONE; cdt.num_directed_edges()];
    for (c, constraint) in constraints.iter().enumerate() {
        let [a, b] = constraint.ends;
        let Some(edge) = cdt.get_edge_from_neighbors(vertex(a), vertex(b)) else { continue };
        on_edge[edge.fix().index()] = 2 * c as u32;
        on_edge[edge.rev().fix().index()] = 2 * c as u32 + 1;
    }
    let mut cell_of = vec![NONE; cdt.num_all_faces()];
    cdt.inner_faces().zip(0..).for_each(|(face, t)| cell_of[face.fix().index()] = t);
    let mut out = Cells::default();
    for face in cdt.inner_faces() {
        let edges = face.adjacent_edges();
        out.cells.push(edges.map(|e| e.from().fix().index() as u32));
        out.constraints.push(edges.map(|e| on_edge[e.fix().index()]));
        out.neighbours.push(edges.map(|e| cell_of[e.rev().face().fix().index()]));
    }
    Ok((out, failed))
}

type FaceHandle = spade::handles::FixedFaceHandle<spade::handles::InnerTag>;

/// Sorts indices along a Hilbert curve through the bounding box of their points, ties by index.
pub fn sort_spatially(indices: &mut Vec<u32>, point: impl Fn(u32) -> Point<2> + Sync) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for &i in indices.iter() {
        for (k, x) in point(i).into_iter().enumerate() {
            low[k] = low[k].min(x);
            high[k] = high[k].max(x);
        }
    }
    let extent = (high[0] - low[0]).max(high[1] - low[1]);
    let scale = if extent > 0.0 { f64::from(u32::MAX) / extent } else { 0.0 };
    let mut keyed: Vec<(u64, u32)> = indices
        .par_iter()
        .map(|&i| {
            let [x, y] = point(i);
            (hilbert(((x - low[0]) * scale) as u32, ((y - low[1]) * scale) as u32), i)
        })
        .collect();
    keyed.par_sort_unstable();
    indices.clear();
    indices.extend(keyed.into_iter().map(|(_, i)| i));
}

/// Place of a cell of a 2^32 by 2^32 lattice along the Hilbert curve.
fn hilbert(mut x: u32, mut y: u32) -> u64 {
    let mut place = 0u64;
    for bit in (0..32).rev() {
        let (rx, ry) = ((x >> bit) & 1, (y >> bit) & 1);
        place = place << 2 | u64::from((3 * rx) ^ ry);
        if ry == 0 {
            if rx == 1 {
                (x, y) = (!x, !y);
            }
            (x, y) = (y, x);
        }
    }
    place
}
