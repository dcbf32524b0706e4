//! What must hold of every level, judged from the input and the level alone.

use super::Plane;
use super::topology::{Map, Wall, Walls, edge_key, geometry_fault, orient, outline};
use _core::hierarchy::{Level, Method, Options};
use _core::point::NONE;
use std::collections::{HashMap, HashSet};

/// Room for rounding where the package computes in floats.
const ROUNDING: f64 = 1e-9;

/// The first rule that a level breaks.
pub fn check(plane: &Plane, options: Options, levels: &[Level]) -> Option<String> {
    let map = Map::new(&plane.cells, &plane.tags, plane.given.iter().copied());
    for (i, level) in levels.iter().enumerate() {
        let coarser = levels.get(i + 1).filter(|_| options.nested);
        if let Err(fault) = check_level(plane, &map, options, level, coarser) {
            return Some(format!("level {}: {fault}", i + 1));
        }
    }
    None
}

type Fault = Result<(), String>;

fn check_level(plane: &Plane, map: &Map<'_>, options: Options, level: &Level, coarser: Option<&Level>) -> Fault {
    let mesh = &level.mesh;
    let n = mesh.nodes.len() as u32;
    if !mesh.nodes.windows(2).all(|w| w[0] < w[1]) || mesh.nodes.iter().any(|&i| i as usize >= plane.points.len()) {
        return Err("nodes: not ascending nodes of the input".into());
    }
    if mesh.cells.iter().flatten().any(|&i| i >= n) || mesh.cells.len() != mesh.cell_tags.len() {
        return Err("nodes: a cell names no node, or has no tag".into());
    }
    let is_used: HashSet<u32> = mesh.cells.iter().flatten().copied().collect();
    if let Some(i) = (0..n).find(|i| !is_used.contains(i)) {
        return Err(format!("nodes: node {} is in no cell", mesh.nodes[i as usize]));
    }
    // from here on in the input's nodes
    let cells: Vec<[u32; 3]> = mesh.cells.iter().map(|cell| cell.map(|i| mesh.nodes[i as usize])).collect();
    if let Some(fault) = geometry_fault(&plane.points, &cells) {
        return Err(format!("geometry: {fault}"));
    }
    let coarse = check_facets(level, &cells)?;
    if level.dropped.is_some() {
        if let Some(tag) = mesh.cell_tags.iter().find(|tag| !plane.tags.contains(tag)) {
            return Err(format!("tags: {tag} is no tag of the input"));
        }
        check_parts(map, &coarse)?;
    } else {
        check_domain(map, &coarse, level)?;
    }
    check_delaunay(plane, level, &cells)?;
    if let Some(coarser) = coarser
        && let Some(i) = coarser.mesh.nodes.iter().find(|i| mesh.nodes.binary_search(i).is_err())
    {
        return Err(format!("nested: node {i} of the next coarser level is missing"));
    }
    if options.method != Method::Mis && level.dropped.is_none() {
        check_spacing(plane, map, options, level, coarser)?;
    }
    Ok(())
}

/// The facets that are reported are those of the cells.
fn check_facets<'a>(level: &'a Level, cells: &'a [[u32; 3]]) -> Result<Map<'a>, String> {
    let mesh = &level.mesh;
    let facets: Vec<[u32; 2]> = mesh.facets.iter().map(|edge| edge.map(|i| mesh.nodes[i as usize])).collect();
    let given = facets.iter().zip(&mesh.facet_tags).filter_map(|(&edge, &tag)| Some((edge, tag?)));
    let coarse = Map::new(cells, &mesh.cell_tags, given);
    if !coarse.is_conforming {
        return Err("conforming: an edge has two cells on one side".into());
    }
    let mut listed = HashSet::new();
    for (k, &[a, b]) in facets.iter().enumerate() {
        let beside = [coarse.left_of(a, b), coarse.left_of(b, a)];
        let told = mesh.facet_cells[k].map(|t| (t != NONE).then_some(t));
        if beside != told || beside[0].is_none() || beside[1].is_none() != (k < mesh.n_boundary) {
            return Err(format!("facets: {:?} lies beside cells {beside:?}, not {told:?}", [a, b]));
        }
        if coarse.wall(a, b).is_none() || !listed.insert(edge_key(a, b)) {
            return Err(format!("facets: {:?} is no facet, or twice", [a, b]));
        }
    }
    for &[a, b, c] in cells {
        if let Some([u, v]) = [[a, b], [b, c], [c, a]]
            .into_iter()
            .find(|&[u, v]| coarse.wall(u, v).is_some() && !listed.contains(&edge_key(u, v)))
        {
            return Err(format!("facets: {:?} is missing", [u, v]));
        }
    }
    Ok(coarse)
}

/// The domain is the input's.
fn check_domain(fine: &Map<'_>, coarse: &Map<'_>, level: &Level) -> Fault {
    let mesh = &level.mesh;
    let want = Walls::new(fine, |i| mesh.nodes.binary_search(&i).is_ok()).map_err(|e| format!("domain: {e}"))?;
    let have = Walls::new(coarse, |_| true)?;
    let (wanted, had): (Vec<_>, Vec<_>) =
        (want.loops.iter().map(|l| outline(l)).collect(), have.loops.iter().map(|l| outline(l)).collect());
    if wanted != had {
        let lost = wanted.iter().find(|l| !had.contains(l));
        let found = had.iter().find(|l| !wanted.contains(l));
        return Err(format!("domain: loop {lost:?} became {found:?}"));
    }
    if want.regions != have.regions || want.parts != have.parts {
        return Err(format!("domain: regions {:?} became {:?}", want.regions, have.regions));
    }
    if let Some((i, _)) = have.region_of.iter().find(|&(i, region)| want.region_of.get(i) != Some(region)) {
        return Err(format!("domain: node {i} changed its region"));
    }
    Ok(())
}

/// The nodes of a part of the level are all of one part of the input: parts may be cut or vanish, and are never joined.
fn check_parts(fine: &Map<'_>, coarse: &Map<'_>) -> Fault {
    let parts_of = |map: &Map<'_>| {
        let mut parts: HashMap<u32, HashSet<u32>> = HashMap::new();
        for (cell, part) in map.cells.iter().zip(map.components(|_, _| true)) {
            cell.iter().for_each(|&i| {
                parts.entry(i).or_default().insert(part);
            });
        }
        parts
    };
    let of_node = parts_of(fine);
    let mut common: HashMap<u32, HashSet<u32>> = HashMap::new();
    for (i, parts) in parts_of(coarse) {
        for part in parts {
            let left = common.entry(part).or_insert_with(|| of_node[&i].clone());
            left.retain(|one| of_node[&i].contains(one));
            if left.is_empty() {
                return Err(format!("parts: node {i} is joined to another part"));
            }
        }
    }
    Ok(())
}

/// Every edge that is no facet is locally Delaunay.
fn check_delaunay(plane: &Plane, level: &Level, cells: &[[u32; 3]]) -> Fault {
    let mesh = &level.mesh;
    let facets: HashSet<[u32; 2]> =
        mesh.facets.iter().map(|edge| edge.map(|i| mesh.nodes[i as usize])).map(|[a, b]| edge_key(a, b)).collect();
    let map = Map::new(cells, &mesh.cell_tags, std::iter::empty());
    let at = |i: u32| {
        let [x, y] = plane.points[i as usize];
        robust::Coord { x, y }
    };
    for &[a, b, c] in cells {
        for [u, v, w] in [[a, b, c], [b, c, a], [c, a, b]] {
            let Some(other) = map.left_of(v, u).filter(|_| !facets.contains(&edge_key(u, v))) else { continue };
            let Some(x) = cells[other as usize].into_iter().find(|&i| i != u && i != v) else { continue };
            if robust::incircle(at(u), at(v), at(w), at(x)) > 0.0 {
                return Err(format!("Delaunay: node {x} lies in the circle of {:?}", [u, v, w]));
            }
        }
    }
    Ok(())
}

fn distance(p: [f64; 2], q: [f64; 2]) -> f64 {
    let (dx, dy) = (p[0] - q[0], p[1] - q[1]);
    (dx * dx + dy * dy).sqrt()
}

fn segment_distance(x: [f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    // from the nearer end, or rounding hides what is small against the segment
    let (a, b) = if distance(x, a) <= distance(x, b) { (a, b) } else { (b, a) };
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let p = [x[0] - a[0], x[1] - a[1]];
    let t = ((p[0] * dx + p[1] * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
    // relative to that end: far from the origin coordinates are rounded more than differences
    distance(p, [t * dx, t * dy])
}

/// Independence (Definition 3.5) and distance to the facets of the interior nodes that are new on this level, spacing
/// that grows with the level, and maximality where f is Definition 3.3's.
fn check_spacing(plane: &Plane, fine: &Map<'_>, options: Options, level: &Level, coarser: Option<&Level>) -> Fault {
    let mesh = &level.mesh;
    let rules = options.rules;
    let place = |i: u32| plane.points[i as usize];
    if level.spacing.len() != mesh.nodes.len() {
        return Err("spacing: not one value a node".into());
    }
    let walls = Walls::new(fine, |i| mesh.nodes.binary_search(&i).is_ok())?;
    let f_of = |i: u32| mesh.nodes.binary_search(&i).map(|k| level.spacing[k]).unwrap_or(f64::NAN);
    // dropping starts from a spacing that is not held under the gaps
    if let Some(coarser) = coarser.filter(|coarser| coarser.dropped.is_none()) {
        for (&i, &above) in coarser.mesh.nodes.iter().zip(&coarser.spacing) {
            if f_of(i) > above * (1.0 + ROUNDING) {
                return Err(format!("spacing: f falls from {} to {above} at node {i}", f_of(i)));
            }
        }
    }
    if options.min_angle.is_some() {
        return Ok(());
    }
    let is_seed = |i: u32| coarser.is_some_and(|coarser| coarser.mesh.nodes.binary_search(&i).is_ok());
    let facets: Vec<&Wall> = walls.loops.iter().flatten().collect();
    // differences of coordinates are no better than these
    let slack = 4.0 * f64::EPSILON * plane.points.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    for (&i, &f) in mesh.nodes.iter().zip(&level.spacing) {
        if is_seed(i) || !walls.region_of.contains_key(&i) {
            continue;
        }
        for (&j, &other) in mesh.nodes.iter().zip(&level.spacing) {
            let d = distance(place(i), place(j));
            if d > 0.0 && d < (f + other) / rules.beta {
                return Err(format!("independence: nodes {i} and {j} are {d} apart, f = {f}, {other}"));
            }
        }
        for wall in &facets {
            let d = segment_distance(place(i), place(wall.tail), place(wall.head));
            if d < rules.delta * f * (1.0 - ROUNDING) - slack {
                return Err(format!("delta: node {i} is {d} from facet {:?}, f = {f}", [wall.tail, wall.head]));
            }
        }
    }
    if !rules.hold && !options.keep && options.method == Method::Function && !options.pool {
        check_maximality(plane, options, level, &walls)?;
    }
    Ok(())
}

/// No interior node could be added: each conflicts, is too near to a coarse facet, or was cut off.
fn check_maximality(plane: &Plane, options: Options, level: &Level, walls: &Walls) -> Fault {
    let (mesh, rules) = (&level.mesh, options.rules);
    let place = |i: u32| plane.points[i as usize];
    let n = plane.points.len() as u32;
    let g: Vec<f64> = (0..n)
        .map(|i| (0..n).map(|j| distance(place(i), place(j))).filter(|&d| d > 0.0).fold(f64::INFINITY, f64::min))
        .collect();
    let f_at = |x: u32| {
        let weight = |p: u32| level.factor * g[p as usize] + rules.gradation * distance(place(p), place(x));
        (0..n).map(weight).fold(f64::INFINITY, f64::min)
    };
    for (&i, &f) in mesh.nodes.iter().zip(&level.spacing) {
        if (f - f_at(i)).abs() > ROUNDING * f {
            return Err(format!("spacing: {f} at node {i}, by definition {}", f_at(i)));
        }
    }
    for &x in walls.region_of.keys().filter(|x| mesh.nodes.binary_search(x).is_err()) {
        let f = f_at(x);
        let conflicts = mesh
            .nodes
            .iter()
            .zip(&level.spacing)
            .any(|(&j, &other)| distance(place(x), place(j)) < (f + other) / rules.beta * (1.0 + ROUNDING));
        let is_near = |wall: &Wall| {
            segment_distance(place(x), place(wall.tail), place(wall.head)) <= rules.delta * f * (1.0 + ROUNDING)
        };
        if !conflicts && !walls.loops.iter().flatten().any(|wall| is_near(wall) || holds(plane, wall, place(x))) {
            return Err(format!("maximality: node {x} could stay"));
        }
    }
    Ok(())
}

/// Whether a point lies between a coarse wall and the walls of the input that it stands for, or on it.
fn holds(plane: &Plane, wall: &Wall, x: [f64; 2]) -> bool {
    let mut path = vec![wall.tail];
    path.extend(&wall.between);
    path.push(wall.head);
    let mut odd = false;
    for k in 0..path.len() {
        let (a, b) = (plane.points[path[k] as usize], plane.points[path[(k + 1) % path.len()] as usize]);
        let o = orient(a, b, x);
        if o == 0.0 && segment_distance(x, a, b) == 0.0 {
            return true;
        }
        odd ^= (a[1] > x[1]) != (b[1] > x[1]) && (o > 0.0) == (b[1] > a[1]);
    }
    odd
}
