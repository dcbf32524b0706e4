//! One constrained Delaunay triangulation, made by spade.

use super::Cell;
use crate::error::Error;
use crate::point::{NONE, Point, orient, power_of_two, scale_to};
use rayon::prelude::*;
use spade::handles::{FixedFaceHandle, FixedVertexHandle, InnerTag};
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};
use std::cmp::Ordering;

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
) -> Result<(Vec<Cell>, Vec<u32>), Error> {
    let third = off_the_line(points);
    if third == points.len() && third > FEW {
        return along_a_line(points, ends, name).map(|failed| (Vec::new(), failed));
    }
    // while all points lie on a line, each costs spade as much as all before
    let order = Order { third: if third > FEW { third } else { 2 } };
    let mut cdt = insert_all(points, order, name)?;
    let vertex = |i: u32| FixedVertexHandle::from_index(order.place(i as usize));
    let turned = turned(ends, points.len());
    let from_to = |c: usize| if turned[c] { [ends[c][1], ends[c][0]] } else { ends[c] }.map(vertex);
    let failed = constrain(&mut cdt, (0..ends.len()).map(from_to));
    let mut on_edge = vec![NONE; cdt.num_directed_edges()];
    for c in 0..ends.len() {
        let [from, to] = from_to(c);
        let Some(edge) = cdt.get_edge_from_neighbors(from, to) else { continue };
        let sides = [edge.fix().index(), edge.rev().fix().index()];
        on_edge[sides[usize::from(turned[c])]] = 2 * c as u32;
        on_edge[sides[usize::from(!turned[c])]] = 2 * c as u32 + 1;
    }
    // spade counts the outer face first
    let cell_of = |face: usize| face.checked_sub(1).map_or(NONE, |t| t as u32);
    let cell = |face: FixedFaceHandle<InnerTag>| {
        let edges = cdt.face(face).adjacent_edges();
        Cell {
            corners: edges.map(|e| order.point(e.from().fix().index()) as u32),
            neighbours: edges.map(|e| cell_of(e.rev().face().fix().index())),
            constraints: edges.map(|e| on_edge[e.fix().index()]),
        }
    };
    let faces: Vec<_> = cdt.fixed_inner_faces().collect();
    Ok((faces.into_par_iter().with_min_len(GRAIN).map(cell).collect(), failed))
}

/// So many points on a line are no matter.
const FEW: usize = 16;

/// With more constraints at a point they are looked for from their other ends: spade goes around the first end of each.
const MANY: usize = 64;

/// Which constraints are better looked for from their second end.
fn turned(ends: &[[u32; 2]], n: usize) -> Vec<bool> {
    let mut count = vec![0; n];
    ends.iter().flatten().for_each(|&i| count[i as usize] += 1);
    ends.iter().map(|&[a, b]| count[a as usize] > MANY.max(count[b as usize])).collect()
}

/// The order in which points are inserted: their own, but for one that is brought forward to be the third.
#[derive(Clone, Copy)]
struct Order {
    third: usize,
}

impl Order {
    /// The point at a place of the order.
    fn point(self, place: usize) -> usize {
        match place {
            2 => self.third,
            place if place > 2 && place <= self.third => place - 1,
            place => place,
        }
    }

    /// The place of a point in the order.
    fn place(self, point: usize) -> usize {
        match point {
            point if point == self.third => 2,
            point if point >= 2 && point < self.third => point + 1,
            point => point,
        }
    }
}

/// The first point that is not on one line with those before it; their number where there is none.
fn off_the_line(points: &[Point<2>]) -> usize {
    let [a, b, rest @ ..] = points else { return points.len() };
    rest.iter().position(|c| orient(a, b, c) != 0.0).map_or(points.len(), |k| k + 2)
}

/// The constraints that can't be edges where all points lie on a line: those that are not between neighbours.
fn along_a_line(points: &[Point<2>], ends: &[[u32; 2]], name: impl Fn(usize) -> u32) -> Result<Vec<u32>, Error> {
    let at = |&i: &usize| (points[i][0] + 0.0, points[i][1] + 0.0);
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|a, b| at(a).partial_cmp(&at(b)).unwrap_or(Ordering::Equal));
    if let Some(pair) = order.windows(2).find(|pair| at(&pair[0]) == at(&pair[1])) {
        return Err(repeats(points, pair[1], pair[0], name));
    }
    let mut rank = vec![0; points.len()];
    order.iter().enumerate().for_each(|(k, &i)| rank[i] = k);
    let is_edge = |ends: &[u32; 2]| rank[ends[0] as usize].abs_diff(rank[ends[1] as usize]) == 1;
    Ok((0..).zip(ends).filter(|(_, ends)| !is_edge(ends)).map(|(c, _)| c).collect())
}

fn repeats(points: &[Point<2>], i: usize, before: usize, name: impl Fn(usize) -> u32) -> Error {
    Error::Argument(format!("point {} repeats point {} at {:?}", name(i), name(before), points[i]))
}

/// Inserts the points in an order.
fn insert_all(points: &[Point<2>], order: Order, name: impl Fn(usize) -> u32) -> Result<Cdt, Error> {
    let mut cdt = Cdt::with_capacity(points.len(), points.len() * 3, points.len() * 2);
    let scale = scale(points);
    for (place, i) in (0..points.len()).map(|place| (place, order.point(place))) {
        let p = &points[i];
        // what vanishes beside the largest coordinate is taken for zero
        let [x, y] = p.map(|c| c * scale).map(|c| if c.abs() < LEAST { 0.0 } else { c });
        let handle =
            cdt.insert(Point2::new(x, y)).map_err(|e| Error::Argument(format!("point {} at {p:?}: {e}", name(i))))?;
        if handle.index() != place {
            return Err(repeats(points, i, order.point(handle.index()), name));
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
    scale_to(MOST_EXPONENT - 1, most)
}

/// Adds the constraints; returns those that can't be: they cross one that is there, or pass through a point.
fn constrain(cdt: &mut Cdt, ends: impl Iterator<Item = [FixedVertexHandle; 2]>) -> Vec<u32> {
    let mut failed = Vec::new();
    for (c, [a, b]) in ends.enumerate() {
        if cdt.can_add_constraint(a, b) {
            cdt.add_constraint(a, b);
        }
        let there = cdt.get_edge_from_neighbors(a, b);
        if !there.is_some_and(|edge| edge.is_constraint_edge()) {
            failed.push(c as u32);
        }
    }
    failed
}
