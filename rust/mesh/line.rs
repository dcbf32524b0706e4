//! Meshes of the line: intervals between nodes. The rules are those of the plane, one dimension down: an edge is a node
//! there, a slit is a cut at a place where two nodes share the coordinate, one with a cell to the left, one to the right.

use super::cells::{Found, refuse_coordinates, refuse_orphans, refuse_range};
use super::{Facet, Index, Topology, refuse_sizes};
use crate::error::Broken;
use crate::point::{NONE, Point};
use std::sync::atomic::{AtomicBool, Ordering};

/// Checks a mesh of intervals.
///
/// Runtime: O(n + m log m).
pub fn check<I: Index>(
    points: &[Point<1>],
    cells: &[[I; 2]],
    facets: Option<&[[i64; 1]]>,
    cell_tags: Option<&[i64]>,
) -> Result<Topology<1>, Broken> {
    refuse_sizes(points.len(), cells.len())?;
    refuse_coordinates(points)?;
    refuse_range("cells", cells, points.len())?;
    let x = |node: u32| points[node as usize][0];
    let mut flip = Vec::new();
    let (mut repeated, mut flat) = (Found::default(), Found::default());
    let used: Vec<AtomicBool> = points.iter().map(|_| AtomicBool::new(false)).collect();
    let mut positive = Vec::with_capacity(cells.len());
    for (k, cell) in cells.iter().enumerate() {
        let [a, b] = cell.map(|i| i.value() as u32);
        for node in [a, b] {
            used[node as usize].store(true, Ordering::Relaxed);
        }
        if a == b {
            repeated.note(k);
        } else if x(a) == x(b) {
            flat.note(k);
        }
        if x(a) > x(b) {
            flip.push(k as u32);
        }
        positive.push(if x(a) > x(b) { [b, a] } else { [a, b] });
    }
    let rows = |cell: usize| positive[cell].to_vec();
    repeated.refuse(|cell, more| Broken::RepeatedNode { cell, nodes: rows(cell), more })?;
    flat.refuse(|cell, more| Broken::ZeroArea { cell, nodes: rows(cell), more })?;
    refuse_orphans(points, &used)?;
    refuse_overlap(points, &positive)?;
    let (sides, shared) = sides(points.len(), &positive);
    if let Some(cell) = soup(points, &positive, &sides) {
        let [a, _] = positive[cell];
        let twin = (0..points.len() as u32).find(|&other| other != a && x(other) == x(a)).unwrap_or(a);
        let why = "a cell there has both its ends doubled";
        let broken = Broken::CoincidentNodes { nodes: [a.min(twin), a.max(twin)], at: vec![x(a)], why, more: 0 };
        return Err(broken);
    }
    let mut given = vec![NONE; points.len()];
    if let Some(facets) = facets {
        refuse_range("facets", facets, points.len())?;
        for (k, [node]) in facets.iter().enumerate() {
            let row = &mut given[*node as usize];
            *row = (*row).min(k as u32);
        }
    }
    let facet = |node: u32, cells: [u32; 2]| Facet { nodes: [node], cells, given: given[node as usize] };
    let mut facets = Vec::new();
    for node in 0..points.len() as u32 {
        match sides[node as usize] {
            [left, NONE] => facets.push(facet(node, [left, NONE])),
            [NONE, right] => facets.push(facet(node, [right, NONE])),
            _ => {}
        }
    }
    let n_boundary = facets.len();
    for node in shared {
        let cells = sides[node as usize];
        let [left, right] = cells;
        if given[node as usize] != NONE || cell_tags.is_some_and(|tags| tags[left as usize] != tags[right as usize]) {
            facets.push(facet(node, cells));
        }
    }
    Ok(Topology { flip, facets, n_boundary, layer: None })
}

/// Left and right cell of each node, and the nodes that have both.
fn sides(n: usize, cells: &[[u32; 2]]) -> (Vec<[u32; 2]>, Vec<u32>) {
    let mut sides = vec![[NONE; 2]; n];
    for (k, &[a, b]) in cells.iter().enumerate() {
        sides[b as usize][0] = k as u32;
        sides[a as usize][1] = k as u32;
    }
    let shared = (0..n as u32).filter(|&node| !sides[node as usize].contains(&NONE)).collect();
    (sides, shared)
}

/// Refuses duplicates, nodes with three cells and intervals that overlap: sorted by their left ends each must end before the next begins.
fn refuse_overlap(points: &[Point<1>], cells: &[[u32; 2]]) -> Result<(), Broken> {
    let x = |node: u32| points[node as usize][0];
    let mut order: Vec<u32> = (0..cells.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| {
        let [a_cell, b_cell] = [a, b].map(|cell| cells[cell as usize]);
        x(a_cell[0]).total_cmp(&x(b_cell[0])).then(x(a_cell[1]).total_cmp(&x(b_cell[1]))).then(a.cmp(&b))
    });
    let nodes = |cell: u32| cells[cell as usize];
    let overlap = |pair: &[u32]| x(nodes(pair[0])[1]) > x(nodes(pair[1])[0]);
    let Some(pair) = order.windows(2).find(|pair| overlap(pair)) else {
        return Ok(());
    };
    let more = order.windows(2).filter(|pair| overlap(pair)).count() - 1;
    let [other, cell] = [pair[0].min(pair[1]), pair[0].max(pair[1])];
    let rows = nodes(cell).to_vec();
    let (cell_index, first) = (cell as usize, other as usize);
    if nodes(cell) == nodes(other) {
        return Err(Broken::DuplicateCell { cell: cell_index, nodes: rows, first, more });
    }
    if let Some(&node) = nodes(cell).iter().find(|node| nodes(other).contains(node)) {
        let around: Vec<u32> = (0..cells.len() as u32).filter(|&c| nodes(c).contains(&node)).collect();
        if around.len() > 2 {
            return Err(Broken::CrowdedEdge { nodes: vec![node], cells: around, more });
        }
        return Err(Broken::InvertedCell { cell: cell_index, nodes: rows, other: first, edge: vec![node], more });
    }
    let how = format!("from {} to {}", x(nodes(pair[1])[0]), x(nodes(pair[0])[1]).min(x(nodes(pair[1])[1])));
    Err(Broken::OverlappingCells { cell: cell_index, nodes: rows, other: Some(first), how, more })
}

/// The first cell with both ends doubled, if there is one.
fn soup(points: &[Point<1>], cells: &[[u32; 2]], sides: &[[u32; 2]]) -> Option<usize> {
    let mut ends: Vec<(u64, u32)> = Vec::new();
    for (node, sides) in sides.iter().enumerate().filter(|(_, sides)| sides.contains(&NONE)) {
        let cell = if sides[0] == NONE { sides[1] } else { sides[0] };
        // -0.0 and 0.0 are one place
        ends.push(((points[node][0] + 0.0).to_bits(), cell));
    }
    ends.sort_unstable();
    let mut doubled = vec![0u8; cells.len()];
    for pair in ends.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        doubled[pair[0].1 as usize] += 1;
        doubled[pair[1].1 as usize] += 1;
    }
    doubled.iter().position(|&count| count == 2)
}
