//! Walking from a located point to a neighbour, along the straight line between them.
//!
//! The line stays in the finer mesh's domain (it is one of its edges), so where it leaves the coarse mesh, its end lies
//! outside: between a chord of the boundary and the nodes that the chord cuts off, or in what was dropped altogether.
//! All signs are exact: no cell is entered twice, nothing cycles, whatever the triangulation.
//!
//! ```text
//!            c
//!           / \        the line came in over h = a -> b, a on its left or on it, b on its right or on it;
//!          / v \       it leaves over c -> a where c is on its right, over b -> c where c is on its left,
//!         a --h-> b    and goes on from c itself where it meets it
//!            u
//! ```

use super::halfedges::{HalfEdges, next, prev};
use crate::error::Error;
use crate::point::{NONE, Point, distance_2, orient};

/// Where a point lies in a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// The cell, or `NONE` where not yet known.
    pub cell: u32,
    /// Number of the cell's half-edge that the point lies beyond, outside of the mesh; `INSIDE`.
    pub beyond: u32,
    /// Barycentric weights in the cell of the point, or of the nearest point on the half-edge.
    pub weights: [f64; 3],
}

/// Of a place that lies in the mesh.
pub const INSIDE: u32 = 3;

impl Place {
    /// Not yet known.
    pub const UNKNOWN: Place = Place { cell: NONE, beyond: INSIDE, weights: [0.0; 3] };

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

/// How a walk ends.
enum End {
    /// In the cell of this half-edge.
    In(u32),
    /// At this half-edge of the boundary.
    At(u32),
}

/// What comes next.
enum Step {
    /// The line has crossed into the cell of this half-edge, strictly between the edge's ends.
    Enter(u32),
    /// The line starts at the node of this half-edge.
    Leave(u32),
    Done(End),
}

/// Where `v` lies, seen from its neighbour `u` at `place`.
pub fn walk(mesh: &HalfEdges<'_>, u: &Point<2>, place: &Place, v: &Point<2>) -> Result<Place, Error> {
    let mut origin = *u;
    let mut step = start(mesh, &mut origin, place, v);
    // every cell and every node at most once
    for _ in 0..4 * mesh.cells.len() + 16 {
        step = match step {
            Step::Enter(h) => cross(mesh, &mut origin, h, v),
            Step::Leave(h) => leave(mesh, &mut origin, h, v),
            Step::Done(End::In(h)) => return Ok(inside(mesh, h / 3, v)),
            Step::Done(End::At(h)) => return Ok(outside(mesh, h, v)),
        };
    }
    Err(Error::Internal(format!("the walk to ({}, {}) does not end", v[0], v[1])))
}

fn start(mesh: &HalfEdges<'_>, origin: &mut Point<2>, place: &Place, v: &Point<2>) -> Step {
    let first = 3 * place.cell;
    if let Some(edge) = place.edge() {
        if orient(mesh.point(edge), mesh.point(next(edge)), v) < 0.0 {
            return Step::Done(End::At(edge));
        }
        *origin = *mesh.point(edge);
        return turn(mesh, origin, edge, v, true);
    }
    let zeros = place.weights.iter().filter(|&&w| w == 0.0).count() as u32;
    if zeros == 2 {
        let k = (0..3).find(|&k| place.weights[k] != 0.0).unwrap_or(0) as u32;
        *origin = *mesh.point(first + k);
        return Step::Leave(first + k);
    }
    if zeros == 1 {
        let zero = (0..3).find(|&k| place.weights[k] == 0.0).unwrap_or(0) as u32;
        return start_on_edge(mesh, origin, next(first + zero), v);
    }
    let sides = [0, 1, 2].map(|k| orient(origin, v, mesh.point(first + k)));
    for k in 0..3u32 {
        let (a, b, c) = (sides[k as usize], sides[(k as usize + 1) % 3], sides[(k as usize + 2) % 3]);
        if a < 0.0 && b > 0.0 {
            return over(mesh, first + k, v);
        }
        if a < 0.0 && b == 0.0 && c > 0.0 {
            return at_apex(mesh, origin, first + (k + 1) % 3, v);
        }
    }
    // rounding has put the origin a little out of the cell that it was found in
    *origin = *mesh.point(first);
    Step::Leave(first)
}

/// The origin lies strictly between the ends of half-edge h.
fn start_on_edge(mesh: &HalfEdges<'_>, origin: &mut Point<2>, h: u32, v: &Point<2>) -> Step {
    let (a, b) = (mesh.point(h), mesh.point(next(h)));
    let side = orient(a, b, v);
    // the origin may be off the edge by a rounding: leave from an end wherever its line would not pass between them
    let (left, right) = (orient(origin, v, a), orient(origin, v, b));
    if side > 0.0 && left > 0.0 && right < 0.0 {
        return Step::Enter(h);
    }
    if side < 0.0 {
        match mesh.twin(h) {
            NONE => return Step::Done(End::At(h)),
            across if left < 0.0 && right > 0.0 => return Step::Enter(across),
            _ => {}
        }
    }
    let along = (v[0] - a[0]) * (b[0] - a[0]) + (v[1] - a[1]) * (b[1] - a[1]);
    let forward = along > (origin[0] - a[0]) * (b[0] - a[0]) + (origin[1] - a[1]) * (b[1] - a[1]);
    let end = if forward { next(h) } else { h };
    if side == 0.0 && along >= 0.0 && along <= distance_2(a, b) {
        return Step::Done(End::In(h));
    }
    *origin = *mesh.point(end);
    Step::Leave(end)
}

/// The line leaves the cell of `h` over `h`, or ends before.
#[inline]
fn over(mesh: &HalfEdges<'_>, h: u32, v: &Point<2>) -> Step {
    if orient(mesh.point(h), mesh.point(next(h)), v) >= 0.0 {
        return Step::Done(End::In(h));
    }
    match mesh.twin(h) {
        NONE => Step::Done(End::At(h)),
        across => Step::Enter(across),
    }
}

/// The line meets the node of `h`, or ends before.
fn at_apex(mesh: &HalfEdges<'_>, origin: &mut Point<2>, h: u32, v: &Point<2>) -> Step {
    if orient(mesh.point(h), mesh.point(next(h)), v) >= 0.0 {
        return Step::Done(End::In(h));
    }
    *origin = *mesh.point(h);
    Step::Leave(h)
}

#[inline]
fn cross(mesh: &HalfEdges<'_>, origin: &mut Point<2>, h: u32, v: &Point<2>) -> Step {
    let apex = prev(h);
    let side = orient(origin, v, mesh.point(apex));
    if side > 0.0 {
        over(mesh, next(h), v)
    } else if side < 0.0 {
        over(mesh, apex, v)
    } else {
        at_apex(mesh, origin, apex, v)
    }
}

/// The line starts at the node of `h`: turns around it to the cell that the line runs into.
fn leave(mesh: &HalfEdges<'_>, origin: &mut Point<2>, h: u32, v: &Point<2>) -> Step {
    if *origin == *v {
        return Step::Done(End::In(h));
    }
    let mut edge = h;
    if orient(origin, mesh.point(next(edge)), v) >= 0.0 {
        return turn(mesh, origin, edge, v, false);
    }
    loop {
        let across = mesh.twin(edge);
        if across == NONE {
            return look_around(mesh, origin, h, v);
        }
        edge = next(across);
        if edge == h {
            return look_around(mesh, origin, h, v);
        }
        if orient(origin, mesh.point(next(edge)), v) >= 0.0 {
            return into(mesh, origin, edge, v);
        }
    }
}

/// Turns counter-clockwise from a half-edge that `v` is left of (or on); stops at the boundary if told so.
fn turn(mesh: &HalfEdges<'_>, origin: &mut Point<2>, h: u32, v: &Point<2>, one_side: bool) -> Step {
    let mut edge = h;
    let mut left = true;
    loop {
        let side = orient(origin, mesh.point(prev(edge)), v);
        if left && side <= 0.0 {
            return into(mesh, origin, edge, v);
        }
        left = side >= 0.0;
        let across = mesh.twin(prev(edge));
        if across == NONE && one_side {
            return Step::Done(End::At(prev(edge)));
        }
        if across == NONE || across == h {
            return look_around(mesh, origin, h, v);
        }
        edge = across;
    }
}

/// The line starts at the node of `h` and runs into its cell.
fn into(mesh: &HalfEdges<'_>, origin: &mut Point<2>, h: u32, v: &Point<2>) -> Step {
    let far = next(h);
    if orient(mesh.point(far), mesh.point(prev(h)), v) >= 0.0 {
        return Step::Done(End::In(h));
    }
    for end in [far, prev(h)] {
        if orient(origin, mesh.point(end), v) == 0.0 {
            *origin = *mesh.point(end);
            return Step::Leave(end);
        }
    }
    match mesh.twin(far) {
        NONE => Step::Done(End::At(far)),
        across => Step::Enter(across),
    }
}

/// Looks at all cells of a node, also where several fans meet; where none is right, at the nearest boundary edge.
fn look_around(mesh: &HalfEdges<'_>, origin: &mut Point<2>, h: u32, v: &Point<2>) -> Step {
    let node = mesh.node(h);
    let right = mesh.leaving(node).iter().find(|&&[_, edge]| {
        orient(origin, mesh.point(next(edge)), v) >= 0.0 && orient(origin, mesh.point(prev(edge)), v) <= 0.0
    });
    if let Some(&[_, edge]) = right {
        return into(mesh, origin, edge, v);
    }
    let ends = mesh.leaving(node).iter().flat_map(|&[_, edge]| [edge, prev(edge)]);
    let nearest = ends
        .filter(|&edge| mesh.twin(edge) == NONE)
        .map(|edge| (nearest_on(mesh, edge, v).1, edge))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    Step::Done(nearest.map_or(End::In(h), |(_, edge)| End::At(edge)))
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
fn inside(mesh: &HalfEdges<'_>, cell: u32, v: &Point<2>) -> Place {
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
fn nearest_on(mesh: &HalfEdges<'_>, h: u32, v: &Point<2>) -> (f64, f64) {
    let (a, b) = (mesh.point(h), mesh.point(next(h)));
    let d = [b[0] - a[0], b[1] - a[1]];
    let t = (((v[0] - a[0]) * d[0] + (v[1] - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
    (t, distance_2(&[a[0] + t * d[0], a[1] + t * d[1]], v))
}

/// The nearest point on the wall that a walk stopped at: slides over boundary edges both ways, as long as a nearer
/// point may come and the wall has not turned back (never around the tip of a slit or the end of a thin wall).
fn outside(mesh: &HalfEdges<'_>, h: u32, v: &Point<2>) -> Place {
    let way = |edge: u32| {
        let (a, b) = (mesh.point(edge), mesh.point(next(edge)));
        [b[0] - a[0], b[1] - a[1]]
    };
    let length = |edge: u32| distance_2(mesh.point(edge), mesh.point(next(edge))).sqrt();
    let first = way(h);
    let (t, d) = nearest_on(mesh, h, v);
    let mut best = (d, h);
    for forward in [true, false] {
        let mut edge = h;
        let mut passed = length(h) * if forward { 1.0 - t } else { t };
        for _ in 0..MOST_SLIDES {
            // a wall that has gone twice the distance further is not likely to come back
            if passed > 3.0 * best.0.sqrt() {
                break;
            }
            edge = if forward { mesh.next_on_boundary(edge) } else { mesh.prev_on_boundary(edge) };
            let here = way(edge);
            if edge == h || here[0] * first[0] + here[1] * first[1] <= 0.0 {
                break;
            }
            let distance = nearest_on(mesh, edge, v).1;
            if distance < best.0 {
                best = (distance, edge);
            }
            passed += length(edge);
        }
    }
    beyond(mesh, best.1, v)
}

/// Boundary edges that a point slides over at most.
const MOST_SLIDES: usize = 256;

/// The nearest point on a half-edge of the boundary.
fn beyond(mesh: &HalfEdges<'_>, h: u32, v: &Point<2>) -> Place {
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
