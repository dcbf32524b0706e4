//! The tree of segments finds all that brute force finds.

use _core::domain::segments_cross;
use _core::point::Point;
use _core::segments::Segments;
use proptest::prelude::*;

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

proptest! {
    #[test]
    fn all_that_meet_a_segment_are_found(all in segments()) {
        let tree = Segments::new(&all);
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
        let tree = Segments::new(&all);
        for [x, _] in &all {
            let mut found = vec![false; all.len()];
            tree.near(x, reach, |s| found[s as usize] = true);
            for ([a, b], found) in all.iter().zip(found) {
                prop_assert!(found || _core::domain::segment_distance_2(x, a, b) > reach * reach);
            }
        }
    }

    #[test]
    fn a_later_position_finds_the_rest_only(all in segments()) {
        let tree = Segments::new(&all);
        for (position, &s) in tree.order().iter().enumerate() {
            let [a, b] = all[s as usize];
            let (mut later, mut whole) = (Vec::new(), Vec::new());
            tree.meeting_from(position + 1, &a, &b, |s| later.push(s));
            tree.meeting(&a, &b, |s| whole.push(s));
            let rest = &tree.order()[position + 1..];
            prop_assert_eq!(later, whole.into_iter().filter(|s| rest.contains(s)).collect::<Vec<_>>());
        }
    }
}
