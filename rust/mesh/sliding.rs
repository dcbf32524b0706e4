//! Cells must not overlap; but parts that are nowhere joined may, shallowly: the two sides of a sliding interface are
//! polygons with different corners on the same curve.
//!
//! First all parts are looked at as one, which settles nearly every mesh. Where something is found, parts are told apart (cells
//! that nodes join), each must be right alone, and two of them may overlap as long as no boundary node of the one, no middle
//! of the piece of an edge inside the other, and no centroid of a cell at such an edge lies deeper in the other than a
//! twentieth of that edge. Such parts get different *layers*, by greedy colouring, and so do parts of which one has a node on an edge of
//! the other.

use super::Facet;
use super::around::{Around, Sets, Suspect};
use super::outline::{Contact, Outline, SOUP, coincident, lower};
use crate::error::Broken;
use crate::point::{NONE, Point, distance, distance_2, orient};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};

/// Depth allowed, in lengths of the edge.
const SHALLOW: f64 = 0.05;

/// Refuses cells that overlap and nodes that hang; returns a layer for each node where parts overlap shallowly or touch at a node
/// that only one of them has.
pub fn layers(points: &[Point<2>], cells: &[[u32; 3]], boundary: &[Facet<2>]) -> Result<Option<Vec<u32>>, Broken> {
    let Err(broken) = examine(points, cells, boundary, None) else {
        return Ok(None);
    };
    if let Broken::CoincidentNodes { why: SOUP, .. } = broken {
        return Err(broken);
    }
    let (part_of, n_parts) = parts(points.len(), cells);
    let broken = if n_parts == 1 {
        broken
    } else {
        let part: Vec<u32> = boundary.iter().map(|facet| part_of[facet.nodes[0] as usize]).collect();
        match examine(points, cells, boundary, Some(&part)) {
            Ok(pairs) if pairs.is_empty() => return Ok(None),
            Ok(pairs) => {
                let colour = colours(n_parts, &pairs);
                return Ok(Some(part_of.into_iter().map(|part| colour[part as usize]).collect()));
            }
            Err(broken) => broken,
        }
    };
    match broken {
        Broken::OverlappingCells { .. } => Err(doubled_inside(points, boundary).unwrap_or(broken)),
        other => Err(other),
    }
}

/// Part of each node, numbered by first nodes, and how many.
fn parts(n: usize, cells: &[[u32; 3]]) -> (Vec<u32>, usize) {
    let mut sets = Sets::new(n);
    for &[a, b, c] in cells {
        sets.join(a, b);
        sets.join(b, c);
    }
    let mut number = vec![NONE; n];
    let mut count = 0;
    for node in 0..n as u32 {
        let root = sets.find(node) as usize;
        if number[root] == NONE {
            number[root] = count;
            count += 1;
        }
        number[node as usize] = number[root];
    }
    (number, count as usize)
}

/// Smallest colour that no neighbour of a smaller number has, part by part.
fn colours(n_parts: usize, pairs: &BTreeSet<[u32; 2]>) -> Vec<u32> {
    let mut before = vec![Vec::new(); n_parts];
    for &[a, b] in pairs {
        before[b as usize].push(a);
    }
    let mut colour = vec![0u32; n_parts];
    for part in 0..n_parts {
        let taken: BTreeSet<u32> = before[part].iter().map(|&a| colour[a as usize]).collect();
        colour[part] = (0..).find(|c| !taken.contains(c)).unwrap_or(0);
    }
    colour
}

/// Looks at the boundary, as one part or as several; returns the pairs of parts that overlap shallowly, or of which one has a
/// node on an edge of the other.
fn examine(
    points: &[Point<2>],
    cells: &[[u32; 3]],
    boundary: &[Facet<2>],
    part: Option<&[u32]>,
) -> Result<BTreeSet<[u32; 2]>, Broken> {
    let outline = Outline::new(points, boundary, part)?;
    let Some(contacts) = outline.contacts() else {
        return Err(first_cross(&outline, cells));
    };
    let part_of = |segment: u32| outline.segments[segment as usize].part;
    let mut cuts: BTreeMap<Suspect, Vec<f64>> = BTreeMap::new();
    let crosses = contacts.iter().filter_map(|contact| match *contact {
        Contact::Cross(i, j) => Some([i, j]),
        Contact::Touch { .. } => None,
    });
    let mut own = crosses.clone().filter(|&[i, j]| part_of(i) == part_of(j));
    if let Some(pair) = own.next() {
        return Err(cross(&outline, cells, pair, own.count()));
    }
    for [i, j] in crosses {
        cuts.entry((i, part_of(j))).or_default().push(cut(&outline, i, j));
        cuts.entry((j, part_of(i))).or_default().push(cut(&outline, j, i));
    }
    refuse_hanging(&outline, points, &contacts)?;
    let around = Around::new(&outline, &contacts);
    for suspect in around.alternate(points, cells)?.into_iter().chain(around.grounded(cells)?) {
        cuts.entry(suspect).or_default();
    }
    // no triangulation could keep an edge that a node of another part lies on
    let touching = contacts.iter().filter_map(|contact| match *contact {
        Contact::Touch { of, inside, .. } => Some([part_of(of), part_of(inside)]),
        Contact::Cross(..) => None,
    });
    let mut pairs: BTreeSet<[u32; 2]> = touching.filter(|[a, b]| a != b).map(|[a, b]| [a.min(b), a.max(b)]).collect();
    for ((segment, other), cuts) in cuts {
        refuse_deep(&outline, points, cells, (segment, other), cuts)?;
        let part = part_of(segment);
        pairs.insert([part.min(other), part.max(other)]);
    }
    Ok(pairs)
}

fn cross(outline: &Outline<'_>, cells: &[[u32; 3]], pair: [u32; 2], more: usize) -> Broken {
    let mut facets = pair.map(|s| outline.boundary[outline.segments[s as usize].edge as usize]);
    facets.sort_unstable_by_key(|facet| facet.cells[0]);
    let [other, one] = facets;
    let how = format!("boundary edges {:?} and {:?} cross", one.nodes, other.nodes);
    let cell = one.cells[0] as usize;
    Broken::OverlappingCells { cell, nodes: cells[cell].to_vec(), other: Some(other.cells[0] as usize), how, more }
}

/// The first crossing in the order of the tree; where there are very many, parts don't matter.
fn first_cross(outline: &Outline<'_>, cells: &[[u32; 3]]) -> Broken {
    let mut found = Vec::new();
    for position in 0..outline.segments.len() {
        outline.contacts_at(position, &mut found);
        for contact in found.drain(..) {
            if let Contact::Cross(i, j) = contact {
                return cross(outline, cells, [i, j], outline.segments.len());
            }
        }
    }
    let nodes = cells[0].to_vec();
    Broken::OverlappingCells { cell: 0, nodes, other: None, how: "boundary edges run on each other".into(), more: 0 }
}

/// Refuses nodes inside an edge of the boundary of their own part.
fn refuse_hanging(outline: &Outline<'_>, points: &[Point<2>], contacts: &[Contact]) -> Result<(), Broken> {
    let mut hanging: Vec<(u32, u32)> = Vec::new();
    for contact in contacts {
        let Contact::Touch { place, of, inside } = *contact else { continue };
        let (of, inside) = (&outline.segments[of as usize], &outline.segments[inside as usize]);
        if of.part == inside.part {
            let node = outline.boundary[of.edge as usize].nodes[usize::from(of.tail != place)];
            hanging.push((node, inside.edge));
        }
    }
    hanging.sort_unstable();
    hanging.dedup_by_key(|(node, _)| *node);
    let Some(&(node, edge)) = hanging.first() else {
        return Ok(());
    };
    let facet = outline.boundary[edge as usize];
    let at = points[node as usize].to_vec();
    let (cell, more) = (facet.cells[0] as usize, hanging.len() - 1);
    Err(Broken::HangingNode { node, at, edge: facet.nodes, cell, more })
}

/// Where segment `j` cuts segment `i`, from 0 to 1 along it.
fn cut(outline: &Outline<'_>, i: u32, j: u32) -> f64 {
    let ([a, b], [c, d]) = (outline.ends(i), outline.ends(j));
    let (from, to) = (orient(&c, &d, &a).abs(), orient(&c, &d, &b).abs());
    if from + to > 0.0 { from / (from + to) } else { 0.5 }
}

/// Refuses a segment that reaches deep into another part.
fn refuse_deep(
    outline: &Outline<'_>,
    points: &[Point<2>],
    cells: &[[u32; 3]],
    (segment, other): Suspect,
    mut cuts: Vec<f64>,
) -> Result<(), Broken> {
    let [a, b] = outline.ends(segment);
    let allowed = SHALLOW * distance(&a, &b);
    cuts.extend([0.0, 1.0]);
    cuts.sort_unstable_by(f64::total_cmp);
    let along = |t: f64| [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
    let facet = outline.boundary[outline.segments[segment as usize].edge as usize];
    let cell = facet.cells[0] as usize;
    let corners = cells[cell].map(|node| points[node as usize]);
    let centroid = [0, 1].map(|k| corners.iter().map(|p| p[k] / 3.0).sum());
    let middles = cuts.windows(2).map(|pair| along(0.5 * (pair[0] + pair[1])));
    for x in [a, b, centroid].into_iter().chain(middles) {
        let inside = outline.covers(other, &x);
        let depth = if inside { distance_to(outline, &x, other, allowed) } else { 0.0 };
        if depth > allowed {
            let how = format!(
                "two parts that no node joins may overlap by a twentieth of an edge, here by over {allowed:.3e} at \
                 ({:?}, {:?})",
                x[0], x[1]
            );
            let holds = |nodes: &[u32; 3]| {
                let [a, b, c] = nodes.map(|node| points[node as usize]);
                orient(&a, &b, &x) >= 0.0 && orient(&b, &c, &x) >= 0.0 && orient(&c, &a, &x) >= 0.0
            };
            let covering = cells.iter().enumerate().find(|&(k, nodes)| k != cell && holds(nodes)).map(|(k, _)| k);
            return Err(Broken::OverlappingCells { cell, nodes: cells[cell].to_vec(), other: covering, how, more: 0 });
        }
    }
    Ok(())
}

/// Distance from `x` to the boundary of a part; anything over `enough` where it is farther than that.
fn distance_to(outline: &Outline<'_>, x: &Point<2>, part: u32, enough: f64) -> f64 {
    let mut nearest = f64::INFINITY;
    outline.tree.near(x, enough, |s| {
        if outline.segments[s as usize].part == part {
            let [a, b] = outline.ends(s);
            let along = [b[0] - a[0], b[1] - a[1]];
            let dot = (x[0] - a[0]) * along[0] + (x[1] - a[1]) * along[1];
            let t = (dot / distance_2(&a, &b)).clamp(0.0, 1.0);
            nearest = nearest.min(distance(x, &[a[0] + t * along[0], a[1] + t * along[1]]));
        }
    });
    nearest
}

/// The error where a node inside the mesh shares coordinates with another one, if there is such a node.
fn doubled_inside(points: &[Point<2>], boundary: &[Facet<2>]) -> Option<Broken> {
    let mut at_boundary = vec![false; points.len()];
    for facet in boundary {
        at_boundary[facet.nodes[0] as usize] = true;
    }
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| lower(&points[a as usize], &points[b as usize]).then(a.cmp(&b)));
    let same = |a: &u32, b: &u32| lower(&points[*a as usize], &points[*b as usize]) == Ordering::Equal;
    let inside = |group: &&[u32]| group.len() > 1 && group.iter().any(|&node| !at_boundary[node as usize]);
    let groups: Vec<&[u32]> = order.chunk_by(same).filter(inside).collect();
    let first = groups.iter().min_by_key(|group| group[0])?;
    Some(coincident(points, [first[0], first[1]], "their cells overlap", groups.len() - 1))
}
