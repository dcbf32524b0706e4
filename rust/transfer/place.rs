//! Where a point lies in a mesh: in a cell, or nearest to an edge or node of the boundary.

use super::halfedges::{HalfEdges, next};
use crate::point::{NONE, Point, distance_2, orient};

/// Where a point lies in a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// The cell, or `NONE` where not yet known.
    pub cell: u32,
    /// Number of the cell's half-edge that the point lies beyond, outside of the mesh; `INSIDE`, `BEYOND_NODE`.
    pub beyond: u32,
    /// Barycentric weights in the cell of the point, or of the nearest point on the half-edge.
    pub weights: [f64; 3],
}

/// Of a place that lies in the mesh.
pub const INSIDE: u32 = 3;

/// Of a place outside that reaches the mesh at a node only; its edges there are on other sides.
pub const BEYOND_NODE: u32 = 4;

impl Place {
    /// Not yet known.
    pub const UNKNOWN: Place = Place { cell: NONE, beyond: INSIDE, weights: [0.0; 3] };

    /// Whether the place lies out of the mesh.
    #[inline(always)]
    pub fn is_outside(&self) -> bool {
        self.beyond != INSIDE
    }

    /// The node that the place is, where it is one.
    pub fn node(&self, mesh: &HalfEdges<'_>) -> Option<u32> {
        (0..3).find(|&k| self.weights[k] == 1.0).map(|k| mesh.cells[self.cell as usize][k])
    }

    /// The half-edge that the place lies beyond.
    pub fn edge(&self) -> Option<u32> {
        (self.beyond < INSIDE).then_some(3 * self.cell + self.beyond)
    }

    /// The node where a half-edge starts.
    pub fn at_start(h: u32) -> Place {
        let mut weights = [0.0; 3];
        weights[(h % 3) as usize] = 1.0;
        Place { cell: h / 3, beyond: INSIDE, weights }
    }
}

/// How far rounding of its coordinates may have put a point off a line.
fn roundings(v: &Point<2>) -> f64 {
    4.0 * f64::EPSILON * v[0].abs().max(v[1].abs())
}

/// Twice the areas opposite to the nodes of a cell, and whether the point is up to rounding on the edge there.
fn areas(mesh: &HalfEdges<'_>, cell: u32, v: &Point<2>) -> ([f64; 3], [bool; 3]) {
    let corners = mesh.cells[cell as usize].map(|i| &mesh.points[i as usize]);
    let off = roundings(v);
    let mut area = [0.0; 3];
    let mut on = [false; 3];
    for k in 0..3 {
        let (a, b) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
        area[k] = orient(a, b, v);
        on[k] = area[k] <= 0.0 || area[k] * area[k] <= off * off * distance_2(a, b);
    }
    (area, on)
}

/// The place of a point of the closed cell.
pub fn inside(mesh: &HalfEdges<'_>, cell: u32, v: &Point<2>) -> Place {
    let (area, on) = areas(mesh, cell, v);
    let first = 3 * cell;
    let weights = match on {
        [false, false, false] => normalised(area),
        [true, false, false] => along(mesh, first + 1, v),
        [false, true, false] => along(mesh, first + 2, v),
        [false, false, true] => along(mesh, first, v),
        _ => on_several(mesh, first, on, v),
    };
    Place { cell, beyond: INSIDE, weights }
}

/// Weights of a point up to rounding on the lines of two or three edges: at a corner, or in a needle far from any.
fn on_several(mesh: &HalfEdges<'_>, first: u32, on: [bool; 3], v: &Point<2>) -> [f64; 3] {
    let off = roundings(v);
    let corner = (0..3).find(|&k| distance_2(mesh.point(first + k), v) <= off * off);
    if let Some(k) = corner {
        return [0, 1, 2].map(|other| f64::from(other == k));
    }
    // opposite to node k is the half-edge of the next one
    let edges = (0..3).filter(|&k| on[k as usize]).map(|k| next(first + k));
    let nearest = edges.map(|h| (nearest_on(mesh, h, v).1, h)).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    along(mesh, nearest.map_or(first, |(_, h)| h), v)
}

/// Weights that sum to 1 exactly.
fn normalised(area: [f64; 3]) -> [f64; 3] {
    let sum = area[0] + area[1] + area[2];
    if sum <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let mut weights = area.map(|a| a / sum);
    let most = (0..3).fold(0, |most, k| if weights[k] > weights[most] { k } else { most });
    weights[most] = 1.0 - (weights[(most + 1) % 3] + weights[(most + 2) % 3]);
    weights
}

/// Weights of the nearest point on a half-edge.
fn along(mesh: &HalfEdges<'_>, h: u32, v: &Point<2>) -> [f64; 3] {
    let t = nearest_on(mesh, h, v).0;
    let mut weights = [0.0; 3];
    // 1 - (1 - t) is exact where t itself may not be
    weights[(h % 3) as usize] = 1.0 - t;
    weights[(next(h) % 3) as usize] = 1.0 - (1.0 - t);
    weights
}

/// Share of the way along a half-edge to its point nearest to `v`, and the squared distance.
pub fn nearest_on(mesh: &HalfEdges<'_>, h: u32, v: &Point<2>) -> (f64, f64) {
    let (a, b) = (mesh.point(h), mesh.point(next(h)));
    let d = [b[0] - a[0], b[1] - a[1]];
    let t = (((v[0] - a[0]) * d[0] + (v[1] - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
    (t, distance_2(&[a[0] + t * d[0], a[1] + t * d[1]], v))
}

/// The nearest point on a half-edge of the boundary.
pub fn beyond(mesh: &HalfEdges<'_>, h: u32, v: &Point<2>) -> Place {
    let off = roundings(v);
    let beyond = if nearest_on(mesh, h, v).1 <= off * off { INSIDE } else { h % 3 };
    Place { cell: h / 3, beyond, weights: along(mesh, h, v) }
}

/// The place of a point from which nothing near is known: the first cell that holds it, or the nearest boundary edge.
/// Runtime: O(m).
pub fn anywhere(mesh: &HalfEdges<'_>, v: &Point<2>) -> Place {
    let holds = |&cell: &u32| {
        let corners = mesh.cells[cell as usize].map(|i| &mesh.points[i as usize]);
        (0..3).all(|k| orient(corners[k], corners[(k + 1) % 3], v) >= 0.0)
    };
    if let Some(cell) = (0..mesh.cells.len() as u32).find(holds) {
        return inside(mesh, cell, v);
    }
    let nearest = mesh.boundary().map(|h| (nearest_on(mesh, h, v).1, h)).min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map_or(Place::UNKNOWN, |(_, h)| beyond(mesh, h, v))
}
