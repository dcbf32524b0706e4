//! Walls of a mesh and the loops along them, by counting edges: what "the same domain" means.
//!
//! A *wall* is a directed edge with a cell on its left that is boundary, separates two tags, or was given. Walking along
//! walls with the cells on the left, turning at each node to the next wall through the cells, gives closed *loops*. Two
//! meshes are of one domain where the loops of one are those of the other with nodes left out, loops of one region
//! (cells connected without crossing a wall) belong to one region of the other, and so for parts.

use super::Plane;
use _core::domain::FacetRow;
use std::collections::{BTreeMap, HashMap};

/// What lies beside a wall, so that a wall may run on past a node only where it stays the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Label {
    /// Tag of the cell on the left.
    pub left: i64,
    /// Tag of the cell on the right, where one shares the edge.
    pub right: Option<i64>,
    /// Tag of the given facet.
    pub given: Option<i64>,
}

/// A wall from node `tail` to the tail of the next one of its loop.
#[derive(Debug, Clone, PartialEq)]
pub struct Wall {
    /// Node where it starts.
    pub tail: u32,
    /// Node where it ends.
    pub head: u32,
    /// What lies beside it.
    pub label: Label,
    /// Nodes that were left out between tail and head.
    pub between: Vec<u32>,
}

/// Orientation, exactly.
pub fn orient(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let at = |p: [f64; 2]| robust::Coord { x: p[0], y: p[1] };
    robust::orient2d(at(a), at(b), at(c))
}

/// A key of an undirected edge.
pub fn edge_key(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Cells, tags and given facets with the cell on the left of each directed edge.
pub struct Map<'a> {
    /// Cells.
    pub cells: &'a [[u32; 3]],
    tags: &'a [i64],
    given: HashMap<[u32; 2], i64>,
    left: HashMap<[u32; 2], u32>,
    /// Whether no directed edge has two cells.
    pub is_conforming: bool,
}

impl<'a> Map<'a> {
    /// Counts the edges.
    pub fn new(cells: &'a [[u32; 3]], tags: &'a [i64], given: impl Iterator<Item = ([u32; 2], i64)>) -> Map<'a> {
        let mut map = Map {
            cells,
            tags,
            given: given.map(|([a, b], tag)| (edge_key(a, b), tag)).collect(),
            left: HashMap::new(),
            is_conforming: true,
        };
        for (t, &[a, b, c]) in cells.iter().enumerate() {
            for edge in [[a, b], [b, c], [c, a]] {
                map.is_conforming &= map.left.insert(edge, t as u32).is_none();
            }
        }
        map
    }

    /// The cell on the left of a directed edge.
    pub fn left_of(&self, a: u32, b: u32) -> Option<u32> {
        self.left.get(&[a, b]).copied()
    }

    /// Label of a directed edge that has a cell on its left, where it is a wall.
    pub fn wall(&self, a: u32, b: u32) -> Option<Label> {
        let left = self.tags[self.left_of(a, b)? as usize];
        let right = self.left_of(b, a).map(|t| self.tags[t as usize]);
        let given = self.given.get(&edge_key(a, b)).copied();
        (right != Some(left) || given.is_some()).then_some(Label { left, right, given })
    }

    /// Loops along the walls and the cell at the start of each, the map being conforming.
    pub fn loops(&self) -> Vec<(Vec<Wall>, u32)> {
        let mut loops = Vec::new();
        let mut seen: HashMap<[u32; 2], ()> = HashMap::new();
        for (t, &[a, b, c]) in self.cells.iter().enumerate() {
            for edge in [[a, b], [b, c], [c, a]] {
                if seen.contains_key(&edge) || self.wall(edge[0], edge[1]).is_none() {
                    continue;
                }
                let mut walls = Vec::new();
                let [mut u, mut v] = edge;
                while let Some(label) = self.wall(u, v) {
                    if seen.insert([u, v], ()).is_some() {
                        break;
                    }
                    walls.push(Wall { tail: u, head: v, label, between: Vec::new() });
                    let mut at = self.left[&[u, v]];
                    (u, v) = loop {
                        let cell = self.cells[at as usize];
                        let k = cell.iter().position(|&i| i == v).expect("a cell of the fan holds its node");
                        let w = cell[(k + 1) % 3];
                        match self.wall(v, w) {
                            Some(_) => break (v, w),
                            None => at = self.left[&[w, v]],
                        }
                    };
                }
                loops.push((walls, t as u32));
            }
        }
        loops
    }

    /// Component of each cell, edges for which `crossed` holds being crossed.
    pub fn components(&self, crossed: impl Fn(u32, u32) -> bool) -> Vec<u32> {
        let mut of = vec![u32::MAX; self.cells.len()];
        let mut count = 0;
        for first in 0..self.cells.len() {
            if of[first] != u32::MAX {
                continue;
            }
            of[first] = count;
            let mut stack = vec![first as u32];
            while let Some(t) = stack.pop() {
                let [a, b, c] = self.cells[t as usize];
                for [u, v] in [[a, b], [b, c], [c, a]] {
                    if let Some(next) = self.left_of(v, u).filter(|&s| of[s as usize] == u32::MAX && crossed(u, v)) {
                        of[next as usize] = count;
                        stack.push(next);
                    }
                }
            }
            count += 1;
        }
        of
    }
}

/// Loops with the nodes left out that are not kept, each begun at its least place; the regions by their loops, and the
/// region of each node that is on no wall.
#[derive(Debug, Default)]
pub struct Walls {
    /// Loops, ascending.
    pub loops: Vec<Vec<Wall>>,
    /// Loops of each region, ascending; regions ascending.
    pub regions: Vec<Vec<usize>>,
    /// Regions of each part, ascending; parts ascending.
    pub parts: Vec<Vec<usize>>,
    /// Region of each node that is on no wall.
    pub region_of: BTreeMap<u32, usize>,
}

/// What is compared of a loop.
pub fn outline(walls: &[Wall]) -> Vec<(u32, Label)> {
    walls.iter().map(|wall| (wall.tail, wall.label)).collect()
}

impl Walls {
    /// Walls of a map as they are where only `kept` nodes stay; an error where a node is left out that can't be.
    pub fn new(map: &Map<'_>, kept: impl Fn(u32) -> bool) -> Result<Walls, String> {
        let region = map.components(|u, v| map.wall(u, v).is_none());
        let part = map.components(|_, _| true);
        let mut found: Vec<(Vec<Wall>, u32)> = Vec::new();
        for (walls, cell) in map.loops() {
            found.push((contract(walls, &kept)?, cell));
        }
        found.sort_by_key(|a| outline(&a.0));
        let n_regions = region.iter().map(|&r| r as usize + 1).max().unwrap_or(0);
        let (mut loops_of, mut part_of) = (vec![Vec::new(); n_regions], vec![0; n_regions]);
        for (l, &(_, cell)) in found.iter().enumerate() {
            loops_of[region[cell as usize] as usize].push(l);
        }
        for t in 0..map.cells.len() {
            part_of[region[t] as usize] = part[t];
        }
        let mut order: Vec<usize> = (0..n_regions).collect();
        order.sort_by(|&a, &b| loops_of[a].cmp(&loops_of[b]));
        let mut place = vec![0; n_regions];
        order.iter().enumerate().for_each(|(k, &r)| place[r] = k);
        let mut parts: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        order.iter().enumerate().for_each(|(k, &r)| parts.entry(part_of[r]).or_default().push(k));
        let mut parts: Vec<Vec<usize>> = parts.into_values().collect();
        parts.sort();
        let mut region_of = BTreeMap::new();
        for (t, cell) in map.cells.iter().enumerate() {
            region_of.extend(cell.iter().map(|&i| (i, place[region[t] as usize])));
        }
        for (&[a, b], _) in map.left.iter().filter(|&(&[a, b], _)| map.wall(a, b).is_some()) {
            region_of.remove(&a);
            region_of.remove(&b);
        }
        let regions = order.iter().map(|&r| loops_of[r].clone()).collect();
        Ok(Walls { loops: found.into_iter().map(|(walls, _)| walls).collect(), regions, parts, region_of })
    }
}

fn contract(walls: Vec<Wall>, kept: &impl Fn(u32) -> bool) -> Result<Vec<Wall>, String> {
    let Some(first) = walls.iter().position(|wall| kept(wall.tail)) else {
        return Err(format!("a loop of {} walls lost all its nodes, e.g. {}", walls.len(), walls[0].tail));
    };
    let mut out: Vec<Wall> = Vec::new();
    let n = walls.len();
    for wall in walls.into_iter().cycle().skip(first).take(n) {
        match out.last_mut() {
            Some(last) if !kept(wall.tail) => {
                if last.label != wall.label {
                    return Err(format!(
                        "node {} was left out where {:?} ends and {:?} begins",
                        wall.tail, last.label, wall.label
                    ));
                }
                last.between.push(wall.tail);
                last.head = wall.head;
            }
            _ => out.push(wall),
        }
    }
    let key = outline(&out);
    let least = (0..out.len()).min_by(|&a, &b| key[a..].iter().chain(&key[..a]).cmp(key[b..].iter().chain(&key[..b])));
    out.rotate_left(least.unwrap_or(0));
    Ok(out)
}

/// The facet edges of a mesh as the package takes them.
pub fn facet_rows(plane: &Plane) -> Vec<FacetRow> {
    let map = Map::new(&plane.cells, &plane.tags, plane.given.iter().copied());
    let (mut boundary, mut interior) = (Vec::new(), Vec::new());
    for &[a, b, c] in &plane.cells {
        for [u, v] in [[a, b], [b, c], [c, a]] {
            let Some(label) = map.wall(u, v) else { continue };
            let row = FacetRow { nodes: [u, v], cell_tags: (label.left, label.right), given: label.given };
            match label.right {
                None => boundary.push(row),
                Some(_) if u < v => interior.push(row),
                Some(_) => {}
            }
        }
    }
    boundary.append(&mut interior);
    boundary
}

/// Whether a plane is a mesh that the package takes.
pub fn is_legal(plane: &Plane) -> bool {
    let map = Map::new(&plane.cells, &plane.tags, plane.given.iter().copied());
    if plane.cells.is_empty() || !map.is_conforming || plane.points.iter().flatten().any(|x| !x.is_finite()) {
        return false;
    }
    let mut used = vec![false; plane.points.len()];
    plane.cells.iter().flatten().for_each(|&i| used[i as usize] = true);
    let is_edge = |[a, b]: [u32; 2]| map.left_of(a, b).is_some() || map.left_of(b, a).is_some();
    used.iter().all(|&u| u)
        && plane.given.iter().all(|&(edge, _)| is_edge(edge))
        && !is_soup(plane, &map)
        && geometry_fault(&plane.points, &plane.cells).is_none()
        && geometry_fault(&flushed(&plane.points), &plane.cells).is_none()
}

/// The points as the triangulator takes them: magnitudes under 1.8e-43 are zero to it, and a mesh that lives on them is none.
fn flushed(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    points.iter().map(|p| p.map(|x| if x.abs() < spade::MIN_ALLOWED_VALUE { 0.0 } else { x })).collect()
}

/// Whether some cell has all three edges doubled.
fn is_soup(plane: &Plane, map: &Map<'_>) -> bool {
    let key = |i: u32| plane.points[i as usize].map(|x| (x + 0.0).to_bits());
    let mut sides: HashMap<[[u64; 2]; 2], u32> = HashMap::new();
    let free = |u: u32, v: u32| map.left_of(v, u).is_none();
    let edges = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
    for [u, v] in plane.cells.iter().flat_map(edges).filter(|&[u, v]| free(u, v)) {
        *sides.entry([key(u), key(v)]).or_default() += 1;
    }
    plane.cells.iter().any(|cell| edges(cell).iter().all(|&[u, v]| free(u, v) && sides.contains_key(&[key(v), key(u)])))
}

/// Why cells are no embedded triangulation: a cell that is not positive, two cells that overlap, a node inside an edge.
pub fn geometry_fault(points: &[[f64; 2]], cells: &[[u32; 3]]) -> Option<String> {
    let corners = |t: usize| cells[t].map(|i| points[i as usize]);
    for (t, cell) in cells.iter().enumerate() {
        let [a, b, c] = corners(t);
        // NaN is a fault too
        if !matches!(orient(a, b, c).partial_cmp(&0.0), Some(std::cmp::Ordering::Greater)) {
            return Some(format!("cell {cell:?} at {:?} is not positive", [a, b, c]));
        }
    }
    let low = |t: usize, k: usize| corners(t).iter().fold(f64::INFINITY, |m, p| m.min(p[k]));
    let high = |t: usize, k: usize| corners(t).iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[k]));
    let boxes: Vec<[f64; 4]> = (0..cells.len()).map(|t| [low(t, 0), high(t, 0), low(t, 1), high(t, 1)]).collect();
    let mut order: Vec<usize> = (0..cells.len()).collect();
    order.sort_by(|&a, &b| boxes[a][0].total_cmp(&boxes[b][0]));
    let mut active: Vec<usize> = Vec::new();
    for &t in &order {
        active.retain(|&s| boxes[s][1] >= boxes[t][0]);
        for &s in &active {
            if boxes[s][3] < boxes[t][2] || boxes[t][3] < boxes[s][2] {
                continue;
            }
            let (one, other) = (corners(s), corners(t));
            if !separated(one, other) && !separated(other, one) {
                return Some(format!("cells {:?} {one:?} and {:?} {other:?} overlap", cells[s], cells[t]));
            }
            for (p, q) in [(one, other), (other, one)] {
                for k in 0..3 {
                    let (a, b) = (p[k], p[(k + 1) % 3]);
                    if let Some(x) = q.iter().find(|&&x| on_open_segment(x, a, b)) {
                        return Some(format!("node at {x:?} lies within the edge {a:?} {b:?}"));
                    }
                }
            }
        }
        active.push(t);
    }
    None
}

/// Whether an edge of the first triangle has the second wholly on its outer side.
fn separated(one: [[f64; 2]; 3], other: [[f64; 2]; 3]) -> bool {
    (0..3).any(|k| other.iter().all(|&x| orient(one[k], one[(k + 1) % 3], x) <= 0.0))
}

fn on_open_segment(x: [f64; 2], a: [f64; 2], b: [f64; 2]) -> bool {
    if x == a || x == b {
        return false;
    }
    let within = |k: usize| a[k].min(b[k]) <= x[k] && x[k] <= a[k].max(b[k]);
    within(0) && within(1) && orient(a, b, x) == 0.0
}
