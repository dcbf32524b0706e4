//! Domains on which the package once failed, made small; each with what was wrong.

mod fuzz;

use _core::hierarchy::{Drop, Method, Options};
use _core::level::Rules;
use fuzz::{Plane, failure, topology};

/// Every node on its own level, the paper's candidates, no guard: what a case departs from.
const PLAIN: Options = Options {
    factor: 2.0,
    levels: Some(2),
    coarsest: 1,
    nested: true,
    method: Method::Function,
    rules: Rules { beta: 2.0, delta: 0.5, gradation: 0.5, hold: false },
    keep: false,
    drop: Drop::Never,
    min_angle: None,
    pool: false,
    cos_feature: 0.5,
};

const KEEP: Options = Options { rules: Rules { hold: true, ..PLAIN.rules }, keep: true, ..PLAIN };

/// A cosine under which nothing is a corner but for changes of topology and tags.
const NO_CORNER: f64 = -0.999;

fn plane(points: &[[f64; 2]], cells: &[[u32; 3]]) -> Plane {
    Plane { points: points.to_vec(), cells: cells.to_vec(), tags: vec![0; cells.len()], given: Vec::new() }
}

#[track_caller]
fn must_hold(plane: &Plane, options: Options) {
    assert!(topology::is_legal(plane), "the case is no legal mesh");
    assert_eq!(failure(plane, options), None);
}

/// A row of `n` unit squares, each cut along a diagonal.
fn strip(n: u32) -> Plane {
    let points: Vec<[f64; 2]> = (0..=n).flat_map(|i| [[f64::from(i), 0.0], [f64::from(i), 1.0]]).collect();
    let cells: Vec<[u32; 3]> =
        (0..n).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 3], [2 * i, 2 * i + 3, 2 * i + 1]]).collect();
    plane(&points, &cells)
}

/// Two parts touch along a doubled line that is stitched at both ends; without a doubled node between the
/// stitches they would be one part.
#[test]
fn a_slit_between_single_nodes_stays_open() {
    let points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 0.0], [1.0, -2.0], [1.0, 2.0]];
    let case = plane(&points, &[[0, 4, 1], [1, 4, 2], [0, 3, 5], [3, 2, 5]]);
    for method in [Method::Function, Method::Threshold, Method::Mis] {
        must_hold(&case, Options { method, cos_feature: NO_CORNER, ..PLAIN });
        must_hold(&case, Options { method, cos_feature: NO_CORNER, ..KEEP });
    }
}

/// The baseline put back facet vertices that the next finer level had not.
#[test]
fn levels_of_the_baseline_are_nested() {
    for n in 2..9 {
        must_hold(&strip(n), Options { method: Method::Mis, levels: Some(5), cos_feature: NO_CORNER, ..PLAIN });
    }
}

/// A hole that touches another part at a node is a chain from a junction to itself. It was given its second and third
/// vertex after the interior nodes had been chosen, which then lay too near.
#[test]
fn a_loop_through_a_pinch_has_three_vertices_before_interior_nodes_are_chosen() {
    let points = [
        [0.78, 0.11],
        [0.8, 0.11],
        [0.79, 0.12],
        [0.78, 0.13],
        [0.78, 0.16],
        [0.77, 0.14],
        [0.75, 0.09],
        [0.78, 0.09],
        [0.77, 0.11],
        [0.77, 0.12],
        [0.8, 0.14],
        [0.81, 0.12],
        [0.8, 0.13],
        [0.81, 0.09],
        [0.75, 0.06],
        [0.75, 0.11],
    ];
    let cells = [
        [0, 1, 2],
        [3, 4, 5],
        [6, 7, 8],
        [8, 3, 9],
        [4, 3, 10],
        [1, 11, 12],
        [7, 13, 1],
        [11, 10, 12],
        [14, 7, 6],
        [8, 7, 0],
        [7, 1, 0],
        [3, 8, 0],
        [1, 12, 2],
        [3, 0, 2],
        [3, 5, 9],
        [6, 8, 15],
    ];
    let rules = Rules { delta: 0.75, ..PLAIN.rules };
    must_hold(&plane(&points, &cells), Options { rules, cos_feature: NO_CORNER, levels: Some(1), ..PLAIN });
}
