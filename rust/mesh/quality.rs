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

/// Measures counter-clockwise triangles. Percentiles are those of all angles, without interpolation between them.
///
/// Runtime: O(m).
pub fn quality<I: Index>(points: &[Point<2>], cells: &[[I; 3]], percentiles: &[f64]) -> Quality {
    let mut angles = vec![0.0f32; 3 * cells.len()];
    let told: Vec<[f64; 5]> = angles
        .par_chunks_mut(3 * CHUNK)
        .zip(cells.par_chunks(CHUNK))
        .map(|(angles, cells)| {
            let mut told = [f64::INFINITY, 0.0, f64::INFINITY, 0.0, 0.0];
            for (cell, angles) in cells.iter().zip(angles.as_chunks_mut::<3>().0) {
                let p = cell.map(|i| points[i.value() as usize]);
                for k in 0..3 {
                    let (a, b, c) = (p[k], p[(k + 1) % 3], p[(k + 2) % 3]);
                    let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
                    let cross = u[0] * v[1] - u[1] * v[0];
                    let angle = cross.abs().atan2(u[0] * v[0] + u[1] * v[1]).to_degrees();
                    angles[k] = angle as f32;
                    let edge = distance(&a, &b);
                    told[0] = told[0].min(edge);
                    told[1] = told[1].max(edge);
                    told[2] = told[2].min(angle);
                    told[3] = told[3].max(angle);
                    if k == 0 {
                        told[4] += 0.5 * cross;
                    }
                }
            }
            told
        })
        .collect();
    let least = |k: usize| told.iter().map(|told| told[k]).fold(f64::INFINITY, f64::min);
    let most = |k: usize| told.iter().map(|told| told[k]).fold(0.0, f64::max);
    let last = angles.len().saturating_sub(1);
    let mut from = 0;
    let angles_deg = percentiles
        .iter()
        .map(|&percentile| match percentile {
            0.0 => least(2),
            100.0 => most(3),
            // ascending percentiles: each selection leaves what is smaller before it
            _ => {
                let place = ((percentile / 100.0 * last as f64).round() as usize).clamp(from, last);
                let (_, angle, _) = angles[from..].select_nth_unstable_by(place - from, f32::total_cmp);
                let angle = f64::from(*angle);
                from = place;
                angle
            }
        })
        .collect();
    Quality { angles_deg, min_edge: least(0), max_edge: most(1), area: told.iter().map(|told| told[4]).sum() }
}
