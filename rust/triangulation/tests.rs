//! The order of points; large triangulations, in strips, against what defines them: sound cells that fill the hull, all constraints there, and
//! every other edge locally Delaunay by exact predicates.

use super::order::hilbert;
use super::*;
use crate::point::{in_circle, orient};

/// Numbers in [0, 1), the same ones every time.
fn numbers(mut state: u64) -> impl FnMut() -> f64 {
    move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// The Hilbert curve bit by bit.
fn plain_hilbert(mut x: u32, mut y: u32) -> u64 {
    let mut place = 0;
    for bit in (0..32).rev() {
        let (rx, ry) = (x >> bit & 1, y >> bit & 1);
        place = place << 2 | u64::from((3 * rx) ^ ry);
        if ry == 0 {
            if rx == 1 {
                (x, y) = (!x, !y);
            }
            (x, y) = (y, x);
        }
    }
    place
}

#[test]
fn the_curve_several_bits_at_a_time_is_the_curve() {
    let mut next = numbers(1);
    let mut word = || (next() * 2f64.powi(32)) as u32;
    for _ in 0..100_000 {
        let (x, y) = (word(), word());
        assert_eq!(hilbert(x, y), plain_hilbert(x, y), "{x} {y}");
    }
}

#[test]
fn neighbours_along_the_curve_are_neighbours_in_the_plane() {
    let mut cells: Vec<(u64, i64, i64)> =
        (0..64).flat_map(|x| (0..64).map(move |y| (hilbert(x << 26, y << 26), x.into(), y.into()))).collect();
    cells.sort_unstable();
    for pair in cells.windows(2) {
        assert_eq!((pair[0].1 - pair[1].1).abs() + (pair[0].2 - pair[1].2).abs(), 1);
    }
}

/// Sorted as callers sort them, and `ends` with them.
fn sorted(points: Vec<Point<2>>, ends: Vec<[u32; 2]>) -> (Vec<Point<2>>, Vec<[u32; 2]>) {
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    sort_spatially(&mut order, |i| points[i as usize]);
    let mut place = vec![0; points.len()];
    order.iter().zip(0..).for_each(|(&i, k)| place[i as usize] = k);
    let moved = ends.into_iter().map(|ends| ends.map(|i| place[i as usize])).collect();
    (order.into_iter().map(|i| points[i as usize]).collect(), moved)
}

fn is_constrained_delaunay(points: &[Point<2>], ends: &[[u32; 2]], all: &[Cell]) {
    let at = |i: u32| &points[i as usize];
    let mut seen = vec![[0; 2]; ends.len()];
    let mut on_hull = 0;
    for (t, Cell { corners, .. }) in all.iter().enumerate() {
        assert!(orient(at(corners[0]), at(corners[1]), at(corners[2])) > 0.0, "cell {t}");
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let (next, code) = (all[t].neighbours[k], all[t].constraints[k]);
            if code != NONE {
                let mut ends = ends[code as usize / 2];
                if code % 2 == 1 {
                    ends.reverse();
                }
                assert_eq!(ends, [a, b], "cell {t}, constraint {code}");
                seen[code as usize / 2][code as usize % 2] += 1;
            }
            if next == NONE {
                on_hull += 1;
                continue;
            }
            let other = all[next as usize].corners;
            let j = (0..3).find(|&j| other[j] == b && other[(j + 1) % 3] == a).expect("the neighbour has the edge");
            assert_eq!(all[next as usize].neighbours[j], t as u32);
            assert_eq!(all[next as usize].constraints[j], if code == NONE { NONE } else { code ^ 1 });
            if code == NONE {
                let beyond = at(other[(j + 2) % 3]);
                assert!(in_circle(at(corners[0]), at(corners[1]), at(corners[2]), beyond) <= 0.0, "edge {a} {b}");
            }
        }
    }
    assert_eq!(all.len() + on_hull + 2, 2 * points.len());
    assert!(seen.iter().all(|&[left, right]| left <= 1 && right <= 1 && left + right >= 1));
}

/// Checks a triangulation, and that strips made it or not.
fn check(points: Vec<Point<2>>, ends: Vec<[u32; 2]>, in_strips: bool) {
    let (points, ends) = sorted(points, ends);
    let made = strips::in_strips(&points, &ends, strips::COLUMNS).expect("no points repeat");
    assert_eq!(made.is_some(), in_strips);
    let (cells, failed) = whole(&points, &ends, |k| k as u32).expect("no points repeat");
    assert!(failed.is_empty());
    is_constrained_delaunay(&points, &ends, &cells);
}

fn uniform(n: usize, seed: u64) -> Vec<Point<2>> {
    let mut next = numbers(seed);
    (0..n).map(|_| [next(), next()]).collect()
}

#[test]
fn uniform_points() {
    check(uniform(50_000, 1), Vec::new(), true);
    check(uniform(180_000, 2), Vec::new(), true);
    // along the other axis
    check(uniform(50_000, 3).into_iter().map(|[x, y]| [0.3 * x, 7.0 * y - 1e3]).collect(), Vec::new(), true);
}

#[test]
fn a_lattice_all_cocircular() {
    let points = (0..240).flat_map(|x| (0..240).map(move |y| [f64::from(x), f64::from(y)])).collect();
    check(points, Vec::new(), true);
}

#[test]
fn points_graded_over_many_decades() {
    let graded = |p: Point<2>| p.map(|x| 10f64.powf(8.0 * x - 8.0));
    check(uniform(60_000, 4).into_iter().map(graded).collect(), Vec::new(), true);
}

#[test]
fn constraints_across_all_strips() {
    // a row of points along the middle, joined one by one, and some long constraints far from others
    let mut next = numbers(5);
    let mut points: Vec<Point<2>> = uniform(60_000, 6).into_iter().filter(|p| (p[1] - 0.5).abs() > 0.004).collect();
    let first = points.len() as u32;
    points.extend((0..300).map(|k| [(f64::from(k) + 0.5 * next()) / 300.0, 0.5 + 1e-3 * next()]));
    let ends = (first..points.len() as u32 - 1).map(|i| [i, i + 1]).collect();
    check(points, ends, true);
}

#[test]
fn a_constraint_through_the_cells_of_a_strip() {
    // one long constraint over points that lie close by, from side to side: strips can't serve
    let mut points: Vec<Point<2>> = uniform(60_000, 7);
    points.retain(|p| p[1] != 0.5);
    let n = points.len() as u32;
    points.extend([[0.001, 0.5], [0.999, 0.5]]);
    check(points, vec![[n, n + 1]], false);
}

#[test]
fn few_columns_of_points() {
    // strips begin and end on columns; some have all their points on one line
    let points = (0..6).flat_map(|x| (0..10_000).map(move |y| [1e5 * f64::from(x), f64::from(y)])).collect();
    let (points, _) = sorted(points, Vec::new());
    let (cells, _) = whole(&points, &[], |k| k as u32).expect("no points repeat");
    is_constrained_delaunay(&points, &[], &cells);
}

#[test]
fn points_that_repeat_are_named_as_they_came() {
    let mut points = uniform(60_000, 8);
    points[40_000] = points[17];
    let error = delaunay(&points, &[]).expect_err("two points are one");
    let text = error.to_string();
    assert!(text.contains("point 40000") && text.contains("point 17"), "{text}");
}

#[test]
fn a_thousand_small_clouds_in_narrow_strips() {
    let mut next = numbers(9);
    let mut served = 0;
    for round in 0..1000 {
        let n = 200 + (600.0 * next()) as usize;
        let mut points: Vec<Point<2>> = (0..n).map(|_| [next(), next()]).collect();
        match round % 4 {
            0 => {}
            1 => points.iter_mut().flatten().for_each(|x| *x = (*x * 40.0).round()),
            2 => points.iter_mut().for_each(|p| p[0] = 10f64.powf(6.0 * p[0] - 6.0)),
            _ => points.iter_mut().for_each(|p| p[1] = (p[1] - 0.5).abs() * p[0].powi(3)),
        }
        points.sort_unstable_by(|a, b| a.partial_cmp(b).expect("finite"));
        points.dedup();
        // edges of another triangulation of some of the points never cross; on a lattice they pass through points
        let (some, _) = sorted(points.iter().step_by(7).copied().collect(), Vec::new());
        let (coarse, _) = cdt::triangulated(&some, &[], |k| k as u32).expect("no points repeat");
        let (points, _) = sorted(points, Vec::new());
        let name = |k: u32| points.iter().position(|p| *p == some[k as usize]).expect("one of them") as u32;
        let edges =
            coarse.iter().map(|cell| [cell.corners[0], cell.corners[1]]).filter(|e| e[0] < e[1] && round % 4 != 1);
        let ends: Vec<[u32; 2]> = edges.filter(|_| next() < 0.1).map(|e| e.map(name)).collect();
        if let Some(cells) = strips::in_strips(&points, &ends, 4).expect("no points repeat") {
            is_constrained_delaunay(&points, &ends, &cells);
            served += 1;
        }
    }
    assert!(served > 400, "{served}");
}
