//! The quadtree's leaves, made a second way: one list of leaves, split and balanced by looking at all pairs.

mod clouds;

use _core::kdtree::KdTree;
use _core::point::Point;
use _core::progress::Progress;
use _core::quadtree::spacing;
use _core::spacing::nearest;
use clouds::{cloud, extent};
use proptest::prelude::*;

/// A cube of the unit root: its corner and side, both multiples of powers of two and so exact.
type Leaf<const D: usize> = (Point<D>, f64);

fn halves<const D: usize>((corner, side): Leaf<D>) -> impl Iterator<Item = Leaf<D>> {
    let half = side / 2.0;
    (0..1 << D).map(move |child| (std::array::from_fn(|k| corner[k] + half * f64::from(child >> k & 1)), half))
}

fn holds<const D: usize>((corner, side): Leaf<D>, x: &Point<D>) -> bool {
    (0..D).all(|k| corner[k] <= x[k] && x[k] < corner[k] + side)
}

/// Whether two closed cubes meet.
fn touch<const D: usize>((a, s): Leaf<D>, (b, t): Leaf<D>) -> bool {
    (0..D).all(|k| a[k] <= b[k] + t && b[k] <= a[k] + s)
}

fn leaves<const D: usize>(points: &[Point<D>]) -> Vec<Leaf<D>> {
    let mut open = vec![([0.0; D], 1.0)];
    let mut leaves = Vec::new();
    while let Some(leaf) = open.pop() {
        let (corner, side) = leaf;
        let around = (corner.map(|x| x - side), 3.0 * side);
        let own = points.iter().find(|x| holds(leaf, x));
        if own.is_some_and(|own| points.iter().any(|x| x != own && holds(around, x))) {
            open.extend(halves(leaf));
        } else {
            leaves.push(leaf);
        }
    }
    loop {
        let too_large = |a: &Leaf<D>| leaves.iter().any(|b| b.1 < a.1 / 2.0 && touch(*a, *b));
        let Some(worst) = leaves.iter().position(too_large) else { return leaves };
        let leaf = leaves.swap_remove(worst);
        leaves.extend(halves(leaf));
    }
}

/// Points on a grid that hold their own place under the rounding of `x - lo`.
fn on_grid<const D: usize>() -> impl Strategy<Value = Vec<Point<D>>> {
    let point = prop::array::uniform::<_, D>((0..64u8).prop_map(|i| f64::from(i) / 64.0));
    prop::collection::vec(point, 2..7).prop_map(|mut points| {
        points.push([0.0; D]);
        points.push([63.0 / 64.0; D]);
        points
    })
}

fn is_the_balanced_tree<const D: usize>(points: &[Point<D>], at: &[Point<D>]) -> Result<(), TestCaseError> {
    let leaves = leaves(points);
    let side = |x: &Point<D>| leaves.iter().find(|leaf| holds(**leaf, x)).map(|leaf| 15.0 / 16.0 * leaf.1);
    let sides: Vec<Option<f64>> = at.iter().map(side).collect();
    let found = spacing(points, at, &Progress::default())?;
    prop_assert_eq!(found.into_iter().map(Some).collect::<Vec<_>>(), sides);
    Ok(())
}

fn is_under_nearest<const D: usize>(points: &[Point<D>]) -> Result<(), TestCaseError> {
    let progress = Progress::default();
    let g = nearest(&KdTree::new(points), &progress)?;
    let h = spacing(points, points, &progress)?;
    for (g, h) in g.iter().zip(h) {
        prop_assert!(h > 0.0);
        prop_assert!(h <= *g || *g < 1e-12 * extent(points));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn leaves_of_a_line_are_split_and_balanced(points in on_grid::<1>(), at in on_grid::<1>()) {
        is_the_balanced_tree(&points, &at)?;
    }

    #[test]
    fn leaves_of_a_plane_are_split_and_balanced(points in on_grid::<2>(), at in on_grid::<2>()) {
        is_the_balanced_tree(&points, &at)?;
    }

    #[test]
    fn leaves_of_space_are_split_and_balanced(points in on_grid::<3>(), at in on_grid::<3>()) {
        is_the_balanced_tree(&points[points.len() - 3..], &at)?;
    }

    #[test]
    fn the_spacing_never_exceeds_nearest_on_a_line(points in cloud::<1>(60)) { is_under_nearest(&points)?; }

    #[test]
    fn the_spacing_never_exceeds_nearest_in_a_plane(points in cloud::<2>(60)) { is_under_nearest(&points)?; }

    #[test]
    fn the_spacing_never_exceeds_nearest_in_space(points in cloud::<3>(40)) { is_under_nearest(&points)?; }
}

#[test]
fn outside_the_root_the_nearest_leaf_answers() {
    let points = [[0.0, 0.0], [0.25, 0.25], [0.75, 0.75]];
    let at = |x| spacing(&points, &[x], &Progress::default()).expect("nobody stops it")[0];
    assert_eq!(at([-5.0, 0.1]), at([0.0, 0.1]));
    assert_eq!(at([5.0, 9.0]), at([0.999_999, 0.999_999]));
}
