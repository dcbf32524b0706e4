//! Shape and size of triangles (Definitions 2.1 and 2.2): angles, edges, area.

use super::Index;
use crate::point::{Point, distance};
use rayon::prelude::*;

/// What [`quality`] measures.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// The angles at the percentiles asked for, in degrees.
    pub angles_deg: Vec<f64>,
    /// Shortest edge.
    pub min_edge: f64,
    /// Longest edge.
    pub max_edge: f64,
    /// Sum of the areas.
    pub area: f64,
}

const CHUNK: usize = 1 << 14;

/// Percentiles come from a histogram with this many bins a degree.
const BINS_A_DEGREE: f64 = 256.0;

#[derive(Clone, Copy)]
struct Extremes {
    edges: [f64; 2],
    angles: [f64; 2],
    area: f64,
}

/// Measures counter-clockwise triangles. Percentiles of all angles are right to 1/512 degree, the extremes exact.
///
/// Runtime: O(m).
pub fn quality<I: Index>(points: &[Point<2>], cells: &[[I; 3]], percentiles: &[f64]) -> Quality {
    let none = || (vec![0u64; (180.0 * BINS_A_DEGREE) as usize + 1], Vec::new());
    let (bins, mut told) = cells
        .par_chunks(CHUNK)
        .enumerate()
        .fold(none, |(mut bins, mut told), (chunk, cells)| {
            told.push((chunk, measure(points, cells, &mut bins)));
            (bins, told)
        })
        .reduce(none, |(mut bins, mut told), (more, others)| {
            bins.iter_mut().zip(more).for_each(|(bin, more)| *bin += more);
            told.extend(others);
            (bins, told)
        });
    // sums in the order of the cells, whatever the threads did
    told.sort_unstable_by_key(|&(chunk, _)| chunk);
    let told: Vec<Extremes> = told.into_iter().map(|(_, extremes)| extremes).collect();
    let least = |of: fn(&Extremes) -> f64| told.iter().map(of).fold(f64::INFINITY, f64::min);
    let most = |of: fn(&Extremes) -> f64| told.iter().map(of).fold(0.0, f64::max);
    let (min_angle, max_angle) = (least(|e| e.angles[0]), most(|e| e.angles[1]));
    let last = (3 * cells.len()).saturating_sub(1) as f64;
    let angle = |percentile: f64| {
        let wanted = (percentile / 100.0 * last).round() as u64;
        let mut below = 0;
        let bin = bins.iter().position(|&count| {
            below += count;
            below > wanted
        });
        ((bin.unwrap_or(0) as f64 + 0.5) / BINS_A_DEGREE).clamp(min_angle, max_angle)
    };
    let exact = |percentile: f64| match percentile {
        0.0 => min_angle,
        100.0 => max_angle,
        _ => angle(percentile),
    };
    Quality {
        angles_deg: percentiles.iter().map(|&percentile| exact(percentile)).collect(),
        min_edge: least(|e| e.edges[0]),
        max_edge: most(|e| e.edges[1]),
        area: told.iter().map(|e| e.area).sum(),
    }
}

fn measure<I: Index>(points: &[Point<2>], cells: &[[I; 3]], bins: &mut [u64]) -> Extremes {
    let none = [f64::INFINITY, 0.0];
    let mut told = Extremes { edges: none, angles: none, area: 0.0 };
    let note = |extremes: &mut [f64; 2], x: f64| *extremes = [extremes[0].min(x), extremes[1].max(x)];
    for cell in cells {
        let p = cell.map(|i| points[i.value() as usize]);
        for k in 0..3 {
            let (a, b, c) = (p[k], p[(k + 1) % 3], p[(k + 2) % 3]);
            let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
            let cross = u[0] * v[1] - u[1] * v[0];
            let angle = cross.abs().atan2(u[0] * v[0] + u[1] * v[1]).to_degrees();
            note(&mut told.angles, angle);
            note(&mut told.edges, distance(&a, &b));
            bins[(angle * BINS_A_DEGREE) as usize] += 1;
            if k == 0 {
                told.area += 0.5 * cross;
            }
        }
    }
    told
}
