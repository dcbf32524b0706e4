//! What makes a plain mesh a domain: holes, pinches, slits, interfaces, given facets, needles, further parts, scales.

use super::random::Random;
use super::topology::{Map, edge_key, geometry_fault, orient};
use super::{Plane, base};
use std::collections::{HashMap, HashSet};
use std::f64::consts::TAU;

/// Carves a mesh. The outcome need not be legal.
pub fn carve(plane: &mut Plane, random: &mut Random) {
    if plane.cells.is_empty() {
        return;
    }
    let has_pattern = plane.tags.iter().any(|&tag| tag != 0);
    if !has_pattern && random.chance(0.5) {
        pattern(plane, random);
    }
    match random.below(4) {
        0 => {
            let tag = plane.tags[random.below(plane.tags.len())];
            let wanted = plane.tags.iter().map(|&t| t != tag).collect::<Vec<_>>();
            if wanted.iter().any(|&w| w) {
                keep_cells(plane, &wanted);
            }
        }
        1 => cut_between_tags(plane, random),
        _ => {}
    }
    if random.chance(0.4) {
        holes(plane, random);
    }
    if random.chance(0.15) {
        pinch(plane, random);
    }
    if random.chance(0.2) {
        join(plane, random);
    }
    match random.below(4) {
        0 => plane.tags.iter_mut().for_each(|tag| *tag = 0),
        1 => pattern(plane, random),
        _ => {}
    }
    if random.chance(0.45) {
        let edges = paths(plane, random);
        cut(plane, &edges, random);
    }
    if random.chance(0.2) {
        open(plane, random);
    }
    if random.chance(0.15) {
        (0..random.range(1, 4)).for_each(|_| spike(plane, random));
    }
    if random.chance(0.35) {
        give(plane, random);
    }
    if random.chance(0.35) {
        place(plane, random);
    }
    renumber(plane, random);
}

/// Keeps some cells, and the nodes that they have.
pub fn keep_cells(plane: &mut Plane, wanted: &[bool]) {
    let keep = |k: &usize| wanted[*k];
    plane.tags = (0..plane.cells.len()).filter(keep).map(|k| plane.tags[k]).collect();
    plane.cells = (0..plane.cells.len()).filter(keep).map(|k| plane.cells[k]).collect();
    compact(plane);
}

/// Drops nodes without a cell and given facets without an edge.
pub fn compact(plane: &mut Plane) {
    let mut at = vec![u32::MAX; plane.points.len()];
    let mut points = Vec::new();
    for i in plane.cells.iter_mut().flatten() {
        if at[*i as usize] == u32::MAX {
            at[*i as usize] = points.len() as u32;
            points.push(plane.points[*i as usize]);
        }
        *i = at[*i as usize];
    }
    plane.points = points;
    let edges: HashSet<[u32; 2]> =
        plane.cells.iter().flat_map(|&[a, b, c]| [edge_key(a, b), edge_key(b, c), edge_key(c, a)]).collect();
    plane.given.retain_mut(|(edge, _)| {
        *edge = edge.map(|i| at[i as usize]);
        !edge.contains(&u32::MAX) && edges.contains(&edge_key(edge[0], edge[1]))
    });
}

fn neighbours(plane: &Plane) -> Vec<[Option<u32>; 3]> {
    let map = Map::new(&plane.cells, &plane.tags, std::iter::empty());
    plane.cells.iter().map(|&[a, b, c]| [[b, a], [c, b], [a, c]].map(|[u, v]| map.left_of(u, v))).collect()
}

/// Cells around a random one, breadth first.
fn patch(plane: &Plane, size: usize, random: &mut Random) -> Vec<usize> {
    let around = neighbours(plane);
    let mut found = vec![random.below(plane.cells.len())];
    let mut at = 0;
    while at < found.len() && found.len() < size {
        for s in around[found[at]].iter().flatten() {
            if !found.contains(&(*s as usize)) && random.chance(0.8) {
                found.push(*s as usize);
            }
        }
        at += 1;
    }
    found
}

/// Tags in patches, at random, in rings, in Voronoi cells, in stripes.
fn pattern(plane: &mut Plane, random: &mut Random) {
    let centre = |plane: &Plane, t: usize| {
        [0, 1].map(|k| plane.cells[t].iter().map(|&i| plane.points[i as usize][k]).sum::<f64>() / 3.0)
    };
    match random.below(5) {
        0 => {
            for tag in 1..=random.range(1, 4) {
                let size = random.range(1, plane.cells.len() / 3 + 1);
                patch(plane, size, random).into_iter().for_each(|t| plane.tags[t] = tag as i64);
            }
        }
        1 => {
            let share = random.between(0.02, 0.5);
            plane.tags.iter_mut().for_each(|tag| *tag = i64::from(random.chance(share)));
        }
        2 => {
            let around = neighbours(plane);
            let mut depth = vec![-1; plane.cells.len()];
            let mut found = vec![random.below(plane.cells.len())];
            depth[found[0]] = 0;
            let mut at = 0;
            while at < found.len() {
                let t = found[at];
                for s in around[t].iter().flatten().map(|&s| s as usize) {
                    if depth[s] < 0 {
                        depth[s] = depth[t] + 1;
                        found.push(s);
                    }
                }
                at += 1;
            }
            let modulus = random.range(2, 4) as i64;
            plane.tags = depth.into_iter().map(|d| if d < 0 { 7 } else { d % modulus }).collect();
        }
        3 => {
            let seeds: Vec<[f64; 2]> =
                (0..random.range(2, 7)).map(|_| centre(plane, random.below(plane.cells.len()))).collect();
            for t in 0..plane.cells.len() {
                let [x, y] = centre(plane, t);
                let near = (0..seeds.len()).min_by(|&a, &b| {
                    let d = |s: usize| (seeds[s][0] - x).hypot(seeds[s][1] - y);
                    d(a).total_cmp(&d(b))
                });
                plane.tags[t] = near.unwrap_or(0) as i64;
            }
        }
        _ => {
            let (turn, width) = (TAU * random.unit(), random.between(0.05, 2.0));
            for t in 0..plane.cells.len() {
                let [x, y] = centre(plane, t);
                plane.tags[t] = ((x * turn.cos() + y * turn.sin()) / width).floor().rem_euclid(3.0) as i64;
            }
        }
    }
}

fn holes(plane: &mut Plane, random: &mut Random) {
    let mut wanted = vec![true; plane.cells.len()];
    if random.chance(0.15) {
        let share = random.between(0.05, 0.5);
        wanted.iter_mut().for_each(|w| *w = !random.chance(share));
    } else {
        for _ in 0..random.range(1, 6) {
            let size = random.pick(&[1, 1, 2, 4, 8, 30]);
            patch(plane, size, random).into_iter().for_each(|t| wanted[t] = false);
        }
    }
    if wanted.iter().any(|&w| w) {
        keep_cells(plane, &wanted);
    }
}

/// Takes cells away so that fans touch at a node only.
fn pinch(plane: &mut Plane, random: &mut Random) {
    let mut wanted = vec![true; plane.cells.len()];
    for _ in 0..random.range(1, 5) {
        let node = random.below(plane.points.len()) as u32;
        for (t, _) in plane.cells.iter().enumerate().filter(|(_, cell)| cell.contains(&node)) {
            wanted[t] &= random.chance(0.5);
        }
    }
    if wanted.iter().any(|&w| w) {
        keep_cells(plane, &wanted);
    }
}

/// Adds a second mesh to the right: apart, nearly touching, or touching at a node that is shared or doubled.
fn join(plane: &mut Plane, random: &mut Random) {
    let other = base::base(random);
    if other.cells.is_empty() {
        return;
    }
    let extreme = |points: &[[f64; 2]], sign: f64| {
        (0..points.len()).max_by(|&a, &b| (sign * points[a][0]).total_cmp(&(sign * points[b][0]))).unwrap_or(0)
    };
    compact(plane);
    let (right, left) = (extreme(&plane.points, 1.0), extreme(&other.points, -1.0));
    let gap = random.pick(&[0.0, 0.0, 1e-10, 1e-3, 0.3]);
    let (p, q) = (plane.points[right], other.points[left]);
    let first = plane.points.len() as u32;
    plane.points.extend(other.points.iter().map(|x| [x[0] - q[0] + p[0] + gap, x[1] - q[1] + p[1]]));
    plane.points[first as usize + left] = [p[0] + gap, p[1]];
    plane.cells.extend(other.cells.iter().map(|cell| cell.map(|i| i + first)));
    plane.tags.extend(&other.tags);
    if gap == 0.0 && random.chance(0.5) {
        for i in plane.cells.iter_mut().flatten().filter(|i| **i == first + left as u32) {
            *i = right as u32;
        }
    }
    compact(plane);
}

/// Edges of random walks: straight or wild, alone, branching or crossing; or the rim of a patch.
fn paths(plane: &Plane, random: &mut Random) -> HashSet<[u32; 2]> {
    let mut edges = HashSet::new();
    let mut around: HashMap<u32, Vec<u32>> = HashMap::new();
    for &[a, b, c] in &plane.cells {
        for [u, v] in [[a, b], [b, c], [c, a]] {
            around.entry(u).or_default().push(v);
            around.entry(v).or_default().push(u);
        }
    }
    around.values_mut().for_each(|list| {
        list.sort_unstable();
        list.dedup();
    });
    let branching = random.chance(0.4);
    let mut start = random.below(plane.points.len()) as u32;
    for _ in 0..random.range(1, 4) {
        if random.chance(0.15) {
            let size = random.range(1, 20);
            let cells = patch(plane, size, random);
            let mut count: HashMap<[u32; 2], u32> = HashMap::new();
            for &[a, b, c] in cells.iter().map(|&t| &plane.cells[t]) {
                [[a, b], [b, c], [c, a]].iter().for_each(|&[u, v]| *count.entry(edge_key(u, v)).or_default() += 1);
            }
            edges.extend(count.into_iter().filter(|&(_, n)| n == 1).map(|(edge, _)| edge));
            continue;
        }
        let straight = random.between(0.0, 1.0);
        let mut at = start;
        let mut way = [random.between(-1.0, 1.0), random.between(-1.0, 1.0)];
        let mut seen = vec![at];
        for _ in 0..random.range(1, 20) {
            let Some(list) = around.get(&at) else { break };
            let p = plane.points[at as usize];
            let ahead = |&v: &u32| {
                let q = plane.points[v as usize];
                let d = [q[0] - p[0], q[1] - p[1]];
                (d[0] * way[0] + d[1] * way[1]) / d[0].hypot(d[1])
            };
            let next = if random.chance(straight) {
                list.iter().copied().max_by(|a, b| ahead(a).total_cmp(&ahead(b))).unwrap_or(at)
            } else {
                random.pick(list)
            };
            if seen.contains(&next) && random.chance(0.9) {
                break;
            }
            let q = plane.points[next as usize];
            way = [q[0] - p[0], q[1] - p[1]];
            edges.insert(edge_key(at, next));
            seen.push(next);
            at = next;
        }
        start = if branching { random.pick(&seen) } else { random.below(plane.points.len()) as u32 };
    }
    edges
}

fn cut_between_tags(plane: &mut Plane, random: &mut Random) {
    let map = Map::new(&plane.cells, &plane.tags, std::iter::empty());
    let mut edges = HashSet::new();
    for &[a, b, c] in &plane.cells {
        for [u, v] in [[a, b], [b, c], [c, a]] {
            if map.wall(u, v).is_some() {
                edges.insert(edge_key(u, v));
            }
        }
    }
    let share = random.pick(&[1.0, 0.9, 0.5]);
    let mut edges: Vec<[u32; 2]> = edges.into_iter().collect();
    edges.sort_unstable();
    let edges = edges.into_iter().filter(|_| random.chance(share)).collect();
    cut(plane, &edges, random);
}

/// Doubles the nodes along edges, a copy for each fan of cells between them; now and then fans keep a node in common.
fn cut(plane: &mut Plane, edges: &HashSet<[u32; 2]>, random: &mut Random) {
    let around = neighbours(plane);
    let touched: HashSet<u32> = edges.iter().flatten().copied().collect();
    // corner k of cell t is 3 t + k; corners of one fan are joined
    let mut group: Vec<usize> = (0..3 * plane.cells.len()).collect();
    fn root(group: &mut [usize], mut i: usize) -> usize {
        while group[i] != i {
            group[i] = group[group[i]];
            i = group[i];
        }
        i
    }
    for (t, (cell, around)) in plane.cells.iter().zip(&around).enumerate() {
        for (k, other) in around.iter().enumerate() {
            let ends = [cell[k], cell[(k + 1) % 3]];
            let Some(s) = other.map(|s| s as usize).filter(|_| !edges.contains(&edge_key(ends[0], ends[1]))) else {
                continue;
            };
            for node in ends {
                let corner = |t: usize| 3 * t + plane.cells[t].iter().position(|&i| i == node).unwrap_or(0);
                let (a, b) = (root(&mut group, corner(t)), root(&mut group, corner(s)));
                group[a] = b;
            }
        }
    }
    let stitched = if random.chance(0.25) { random.between(0.0, 0.5) } else { 0.0 };
    let mut first: Vec<Option<usize>> = vec![None; plane.points.len()];
    for corner in 0..group.len() {
        let node = plane.cells[corner / 3][corner % 3];
        if !touched.contains(&node) || random.chance(stitched / 4.0) {
            let a = root(&mut group, corner);
            let b = root(&mut group, *first[node as usize].get_or_insert(a));
            group[a] = b;
        }
    }
    let mut copy: HashMap<usize, u32> = HashMap::new();
    let mut points = Vec::new();
    let old = plane.cells.clone();
    for corner in 0..group.len() {
        let node = old[corner / 3][corner % 3];
        let copy = *copy.entry(root(&mut group, corner)).or_insert_with(|| {
            points.push(plane.points[node as usize]);
            points.len() as u32 - 1
        });
        plane.cells[corner / 3][corner % 3] = copy;
    }
    plane.points = points;
}

/// Moves copies apart into their own cells: slits become thin notches and cavities, and nodes nearly coincide.
fn open(plane: &mut Plane, random: &mut Random) {
    let width = random.pick(&[1e-12, 1e-9, 1e-6, 1e-3, 0.1, 0.3]);
    let key = |p: [f64; 2]| p.map(f64::to_bits);
    let mut count: HashMap<[u64; 2], u32> = HashMap::new();
    plane.points.iter().for_each(|&p| *count.entry(key(p)).or_default() += 1);
    let everywhere = random.chance(0.3);
    for i in 0..plane.points.len() {
        let p = plane.points[i];
        if (!everywhere && count[&key(p)] < 2) || random.chance(0.2) {
            continue;
        }
        let fan: Vec<[u32; 3]> = plane.cells.iter().copied().filter(|cell| cell.contains(&(i as u32))).collect();
        let corners = fan.iter().flatten().map(|&j| plane.points[j as usize]);
        let n = 3.0 * fan.len() as f64;
        let [x, y] = corners.fold([0.0; 2], |s, q| [s[0] + q[0] / n, s[1] + q[1] / n]);
        plane.points[i] = [p[0] + width * (x - p[0]), p[1] + width * (y - p[1])];
        let is_turned = |cell: &[u32; 3]| {
            let [a, b, c] = cell.map(|j| plane.points[j as usize]);
            orient(a, b, c) <= 0.0
        };
        if fan.iter().any(is_turned) {
            plane.points[i] = p;
        }
    }
}

/// Adds a cell beyond a boundary edge: flat, fair or a needle.
fn spike(plane: &mut Plane, random: &mut Random) {
    let map = Map::new(&plane.cells, &plane.tags, std::iter::empty());
    let rim: Vec<[u32; 2]> = plane
        .cells
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .filter(|&[u, v]| map.left_of(v, u).is_none())
        .collect();
    if rim.is_empty() {
        return;
    }
    let [u, v] = random.pick(&rim);
    let [p, q] = [u, v].map(|i| plane.points[i as usize]);
    let (t, height) = (random.unit(), 10f64.powf(random.between(-10.0, 2.0)));
    let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
    let before = plane.clone();
    plane.points.push([p[0] + t * dx + height * dy, p[1] + t * dy - height * dx]);
    plane.cells.push([v, u, plane.points.len() as u32 - 1]);
    plane.tags.push(0);
    if geometry_fault(&plane.points, &plane.cells).is_some() {
        *plane = before;
    }
}

/// Gives facets: walks, or all edges of a kind, tags changing now and then.
fn give(plane: &mut Plane, random: &mut Random) {
    let mut edges: Vec<[u32; 2]> = if random.chance(0.7) {
        paths(plane, random).into_iter().collect()
    } else {
        let map = Map::new(&plane.cells, &plane.tags, std::iter::empty());
        let all = plane.cells.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        all.filter(|&[u, v]| map.wall(u, v).is_some()).map(|[u, v]| edge_key(u, v)).collect()
    };
    edges.sort_unstable();
    edges.dedup();
    let (share, tags) = (random.pick(&[1.0, 0.9, 0.3]), random.pick(&[1, 1, 2, 5]));
    for edge in edges {
        if random.chance(share) {
            plane.given.push((edge, random.below(tags) as i64));
        }
    }
}

/// Stretches, turns, scales and moves the mesh.
fn place(plane: &mut Plane, random: &mut Random) {
    let stretch = random.pick(&[1.0, 1.0, 10.0, 1e4]);
    let turn = random.pick(&[0.0, 0.0, 0.3, TAU / 8.0]);
    let scale = random.pick(&[1.0, 1e-6, 1e6, 1e3]);
    let offset = random.pick(&[0.0, 0.0, 1.0, 1e6]);
    for p in &mut plane.points {
        let (x, y) = (p[0], p[1] / stretch);
        let (x, y) = (x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos());
        *p = [scale * (x + offset), scale * (y - offset)];
    }
}

/// Numbers the nodes at random, so that copies and sides come in any order.
fn renumber(plane: &mut Plane, random: &mut Random) {
    let mut to: Vec<u32> = (0..plane.points.len() as u32).collect();
    random.shuffle(&mut to);
    let old = plane.points.clone();
    to.iter().zip(old).for_each(|(&i, p)| plane.points[i as usize] = p);
    plane.cells.iter_mut().flatten().for_each(|i| *i = to[*i as usize]);
    plane.given.iter_mut().for_each(|(edge, _)| *edge = edge.map(|i| to[i as usize]));
}
