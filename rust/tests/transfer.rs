//! Transfer, by properties that need no other implementation.

use _core::point::{NONE, Point, orient};
use _core::transfer::halfedges::{HalfEdges, next, prev};
use _core::transfer::prolongation::{Finer, Unplaced, locate, weights};
use _core::transfer::rows::{Rows, RowsRef};
use _core::transfer::{filter, galerkin, overlap};
use proptest::prelude::*;

/// A lattice of k × k squares, its inner nodes moved, each square cut in two.
fn square(k: usize, moves: &[(f64, f64)]) -> (Vec<Point<2>>, Vec<[u32; 3]>) {
    let mut points = Vec::new();
    for i in 0..=k {
        for j in 0..=k {
            let inner = |t: usize| t > 0 && t < k;
            let (dx, dy) = moves[(i * (k + 1) + j) % moves.len()];
            let dx = if inner(i) { 0.2 * dx } else { 0.0 };
            let dy = if inner(j) { 0.2 * dy } else { 0.0 };
            points.push([(i as f64 + dx) / k as f64, (j as f64 + dy) / k as f64]);
        }
    }
    let node = |i: usize, j: usize| (i * (k + 1) + j) as u32;
    let mut cells = Vec::new();
    for i in 0..k {
        for j in 0..k {
            let (a, b, c, d) = (node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1));
            if (i + j) % 2 == 0 {
                cells.extend([[a, b, c], [a, c, d]]);
            } else {
                cells.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    (points, cells)
}

/// Every other node of a lattice of 2k × 2k squares.
fn coarsened(k: usize, fine: &[Point<2>]) -> (Vec<Point<2>>, Vec<[u32; 3]>, Vec<u32>) {
    let (_, cells) = square(k, &[(0.0, 0.0)]);
    let injection: Vec<u32> =
        (0..=k).flat_map(|i| (0..=k).map(move |j| (2 * i * (2 * k + 1) + 2 * j) as u32)).collect();
    (injection.iter().map(|&i| fine[i as usize]).collect(), cells, injection)
}

fn moves() -> impl Strategy<Value = Vec<(f64, f64)>> {
    prop::collection::vec((-1.0..1.0f64, -1.0..1.0f64), 5..40)
}

fn boundary_of(points: &[Point<2>], cells: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mesh = HalfEdges::new(points, cells).unwrap();
    mesh.boundary().map(|h| [mesh.node(h), mesh.node(next(h))]).collect()
}

fn area(points: &[Point<2>], cell: &[u32; 3]) -> f64 {
    let [a, b, c] = cell.map(|i| points[i as usize]);
    orient(&a, &b, &c) / 2.0
}

proptest! {
    #[test]
    fn twins_are_mutual_and_the_boundary_closes(k in 1..6usize, moves in moves()) {
        let (points, cells) = square(k, &moves);
        let mesh = HalfEdges::new(&points, &cells).unwrap();
        for h in 0..3 * cells.len() as u32 {
            prop_assert_eq!(next(prev(h)), h);
            if mesh.twin(h) != NONE {
                prop_assert_eq!(mesh.twin(mesh.twin(h)), h);
                prop_assert_eq!(mesh.node(next(h)), mesh.node(mesh.twin(h)));
            }
        }
        let all: Vec<u32> = mesh.boundary().collect();
        prop_assert_eq!(all.len(), 4 * k);
        let mut around = vec![all[0]];
        while around.len() == 1 || around[around.len() - 1] != all[0] {
            let last = around[around.len() - 1];
            around.push(mesh.next_on_boundary(last));
            prop_assert_eq!(mesh.prev_on_boundary(around[around.len() - 1]), last);
        }
        prop_assert_eq!(around.len(), 4 * k + 1);
    }

    #[test]
    fn interpolation_is_exact_for_linear_functions(k in 1..7usize, moves in moves()) {
        let (points, cells) = square(2 * k, &moves);
        let (coarse_points, coarse_cells, injection) = coarsened(k, &points);
        let coarse = HalfEdges::new(&coarse_points, &coarse_cells).unwrap();
        let boundary = boundary_of(&points, &cells);
        let finer = Finer { points: &points, cells: &cells, boundary: &boundary };
        let located = locate(Unplaced::new(finer, &injection), &coarse).unwrap();
        let (rows, outside) = weights(&points, &coarse, &located.places).unwrap();
        prop_assert!(located.lost.is_empty() && outside.is_empty());
        let view = rows.view();
        for (i, point) in points.iter().enumerate() {
            let (columns, values) = view.row(i);
            prop_assert!(columns.windows(2).all(|pair| pair[0] < pair[1]));
            prop_assert!(values.iter().all(|&w| w > 0.0));
            prop_assert_eq!(values.iter().sum::<f64>(), 1.0);
            for d in 0..2 {
                let got: f64 = columns.iter().zip(values).map(|(&j, w)| w * coarse_points[j as usize][d]).sum();
                prop_assert!((got - point[d]).abs() < 1e-14);
            }
        }
        for (c, &i) in injection.iter().enumerate() {
            prop_assert_eq!(view.row(i as usize), (&[c as i32][..], &[1.0][..]));
        }
    }

    #[test]
    fn overlaps_fill_the_cells_of_both_meshes(k in 1..6usize, moves in moves()) {
        let (points, cells) = square(2 * k, &moves);
        let (coarse_points, coarse_cells, injection) = coarsened(k, &points);
        let coarse = HalfEdges::new(&coarse_points, &coarse_cells).unwrap();
        let boundary = boundary_of(&points, &cells);
        let finer = Finer { points: &points, cells: &cells, boundary: &boundary };
        let located = locate(Unplaced::new(finer, &injection), &coarse).unwrap();
        let rows = overlap::areas(&points, &cells, &coarse, &located).unwrap();
        let mut covered = vec![0.0; coarse_cells.len()];
        for (i, cell) in cells.iter().enumerate() {
            let (columns, values) = rows.view().row(i);
            prop_assert!((values.iter().sum::<f64>() - area(&points, cell)).abs() < 1e-13);
            columns.iter().zip(values).for_each(|(&j, value)| covered[j as usize] += value);
        }
        for (cell, covered) in coarse_cells.iter().zip(covered) {
            prop_assert!((covered - area(&coarse_points, cell)).abs() < 1e-13);
        }
    }

    #[test]
    fn the_triple_product_is_that_of_the_dense_matrices(a in matrix(9, 9), p in matrix(9, 5)) {
        let restriction = p.view().transposed();
        let made = galerkin::triple(restriction.view(), a.view(), p.view()).unwrap();
        let (a, p, r, made) = (dense(a.view()), dense(p.view()), dense(restriction.view()), dense(made.view()));
        let expected = product(&product(&r, &a), &p);
        for (row, other) in made.iter().zip(&expected) {
            for (x, y) in row.iter().zip(other) {
                prop_assert!((x - y).abs() <= 1e-12);
            }
        }
    }
}

fn rows_of(dense: &[Vec<f64>]) -> Rows {
    let kept = |row: &[f64]| (0..row.len()).filter(|&j| row[j] != 0.0).collect::<Vec<_>>();
    let columns: Vec<Vec<usize>> = dense.iter().map(|row| kept(row)).collect();
    Rows {
        columns: dense.len(),
        indptr: Rows::starts(columns.iter().map(|row| row.len())).unwrap(),
        indices: columns.iter().flatten().map(|&j| j as i32).collect(),
        data: columns.iter().enumerate().flat_map(|(i, row)| row.iter().map(move |&j| dense[i][j])).collect(),
    }
}

#[test]
fn a_weak_coupling_goes_over_the_neighbour_that_both_have_and_a_weak_repulsion_to_the_diagonal() {
    let a = vec![
        vec![2.0, -1.0, -0.01, 0.0, -0.01],
        vec![-1.0, 2.0, -1.0, 0.01, 0.0],
        vec![-0.01, -1.0, 2.0, 0.0, 0.0],
        vec![0.0, 0.01, 0.0, 1.0, 0.0],
        vec![-0.01, 0.0, 0.0, 0.0, 1.0],
    ];
    let made = dense(filter::filtered(rows_of(&a), 0.02).unwrap().view());
    // between 0 and 4 there is no other way: it stays
    let expected = [
        [2.01, -1.02, 0.0, 0.0, -0.01],
        [-1.02, 2.05, -1.02, 0.0, 0.0],
        [0.0, -1.02, 2.01, 0.0, 0.0],
        [0.0, 0.0, 0.0, 1.01, 0.0],
        [-0.01, 0.0, 0.0, 0.0, 1.0],
    ];
    for (row, other) in made.iter().zip(&expected) {
        for (x, y) in row.iter().zip(other) {
            assert!((x - y).abs() < 1e-14, "{made:?}");
        }
    }
}

proptest! {
    #[test]
    fn leaving_weak_couplings_out_keeps_sums_and_connections_and_weakens_no_energy(
        couplings in prop::collection::vec(prop_oneof![Just(0.0), 0.001..0.1f64, 0.1..1.0f64], 36),
        x in prop::collection::vec(-1.0..1.0f64, 9),
    ) {
        let n = 9;
        let mut a = vec![vec![0.0; n]; n];
        let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
        for ((i, j), &w) in pairs.zip(&couplings) {
            for (i, j) in [(i, j), (j, i)] {
                a[i][j] -= w;
                a[i][i] += w;
            }
        }
        let made = dense(filter::filtered(rows_of(&a), 0.1).unwrap().view());
        let energy = |a: &[Vec<f64>]| -> f64 {
            a.iter().zip(&x).map(|(row, y)| y * row.iter().zip(&x).map(|(a, x)| a * x).sum::<f64>()).sum()
        };
        prop_assert!(energy(&made) >= energy(&a) - 1e-12);
        let joined = |a: &[Vec<f64>]| {
            let mut part: Vec<usize> = (0..n).collect();
            for _ in 0..n {
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|&(i, j)| a[i][j] != 0.0) {
                    part[i] = part[i].min(part[j]);
                }
            }
            part
        };
        prop_assert_eq!(joined(&made), joined(&a));
        for (i, row) in made.iter().enumerate() {
            prop_assert!(row.iter().sum::<f64>().abs() < 1e-12);
            for j in 0..n {
                prop_assert!((row[j] - made[j][i]).abs() < 1e-12);
            }
        }
    }
}

/// A sparse matrix of some entries, each row's columns ascending.
fn matrix(rows: usize, columns: usize) -> impl Strategy<Value = Rows> {
    let row = prop::collection::btree_map(0..columns as i32, -2.0..2.0f64, 0..columns);
    prop::collection::vec(row, rows).prop_map(move |rows| Rows {
        columns,
        indptr: Rows::starts(rows.iter().map(|row| row.len())).unwrap(),
        indices: rows.iter().flat_map(|row| row.keys().copied()).collect(),
        data: rows.iter().flat_map(|row| row.values().copied()).collect(),
    })
}

fn dense(rows: RowsRef<'_>) -> Vec<Vec<f64>> {
    let mut out = vec![vec![0.0; rows.columns]; rows.len()];
    for (i, out) in out.iter_mut().enumerate() {
        let (columns, values) = rows.row(i);
        columns.iter().zip(values).for_each(|(&j, &value)| out[j as usize] += value);
    }
    out
}

fn product(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let column = |row: &Vec<f64>, j: usize| row.iter().zip(b).map(|(x, other)| x * other[j]).sum();
    a.iter().map(|row| (0..b[0].len()).map(|j| column(row, j)).collect()).collect()
}

#[test]
fn matrices_that_do_not_fit_are_refused() {
    let one = Rows { columns: 2, indptr: vec![0, 1], indices: vec![1], data: vec![1.0] };
    assert!(galerkin::triple(one.view(), one.view(), one.view()).is_err());
    assert!(RowsRef::checked("a", 1, &[0, 1], &[1], &[1.0]).is_err());
    assert!(RowsRef::checked("a", 2, &[0, 2], &[1], &[1.0]).is_err());
    assert!(RowsRef::checked("a", 2, &[1, 0], &[1], &[1.0]).is_err());
    assert!(HalfEdges::new(&[[0.0, 0.0]], &[[0, 1, 2]]).is_err());
}

/// The banks of a slit from (0, 0) to (1, 0), open at the left, coincide; the finer one bulges to either side.
#[test]
fn nodes_of_a_bent_slit_stay_on_their_bank() {
    for bulge in [-0.05, 0.0, 0.05] {
        // 0 and 1 upper and lower copy of the mouth, 2 the tip, 3 and 4 copies of the middle, 5-10 around
        let points: Vec<Point<2>> = vec![
            [0.0, 0.0],
            [0.0, 0.0],
            [1.0, 0.0],
            [0.5, bulge],
            [0.5, bulge],
            [0.0, 1.0],
            [0.0, -1.0],
            [1.0, 1.0],
            [1.0, -1.0],
            [2.0, 0.0],
            [0.5, 0.5],
            [0.5, -0.5],
        ];
        let fine = [
            [0, 3, 10],
            [3, 2, 10],
            [0, 10, 5],
            [10, 7, 5],
            [2, 7, 10],
            [4, 1, 11],
            [2, 4, 11],
            [11, 1, 6],
            [11, 6, 8],
            [11, 8, 2],
            [2, 9, 7],
            [2, 8, 9],
        ];
        let injection: Vec<u32> = vec![0, 1, 2, 5, 6, 7, 8, 9];
        let coarse_points: Vec<Point<2>> = injection.iter().map(|&i| points[i as usize]).collect();
        let coarse = [[0, 2, 3], [2, 5, 3], [2, 1, 4], [2, 4, 6], [2, 7, 5], [2, 6, 7]];
        let coarse = HalfEdges::new(&coarse_points, &coarse).unwrap();
        let boundary = boundary_of(&points, &fine);
        let finer = Finer { points: &points, cells: &fine, boundary: &boundary };
        let located = locate(Unplaced::new(finer, &injection), &coarse).unwrap();
        let (rows, outside) = weights(&points, &coarse, &located.places).unwrap();
        let of = |i: usize| rows.view().row(i).0;
        assert!(!of(3).contains(&1) && of(3).contains(&0), "the upper bank takes {:?}", of(3));
        assert!(!of(4).contains(&0) && of(4).contains(&1), "the lower bank takes {:?}", of(4));
        assert_eq!(outside.len(), usize::from(bulge != 0.0));
        outside.iter().for_each(|(_, distance)| assert!((distance - 0.05).abs() < 1e-15));
    }
}
