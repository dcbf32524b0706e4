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

/// The nodes of a level of needles had no cell of their own once fewer of them were kept.
#[test]
fn a_level_that_would_have_no_cell_repeats_the_finer_one() {
    let points = [
        [-0.088656, 0.286601],
        [955.218281, 295.902341],
        [-0.118208, 0.382135],
        [-0.14776, 0.477668],
        [-42.206981, -12.628704],
    ];
    let case = plane(&points, &[[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
    let rules = Rules { delta: 1.5, gradation: 0.05, ..PLAIN.rules };
    must_hold(&case, Options { factor: 1.3, drop: Drop::Always, rules, cos_feature: NO_CORNER, ..PLAIN });
}

/// The sides of a slit became one edge between two cells of one material, but for the tag of a given facet on one side.
#[test]
fn a_closed_slit_with_a_given_facet_on_one_side_is_a_facet_or_delaunay() {
    let points = [
        [2.905271, 0.898719],
        [2.973147, 0.91981],
        [1.816957, 0.562157],
        [4.70606, 1.455845],
        [3.903334, 1.207547],
        [3.810573, 1.178742],
        [4.76886, 1.475187],
        [0.866431, 0.26811],
        [0.920932, 0.285081],
        [2.976708, 0.921012],
        [1.863652, 0.576704],
        [2.973147, 0.91981],
        [3.903334, 1.207547],
        [4.857623, 1.502846],
        [3.827013, 1.184046],
        [1.049201, 0.324878],
        [1.866138, 0.577585],
        [1.863652, 0.576704],
        [1.866138, 0.577585],
        [1.956983, 0.605793],
        [2.737229, 0.847047],
        [3.714808, 1.149439],
        [4.717706, 1.459665],
        [0.896702, 0.277794],
        [1.956983, 0.605793],
        [3.729858, 1.154201],
        [2.993442, 0.926385],
        [4.672785, 1.445894],
        [1.887063, 0.58427],
        [2.819746, 0.872775],
    ];
    let cells = [
        [0, 1, 2],
        [3, 4, 0],
        [0, 4, 1],
        [5, 6, 3],
        [7, 2, 8],
        [9, 10, 8],
        [11, 12, 9],
        [12, 3, 13],
        [12, 13, 14],
        [15, 8, 10],
        [10, 16, 15],
        [17, 9, 18],
        [19, 18, 9],
        [20, 9, 14],
        [14, 21, 20],
        [22, 21, 14],
        [15, 16, 23],
        [16, 24, 23],
        [25, 26, 20],
        [20, 21, 25],
        [21, 22, 27],
        [21, 27, 25],
        [24, 26, 28],
        [26, 29, 28],
    ];
    let case = Plane { given: vec![([11, 12], 2)], ..plane(&points, &cells) };
    let rules = Rules { delta: 0.75, gradation: 0.25, ..KEEP.rules };
    let options =
        Options { levels: Some(7), nested: false, method: Method::Threshold, drop: Drop::Auto, rules, ..KEEP };
    must_hold(&case, options);
}

/// Distances to a facet 1e15 times as long were lost in rounding.
#[test]
fn nodes_keep_away_from_facets_that_are_very_much_longer_than_the_spacing() {
    let points = [
        [5.837714092174184e-18, 5.102423490618315e-19],
        [2.1489927567838654e-17, 6.394357538840968e-20],
        [2.566385497623139e-16, 4.2596318237924304e-19],
        [2.3942426154756056e-18, 3.3670298500339124e-27],
        [2.997842963877765e-45, 4.77117565853004e-15],
        [6.445534071755086e-15, 1.585778317768507e-19],
        [6.966557194701579e-11, 5.0733058324602016e-17],
        [4.569803079794057e-18, 6.104352045125837e-14],
        [1.2996070843994588e-26, 5.647857833036903e-12],
        [5.081177899360504e-10, 4.492547233947337e-19],
        [1.519356257115404e-26, 3.827032787344435e-42],
        [1.743083177873576e-8, 1.9899740034619036e-19],
        [1.9530982060145617e-24, 5.772508855852244e-8],
        [2.956886396911885e-7, 2.157115302017153e-20],
        [3.5812331883740156e-55, 4.2744766814475416e-7],
        [1.6742977430241042e-24, 3.4622280761514085e-7],
        [1.1916469224317186e-7, 2.748270132798988e-7],
        [8.898989865522857e-13, 6.285862093280654e-7],
        [1.5100638791624373e-6, 1.0822554768782485e-35],
        [1.1266145291359095e-15, 1.1590781198221236e-6],
        [4.5650391196835254e-18, 4.8769921558272395e-5],
        [0.00021556141915365587, 2.7761568766097803e-34],
        [8.063461936591649e-5, 0.00029649454971434984],
        [0.00039969728525402626, 6.8586211037413354e-18],
        [0.00047682459319265823, 3.6109686035345275e-5],
        [5.836138766251063e-50, 0.00027356192249534505],
        [3.0198437383050946e-11, 0.0001985496887386035],
        [9.102662267669046e-8, 0.00020359243377534106],
        [1.0849602744195415e-16, 0.00010863881906345032],
        [0.10496091171013468, 1.3781225927672214e-70],
        [1.4400621162282653e-20, 0.06860886487147898],
        [1.3547610821403703e-46, 0.11171179049730394],
    ];
    let cells = [
        [0, 1, 2],
        [1, 0, 3],
        [2, 4, 0],
        [5, 2, 1],
        [1, 3, 5],
        [6, 5, 3],
        [2, 5, 4],
        [7, 4, 5],
        [8, 4, 7],
        [9, 6, 3],
        [3, 10, 9],
        [9, 10, 11],
        [8, 12, 4],
        [11, 10, 13],
        [14, 4, 12],
        [14, 15, 16],
        [12, 15, 14],
        [14, 16, 17],
        [13, 10, 18],
        [17, 19, 14],
        [19, 20, 14],
        [18, 10, 21],
        [22, 23, 24],
        [25, 26, 27],
        [26, 25, 28],
        [28, 25, 20],
        [20, 25, 14],
        [27, 22, 25],
        [21, 10, 29],
        [30, 31, 25],
    ];
    let rules = Rules { beta: 3.0, ..KEEP.rules };
    must_hold(
        &plane(&points, &cells),
        Options { factor: 3.0, levels: Some(1), nested: false, rules, cos_feature: 0.8660254037844387, ..KEEP },
    );
}

/// A strip 1e-4 wide, a million away from the origin, a node of which is at delta * f from a chord but for 1e-9 of that.
#[test]
fn a_thin_strip_far_from_the_origin() {
    let points = [
        [1000002.1213203436, -999997.8786796564],
        [1000002.1212496329, -999997.8786089458],
        [1000001.4141428517, -999998.585715727],
        [1000002.8284271248, -999997.1715728752],
        [1000002.8283564141, -999997.1715021646],
        [1000001.414072141, -999998.5856450163],
        [1000002.1211789222, -999997.8785382351],
        [1000002.8282857034, -999997.1714314539],
        [1000002.1211082116, -999997.8784675244],
        [1000001.4140014304, -999998.5855743056],
        [1000002.8282149928, -999997.1713607432],
        [1000001.4139307197, -999998.585503595],
        [1000002.1210375008, -999997.8783968138],
        [1000002.1209667901, -999997.8783261031],
        [1000001.4138600089, -999998.5854328843],
    ];
    let cells = [
        [0, 1, 2],
        [0, 3, 1],
        [3, 4, 1],
        [2, 1, 5],
        [1, 6, 5],
        [1, 4, 6],
        [4, 7, 6],
        [6, 8, 9],
        [9, 5, 6],
        [6, 7, 8],
        [7, 10, 8],
        [9, 8, 11],
        [12, 13, 14],
    ];
    let rules = Rules { beta: 3.0, delta: 0.75, gradation: 0.05, hold: false };
    must_hold(&plane(&points, &cells), Options { levels: Some(1), nested: false, rules, cos_feature: 0.996, ..PLAIN });
}
