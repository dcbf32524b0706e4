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

/// A chord between two materials of the input had one material on both sides once features were dropped: no facet any
/// more, yet not Delaunay.
#[test]
fn a_chord_that_bounds_nothing_is_an_edge_like_any_other() {
    let points = [
        [0.47, 0.78],
        [0.47, 0.74],
        [0.62, 0.84],
        [0.49, 0.59],
        [0.55, 0.65],
        [0.67, 0.87],
        [0.67, 0.45],
        [0.91, 0.61],
        [0.83, 0.91],
        [0.51, 0.85],
        [0.28, 0.95],
        [0.25, 0.98],
        [0.91, 0.99],
        [0.93, 0.41],
        [0.91, 0.53],
        [0.98, 0.52],
    ];
    let cells = [
        [0, 1, 2],
        [3, 4, 1],
        [5, 4, 6],
        [2, 4, 5],
        [6, 7, 8],
        [9, 10, 0],
        [8, 5, 6],
        [11, 5, 12],
        [13, 14, 6],
        [8, 12, 5],
        [12, 8, 7],
        [7, 15, 12],
    ];
    let case = Plane { tags: vec![1, 0, 0, 1, 0, 1, 1, 1, 0, 1, 1, 1], ..plane(&points, &cells) };
    let rules = Rules { delta: 0.0, ..KEEP.rules };
    let cos_feature = -0.1736481776669303;
    let options = Options { factor: 1.3, levels: None, drop: Drop::Auto, rules, cos_feature, ..KEEP };
    must_hold(&case, options);
}

/// Both ends of a slit were left with one copy, so that its sides became one edge that was still treated as a slit.
#[test]
fn a_slit_whose_ends_have_one_copy_each_is_closed_where_features_are_dropped() {
    let points = [
        [0.739, 0.734],
        [0.775, 0.843],
        [0.746, 0.919],
        [0.642, 0.905],
        [0.646, 0.806],
        [0.907, 0.867],
        [0.827, 0.862],
        [0.901, 0.813],
        [0.901, 0.813],
        [0.919, 0.623],
        [0.926, 0.524],
        [0.766, 0.511],
        [0.91, 0.557],
    ];
    let cells = [
        [0, 1, 2],
        [3, 4, 2],
        [5, 6, 7],
        [2, 4, 0],
        [6, 1, 7],
        [6, 2, 1],
        [0, 8, 1],
        [8, 0, 9],
        [9, 10, 5],
        [11, 12, 9],
        [9, 5, 7],
    ];
    let rules = Rules { beta: 3.0, delta: 0.1, gradation: 0.05, hold: false };
    let cos_feature = -0.1736481776669303;
    let options =
        Options { factor: 4.0, levels: Some(1), nested: false, drop: Drop::Always, rules, cos_feature, ..PLAIN };
    must_hold(&plane(&points, &cells), options);
}

/// The area of a needle was rounded below zero, and no level was near enough to it.
#[test]
fn a_needle_whose_area_is_rounded_below_zero_has_levels() {
    let case = plane(&[[35294.1, -124.6], [23529.4, -55.4], [11764.7, 13.8]], &[[0, 1, 2]]);
    must_hold(&case, Options { levels: Some(1), drop: Drop::Always, ..PLAIN });
}
