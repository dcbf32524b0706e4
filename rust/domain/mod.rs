//! The facets of a planar domain: vertices, chains, corners, slits.
//!
//! A *facet edge* is an edge of the mesh that every coarser mesh must keep as part of a union of its own edges: the
//! boundary, edges between cells of different tags, edges that the user gave. Nodes that share coordinates are one
//! *facet vertex* with several *copies*; the two sides of a slit are then one line of facet edges, each edge with a
//! left and a right side of its own nodes:
//!
//! ```text
//!        left:  a' --------- b'          copies of the upper side
//!               u ===========> v         facet vertices
//!        right: a  --------- b           copies of the lower side
//! ```
//!
//! A *chain* is a maximal path of facet edges through vertices where exactly two of them meet; it is closed or ends at
//! *junctions*. A vertex is *fixed* where the topology or the attributes (tags, kind of side) change, and a *corner*
//! (P0 of Figure 2) where it is fixed or the chain turns by more than `feature_angle`.

mod chords;
mod gap;
mod loose;
mod sight;

pub use chords::Chord;
pub use sight::{Seen, Sight};

use crate::error::Error;
use crate::point::{NONE, Point, distance, orient};
use std::collections::HashMap;

/// What lies on one side of a facet edge `u -> v`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side {
    /// Node at `u` in the cell of this side, [`NONE`] where there is no cell.
    pub tail: u32,
    /// Node at `v` in the cell of this side.
    pub head: u32,
    /// Tag of the cell of this side.
    pub cell_tag: i64,
    /// Whether the user gave this facet.
    pub given: bool,
    /// Its facet tag, 0 where none was given.
    pub tag: i64,
}

impl Side {
    const EMPTY: Side = Side { tail: NONE, head: NONE, cell_tag: 0, given: false, tag: 0 };

    /// Whether a cell lies on this side.
    pub fn is_inside(&self) -> bool {
        self.tail != NONE
    }

    fn reversed(self) -> Side {
        Side { tail: self.head, head: self.tail, ..self }
    }

    fn continues(&self, next: &Side) -> bool {
        self.head == next.tail && self.cell_tag == next.cell_tag && self.given == next.given && self.tag == next.tag
    }
}

/// A facet edge between two facet vertices.
#[derive(Debug, Clone, Copy)]
pub struct FacetEdge {
    /// Facet vertices `u`, `v`.
    pub vertices: [u32; 2],
    /// Left and right side of `u -> v`.
    pub sides: [Side; 2],
    /// Whether cells of both sides share it (an interface), rather than end at it (boundary or slit).
    pub interior: bool,
}

impl FacetEdge {
    /// Whether there are cells on one side only.
    pub fn is_outer(&self) -> bool {
        self.sides[0].is_inside() != self.sides[1].is_inside()
    }

    fn reversed(self) -> FacetEdge {
        let [u, v] = self.vertices;
        let [left, right] = self.sides;
        FacetEdge { vertices: [v, u], sides: [right.reversed(), left.reversed()], interior: self.interior }
    }
}

/// Maximal path of facet edges through vertices of degree two.
#[derive(Debug, Clone)]
pub struct Chain {
    /// Facet vertices along it; a closed chain does not repeat its first.
    pub vertices: Vec<u32>,
    /// Edge `k` leads from vertex `k` to vertex `k + 1` (of a closed chain, cyclically), turned along the chain.
    pub edges: Vec<FacetEdge>,
    /// Length of the chain up to vertex `k`; one entry an edge more, the last is the whole length.
    pub arc: Vec<f64>,
    /// Whether it ends where it begins without a junction there.
    pub closed: bool,
}

impl Chain {
    /// Facet vertex at a position, which may run past the end of a closed chain.
    #[inline]
    pub fn vertex(&self, position: u32) -> u32 {
        let position = position as usize;
        self.vertices[if position < self.vertices.len() { position } else { position - self.vertices.len() }]
    }

    /// Facet edge that leaves a position.
    #[inline]
    pub fn edge(&self, position: u32) -> &FacetEdge {
        let position = position as usize;
        &self.edges[if position < self.edges.len() { position } else { position - self.edges.len() }]
    }

    /// Length of the whole chain.
    pub fn length(&self) -> f64 {
        self.arc[self.arc.len() - 1]
    }
}

/// One facet edge of a mesh as the topology lists it: directed nodes, tags of left and right cell.
#[derive(Debug, Clone, Copy)]
pub struct FacetRow {
    /// Nodes, with the (first) cell on the left.
    pub nodes: [u32; 2],
    /// Tag of the left cell, and of the right one where there is one.
    pub cell_tags: (i64, Option<i64>),
    /// The user's facet tag, where the facet is a given one.
    pub given: Option<i64>,
}

/// The facets of a mesh.
#[derive(Debug, Clone)]
pub struct Domain {
    /// Coordinates of the facet vertices.
    pub points: Vec<Point<2>>,
    copies_start: Vec<u32>,
    copies: Vec<u32>,
    /// All facet edges, as chains.
    pub chains: Vec<Chain>,
    /// For each facet vertex its first place: chain and position.
    place: Vec<(u32, u32)>,
    /// Vertices where topology or attributes change.
    pub fixed: Vec<bool>,
    /// Vertices of class P0.
    pub corner: Vec<bool>,
    /// Chains that end at each junction: (chain, whether at its end).
    ends: HashMap<u32, Vec<(u32, bool)>>,
}

impl Domain {
    /// Builds chains and classes. `cos_feature` is the cosine of `feature_angle`.
    ///
    /// Runtime: O(s log s) for s facet edges.
    pub fn new(points: &[Point<2>], facets: &[FacetRow], cos_feature: f64) -> Result<Domain, Error> {
        let (copies_start, copies, vertex_of) = weld(points, facets);
        let vertex_points: Vec<Point<2>> =
            copies_start[..copies_start.len() - 1].iter().map(|&s| points[copies[s as usize] as usize]).collect();
        let edges = join(facets, &vertex_of)?;
        let mut domain = Domain {
            place: vec![(NONE, NONE); vertex_points.len()],
            fixed: vec![false; vertex_points.len()],
            corner: vec![false; vertex_points.len()],
            points: vertex_points,
            copies_start,
            copies,
            chains: Vec::new(),
            ends: HashMap::new(),
        };
        domain.trace(&edges);
        domain.classify(cos_feature);
        Ok(domain)
    }

    /// Number of facet vertices.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there is no facet.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// The nodes at a facet vertex, ascending; the first represents it.
    pub fn copies(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.copies[self.copies_start[v] as usize..self.copies_start[v + 1] as usize]
    }

    /// All facet nodes, ascending within a vertex.
    pub fn nodes(&self) -> &[u32] {
        &self.copies
    }

    /// The same facets drawn through kept vertices only, which must be enough for all chains.
    pub fn thinned(&self, kept: &[bool]) -> Domain {
        let mut thin = self.clone();
        for ((chain, old), c) in thin.chains.iter_mut().zip(&self.chains).zip(0..) {
            *chain = Chain { vertices: Vec::new(), edges: Vec::new(), arc: vec![0.0], closed: old.closed };
            let mut positions: Vec<u32> =
                (0..old.vertices.len() as u32).filter(|&k| kept[old.vertex(k) as usize]).collect();
            chain.vertices.extend(positions.iter().map(|&k| old.vertex(k)));
            if old.closed {
                positions.extend(positions.first().map(|k| k + old.vertices.len() as u32));
            }
            let mut total = 0.0;
            for pair in positions.windows(2) {
                let (first, last) = (old.edge(pair[0]), old.edge(pair[1] - 1));
                let vertices = [first.vertices[0], last.vertices[1]];
                let sides = [0, 1].map(|s| Side { head: last.sides[s].head, ..first.sides[s] });
                chain.edges.push(FacetEdge { vertices, sides, ..*first });
                let [u, v] = vertices.map(|v| self.points[v as usize]);
                total += distance(&u, &v);
                chain.arc.push(total);
            }
            for (&v, k) in chain.vertices.iter().zip(0..) {
                let place = &mut thin.place[v as usize];
                if place.0 == c {
                    place.1 = k;
                }
            }
        }
        thin
    }

    fn trace(&mut self, edges: &[FacetEdge]) {
        let n = self.points.len();
        let mut start = vec![0u32; n + 1];
        for edge in edges {
            for v in edge.vertices {
                start[v as usize + 1] += 1;
            }
        }
        for v in 0..n {
            start[v + 1] += start[v];
        }
        let mut around = vec![0u32; edges.len() * 2];
        let mut fill = start.clone();
        for (e, edge) in edges.iter().enumerate() {
            for v in edge.vertices {
                around[fill[v as usize] as usize] = e as u32;
                fill[v as usize] += 1;
            }
        }
        let degree = |v: u32| start[v as usize + 1] - start[v as usize];
        let mut used = vec![false; edges.len()];
        let mut follow = |first: u32, from: u32, closed: bool| -> Option<Chain> {
            if used[first as usize] {
                return None;
            }
            let mut chain = Chain { vertices: vec![from], edges: Vec::new(), arc: Vec::new(), closed };
            let (mut edge, mut at) = (first, from);
            loop {
                used[edge as usize] = true;
                let turned = if edges[edge as usize].vertices[0] == at {
                    edges[edge as usize]
                } else {
                    edges[edge as usize].reversed()
                };
                chain.edges.push(turned);
                at = turned.vertices[1];
                if closed && at == from {
                    return Some(chain);
                }
                chain.vertices.push(at);
                if degree(at) != 2 {
                    return Some(chain);
                }
                let s = start[at as usize] as usize;
                edge = if around[s] == edge { around[s + 1] } else { around[s] };
            }
        };
        let mut chains = Vec::new();
        for v in (0..n as u32).filter(|&v| degree(v) != 2) {
            for k in start[v as usize]..start[v as usize + 1] {
                chains.extend(follow(around[k as usize], v, false));
            }
        }
        for v in 0..n as u32 {
            if degree(v) == 2 {
                chains.extend(follow(around[start[v as usize] as usize], v, true));
            }
        }
        for (c, chain) in chains.iter_mut().enumerate() {
            let mut total = 0.0;
            chain.arc.push(0.0);
            for edge in &chain.edges {
                let [u, v] = edge.vertices;
                total += distance(&self.points[u as usize], &self.points[v as usize]);
                chain.arc.push(total);
            }
            for (k, &v) in chain.vertices.iter().enumerate() {
                if self.place[v as usize].0 == NONE {
                    self.place[v as usize] = (c as u32, k as u32);
                }
            }
            if !chain.closed {
                self.ends.entry(chain.vertices[0]).or_default().push((c as u32, false));
                self.ends.entry(chain.vertices[chain.vertices.len() - 1]).or_default().push((c as u32, true));
            }
        }
        self.chains = chains;
    }

    fn classify(&mut self, cos_feature: f64) {
        for chain in &self.chains {
            let m = chain.vertices.len();
            for (k, &v) in chain.vertices.iter().enumerate() {
                if !chain.closed && (k == 0 || k == m - 1) {
                    self.fixed[v as usize] = true;
                    continue;
                }
                let before = &chain.edges[if k == 0 { chain.edges.len() - 1 } else { k - 1 }];
                let after = &chain.edges[k];
                let same =
                    before.interior == after.interior && (0..2).all(|s| before.sides[s].continues(&after.sides[s]));
                self.fixed[v as usize] = !same;
                let (p, q) = (self.points[before.vertices[0] as usize], self.points[v as usize]);
                let r = self.points[after.vertices[1] as usize];
                self.corner[v as usize] = turns_more(&p, &q, &r, cos_feature);
            }
        }
        for v in 0..self.points.len() {
            self.corner[v] |= self.fixed[v];
        }
    }
}

/// Whether the path `p`, `q`, `r` turns at `q` by more than the angle of the given cosine.
fn turns_more(p: &Point<2>, q: &Point<2>, r: &Point<2>, cosine: f64) -> bool {
    let (ax, ay) = (q[0] - p[0], q[1] - p[1]);
    let (bx, by) = (r[0] - q[0], r[1] - q[1]);
    let dot = ax * bx + ay * by;
    dot < cosine * ((ax * ax + ay * ay).sqrt() * (bx * bx + by * by).sqrt())
}

/// Groups facet nodes by coordinates: CSR of copies, groups in the order of their lowest node, and the group of a node.
fn weld(points: &[Point<2>], facets: &[FacetRow]) -> (Vec<u32>, Vec<u32>, HashMap<u32, u32>) {
    let mut nodes: Vec<u32> = facets.iter().flat_map(|f| f.nodes).collect();
    nodes.sort_unstable();
    nodes.dedup();
    // adding 0.0 makes a negative zero positive
    let key = |i: u32| points[i as usize].map(|x| (x + 0.0).to_bits());
    let mut by_place = nodes.clone();
    by_place.sort_unstable_by_key(|&i| (key(i), i));
    let mut first: HashMap<u32, u32> = HashMap::new();
    for run in by_place.chunk_by(|&a, &b| key(a) == key(b)) {
        if run.len() > 1 {
            first.extend(run.iter().map(|&i| (i, run[0])));
        }
    }
    let mut groups: Vec<(u32, u32)> = nodes.iter().map(|&i| (*first.get(&i).unwrap_or(&i), i)).collect();
    groups.sort_unstable();
    let (mut start, mut copies) = (Vec::new(), Vec::with_capacity(groups.len()));
    let mut vertex_of = HashMap::with_capacity(groups.len());
    for run in groups.chunk_by(|a, b| a.0 == b.0) {
        start.push(copies.len() as u32);
        for &(_, node) in run {
            vertex_of.insert(node, start.len() as u32 - 1);
            copies.push(node);
        }
    }
    start.push(copies.len() as u32);
    (start, copies, vertex_of)
}

/// Joins the rows that lie on one pair of vertices into a facet edge.
fn join(facets: &[FacetRow], vertex_of: &HashMap<u32, u32>) -> Result<Vec<FacetEdge>, Error> {
    let mut rows: Vec<FacetEdge> = Vec::with_capacity(facets.len());
    for facet in facets {
        let [a, b] = facet.nodes;
        let (given, tag) = (facet.given.is_some(), facet.given.unwrap_or(0));
        let left = Side { tail: a, head: b, cell_tag: facet.cell_tags.0, given, tag };
        let right = match facet.cell_tags.1 {
            Some(cell_tag) => Side { cell_tag, ..left },
            None => Side::EMPTY,
        };
        let vertices = [vertex_of[&a], vertex_of[&b]];
        let edge = FacetEdge { vertices, sides: [left, right], interior: facet.cell_tags.1.is_some() };
        rows.push(if vertices[0] <= vertices[1] { edge } else { edge.reversed() });
    }
    rows.sort_by_key(|edge| edge.vertices);
    let mut edges: Vec<FacetEdge> = Vec::with_capacity(rows.len());
    for row in rows {
        match edges.last_mut() {
            Some(last) if last.vertices == row.vertices => {
                for s in 0..2 {
                    if row.sides[s].is_inside() {
                        if last.sides[s].is_inside() {
                            return Err(Error::Internal(format!(
                                "two cells on one side of the facet between nodes {} and {}",
                                row.sides[s].tail, row.sides[s].head
                            )));
                        }
                        last.sides[s] = row.sides[s];
                    }
                }
            }
            _ => edges.push(row),
        }
    }
    Ok(edges)
}

/// Squared distance from `p` to the segment `a b`, measured from the nearer end: along a segment 1e15 times as long as the
/// distance, rounding would hide it.
pub fn segment_distance_2(p: &Point<2>, a: &Point<2>, b: &Point<2>) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let (px, py, qx, qy) = (p[0] - a[0], p[1] - a[1], p[0] - b[0], p[1] - b[1]);
    let first = px * px + py * py <= qx * qx + qy * qy;
    let (dx, dy, px, py) = if first { (dx, dy, px, py) } else { (-dx, -dy, qx, qy) };
    let length_2 = dx * dx + dy * dy;
    let t = if length_2 > 0.0 { ((px * dx + py * dy) / length_2).clamp(0.0, 1.0) } else { 0.0 };
    let (ex, ey) = (px - t * dx, py - t * dy);
    ex * ex + ey * ey
}

/// Whether two segments share a point that is not an end of both.
pub fn segments_cross(a: &Point<2>, b: &Point<2>, c: &Point<2>, d: &Point<2>) -> bool {
    let side = |p, q, r| {
        let o = orient(p, q, r);
        (o > 0.0) as i8 - (o < 0.0) as i8
    };
    let (c1, d1, a1, b1) = (side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b));
    if c1 * d1 < 0 && a1 * b1 < 0 {
        return true;
    }
    // an end of one in the interior of the other, or an overlap of collinear ones
    (c1 == 0 && strictly_between(c, a, b))
        || (d1 == 0 && strictly_between(d, a, b))
        || (a1 == 0 && strictly_between(a, c, d))
        || (b1 == 0 && strictly_between(b, c, d))
        || (a == c && b == d)
        || (a == d && b == c)
}

/// Whether `p`, known to be collinear with `a` and `b`, lies between them and is neither.
fn strictly_between(p: &Point<2>, a: &Point<2>, b: &Point<2>) -> bool {
    if p == a || p == b {
        return false;
    }
    let k = if (a[0] - b[0]).abs() >= (a[1] - b[1]).abs() { 0 } else { 1 };
    (a[k] <= p[k] && p[k] <= b[k]) || (b[k] <= p[k] && p[k] <= a[k])
}
