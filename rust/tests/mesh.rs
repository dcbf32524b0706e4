//! The check of a mesh: what it finds out about legal ones, and that each defect is called by its name.

use _core::error::Broken;
use _core::mesh::{check, line, quality};
use _core::point::{NONE, Point, orient};
use proptest::prelude::*;
use std::collections::HashMap;

/// Points and cells of a square lattice, each square cut along a diagonal that `diagonals` chooses.
fn lattice(k: usize, diagonals: u64) -> (Vec<Point<2>>, Vec<[i64; 3]>) {
    let at = |i: usize, j: usize| (i * (k + 1) + j) as i64;
    let points = (0..=k).flat_map(|i| (0..=k).map(move |j| [i as f64, j as f64])).collect();
    let mut cells = Vec::new();
    for i in 0..k {
        for j in 0..k {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            if diagonals >> ((i * k + j) % 64) & 1 == 0 {
                cells.extend([[a, b, c], [a, c, d]]);
            } else {
                cells.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    (points, cells)
}

fn rule(result: Result<impl std::fmt::Debug, Broken>) -> &'static str {
    result.expect_err("the mesh is broken").place().0
}

/// Edges of one cell, by counting.
fn boundary_edges(cells: &[[i64; 3]]) -> Vec<[u32; 2]> {
    let mut count: HashMap<[i64; 2], u32> = HashMap::new();
    for &[a, b, c] in cells {
        for [p, q] in [[a, b], [b, c], [c, a]] {
            *count.entry([p.min(q), p.max(q)]).or_insert(0) += 1;
        }
    }
    let mut alone: Vec<[u32; 2]> =
        count.into_iter().filter(|&(_, n)| n == 1).map(|(edge, _)| edge.map(|v| v as u32)).collect();
    alone.sort_unstable();
    alone
}

proptest! {
    #[test]
    fn boundary_facets_are_the_edges_of_one_cell_with_it_on_the_left(
        k in 1usize..12, diagonals: u64, turned: u64, seed in 0u32..1000
    ) {
        let (points, mut cells) = lattice(k, diagonals);
        // nodes in another order
        let n = points.len();
        let renamed = |v: i64| ((v as usize * 7919 + seed as usize) % n) as i64;
        prop_assume!(n % 7919 != 0);
        let mut shuffled = points.clone();
        for (v, p) in points.iter().enumerate() {
            shuffled[renamed(v as i64) as usize] = *p;
        }
        for (c, cell) in cells.iter_mut().enumerate() {
            *cell = cell.map(renamed);
            if turned >> (c % 64) & 1 == 1 {
                cell.swap(0, 1);
            }
        }
        let topology = check(&shuffled, &cells, None, None).expect("a lattice is legal");
        let turned_cells: Vec<u32> = (0..cells.len() as u32).filter(|c| turned >> (c % 64) & 1 == 1).collect();
        prop_assert_eq!(&topology.flip, &turned_cells);
        prop_assert_eq!(topology.n_boundary, 4 * k);
        let mut edges: Vec<[u32; 2]> =
            topology.facets.iter().map(|f| [f.nodes[0].min(f.nodes[1]), f.nodes[0].max(f.nodes[1])]).collect();
        edges.sort_unstable();
        prop_assert_eq!(edges, boundary_edges(&cells));
        for facet in &topology.facets {
            prop_assert_eq!(facet.cells[1], NONE);
            let [a, b] = facet.nodes;
            let third = cells[facet.cells[0] as usize].map(|v| v as u32).into_iter().find(|&v| v != a && v != b);
            let at = |v: u32| shuffled[v as usize];
            prop_assert!(orient(&at(a), &at(b), &at(third.expect("a corner"))) > 0.0);
        }
        prop_assert!(topology.layer.is_none());
    }

    #[test]
    fn tags_and_given_edges_make_interior_facets(k in 1usize..9, diagonals: u64, tags in prop::collection::vec(0i64..3, 2 * 81)) {
        let (points, cells) = lattice(k, diagonals);
        let tags = &tags[..cells.len()];
        let given = [[cells[0][1], cells[0][2]], [cells[0][0], cells[0][1]]];
        let topology = check(&points, &cells, Some(&given), Some(tags)).expect("a lattice is legal");
        for facet in &topology.facets[topology.n_boundary..] {
            let [left, right] = facet.cells.map(|c| c as usize);
            prop_assert!(facet.given != NONE || tags[left] != tags[right]);
            prop_assert!(left < right);
        }
        for (row, edge) in given.iter().enumerate() {
            let found = topology.facets.iter().filter(|f| f.given == row as u32).collect::<Vec<_>>();
            prop_assert_eq!(found.len(), 1);
            let mut nodes = found[0].nodes.map(i64::from);
            nodes.sort_unstable();
            let mut edge = *edge;
            edge.sort_unstable();
            prop_assert_eq!(nodes, edge);
        }
    }

    #[test]
    fn one_node_moved_far_away_overlaps(k in 2usize..9, diagonals: u64, node in 0usize..100) {
        let (mut points, cells) = lattice(k, diagonals);
        let node = node % points.len();
        let [x, y] = points[node];
        // across the whole lattice and out on the other side
        points[node] = [x + (2 * k) as f64 * if x > k as f64 / 2.0 { -1.0 } else { 1.0 }, y + 0.25];
        let name = rule(check(&points, &cells, None, None));
        prop_assert!(["overlapping or inverted cells", "zero area", "hanging node"].contains(&name), "{}", name);
    }
}

/// What breaks a mesh: changes points or cells.
type Breaking = dyn Fn(&mut Vec<Point<2>>, &mut Vec<[i64; 3]>);

#[test]
fn each_defect_is_called_by_its_name() {
    let (points, cells) = lattice(3, 0b1011);
    let broken = |change: &Breaking| {
        let (mut points, mut cells) = (points.clone(), cells.clone());
        change(&mut points, &mut cells);
        rule(check(&points, &cells, None, None))
    };
    assert_eq!(broken(&|_, cells| cells.clear()), "no cells");
    assert_eq!(broken(&|points, _| points[3][1] = f64::NAN), "non-finite coordinate");
    assert_eq!(broken(&|points, _| points[3][1] = 1e300), "non-finite coordinate");
    assert_eq!(broken(&|_, cells| cells[4][1] = 16), "index out of range");
    assert_eq!(broken(&|_, cells| cells[4][1] = i64::MIN), "index out of range");
    assert_eq!(broken(&|_, cells| cells[4][1] = cells[4][0]), "repeated node");
    assert_eq!(broken(&|_, cells| cells.push([0, 1, 2])), "zero area");
    assert_eq!(broken(&|_, cells| cells.push([cells[2][2], cells[2][0], cells[2][1]])), "duplicate cell");
    assert_eq!(broken(&|points, _| points.push([9.0, 9.0])), "node in no cell");
    let stacked = |points: &mut Vec<Point<2>>, cells: &mut Vec<[i64; 3]>| {
        cells.extend(cells.clone().iter().map(|cell| cell.map(|v| v + 16)));
        points.extend(points.clone());
    };
    assert_eq!(broken(&stacked), "coincident nodes");
}

#[test]
fn a_single_cell_is_a_mesh() {
    let topology = check(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], &[[0i32, 2, 1]], None, None).expect("legal");
    assert_eq!((topology.flip, topology.n_boundary), (vec![0], 3));
}

#[test]
fn chains_of_intervals_are_meshes_of_the_line() {
    let points: Vec<Point<1>> = (0..10).map(|k| [f64::from((k * 7) % 10)]).collect();
    let node_at = |x: i64| (0..10).find(|k| (k * 7) % 10 == x).expect("7 and 10 are coprime");
    let cells: Vec<[i64; 2]> = (0..9).map(|x| [node_at(x), node_at(x + 1)]).collect();
    let topology = line::check(&points, &cells, None, Some(&[0, 0, 0, 1, 1, 1, 1, 1, 1])).expect("legal");
    assert_eq!(topology.n_boundary, 2);
    assert_eq!(topology.facets.len(), 3);
    assert_eq!(topology.facets[2].cells, [2, 3]);
}

#[test]
fn quality_of_equilateral_triangles_is_sixty_degrees() {
    let height = 0.75f64.sqrt();
    let points = [[0.0, 0.0], [1.0, 0.0], [0.5, height], [1.5, height]];
    let found = quality::quality(&points, &[[0i32, 1, 2], [1, 3, 2]], &[0.0, 50.0, 100.0]);
    assert!(found.angles_deg.iter().all(|angle| (angle - 60.0).abs() < 0.002));
    assert!((found.area - height).abs() < 1e-15);
}
