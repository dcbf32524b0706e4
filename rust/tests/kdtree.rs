//! The k-d tree against brute force.

mod clouds;

use _core::kdtree::{Bounds, KdTree, LEAF};
use _core::point::{Point, distance, distance_2};
use clouds::{cloud, extent};
use proptest::prelude::*;
use std::cmp::Ordering;

fn nodes_are_sound<const D: usize>(points: &[Point<D>]) -> Result<(), TestCaseError> {
    let tree = KdTree::new(points);
    let mut seen = tree.order().to_vec();
    seen.sort_unstable();
    prop_assert_eq!(seen, (0..points.len() as u32).collect::<Vec<_>>());
    for (position, &index) in tree.order().iter().enumerate() {
        prop_assert_eq!(tree.points()[position], points[index as usize]);
        prop_assert_eq!(tree.positions()[index as usize] as usize, position);
    }
    let values: Vec<f64> = points.iter().map(|p| p[0]).collect();
    let in_leaf_order: Vec<f64> = tree.order().iter().map(|&i| values[i as usize]).collect();
    let (least, most) = (tree.node_min(&in_leaf_order), tree.node_max(&in_leaf_order));
    for node in 1..least.len() {
        let inside = &tree.points()[tree.range(node)];
        if 2 * node >= least.len() {
            prop_assert!(inside.len() <= LEAF);
        }
        if !inside.is_empty() {
            prop_assert_eq!(least[node], tree.bounds(node).lo[0]);
            prop_assert_eq!(most[node], tree.bounds(node).hi[0]);
        }
        for p in inside {
            for x in points.iter().take(5) {
                prop_assert!(tree.bounds(node).distance_2(x) <= distance_2(p, x));
            }
        }
    }
    Ok(())
}

/// The order of the leaves as the module tells it, every node sorted whole.
fn order_by_sorting<const D: usize>(points: &[Point<D>], items: &mut [u32], [node, first_leaf]: [usize; 2]) {
    let place = |i: u32, axis: usize| points[i as usize][axis];
    if node >= first_leaf {
        let by_axes = |&a: &u32, &b: &u32| {
            let axes = (0..D).map(|axis| place(a, axis).total_cmp(&place(b, axis)));
            axes.fold(Ordering::Equal, Ordering::then).then(a.cmp(&b))
        };
        items.sort_by(by_axes);
        return;
    }
    let axis = Bounds::of(items.iter().map(|&i| &points[i as usize])).widest();
    items.sort_by(|&a, &b| place(a, axis).total_cmp(&place(b, axis)).then(a.cmp(&b)));
    let start = |node: usize| {
        let first = 1 << node.ilog2();
        (node - first) * points.len() / first
    };
    let (left, right) = items.split_at_mut(start(2 * node + 1) - start(2 * node));
    order_by_sorting(points, left, [2 * node, first_leaf]);
    order_by_sorting(points, right, [2 * node + 1, first_leaf]);
}

fn order_is_that_of_sorting<const D: usize>(points: &[Point<D>]) -> Result<(), TestCaseError> {
    let mut first_leaf = 1;
    while points.len().div_ceil(first_leaf) > LEAF {
        first_leaf *= 2;
    }
    let mut expected: Vec<u32> = (0..points.len() as u32).collect();
    order_by_sorting(points, &mut expected, [1, first_leaf]);
    let tree = KdTree::new(points);
    prop_assert_eq!(tree.order(), &expected);
    Ok(())
}

fn searches_agree<const D: usize>(points: &[Point<D>], x: Point<D>, radius: f64) -> Result<(), TestCaseError> {
    let tree = KdTree::new(points);
    let lone = points[0];
    for apart in [None, Some(&lone)] {
        let brute = (0..points.len())
            .filter(|&i| apart.is_none_or(|a| distance_2(&points[i], a) > 0.0))
            .map(|i| (distance_2(&points[i], &x), i as u32))
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let (d_2, position) = tree.nearest(&x, apart);
        prop_assert_eq!(position.map(|p| (d_2, tree.order()[p])), brute);
    }
    let mut found = Vec::new();
    tree.ball(&x, radius, |position, _| found.push(tree.order()[position]));
    found.sort_unstable();
    let brute: Vec<u32> = (0..points.len() as u32).filter(|&i| distance(&points[i as usize], &x) < radius).collect();
    prop_assert_eq!(found, brute);
    let kept: Vec<u32> = (0..points.len() as u32).filter(|p| p % 3 != 1).collect();
    let few = tree.subset(&kept);
    let mut found = Vec::new();
    few.ball(&x, radius, |position, _| found.push(tree.order()[kept[few.order()[position] as usize] as usize]));
    found.sort_unstable();
    let is_near = |&i: &u32| distance(&points[i as usize], &x) < radius;
    let mut brute: Vec<u32> = kept.iter().map(|&p| tree.order()[p as usize]).filter(is_near).collect();
    brute.sort_unstable();
    prop_assert_eq!(found, brute);
    Ok(())
}

proptest! {
    #[test]
    fn every_node_of_a_line_bounds_its_points(points in cloud::<1>(90)) { nodes_are_sound(&points)?; }

    #[test]
    fn every_node_of_a_plane_bounds_its_points(points in cloud::<2>(90)) { nodes_are_sound(&points)?; }

    #[test]
    fn every_node_of_space_bounds_its_points(points in cloud::<3>(90)) { nodes_are_sound(&points)?; }

    #[test]
    fn leaves_of_a_line_are_in_order(points in cloud::<1>(900)) { order_is_that_of_sorting(&points)?; }

    #[test]
    fn leaves_of_a_plane_are_in_order(points in cloud::<2>(900)) { order_is_that_of_sorting(&points)?; }

    #[test]
    fn leaves_of_space_are_in_order(points in cloud::<3>(900)) { order_is_that_of_sorting(&points)?; }

    #[test]
    fn leaves_are_in_order_where_coordinates_repeat_or_differ_by_little(
        steps in prop::collection::vec([0..40u64, 0..40u64], 1..900), exponent in -300..300, low in 0..60, signs: u8,
    ) {
        // lattices in the last digits of coordinates, large, small and about zero
        let size = 10f64.powi(exponent);
        let start = if low < 50 { size.to_bits() >> low << low } else { 0 };
        let at = |step: u64, bit: u8| {
            let x = if low % 2 == 0 { f64::from_bits(start + step) } else { size * step as f64 };
            if u64::from(signs >> bit) & step & 1 == 1 { -x } else { x }
        };
        let points: Vec<Point<2>> = steps.iter().map(|[x, y]| [at(*x, 0), at(*y, 1)]).collect();
        order_is_that_of_sorting(&points)?;
    }

    #[test]
    fn searches_on_a_line_find_what_brute_force_finds(points in cloud::<1>(120), pick: usize, t in 0.0..1.0f64) {
        let x = points[pick % points.len()];
        searches_agree(&points, x.map(|c| c + 0.01 * t * extent(&points)), t * extent(&points))?;
        searches_agree(&points, x, 0.0)?;
    }

    #[test]
    fn searches_in_a_plane_find_what_brute_force_finds(points in cloud::<2>(120), pick: usize, t in 0.0..1.0f64) {
        let x = points[pick % points.len()];
        searches_agree(&points, x.map(|c| c + 0.01 * t * extent(&points)), t * extent(&points))?;
        searches_agree(&points, x, distance(&points[0], &x))?;
    }

    #[test]
    fn searches_in_space_find_what_brute_force_finds(points in cloud::<3>(120), pick: usize, t in 0.0..1.0f64) {
        let x = points[pick % points.len()];
        searches_agree(&points, x.map(|c| c + 0.01 * t * extent(&points)), t * extent(&points))?;
        searches_agree(&points, x, distance(&points[0], &x))?;
    }
}

#[test]
fn the_tree_of_no_points_answers() {
    let tree = KdTree::<2>::new(&[]);
    assert_eq!(tree.nearest(&[0.0, 0.0], None), (f64::INFINITY, None));
    tree.ball(&[0.0, 0.0], 1.0, |_, _| unreachable!("there is no point to find"));
}

#[test]
fn the_tree_of_a_large_grid_has_the_order_of_sorting() -> Result<(), TestCaseError> {
    order_is_that_of_sorting::<2>(
        &(0..900 * 1024).map(|k| [f64::from(k % 1024), f64::from(k / 1024)]).collect::<Vec<_>>(),
    )
}

#[test]
fn the_tree_does_not_depend_on_the_number_of_threads() {
    let points: Vec<Point<2>> =
        (0..600_000u64).map(|i| [((i * 7919) % 600_011) as f64, ((i * 104_729) % 600_011 / 7) as f64]).collect();
    let order = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| KdTree::new(&points).order().to_vec())
    };
    assert_eq!(order(1), order(4));
}
