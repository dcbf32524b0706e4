//! The boundary edges of a mesh as line segments between places, and where they meet.
//!
//! A *place* is a location of boundary nodes; all nodes that share coordinates are one place. Two boundary edges between the
//! same places in opposite directions are the two sides of a slit: cells lie on both sides, the boundary of what is covered
//! does not run there, and both are left out. What stays is a set of directed segments with the cells on the left.
//!
//! Segments of different *parts* (cells that nodes join) are kept apart where parts are told: a slit between two parts then
//! stays two segments.

use super::Facet;
use crate::error::Broken;
use crate::point::{NONE, Point, orient};
use crate::segments::Segments;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Why the nodes of a soup of triangles are no two sides of a slit.
pub const SOUP: &str = "a cell there has all its edges doubled";

/// A boundary edge between two places.
#[derive(Debug, Clone, Copy)]
pub struct Segment {
    /// Place where it begins.
    pub tail: u32,
    /// Place where it ends.
    pub head: u32,
    /// Index of the boundary edge.
    pub edge: u32,
    /// Part of its cell, 0 where parts are not told.
    pub part: u32,
}

/// Where two segments meet other than at an end of both.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// Two segments cross at a point inside both.
    Cross(u32, u32),
    /// A place lies inside a segment.
    Touch {
        /// The place.
        place: u32,
        /// A segment that ends there.
        of: u32,
        /// The segment that it lies inside.
        inside: u32,
    },
}

/// The segments of a boundary, and their contacts.
pub struct Outline<'a> {
    /// Boundary edges of the mesh.
    pub boundary: &'a [Facet<2>],
    /// Coordinates of the places.
    pub places: Vec<Point<2>>,
    /// All segments.
    pub segments: Vec<Segment>,
    /// Tree of the segments.
    pub tree: Segments,
    /// Whether parts are told.
    pub has_parts: bool,
    /// Least y of the places.
    floor: f64,
}

/// Order by y, then x: the first of some points is one that nothing lies below.
pub fn lower(a: &Point<2>, b: &Point<2>) -> Ordering {
    // all coordinates are finite; -0.0 equals 0.0
    let by = |k: usize| a[k].partial_cmp(&b[k]).unwrap_or(Ordering::Equal);
    by(1).then(by(0))
}

/// Places of the boundary nodes, and for each boundary edge its two places.
fn weld(points: &[Point<2>], boundary: &[Facet<2>]) -> (Vec<Point<2>>, Vec<[u32; 2]>) {
    let mut nodes: Vec<u32> = boundary.iter().map(|facet| facet.nodes[0]).collect();
    nodes.par_sort_unstable_by(|&a, &b| lower(&points[a as usize], &points[b as usize]).then(a.cmp(&b)));
    nodes.dedup();
    let mut places: Vec<Point<2>> = Vec::with_capacity(nodes.len());
    let mut place_of = vec![NONE; points.len()];
    for node in nodes {
        let p = points[node as usize];
        // -0.0 and 0.0 are one place
        if places.last().is_none_or(|last| *last != p) {
            places.push(p);
        }
        place_of[node as usize] = places.len() as u32 - 1;
    }
    let ends = boundary.iter().map(|facet| facet.nodes.map(|node| place_of[node as usize])).collect();
    (places, ends)
}

impl<'a> Outline<'a> {
    /// Makes segments of boundary edges. `part` tells the part of each edge, or all are one.
    ///
    /// Runtime: O(b log b).
    pub fn new(points: &[Point<2>], boundary: &'a [Facet<2>], part: Option<&[u32]>) -> Result<Outline<'a>, Broken> {
        let (places, ends) = weld(points, boundary);
        let part_of = |edge: u32| part.map_or(0, |part| part[edge as usize]);
        let key = |edge: u32| {
            let [a, b] = ends[edge as usize];
            (a.min(b), a.max(b), part_of(edge))
        };
        let mut order: Vec<u32> = (0..boundary.len() as u32).collect();
        order.par_sort_unstable_by_key(|&edge| (key(edge), edge));
        let mut segments = Vec::with_capacity(order.len());
        let mut doubled = Vec::new();
        for group in order.chunk_by(|&a, &b| key(a) == key(b)) {
            let up = |edge: &&u32| ends[**edge as usize][0] < ends[**edge as usize][1];
            let ups = group.iter().filter(up).count();
            if ups > 1 || group.len() - ups > 1 {
                return Err(same_side(points, boundary, group, &ends));
            }
            if let [edge] = *group {
                let [tail, head] = ends[edge as usize];
                segments.push(Segment { tail, head, edge, part: part_of(edge) });
            } else {
                doubled.extend([[group[0], group[1]], [group[1], group[0]]]);
            }
        }
        if part.is_none() {
            refuse_soup(points, boundary, &doubled)?;
        }
        let ends: Vec<[u32; 2]> = segments.iter().map(|s: &Segment| [s.tail, s.head]).collect();
        let tree = Segments::new(&places, &ends);
        let floor = places.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
        Ok(Outline { boundary, places, segments, tree, has_parts: part.is_some(), floor })
    }

    /// Coordinates of both ends.
    pub fn ends(&self, segment: u32) -> [Point<2>; 2] {
        let s = &self.segments[segment as usize];
        [self.places[s.tail as usize], self.places[s.head as usize]]
    }

    /// All contacts, or None where there are far too many for a mesh that could be legal.
    ///
    /// Runtime: O(b log b + pairs of segments whose boxes meet).
    pub fn contacts(&self) -> Option<Vec<Contact>> {
        let limit = 1000 + 8 * self.segments.len();
        let count = AtomicUsize::new(0);
        let found: Vec<Vec<Contact>> = (0..self.segments.len())
            .into_par_iter()
            .with_min_len(512)
            .map(|position| {
                let mut found = Vec::new();
                if count.load(Relaxed) <= limit {
                    self.contacts_at(position, &mut found);
                    if !found.is_empty() {
                        count.fetch_add(found.len(), Relaxed);
                    }
                }
                found
            })
            .filter(|found| !found.is_empty())
            .collect();
        (count.load(Relaxed) <= limit).then(|| found.concat())
    }

    /// Contacts of the segment at a position of the tree with those after it.
    pub fn contacts_at(&self, position: usize, found: &mut Vec<Contact>) {
        let s = self.tree.order()[position];
        self.tree.crossing(position, position + 1, |other| self.contact(s, other, found));
    }

    fn contact(&self, i: u32, j: u32, found: &mut Vec<Contact>) {
        let (s, t) = (&self.segments[i as usize], &self.segments[j as usize]);
        let ([a, b], [c, d]) = (self.ends(i), self.ends(j));
        let (of_c, of_d) = (orient(&a, &b, &c), orient(&a, &b, &d));
        if of_c * of_d > 0.0 && of_c.abs().min(of_d.abs()) > 0.0 {
            return;
        }
        let (of_a, of_b) = (orient(&c, &d, &a), orient(&c, &d, &b));
        let apart = |x: f64, y: f64| (x > 0.0 && y < 0.0) || (x < 0.0 && y > 0.0);
        if apart(of_c, of_d) && apart(of_a, of_b) {
            found.push(Contact::Cross(i, j));
            return;
        }
        let mut touch = |turn: f64, place: u32, of: u32, inside: u32| {
            let [from, to] = self.ends(inside);
            let p = &self.places[place as usize];
            // on one line: between the ends if between them in any order along that line
            if turn == 0.0 && lower(&from, p) != Ordering::Equal && lower(&from, p) == lower(p, &to) {
                found.push(Contact::Touch { place, of, inside });
            }
        };
        touch(of_c, t.tail, j, i);
        touch(of_d, t.head, j, i);
        touch(of_a, s.tail, i, j);
        touch(of_b, s.head, i, j);
    }

    /// How often each part covers the place right below `x` (and by nothing to the right of it): (part, times).
    pub fn below(&self, x: &Point<2>) -> Vec<(u32, i32)> {
        let mut covered: Vec<(u32, i32)> = Vec::new();
        self.ascend(x, |part, sign| match covered.iter_mut().find(|(p, _)| *p == part) {
            Some((_, times)) => *times += sign,
            None => covered.push((part, sign)),
        });
        covered
    }

    /// Whether a part covers the place right below `x`.
    pub fn covers(&self, part: u32, x: &Point<2>) -> bool {
        let mut times = 0;
        self.ascend(x, |p, sign| times += if p == part { sign } else { 0 });
        times > 0
    }

    /// Calls `cross(part, sign)` for every segment below `x`: 1 where its cells lie above it, -1 where below.
    fn ascend(&self, x: &Point<2>, mut cross: impl FnMut(u32, i32)) {
        let ground = [x[0], self.floor.min(x[1])];
        self.tree.meeting(&ground, x, |s| {
            if self.is_below(s, x) {
                cross(self.segments[s as usize].part, if self.has_cells_above(s) { 1 } else { -1 });
            }
        });
    }

    /// Whether there are cells right above the next segment below `x`. The segments must cross nowhere.
    pub fn is_floored(&self, x: &Point<2>) -> bool {
        let is_below = |s: u32| self.is_below(s, x);
        let next = self.tree.highest_below(x, self.floor.min(x[1]), is_below, |s, t| self.is_higher(s, t));
        next.is_some_and(|s| self.has_cells_above(s))
    }

    /// Whether a segment leads to the right: its cells lie on its left.
    fn has_cells_above(&self, segment: u32) -> bool {
        let [tail, head] = self.ends(segment);
        tail[0] < head[0]
    }

    fn rightward(&self, segment: u32) -> [Point<2>; 2] {
        let [tail, head] = self.ends(segment);
        if self.has_cells_above(segment) { [tail, head] } else { [head, tail] }
    }

    fn is_below(&self, segment: u32, x: &Point<2>) -> bool {
        let [left, right] = self.rightward(segment);
        left[0] <= x[0] && x[0] < right[0] && orient(&left, &right, x) > 0.0
    }

    /// Whether the first of two segments that cross nowhere is the upper one where both are below a point.
    fn is_higher(&self, s: u32, t: u32) -> bool {
        let [[a, b], [c, d]] = [s, t].map(|segment| self.rightward(segment));
        let first = if a[0] >= c[0] { orient(&c, &d, &a) } else { -orient(&a, &b, &c) };
        let last = if b[0] <= d[0] { orient(&c, &d, &b) } else { -orient(&a, &b, &d) };
        if first == 0.0 { last > 0.0 } else { first > 0.0 }
    }
}

/// The error where two boundary edges between the same places have the same direction.
fn same_side(points: &[Point<2>], boundary: &[Facet<2>], group: &[u32], ends: &[[u32; 2]]) -> Broken {
    let pair = group.iter().enumerate().find_map(|(k, &one)| {
        group[k + 1..].iter().find(|&&two| ends[one as usize] == ends[two as usize]).map(|&two| [one, two])
    });
    let [one, two] = pair.unwrap_or([group[0], group[group.len() - 1]]).map(|edge| boundary[edge as usize].nodes);
    let k = usize::from(one[0] == two[0]);
    coincident(points, [one[k], two[k]], "their cells lie on the same side", 0)
}

/// The error for two nodes that share coordinates.
pub fn coincident(points: &[Point<2>], nodes: [u32; 2], why: &'static str, more: usize) -> Broken {
    let [a, b] = nodes;
    Broken::CoincidentNodes { nodes: [a.min(b), a.max(b)], at: points[a as usize].to_vec(), why, more }
}

/// Refuses cells that coincident edges separate from their neighbours on all three sides: a soup of triangles.
fn refuse_soup(points: &[Point<2>], boundary: &[Facet<2>], doubled: &[[u32; 2]]) -> Result<(), Broken> {
    let mut sides: HashMap<u32, u32> = HashMap::new();
    for [edge, _] in doubled {
        *sides.entry(boundary[*edge as usize].cells[0]).or_insert(0) += 1;
    }
    let alone = sides.iter().filter(|&(_, &count)| count == 3).map(|(&cell, _)| cell);
    let Some(cell) = alone.clone().min() else {
        return Ok(());
    };
    let pair = doubled.iter().find(|[edge, _]| boundary[*edge as usize].cells[0] == cell);
    let [one, two] = pair.map_or([[0; 2]; 2], |pair| pair.map(|edge| boundary[edge as usize].nodes));
    let nodes = if one[0] == two[1] { [one[1], two[0]] } else { [one[0], two[1]] };
    Err(coincident(points, nodes, SOUP, alone.count() - 1))
}
