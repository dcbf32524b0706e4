//! The tree of segments finds all that brute force finds.

use _core::domain::segments_cross;
use _core::point::Point;
use _core::segments::Segments;
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Segments of a family: any, parallel and slanted, from one place, tiny and far away, all on one line.
fn segments() -> impl Strategy<Value = Vec<[Point<2>; 2]>> {
    (0..5usize, prop::collection::vec([-1.0..1.0f64, -1.0..1.0, -1.0..1.0, -1.0..1.0], 0..60)).prop_map(
        |(family, rows)| {
            let make = |[a, b, c, d]: [f64; 4]| match family {
                0 => [[a, b], [c, d]],
                1 => [[a * 1e-3, b * 1e-3], [a * 1e-3 + 2.0 + c, b * 1e-3 + 1.0 + d * 1e-6]],
                2 => [[0.5, 0.5], [c, d]],
                3 => [[1e9 + a * 1e-3, 1e9 + b * 1e-3], [1e9 + c * 1e-3, 1e9 + d * 1e-3]],
                _ => [[a, 2.0 * a], [c, 2.0 * c]],
            };
            rows.into_iter().map(make).collect()
        },
    )
}

/// The tree of segments with one vertex for each place, and the vertices.
fn tree(all: &[[Point<2>; 2]]) -> Segments {
    let mut points: Vec<Point<2>> = Vec::new();
    let mut vertex = |p: &Point<2>| {
        let known = points.iter().position(|q| p == q);
        known.unwrap_or_else(|| {
            points.push(*p);
            points.len() - 1
        }) as u32
    };
    let ends: Vec<[u32; 2]> = all.iter().map(|[a, b]| [vertex(a), vertex(b)]).collect();
    Segments::new(&points, &ends)
}

/// Segments at two vertices, in few directions.
fn fans() -> impl Strategy<Value = Vec<[Point<2>; 2]>> {
    let row = (0..5usize, -3..4i32, -3..4i32).prop_map(|(hub, x, y)| {
        let from = [[0.0, 0.0], [0.0, 0.0], [0.5, 0.25], [0.5, 0.25], [f64::from(y), 1.5]][hub];
        [from, [f64::from(x) * 0.5, f64::from(y) * 0.25]]
    });
    prop::collection::vec(row, 0..150).prop_map(|rows| rows.into_iter().filter(|[a, b]| a != b).collect())
}

proptest! {
    #[test]
    fn all_that_cross_a_segment_are_found(all in fans()) {
        let tree = tree(&all);
        for (position, &s) in tree.order().iter().enumerate() {
            let [a, b] = all[s as usize];
            let mut found = Vec::new();
            tree.crossing(position, position, |s| found.push(s));
            for &t in &tree.order()[position..] {
                let [c, d] = all[t as usize];
                prop_assert!(!segments_cross(&a, &b, &c, &d) || found.contains(&t));
            }
        }
    }

    #[test]
    fn all_that_meet_a_segment_are_found(all in segments()) {
        let tree = tree(&all);
        for [a, b] in &all {
            let mut found = Vec::new();
            tree.meeting(a, b, |s| found.push(s));
            found.sort_unstable();
            let meets = |s: &u32| {
                let [c, d] = &all[*s as usize];
                segments_cross(a, b, c, d) || [a, b].into_iter().any(|p| p == c || p == d)
            };
            let wanted: Vec<u32> = (0..all.len() as u32).filter(meets).collect();
            prop_assert!(wanted.iter().all(|s| found.binary_search(s).is_ok()), "{wanted:?} {found:?}");
            prop_assert!(found.windows(2).all(|pair| pair[0] < pair[1]));
        }
    }

    #[test]
    fn all_that_come_near_a_point_are_found(all in segments(), reach in 0.0..1.0f64) {
        let tree = tree(&all);
        for [x, _] in &all {
            let mut found = vec![false; all.len()];
            tree.near(x, reach, |s| found[s as usize] = true);
            for ([a, b], found) in all.iter().zip(found) {
                prop_assert!(found || _core::domain::segment_distance_2(x, a, b) > reach * reach);
            }
        }
    }

    #[test]
    fn a_segment_near_by_is_at_most_twice_as_far_as_the_nearest(all in segments(), x in [-2.0..2.0f64, -2.0..2.0]) {
        let tree = tree(&all);
        let away = |s: usize| _core::domain::segment_distance_2(&x, &all[s][0], &all[s][1]).sqrt();
        let least = (0..all.len()).map(away).fold(f64::INFINITY, f64::min);
        match tree.nearby(&x) {
            Some((s, reach)) => {
                prop_assert!(away(s as usize) <= 2.000001 * least + 1e-9);
                prop_assert!(reach <= least && reach >= 0.499999 * least - 1e-9);
            }
            None => prop_assert!(all.is_empty()),
        }
    }

    #[test]
    fn a_later_position_finds_the_rest_only(all in segments()) {
        let tree = tree(&all);
        for position in 0..all.len() {
            let (mut later, mut whole) = (Vec::new(), Vec::new());
            tree.crossing(position, position + 1, |s| later.push(s));
            tree.crossing(position, 0, |s| whole.push(s));
            let rest = &tree.order()[position + 1..];
            prop_assert_eq!(later, whole.into_iter().filter(|s| rest.contains(s)).collect::<Vec<_>>());
        }
    }

    #[test]
    fn the_highest_below_a_point_is_found(lines in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64, -0.4..0.4f64), 1..60), x in 0.0..1.0f64) {
        // segments in layers of their own, which cross nowhere
        let all: Vec<[Point<2>; 2]> =
            (0..).zip(&lines).map(|(k, &(a, b, tilt))| [[a, f64::from(k)], [b, f64::from(k) + tilt]]).collect();
        let tree = tree(&all);
        let is_over = |s: u32| {
            let [a, b] = all[s as usize];
            a[0].min(b[0]) <= x && x < a[0].max(b[0])
        };
        for y in [-1.0, 10.0, 30.0, 100.0] {
            let is_below = |s: u32| f64::from(s) + 0.5 < y && is_over(s);
            let found = tree.highest_below(&[x, y], -2.0, is_below, |s, t| s > t);
            prop_assert_eq!(found, (0..all.len() as u32).rev().find(|&s| is_below(s)));
        }
    }
}

/// Segments found for each of `n` segments, on average.
fn found_per_segment(n: usize, segment: impl Fn(f64) -> [Point<2>; 2]) -> f64 {
    let all: Vec<[Point<2>; 2]> = (0..n).map(|k| segment(k as f64 / n as f64)).collect();
    let tree = tree(&all);
    let mut count = 0;
    (0..n).for_each(|position| tree.crossing(position, 0, |_| count += 1));
    count as f64 / n as f64
}

#[test]
fn what_is_found_does_not_grow_with_the_number_of_segments() {
    let on_circle = |t: f64| [(TAU * t).cos(), (TAU * t).sin()];
    // (star, two hubs, long slanted needles with ends here and there)
    let few = [250, 4000].map(|n| {
        let wave = |t: f64| 0.1 * (1e4 * t).sin();
        [
            found_per_segment(n, |t| [[0.0, 0.0], on_circle(t)]),
            found_per_segment(n, |t| [[0.0, if t < 0.5 { 1.0 } else { -1.0 }], [2.0 * (t % 0.5) - 0.5, 0.0]]),
            found_per_segment(n, |t| [[wave(t), t + 0.5 * wave(t)], [1.0 + wave(t), 0.5 + t + 0.5 * wave(t)]]),
        ]
    });
    assert!(few.iter().flatten().all(|&per_segment| per_segment < 16.0), "{few:?}");
}

/// Edges looked at for what lies below a point of a comb of `n` teeth, turned by an angle: on average, for points on all teeth.
fn looked_at_per_point(n: usize, angle: f64) -> f64 {
    let (sine, cosine) = angle.sin_cos();
    let turned = |[x, y]: Point<2>| [x * cosine - y * sine, x * sine + y * cosine];
    let tooth = |k: usize| [[k as f64, 0.0], [k as f64 + 0.5, 20.0], [k as f64 + 1.0, 0.0]].map(turned);
    let all: Vec<[Point<2>; 2]> =
        (0..n).flat_map(|k| [[tooth(k)[0], tooth(k)[1]], [tooth(k)[1], tooth(k)[2]]]).collect();
    let tree = tree(&all);
    let rightward = |s: u32| {
        let [a, b] = all[s as usize];
        if a[0] < b[0] { [a, b] } else { [b, a] }
    };
    let height = |s: u32, x: f64| {
        let [a, b] = rightward(s);
        a[1] + (x - a[0]) * (b[1] - a[1]) / (b[0] - a[0])
    };
    let floor = all.iter().flatten().map(|p| p[1]).fold(f64::INFINITY, f64::min);
    let count = std::cell::Cell::new(0);
    for k in 0..n {
        let x = turned([k as f64 + 0.6, 10.0]);
        let is_below = |s: u32| {
            count.set(count.get() + 1);
            let [a, b] = rightward(s);
            a[0] <= x[0] && x[0] < b[0] && height(s, x[0]) < x[1]
        };
        tree.highest_below(&x, floor, is_below, |s, t| height(s, x[0]) > height(t, x[0]));
    }
    f64::from(count.get()) / n as f64
}

#[test]
fn what_is_looked_at_for_the_highest_below_does_not_grow_with_the_number_of_segments() {
    let angles = [0.0, 0.3, 0.25 * TAU, 0.4 * TAU, 0.5 * TAU];
    let few = angles.map(|angle| [250, 4000].map(|n| looked_at_per_point(n, angle)));
    assert!(few.iter().flatten().all(|&per_point| per_point < 32.0), "{few:?}");
}
