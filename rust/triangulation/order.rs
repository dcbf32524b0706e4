//! The spatial order in which points are inserted.

use crate::kdtree::Bounds;
use crate::point::Point;
use rayon::prelude::*;

/// Sorts indices along a Hilbert curve through the bounding box of their points, ties in the order they come in.
pub fn sort_spatially(indices: &mut Vec<u32>, point: impl Fn(u32) -> Point<2> + Sync) {
    let points: Vec<Point<2>> = indices.par_iter().map(|&i| point(i)).collect();
    let bounds = Bounds::of(&points);
    let (lo, extent) = (bounds.lo, bounds.width());
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
pub(super) fn hilbert(x: u32, y: u32) -> u64 {
    let (mut place, mut way) = (0, 0);
    for shift in (0..32).step_by(STEP as usize).rev() {
        let bits = |c: u32| (c >> shift & ((1 << STEP) - 1)) as usize;
        let entry = CURVE[way][bits(x) << STEP | bits(y)];
        place = place << (2 * STEP) | u64::from(entry & ((1 << (2 * STEP)) - 1));
        way = usize::from(entry >> (2 * STEP));
    }
    place
}
