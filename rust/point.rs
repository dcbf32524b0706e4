//! Points and the one distance formula.
//!
//! Every distance of the package is `sqrt(dx*dx + dy*dy)` in this order and without fused operations, so that the
//! NumPy reference gives the same bits.

use std::cmp::Ordering;

/// A point of dimension `D` (1 to 3).
pub type Point<const D: usize> = [f64; D];

/// An index that means "none": no cell on that side, no given facet, no tag.
pub const NONE: u32 = u32::MAX;

/// Squared Euclidean distance.
#[inline(always)]
pub fn distance_2<const D: usize>(a: &Point<D>, b: &Point<D>) -> f64 {
    let mut sum = 0.0;
    for k in 0..D {
        let d = a[k] - b[k];
        sum += d * d;
    }
    sum
}

/// Euclidean distance.
#[inline(always)]
pub fn distance<const D: usize>(a: &Point<D>, b: &Point<D>) -> f64 {
    distance_2(a, b).sqrt()
}

/// Twice the signed area of the triangle `a`, `b`, `c`, its sign exact: positive where they turn left.
#[inline(always)]
pub fn orient(a: &Point<2>, b: &Point<2>, c: &Point<2>) -> f64 {
    let turn = robust::orient2d(coord(a), coord(b), coord(c));
    if turn != 0.0 { turn } else { orient_magnified(a, b, c) }
}

/// Order counter-clockwise around `v`, beginning to the right; exact.
pub fn turn(v: &Point<2>, p: &Point<2>, q: &Point<2>) -> Ordering {
    let lower_half = |p: &Point<2>| p[1] < v[1] || (p[1] == v[1] && p[0] < v[0]);
    lower_half(p).cmp(&lower_half(q)).then_with(|| 0.0.partial_cmp(&orient(v, p, q)).unwrap_or(Ordering::Equal))
}

/// [`orient`] where products of tiny differences may have vanished: a power of two changes no sign, and coordinates over
/// it need none.
#[cold]
fn orient_magnified(a: &Point<2>, b: &Point<2>, c: &Point<2>) -> f64 {
    const FACTOR: f64 = power_of_two(400);
    const LARGEST: f64 = power_of_two(100);
    if [a, b, c].into_iter().flatten().any(|x| x.abs() > LARGEST) {
        return 0.0;
    }
    let [a, b, c] = [a, b, c].map(|p| coord(&p.map(|x| x * FACTOR)));
    robust::orient2d(a, b, c)
}

/// 2 to an exponent from -1022 to 1023.
pub(crate) const fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent) as u64) << 52)
}

/// The power of two that brings a number to the exponent `to`, or as near as one can.
pub(crate) fn scale_to(to: i32, x: f64) -> f64 {
    let exponent = (x.to_bits() >> 52) as i32 - 1023;
    power_of_two((to - exponent).clamp(-1022, 1023))
}

/// Positive where `d` lies inside the circle through the triangle `a`, `b`, `c` that turns left, 0 on it; its sign exact.
#[inline(always)]
pub fn in_circle(a: &Point<2>, b: &Point<2>, c: &Point<2>, d: &Point<2>) -> f64 {
    let inside = robust::incircle(coord(a), coord(b), coord(c), coord(d));
    if inside.abs() > VANISHING && inside.is_finite() { inside } else { in_circle_scaled([a, b, c, d]) }
}

/// Determinants under this may be what is left of products that vanished.
const VANISHING: f64 = 1e-290;

/// [`in_circle`] where products may have vanished or overflowed: with the largest coordinate near 2^200.
#[cold]
fn in_circle_scaled(corners: [&Point<2>; 4]) -> f64 {
    const MIDDLE: i32 = 200;
    let most = corners.into_iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
    let factor = scale_to(MIDDLE, most);
    let [a, b, c, d] = corners.map(|p| coord(&p.map(|x| x * factor)));
    robust::incircle(a, b, c, d)
}

/// Whether the last of four points on one circle counts as inside that of the others, which turn left: as if the lifting of
/// the one with the lowest name were raised a little.
pub fn encloses_by_name([a, b, c, d]: [&Point<2>; 4], names: [u32; 4]) -> bool {
    // raising a corner lifts the plane at d where d's barycentric coordinate for it is positive
    match (0..4).min_by_key(|&k| names[k]) {
        Some(0) => orient(b, c, d) > 0.0,
        Some(1) => orient(c, a, d) > 0.0,
        Some(2) => orient(a, b, d) > 0.0,
        _ => false,
    }
}

#[inline(always)]
fn coord(p: &Point<2>) -> robust::Coord<f64> {
    robust::Coord { x: p[0], y: p[1] }
}
