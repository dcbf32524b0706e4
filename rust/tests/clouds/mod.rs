//! Point clouds that tempt a geometric search: uniform, graded over six decades, lattices, collinear runs, cocircular
//! points, duplicates, each also far from the origin and tiny.

#![allow(dead_code, reason = "each test file uses its own part")]
use _core::point::Point;
use proptest::prelude::*;

/// A cloud of up to `most` points, at least one.
pub fn cloud<const D: usize>(most: usize) -> impl Strategy<Value = Vec<Point<D>>> {
    let unit = || prop::collection::vec(prop::array::uniform::<_, D>(0.0..1.0f64), 1..most);
    let uniform = unit();
    let graded = unit().prop_map(|points| points.into_iter().map(|p| p.map(|x| 10f64.powf(6.0 * x - 6.0))).collect());
    let lattice = prop::collection::vec(prop::array::uniform::<_, D>((0..6u8).prop_map(f64::from)), 1..most);
    let collinear = prop::collection::vec(0..40u8, 1..most)
        .prop_map(|steps| steps.into_iter().map(|t| std::array::from_fn(|k| f64::from(t) * (k + 1) as f64)).collect());
    let cocircular = prop::collection::vec(0..32u8, 1..most).prop_map(|turns| {
        let on_circle = |t: u8| {
            let angle = std::f64::consts::TAU * f64::from(t) / 32.0;
            std::array::from_fn(|k| [angle.cos(), angle.sin(), 0.0][k])
        };
        turns.into_iter().map(on_circle).collect()
    });
    let repeated = (unit(), 1..4usize).prop_map(|(points, times)| points.repeat(times));
    let shape = prop_oneof![
        uniform.boxed(),
        graded.boxed(),
        lattice.boxed(),
        collinear.boxed(),
        cocircular.boxed(),
        repeated.boxed()
    ];
    let placed = prop_oneof![Just((1.0, 0.0)), Just((1.0, 1e6)), Just((1e-6, 0.0)), Just((1e-6, 1.0))];
    (shape, placed).prop_map(|(points, (scale, offset)): (Vec<Point<D>>, _)| {
        points.into_iter().map(|p| p.map(|x| scale * x + offset)).collect()
    })
}

/// Values of a spacing for each of `n` points, over six decades, some of them 0.
pub fn values(n: usize, scale: f64) -> impl Strategy<Value = Vec<f64>> {
    let value = prop_oneof![
        8 => (0.0..1.0f64).prop_map(move |t| scale * 10f64.powf(6.0 * t - 5.0)),
        1 => Just(0.0),
        1 => Just(scale),
    ];
    prop::collection::vec(value, n)
}

/// The longest side of the box of some points, 1 where they coincide.
pub fn extent<const D: usize>(points: &[Point<D>]) -> f64 {
    let side = |k: usize| {
        let ends = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[k]), b.max(p[k])));
        ends.1 - ends.0
    };
    let longest = (0..D).map(side).fold(0.0, f64::max);
    if longest > 0.0 { longest } else { 1.0 }
}
