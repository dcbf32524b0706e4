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
use super::place::{BEYOND_NODE, Place, beyond, inside, nearest_on};
use super::walls::Walls;
use crate::error::Error;
use crate::point::{NONE, Point, distance_2, orient};

/// How a walk ends.
enum End {
    /// In the cell of this half-edge.
    In(u32),
    /// At this half-edge of the boundary.
    At(u32),
    /// Out of the mesh from the node of this half-edge, to a side that none of its boundary edges is on.
    AtNode(u32),
}

/// What comes next.
enum Step {
    /// The line has crossed into the cell of this half-edge, strictly between the edge's ends.
    Enter(u32),
    /// The line starts at the node of this half-edge.
    Leave(u32),
    Done(End),
}

/// Where a point `v` lies, seen from its neighbour `u` at `place`; `to` is the node of the finer mesh that `v` is, or
/// `NONE`.
pub fn walk(
    mesh: &HalfEdges<'_>,
    walls: &Walls<'_>,
    u: &Point<2>,
    place: &Place,
    to: u32,
    v: &Point<2>,
) -> Result<Place, Error> {
    let mut line = Line { mesh, walls, origin: *u, to, end: v };
    let mut step = line.start(place);
    // every cell and every node at most once
    for _ in 0..4 * mesh.cells.len() + 16 {
        step = match step {
            Step::Enter(h) => line.cross(h),
            Step::Leave(h) => line.leave(h),
            Step::Done(End::In(h)) => return Ok(inside(mesh, h / 3, v)),
            Step::Done(End::At(h)) => return Ok(outside(mesh, walls, h, v)),
            Step::Done(End::AtNode(h)) => return Ok(Place { beyond: BEYOND_NODE, ..Place::at_start(h) }),
        };
    }
    Err(Error::Internal(format!("the walk to ({}, {}) does not end", v[0], v[1])))
}

/// The rest of a line.
struct Line<'a> {
    mesh: &'a HalfEdges<'a>,
    walls: &'a Walls<'a>,
    origin: Point<2>,
    to: u32,
    end: &'a Point<2>,
}

impl Line<'_> {
    fn start(&mut self, place: &Place) -> Step {
        let first = 3 * place.cell;
        if let Some(edge) = place.edge() {
            return self.come_back(edge);
        }
        if place.beyond == BEYOND_NODE {
            let k = (0..3).find(|&k| place.weights[k] == 1.0).unwrap_or(0) as u32;
            return Step::Done(End::AtNode(first + k));
        }
        let zeros = place.weights.iter().filter(|&&w| w == 0.0).count() as u32;
        if zeros == 2 {
            let k = (0..3).find(|&k| place.weights[k] != 0.0).unwrap_or(0) as u32;
            self.origin = *self.mesh.point(first + k);
            return Step::Leave(first + k);
        }
        if zeros == 1 {
            let zero = (0..3).find(|&k| place.weights[k] == 0.0).unwrap_or(0) as u32;
            return self.start_on_edge(next(first + zero));
        }
        let sides = [0, 1, 2].map(|k| orient(&self.origin, self.end, self.mesh.point(first + k)));
        for k in 0..3u32 {
            let (a, b, c) = (sides[k as usize], sides[(k as usize + 1) % 3], sides[(k as usize + 2) % 3]);
            if a < 0.0 && b > 0.0 {
                return self.over(first + k);
            }
            if a < 0.0 && b == 0.0 && c > 0.0 {
                return self.at_apex(first + (k + 1) % 3);
            }
        }
        // rounding has put the origin a little out of the cell that it was found in
        self.origin = *self.mesh.point(first);
        Step::Leave(first)
    }

    /// The line starts outside, beyond the half-edge `h`: it comes in over it or stays out.
    fn come_back(&mut self, h: u32) -> Step {
        let (a, b) = (self.mesh.point(h), self.mesh.point(next(h)));
        let (left, right) = (orient(&self.origin, self.end, a), orient(&self.origin, self.end, b));
        if orient(a, b, self.end) < 0.0 || orient(a, b, &self.origin) >= 0.0 || left < 0.0 || right > 0.0 {
            return Step::Done(End::At(h));
        }
        let end = match (left == 0.0, right == 0.0) {
            (false, false) => return Step::Enter(h),
            (true, _) => h,
            (false, true) => next(h),
        };
        self.origin = *self.mesh.point(end);
        Step::Leave(end)
    }

    /// The origin lies strictly between the ends of half-edge h.
    fn start_on_edge(&mut self, h: u32) -> Step {
        let (a, b) = (self.mesh.point(h), self.mesh.point(next(h)));
        let side = orient(a, b, self.end);
        // the origin may be off the edge by a rounding: leave from an end wherever its line would not pass between them
        let (left, right) = (orient(&self.origin, self.end, a), orient(&self.origin, self.end, b));
        if side > 0.0 && left > 0.0 && right < 0.0 {
            return Step::Enter(h);
        }
        if side < 0.0 {
            match self.mesh.twin(h) {
                NONE => return Step::Done(End::At(h)),
                across if left < 0.0 && right > 0.0 => return Step::Enter(across),
                _ => {}
            }
        }
        let along = (self.end[0] - a[0]) * (b[0] - a[0]) + (self.end[1] - a[1]) * (b[1] - a[1]);
        let forward = along > (self.origin[0] - a[0]) * (b[0] - a[0]) + (self.origin[1] - a[1]) * (b[1] - a[1]);
        let end = if forward { next(h) } else { h };
        if side == 0.0 && along >= 0.0 && along <= distance_2(a, b) {
            return Step::Done(End::In(h));
        }
        self.origin = *self.mesh.point(end);
        Step::Leave(end)
    }

    /// The line leaves the cell of `h` over `h`, or ends before.
    #[inline]
    fn over(&self, h: u32) -> Step {
        if orient(self.mesh.point(h), self.mesh.point(next(h)), self.end) >= 0.0 {
            return Step::Done(End::In(h));
        }
        match self.mesh.twin(h) {
            NONE => Step::Done(End::At(h)),
            across => Step::Enter(across),
        }
    }

    /// The line meets the node of `h`, or ends before.
    fn at_apex(&mut self, h: u32) -> Step {
        if orient(self.mesh.point(h), self.mesh.point(next(h)), self.end) >= 0.0 {
            return Step::Done(End::In(h));
        }
        self.origin = *self.mesh.point(h);
        Step::Leave(h)
    }

    #[inline]
    fn cross(&mut self, h: u32) -> Step {
        let apex = prev(h);
        let side = orient(&self.origin, self.end, self.mesh.point(apex));
        if side > 0.0 {
            self.over(next(h))
        } else if side < 0.0 {
            self.over(apex)
        } else {
            self.at_apex(apex)
        }
    }

    /// The line starts at the node of `h`: turns around it to the cell that the line runs into.
    fn leave(&mut self, h: u32) -> Step {
        if self.origin == *self.end {
            return Step::Done(End::In(h));
        }
        let mut edge = h;
        if orient(&self.origin, self.mesh.point(next(edge)), self.end) >= 0.0 {
            return self.turn(edge);
        }
        loop {
            let across = self.mesh.twin(edge);
            if across == NONE {
                return self.look_around(h);
            }
            edge = next(across);
            if edge == h {
                return self.look_around(h);
            }
            if orient(&self.origin, self.mesh.point(next(edge)), self.end) >= 0.0 {
                return self.into(edge);
            }
        }
    }

    /// Turns counter-clockwise from a half-edge that the line's end is left of (or on).
    fn turn(&mut self, h: u32) -> Step {
        let mut edge = h;
        let mut left = true;
        loop {
            let side = orient(&self.origin, self.mesh.point(prev(edge)), self.end);
            if left && side <= 0.0 {
                return self.into(edge);
            }
            left = side >= 0.0;
            let across = self.mesh.twin(prev(edge));
            if across == NONE || across == h {
                return self.look_around(h);
            }
            edge = across;
        }
    }

    /// The line starts at the node of `h` and runs into its cell.
    fn into(&mut self, h: u32) -> Step {
        let far = next(h);
        if orient(self.mesh.point(far), self.mesh.point(prev(h)), self.end) >= 0.0 {
            return Step::Done(End::In(h));
        }
        for end in [far, prev(h)] {
            if orient(&self.origin, self.mesh.point(end), self.end) == 0.0 {
                self.origin = *self.mesh.point(end);
                return Step::Leave(end);
            }
        }
        match self.mesh.twin(far) {
            NONE => Step::Done(End::At(far)),
            across => Step::Enter(across),
        }
    }

    /// Looks at all cells of a node, also where several fans meet; where none is right, at the nearest boundary edge on the
    /// line's side.
    fn look_around(&mut self, h: u32) -> Step {
        let node = self.mesh.node(h);
        let right = self.mesh.leaving(node).iter().find(|&&[_, edge]| {
            orient(&self.origin, self.mesh.point(next(edge)), self.end) >= 0.0
                && orient(&self.origin, self.mesh.point(prev(edge)), self.end) <= 0.0
        });
        if let Some(&[_, edge]) = right {
            return self.into(edge);
        }
        let ends = self.mesh.leaving(node).iter().flat_map(|&[_, edge]| [edge, prev(edge)]);
        let nearest = ends
            .filter(|&edge| self.mesh.twin(edge) == NONE)
            .filter(|&edge| !self.walls.part(self.mesh, node, self.to, self.end, edge))
            .map(|edge| (nearest_on(self.mesh, edge, self.end).1, edge))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Step::Done(nearest.map_or(End::AtNode(h), |(_, edge)| End::At(edge)))
    }
}

/// The nearest point on the wall that a walk stopped at: slides over boundary edges both ways, as long as a nearer
/// point may come, the wall has not turned back, and the finer mesh goes on around the node between (never around the
/// tip of a slit or the end of a thin wall).
fn outside(mesh: &HalfEdges<'_>, walls: &Walls<'_>, h: u32, v: &Point<2>) -> Place {
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
            if walls.ends_at(mesh.node(if forward { next(edge) } else { edge })) {
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
