//! Makes a failing mesh small: as few levels, cells, tags and given facets as still fail by the same rule.

use super::carve::{compact, keep_cells};
use super::{Plane, failure, topology};
use _core::hierarchy::Options;

/// The rule that a failure names (its text up to the second colon, without numbers).
pub fn rule(failure: &str) -> String {
    let rule = failure.split(": ").filter(|part| !part.starts_with("level ")).take(1).collect::<String>();
    rule.chars().filter(|c| !c.is_ascii_digit()).collect()
}

/// A small mesh and the options under which it fails like the given one.
pub fn shrink(mut plane: Plane, mut options: Options) -> (Plane, Options) {
    let Some(first) = failure(&plane, options) else { return (plane, options) };
    let wanted = rule(&first);
    let fails = |plane: &Plane, options: Options| {
        topology::is_legal(plane) && failure(plane, options).is_some_and(|text| rule(&text) == wanted)
    };
    for simpler in [
        Options { levels: Some(1), ..options },
        Options { nested: false, ..options },
        Options { pool: false, ..options },
        Options { min_angle: None, ..options },
    ] {
        let mixed = Options {
            levels: if simpler.levels == Some(1) { Some(1) } else { options.levels },
            nested: simpler.nested && options.nested,
            pool: simpler.pool && options.pool,
            min_angle: simpler.min_angle.and(options.min_angle),
            ..options
        };
        if fails(&plane, mixed) {
            options = mixed;
        }
    }
    loop {
        let before = (plane.cells.len(), plane.given.len());
        let mut size = plane.cells.len().div_ceil(2);
        while size > 0 {
            let mut at = 0;
            while at < plane.cells.len() && plane.cells.len() > 1 {
                let wanted: Vec<bool> = (0..plane.cells.len()).map(|t| t < at || t >= at + size).collect();
                let mut smaller = plane.clone();
                keep_cells(&mut smaller, &wanted);
                if !smaller.cells.is_empty() && fails(&smaller, options) {
                    plane = smaller;
                } else {
                    at += size;
                }
            }
            size /= 2;
        }
        let mut k = 0;
        while k < plane.given.len() {
            let mut smaller = plane.clone();
            smaller.given.remove(k);
            if fails(&smaller, options) {
                plane = smaller;
            } else {
                k += 1;
            }
        }
        for tag in plane.tags.clone() {
            let mut smaller = plane.clone();
            smaller.tags.iter_mut().filter(|t| **t == tag).for_each(|t| *t = 0);
            if smaller != plane && fails(&smaller, options) {
                plane = smaller;
            }
        }
        if (plane.cells.len(), plane.given.len()) == before {
            break;
        }
    }
    compact(&mut plane);
    // round coordinates show the case better than the draw's
    for digits in [0, 1, 2, 3, 4, 6] {
        let mut smaller = plane.clone();
        let power = 10f64.powi(digits);
        smaller.points.iter_mut().flatten().for_each(|x| *x = (*x * power).round() / power);
        if fails(&smaller, options) {
            return (smaller, options);
        }
    }
    (plane, options)
}
