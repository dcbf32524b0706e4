//! Conflict graph and independent sets against brute force.

mod clouds;

use _core::kdtree::KdTree;
use _core::point::{Point, distance};
use _core::progress::Progress;
use _core::selection::{
    Known, conflict_graph, conflicting, greedy, greedy_after, greedy_in_tiles, rank, skeleton_independent_set,
};
use clouds::{cloud, extent, values};
use proptest::prelude::*;

fn conflict<const D: usize>(points: &[Point<D>], f: &[f64], beta: f64, i: usize, j: usize) -> bool {
    let d = distance(&points[i], &points[j]);
    d > 0.0 && d < (f[i] + f[j]) / beta
}

fn agrees<const D: usize>(
    points: &[Point<D>],
    f: &[f64],
    beta: f64,
    order: &[u32],
    keep: &[u32],
) -> Result<(), TestCaseError> {
    let (tree, progress) = (KdTree::new(points), Progress::default());
    let n = points.len();
    let mut edges = Vec::new();
    for i in 0..n {
        for j in i + 1..n {
            if conflict(points, f, beta, i, j) {
                edges.push([i as u32, j as u32]);
            }
        }
    }
    prop_assert_eq!(conflict_graph(&tree, f, beta, &progress)?, edges);

    let mut inside = keep.to_vec();
    let mut joined = Vec::new();
    for &i in order {
        let blocked = inside.iter().any(|&j| i == j || conflict(points, f, beta, i as usize, j as usize));
        if !blocked {
            inside.push(i);
            joined.push(i);
        }
    }
    let mut only_here = vec![f64::NAN; n];
    order.iter().chain(keep).for_each(|&i| only_here[i as usize] = f[i as usize]);
    prop_assert_eq!(greedy(&tree, &only_here, beta, order, keep, &progress)?, joined);
    Ok(())
}

type Case<const D: usize> = (Vec<Point<D>>, Vec<f64>, f64, Vec<u32>, Vec<u32>);

/// Points, any spacing, beta, an order of some of the points and some to keep.
fn case<const D: usize>(most: usize) -> impl Strategy<Value = Case<D>> {
    cloud::<D>(most).prop_flat_map(|points| {
        let (n, scale) = (points.len(), 0.3 * extent(&points));
        let all: Vec<u32> = (0..n as u32).collect();
        let order = Just(all.clone()).prop_shuffle();
        let kept = prop::sample::subsequence(all, 0..=n.min(4));
        let spacing = prop_oneof![values(n, scale), Just(vec![0.2 * scale; n])];
        (Just(points), spacing, 1.05..4.0f64, (order, 0..=n), kept)
            .prop_map(|(points, f, beta, (order, part), keep)| (points, f, beta, order[..part].to_vec(), keep))
    })
}

proptest! {
    #[test]
    fn selection_on_a_line_is_brute_force((points, f, beta, order, keep) in case::<1>(90)) {
        agrees(&points, &f, beta, &order, &keep)?;
    }

    #[test]
    fn selection_in_a_plane_is_brute_force((points, f, beta, order, keep) in case::<2>(90)) {
        agrees(&points, &f, beta, &order, &keep)?;
    }

    #[test]
    fn selection_in_space_is_brute_force((points, f, beta, order, keep) in case::<3>(90)) {
        agrees(&points, &f, beta, &order, &keep)?;
    }

    #[test]
    fn a_level_that_begins_with_a_known_set_takes_it_first(
        (points, f, beta, order, keep) in case::<2>(90),
        lowered in prop::collection::vec(prop_oneof![3 => Just(1.0), 1 => 0.0..1.0f64], 90),
        part in 0..=90usize,
    ) {
        let (tree, progress) = (KdTree::new(&points), Progress::default());
        let known = Known::new(&tree, tree.in_leaf_order(&f), beta, 0, &progress)?;
        let lower: Vec<f64> = f.iter().zip(lowered.iter().cycle()).map(|(f, share)| f * share).collect();
        let mut asked: Vec<u32> = order.iter().take(part).copied().filter(|i| !keep.contains(i)).collect();
        asked.sort_unstable();
        let (members, others): (Vec<u32>, Vec<u32>) = asked.iter().copied().partition(|i| known.set.contains(i));
        let begun = greedy(&tree, &lower, beta, &members, &keep, &progress)?;
        let stay: Vec<u32> = keep.iter().chain(&begun).copied().collect();
        let mut expected = greedy_in_tiles(&tree, &lower, beta, &others, &stay, &progress)?;
        expected.extend(begun);
        expected.sort_unstable();
        prop_assert_eq!(greedy_after(&tree, &lower, beta, |i| asked.contains(&i), &keep, &known, &progress)?, expected);
    }

    #[test]
    fn a_known_set_is_that_of_all_in_tiles((points, f, beta, _, _) in case::<2>(90), first in 0..90usize) {
        let (tree, progress) = (KdTree::new(&points), Progress::default());
        let first = first.min(points.len()) as u32;
        let known = Known::new(&tree, tree.in_leaf_order(&f), beta, first, &progress)?;
        let all: Vec<u32> = (first..points.len() as u32).collect();
        prop_assert_eq!(known.set, greedy_in_tiles(&tree, &f, beta, &all, &[], &progress)?);
        prop_assert_eq!(known.f, f);
    }

    #[test]
    fn few_beside_many_that_stay_are_chosen_in_their_order(
        (points, f, beta, order, keep) in case::<2>(90), few in 0..8usize,
    ) {
        let (tree, progress) = (KdTree::new(&points), Progress::default());
        let (few, many) = order.split_at(few.min(order.len()));
        let mut few = few.to_vec();
        few.sort_unstable();
        let stay: Vec<u32> = keep.iter().chain(many).copied().collect();
        let mut ranked = few.clone();
        rank(&mut ranked, &f);
        let mut expected = greedy(&tree, &f, beta, &ranked, &stay, &progress)?;
        expected.sort_unstable();
        prop_assert_eq!(greedy_in_tiles(&tree, &f, beta, &few, &stay, &progress)?, expected);
    }

    #[test]
    fn what_conflicts_is_what_the_graph_says((points, f, beta, order, keep) in case::<2>(90)) {
        let (tree, progress) = (KdTree::new(&points), Progress::default());
        let wanted = |i: u32| order.contains(&i);
        let meets = |i: u32| keep.iter().any(|&j| conflict(&points, &f, beta, i as usize, j as usize));
        let expected: Vec<u32> = (0..points.len() as u32).filter(|&i| wanted(i) && meets(i)).collect();
        prop_assert_eq!(conflicting(&tree, &f, beta, &keep, wanted, &progress)?, expected);
    }

    #[test]
    fn the_skeleton_set_is_greedy_on_edges(
        n in 1..40usize,
        cells in prop::collection::vec(prop::array::uniform3(0..1000u32), 0..60),
    ) {
        let cells: Vec<[u32; 3]> = cells.into_iter().map(|cell| cell.map(|node| node % n as u32)).collect();
        let mut inside: Vec<u32> = Vec::new();
        for i in 0..n as u32 {
            let meets = |j: u32| cells.iter().any(|cell| cell.contains(&i) && cell.contains(&j));
            if !inside.iter().any(|&j| meets(j)) {
                inside.push(i);
            }
        }
        prop_assert_eq!(skeleton_independent_set(n, &cells), inside);
    }
}

#[test]
fn the_edge_rule_is_strict() {
    let (points, progress) = ([[0.0], [1.0], [2.0], [3.0]], Progress::default());
    let edges = conflict_graph(&KdTree::new(&points), &[1.0, 1.0, 1.0, 1.5], 2.0, &progress);
    assert_eq!(edges, Ok(vec![[2, 3]]));
}

#[test]
fn both_sides_of_a_slit_stay_together() {
    let (points, progress) = ([[0.0, 0.0], [0.0, 0.0], [0.1, 0.0]], Progress::default());
    let joined = greedy(&KdTree::new(&points), &[1.0; 3], 2.0, &[0, 1, 2], &[], &progress);
    assert_eq!(joined, Ok(vec![0, 1]));
}

#[test]
fn the_set_is_the_sequential_one_whatever_the_number_of_threads() {
    let n = 20_000u32;
    let points: Vec<Point<2>> = (0..n).map(|i| [f64::from(i * 7919 % n), f64::from(i * 104_729 % n)]).collect();
    let f: Vec<f64> = points.iter().map(|p| 150.0 + 0.1 * p[0]).collect();
    let order: Vec<u32> = (0..n).map(|i| i * 3_571 % n).collect();
    let tree = KdTree::new(&points);
    let joined = |threads, order: &[u32], keep: &[u32]| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| greedy(&tree, &f, 2.0, order, keep, &Progress::default()).expect("nobody stops it"))
    };
    let all = joined(1, &order, &[]);
    assert_eq!(joined(3, &order, &[]), all);

    let mut blocked = vec![false; n as usize];
    let mut sequential = Vec::new();
    for &i in &order {
        if !blocked[i as usize] {
            sequential.push(i);
            (0..n as usize).for_each(|j| blocked[j] |= conflict(&points, &f, 2.0, i as usize, j));
        }
    }
    assert_eq!(all, sequential);
    // few candidates have a tree of their own; what is kept is no candidate again
    let few: Vec<u32> = order[..3000].to_vec();
    let keep = &all[..200];
    let rest: Vec<u32> = few.iter().copied().filter(|i| !keep.contains(i)).collect();
    assert_eq!(joined(2, &few, keep), joined(1, &rest, keep));
}

#[test]
fn tiles_make_a_maximal_independent_set_whatever_the_number_of_threads() {
    let n = 60_000u32;
    let place = |i: u32| [f64::from(i * 7919 % n), f64::from(i * 13 % 50_021)];
    let points: Vec<Point<2>> = (0..n).map(place).collect();
    // from few to many neighbours, and jumps that no Lipschitz function has
    let f: Vec<f64> = (0..n).map(|i| 150.0 + 0.02 * points[i as usize][0] + f64::from(i % 7 * 60)).collect();
    let keep: Vec<u32> = (0..n).step_by(997).collect();
    let order: Vec<u32> = (0..n).filter(|i| i % 997 != 0 && i % 5 != 0).collect();
    let (tree, progress) = (KdTree::new(&points), Progress::default());
    let joined = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| greedy_in_tiles(&tree, &f, 2.0, &order, &keep, &progress).expect("nobody stops it"))
    };
    let all = joined(1);
    assert_eq!(joined(4), all);

    let mut is_in = vec![false; n as usize];
    all.iter().for_each(|&i| is_in[i as usize] = true);
    let mut covered = is_in.clone();
    let mut is_kept = vec![false; n as usize];
    keep.iter().for_each(|&i| is_kept[i as usize] = true);
    for [i, j] in conflict_graph(&tree, &f, 2.0, &progress).expect("nobody stops it") {
        let [i, j] = [i as usize, j as usize];
        assert!(!(is_in[i] && (is_in[j] || is_kept[j]) || is_in[j] && is_kept[i]), "{i} and {j} conflict");
        covered[i] |= is_in[j] || is_kept[j];
        covered[j] |= is_in[i] || is_kept[i];
    }
    assert!(order.iter().all(|&i| covered[i as usize]), "the set is not maximal");
}
