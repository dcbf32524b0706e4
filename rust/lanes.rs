//! Loops in the form that compilers turn into vector instructions: whole lanes, no branch within, no count that
//! changes from one leaf to the next.

use crate::point::Point;
use std::ops::Range;

/// How many values go together.
pub const LANES: usize = 4;

/// A range widened to whole lanes, into what follows or, at the end of `n`, into what goes before; 0 to n where there are
/// fewer than one lane.
#[inline(always)]
pub fn whole(range: &Range<usize>, n: usize) -> Range<usize> {
    let count = range.len().next_multiple_of(LANES);
    let start = range.start.min(n.saturating_sub(count));
    start..n.min(start + count)
}

/// The least of each of the numbers that some points and their values make; infinite where there are none.
#[inline(always)]
pub fn least_of<const D: usize, const V: usize, const K: usize>(
    points: &[Point<D>],
    values: [&[f64]; V],
    made: impl Fn(&Point<D>, [f64; V]) -> [f64; K],
) -> [f64; K] {
    let (chunks, rest) = points.as_chunks::<LANES>();
    let mut least = [[f64::INFINITY; LANES]; K];
    for (c, points) in chunks.iter().enumerate() {
        let values = values.map(|values| &values.as_chunks::<LANES>().0[c]);
        for k in 0..LANES {
            let made = made(&points[k], values.map(|values| values[k]));
            for (least, value) in least.iter_mut().zip(made) {
                least[k] = if value < least[k] { value } else { least[k] };
            }
        }
    }
    let first = points.len() - rest.len();
    for (k, point) in rest.iter().enumerate() {
        let made = made(point, values.map(|values| values[first + k]));
        for (least, value) in least.iter_mut().zip(made) {
            least[k] = if value < least[k] { value } else { least[k] };
        }
    }
    least.map(|mut least| {
        let mut width = LANES / 2;
        while width > 0 {
            for k in 0..width {
                let other = least[k + width];
                least[k] = if other < least[k] { other } else { least[k] };
            }
            width /= 2;
        }
        least[0]
    })
}

/// The greatest value; minus infinity where there is none.
#[inline(always)]
pub fn greatest(values: &[f64]) -> f64 {
    values.iter().fold(f64::NEG_INFINITY, |a, &b| if b > a { b } else { a })
}

/// The points, up to 32 of them and as bits, for which something holds of them and their values.
#[inline(always)]
pub fn bits<const D: usize>(points: &[Point<D>], values: &[f64], holds: impl Fn(&Point<D>, f64) -> bool) -> u32 {
    let bit = |k: usize, point, value| u32::from(holds(point, value)) << k;
    let (chunks, rest) = points.as_chunks::<LANES>();
    let mut bits = 0;
    for (c, (points, values)) in chunks.iter().zip(values.as_chunks::<LANES>().0).enumerate() {
        for k in 0..LANES {
            bits |= bit(c * LANES + k, &points[k], values[k]);
        }
    }
    let first = points.len() - rest.len();
    rest.iter().enumerate().fold(bits, |bits, (k, point)| bits | bit(first + k, point, values[first + k]))
}

/// The places of the ones among some bits, ascending.
#[inline(always)]
pub fn ones(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let place = (bits != 0).then(|| bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        place
    })
}

#[cfg(test)]
mod tests {
    use super::{LANES, bits, greatest, least_of, ones, whole};

    #[test]
    fn ranges_are_widened_to_whole_lanes() {
        for n in 0..3 * LANES {
            for start in 0..=n {
                for end in start..=n {
                    let wide = whole(&(start..end), n);
                    assert!(wide.end <= n && (start == end || wide.start <= start && end <= wide.end));
                    assert!(wide.len().is_multiple_of(LANES) || wide == (0..n));
                    assert!(wide.len() < end - start + LANES);
                }
            }
        }
    }

    #[test]
    fn lanes_tell_what_one_by_one_does() {
        for n in 0..=32 {
            let points: Vec<[f64; 1]> = (0..n).map(|k| [f64::from(k * 7 % 5)]).collect();
            let values: Vec<f64> = (0..n).map(|k| f64::from(k * 11 % 13)).collect();
            let sum = |k: usize| points[k][0] + values[k];
            let all = || (0..points.len()).map(sum);
            let least = [all().fold(f64::INFINITY, f64::min), all().map(|sum| -sum).fold(f64::INFINITY, f64::min)];
            assert_eq!(least_of(&points, [&values], |p, [v]| [p[0] + v, -(p[0] + v)]), least);
            assert_eq!(greatest(&values), values.iter().copied().fold(f64::NEG_INFINITY, f64::max));
            let one_by_one = (0..points.len()).fold(0, |bits, k| bits | u32::from(sum(k) > 6.0) << k);
            assert_eq!(bits(&points, &values, |p, v| p[0] + v > 6.0), one_by_one);
            assert!(ones(one_by_one).eq((0..points.len()).filter(|&k| sum(k) > 6.0)));
        }
    }

    #[test]
    fn what_is_no_number_is_left_out() {
        let points = [[0.0]; 7];
        assert_eq!(least_of(&points, [&[f64::NAN; 7]], |_, [v]| [v]), [f64::INFINITY]);
        assert_eq!(bits(&points, &[f64::NAN; 7], |_, v| v < 1.0), 0);
    }
}
