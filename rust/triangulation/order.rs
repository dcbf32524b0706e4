//! The spatial order in which points are inserted.

use crate::kdtree::Bounds;
use crate::point::Point;
use rayon::prelude::*;

/// Sorts indices along a Hilbert curve through the bounding box of their points, ties in the order they come in.
pub fn sort_spatially(indices: &mut Vec<u32>, point: impl Fn(u32) -> Point<2> + Sync) {
    let points: Vec<Point<2>> = indices.par_iter().map(|&i| point(i)).collect();
    let Bounds { lo, .. } = Bounds::of(&points);
    let extent = Bounds::of(&points).width();
    let scale = if extent > 0.0 { f64::from(u32::MAX) / extent } else { 0.0 };
    // place along the curve, its last bits given over to the number: one word sorts several times faster than two
    let bits = usize::BITS - indices.len().leading_zeros();
    let mut keys: Vec<u64> = points
        .par_iter()
        .enumerate()
        .map(|(k, p)| {
            let [x, y] = [0, 1].map(|axis| ((p[axis] - lo[axis]) * scale) as u32);
            hilbert(x, y) >> bits << bits | k as u64
        })
        .collect();
    keys.par_sort_unstable();
    *indices = keys.par_iter().map(|key| indices[(key & ((1 << bits) - 1)) as usize]).collect();
}

/// Bits of either coordinate that [`CURVE`] takes at once.
const STEP: u32 = 4;

/// For every way the curve may lie in a cell of the lattice (bit 0: coordinates exchanged, bit 1: both mirrored) and the
/// next bits of both coordinates: the place of that cell along the curve, and, in the bits above, the way the curve lies there.
static CURVE: [[u16; 1 << (2 * STEP)]; 4] = curve();

const fn curve() -> [[u16; 1 << (2 * STEP)]; 4] {
    let mut table = [[0; 1 << (2 * STEP)]; 4];
    let mut way = 0;
    while way < 4 {
        let mut cell = 0;
        while cell < 1 << (2 * STEP) {
            let (mut place, mut is_exchanged, mut is_mirrored) = (0, way & 1, way >> 1);
            let mut bit = STEP;
            while bit > 0 {
                bit -= 1;
                let (x, y) = ((cell >> (bit + STEP) & 1) ^ is_mirrored, (cell >> bit & 1) ^ is_mirrored);
                let (x, y) = if is_exchanged == 1 { (y, x) } else { (x, y) };
                place = place << 2 | ((3 * x) ^ y);
                is_mirrored ^= x & (y ^ 1);
                is_exchanged ^= y ^ 1;
            }
            table[way][cell] = (place | (is_exchanged | is_mirrored << 1) << (2 * STEP)) as u16;
            cell += 1;
        }
        way += 1;
    }
    table
}

/// Place of a cell of a 2^32 by 2^32 lattice along the Hilbert curve.
fn hilbert(x: u32, y: u32) -> u64 {
    let (mut place, mut way) = (0, 0);
    for shift in (0..32).step_by(STEP as usize).rev() {
        let bits = |c: u32| (c >> shift & ((1 << STEP) - 1)) as usize;
        let entry = CURVE[way][bits(x) << STEP | bits(y)];
        place = place << (2 * STEP) | u64::from(entry & ((1 << (2 * STEP)) - 1));
        way = usize::from(entry >> (2 * STEP));
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The curve bit by bit.
    fn plain(mut x: u32, mut y: u32) -> u64 {
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
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 32) as u32
        };
        for _ in 0..100_000 {
            let (x, y) = (next(), next());
            assert_eq!(hilbert(x, y), plain(x, y), "{x} {y}");
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
}
