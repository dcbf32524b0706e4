//! Spacing functions against brute force, bit for bit.

mod clouds;

use _core::kdtree::KdTree;
use _core::point::{Point, distance};
use _core::progress::Progress;
use _core::spacing::{CoarseSpacing, coarsened, nearest, nearest_at, threshold};
use clouds::{cloud, extent, values};
use proptest::prelude::*;

fn brute_nearest<const D: usize>(points: &[Point<D>]) -> Vec<f64> {
    let others = |x| points.iter().map(move |p| distance(p, x)).filter(|&d| d > 0.0);
    points.iter().map(|x| others(x).fold(f64::INFINITY, f64::min)).collect()
}

fn brute_nearest_at<const D: usize>(points: &[Point<D>], x: &Point<D>) -> f64 {
    let Some(first) = points.iter().min_by(|a, b| distance(a, x).total_cmp(&distance(b, x))) else {
        return f64::INFINITY;
    };
    let apart = points.iter().filter(|p| distance(p, first) > 0.0);
    apart.map(|p| distance(p, x)).fold(f64::INFINITY, f64::min)
}

fn nearest_agrees<const D: usize>(points: &[Point<D>], shift: f64) -> Result<(), TestCaseError> {
    let (tree, progress) = (KdTree::new(points), Progress::default());
    let brute = brute_nearest(points);
    prop_assert_eq!(&nearest(&tree, &progress)?, &brute);
    prop_assert_eq!(&nearest_at(&tree, points, &progress)?, &brute);
    let at: Vec<Point<D>> = points.iter().map(|p| p.map(|x| x + shift)).collect();
    let brute: Vec<f64> = at.iter().map(|x| brute_nearest_at(points, x)).collect();
    prop_assert_eq!(nearest_at(&tree, &at, &progress)?, brute);
    Ok(())
}

fn coarsened_agrees<const D: usize>(
    points: &[Point<D>],
    g: &[f64],
    cap: &[f64],
    (factor, gradation): (f64, f64),
) -> Result<(), TestCaseError> {
    let (tree, progress) = (KdTree::new(points), Progress::default());
    let value = |p: usize, x: &Point<D>, cap: f64| (factor * g[p]).min(cap) + gradation * distance(&points[p], x);
    let brute = |x: &Point<D>| (0..points.len()).map(|p| value(p, x, f64::INFINITY)).fold(f64::INFINITY, f64::min);
    let at_points: Vec<f64> = points.iter().map(brute).collect();
    prop_assert_eq!(&coarsened(points, g, factor, gradation, None, &progress)?, &at_points);
    prop_assert_eq!(&coarsened(points, g, factor, gradation, Some(points), &progress)?, &at_points);

    let at: Vec<Point<D>> = points.iter().map(|p| p.map(|x| x + 0.37 * extent(points))).collect();
    let elsewhere: Vec<f64> = at.iter().map(brute).collect();
    prop_assert_eq!(&coarsened(points, g, factor, gradation, Some(&at), &progress)?, &elsewhere);

    let capped = |x: &Point<D>| (0..points.len()).map(|p| value(p, x, cap[p])).fold(f64::INFINITY, f64::min);
    let spacing = CoarseSpacing::new(&tree, g, Some(cap), gradation);
    prop_assert_eq!(spacing.at_points(factor, &progress)?, points.iter().map(capped).collect::<Vec<_>>());
    prop_assert_eq!(spacing.at(factor, &at, &progress)?, at.iter().map(capped).collect::<Vec<_>>());
    thinned_agrees(&spacing, (points, g, cap), &at, (factor, gradation))
}

/// Sites that are left out for a factor win nowhere, for greater factors neither.
fn thinned_agrees<const D: usize>(
    spacing: &CoarseSpacing<'_, D>,
    (points, g, cap): (&[Point<D>], &[f64], &[f64]),
    at: &[Point<D>],
    (factor, gradation): (f64, f64),
) -> Result<(), TestCaseError> {
    let progress = Progress::default();
    let known = spacing.at_points(factor, &progress)?;
    let once = spacing.thinned(1.5 * factor, Some((factor, &known)));
    let twice = once.thinned(2.0 * factor, None);
    for (thin, factor) in
        [(&once, 1.5 * factor), (&once, 4.0 * factor), (&twice, 2.0 * factor), (&twice, 50.0 * factor)]
    {
        for at in [points, at] {
            let value = |p: usize, x: &Point<D>| (factor * g[p]).min(cap[p]) + gradation * distance(&points[p], x);
            let brute = |x: &Point<D>| (0..points.len()).map(|p| value(p, x)).fold(f64::INFINITY, f64::min);
            prop_assert_eq!(thin.at(factor, at, &progress)?, at.iter().map(brute).collect::<Vec<_>>());
        }
    }
    Ok(())
}

#[test]
fn few_sites_are_left_of_many() {
    let progress = Progress::default();
    let random = |i: u64| {
        let mixed = (i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((mixed ^ (mixed >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1u64 << 53) as f64
    };
    let points: Vec<Point<2>> = (0..20_000).map(|i| [random(2 * i), random(2 * i + 1)]).collect();
    let tree = KdTree::new(&points);
    let g = nearest(&tree, &progress).expect("nobody stops it");
    let cap: Vec<f64> = (0..20_000).map(|i| if i % 50 == 0 { 0.01 } else { f64::INFINITY }).collect();
    let spacing = CoarseSpacing::new(&tree, &g, Some(&cap), 0.7);
    let known = spacing.at_points(2.0, &progress).expect("nobody stops it");
    let thin = spacing.thinned(4.0, Some((2.0, &known))).thinned(8.0, None);
    let left = thin.at_points(8.0, &progress).expect("nobody stops it").len();
    assert!(left < 6_000, "{left} sites are left");
    for factor in [8.0, 9.0, 64.0, 1e5] {
        let whole = spacing.at(factor, &points, &progress).expect("nobody stops it");
        assert_eq!(thin.at(factor, &points, &progress).expect("nobody stops it"), whole, "{factor}");
    }
}

/// Points, spacing and caps at them.
fn spaced<const D: usize>(most: usize) -> impl Strategy<Value = (Vec<Point<D>>, Vec<f64>, Vec<f64>)> {
    cloud::<D>(most).prop_flat_map(|points| {
        let (n, scale) = (points.len(), extent(&points));
        let cap =
            prop::collection::vec(prop_oneof![Just(f64::INFINITY), (0.0..1.0f64).prop_map(move |t| t * scale)], n);
        (Just(points), values(n, scale), cap)
    })
}

fn parameters() -> impl Strategy<Value = (f64, f64)> {
    (prop_oneof![Just(2.0), Just(64.0), 1.0..1e4f64], prop_oneof![Just(1.0), Just(0.5), 0.01..1.0f64])
}

proptest! {
    #[test]
    fn nearest_on_a_line_is_brute_force(points in cloud::<1>(150), t in -1.0..1.0f64) {
        nearest_agrees(&points, 0.1 * t * extent(&points))?;
    }

    #[test]
    fn nearest_in_a_plane_is_brute_force(points in cloud::<2>(150), t in -1.0..1.0f64) {
        nearest_agrees(&points, 0.1 * t * extent(&points))?;
    }

    #[test]
    fn nearest_in_space_is_brute_force(points in cloud::<3>(150), t in -1.0..1.0f64) {
        nearest_agrees(&points, 0.1 * t * extent(&points))?;
    }

    #[test]
    fn coarsened_on_a_line_is_brute_force((points, g, cap) in spaced::<1>(150), how in parameters()) {
        coarsened_agrees(&points, &g, &cap, how)?;
    }

    #[test]
    fn coarsened_in_a_plane_is_brute_force((points, g, cap) in spaced::<2>(150), how in parameters()) {
        coarsened_agrees(&points, &g, &cap, how)?;
    }

    #[test]
    fn coarsened_in_space_is_brute_force((points, g, cap) in spaced::<3>(150), how in parameters()) {
        coarsened_agrees(&points, &g, &cap, how)?;
    }

    #[test]
    fn coarsened_nearest_is_brute_force(points in cloud::<2>(150), how in parameters()) {
        let g = brute_nearest(&points);
        let cap = vec![f64::INFINITY; points.len()];
        coarsened_agrees(&points, &g, &cap, how)?;
    }

    #[test]
    fn what_is_known_of_nearest_changes_nothing((points, _, cap) in spaced::<2>(400), how in parameters()) {
        let (g, (factor, gradation)) = (brute_nearest(&points), how);
        let (tree, progress) = (KdTree::new(&points), Progress::default());
        let plain = CoarseSpacing::new(&tree, &g, Some(&cap), gradation);
        let f = plain.at_points(factor, &progress)?;
        prop_assert_eq!(plain.of_nearest().at_points(factor, &progress)?, f);
    }

    #[test]
    fn points_whose_distance_vanishes_are_copies(points in cloud::<2>(200), how in parameters()) {
        // beside each point one so near that squares of the way vanish, and one twice as far
        let beside = |p: &Point<2>| [*p, [p[0] + 1e-170, p[1]], [p[0] + 2e-170, p[1] - 1e-170]];
        let points: Vec<Point<2>> = points.iter().map(|p| p.map(|x| 1e-160 * x)).flat_map(|p| beside(&p)).collect();
        let (g, (factor, gradation)) = (brute_nearest(&points), how);
        let (tree, progress) = (KdTree::new(&points), Progress::default());
        let plain = CoarseSpacing::new(&tree, &g, None, gradation);
        let f = plain.at_points(factor, &progress)?;
        prop_assert_eq!(plain.of_nearest().at_points(factor, &progress)?, f);
    }

    #[test]
    fn threshold_lifts_what_is_under_the_least_grown((_, g, _) in spaced::<1>(50), factor in 1.0..10.0f64) {
        let least = g.iter().copied().fold(f64::INFINITY, f64::min);
        let brute: Vec<f64> = g.iter().map(|&x| x.max(factor * least)).collect();
        prop_assert_eq!(threshold(&g, factor), brute);
    }
}

#[test]
fn a_single_location_has_no_nearest_other() {
    let points = [[0.5, 0.25]; 3];
    let (tree, progress) = (KdTree::new(&points), Progress::default());
    assert_eq!(nearest(&tree, &progress), Ok(vec![f64::INFINITY; 3]));
    assert_eq!(nearest_at(&tree, &[[1.0, 1.0]], &progress), Ok(vec![f64::INFINITY]));
}

#[test]
fn many_copies_of_a_few_points_cost_little() {
    let points: Vec<Point<2>> = (0..200_000).map(|i| [f64::from(i % 3), 0.0]).collect();
    let (tree, progress) = (KdTree::new(&points), Progress::default());
    let g = nearest(&tree, &progress).expect("nobody stops it");
    assert!(g.iter().all(|&x| x == 1.0));
    let f = CoarseSpacing::new(&tree, &g, None, 1.0).at_points(4.0, &progress).expect("nobody stops it");
    assert!(f.iter().all(|&x| x == 4.0));
}

#[test]
fn a_stopped_call_says_so() {
    let points: Vec<Point<1>> = (0..100).map(|i| [f64::from(i)]).collect();
    let (tree, progress) = (KdTree::new(&points), Progress::default());
    progress.stop();
    assert_eq!(nearest(&tree, &progress), Err(_core::error::Error::Stopped));
}
