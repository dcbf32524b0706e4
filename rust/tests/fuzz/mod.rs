//! Random domains for the hierarchy, and what must hold of every level.
//!
//! [`draw`] makes a legal mesh and options from a seed, [`oracle::check`] judges the levels by their definition alone (it
//! shares no code with the package but `robust`'s predicates), [`shrink::shrink`] makes a failing mesh small.

#![allow(dead_code, reason = "each test file uses its own part")]

pub mod base;
pub mod carve;
pub mod oracle;
pub mod random;
pub mod shrink;
pub mod topology;

use _core::hierarchy::{CellRows, Drop, Input, Method, Options, hierarchy};
use _core::level::Rules;
use _core::progress::Progress;
use random::Random;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use topology::facet_rows;

/// No hierarchy of a few hundred nodes takes longer, unless it has many levels.
const SLOW: Duration = Duration::from_secs(1);

/// What a level of it may take then.
const SLOW_LEVEL: Duration = Duration::from_millis(100);

/// A triangle mesh as a user gives it: cells counter-clockwise, given facets with tags.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Plane {
    /// Nodes; those of equal coordinates are the copies of a slit.
    pub points: Vec<[f64; 2]>,
    /// Cells, counter-clockwise.
    pub cells: Vec<[u32; 3]>,
    /// A tag for each cell.
    pub tags: Vec<i64>,
    /// Given facets and their tags.
    pub given: Vec<([u32; 2], i64)>,
}

/// The mesh and the options of a seed; `None` where the draw is no legal mesh.
pub fn draw(seed: u64) -> Option<(Plane, Options)> {
    let mut random = Random::new(seed);
    let mut plane = base::base(&mut random);
    carve::carve(&mut plane, &mut random);
    let options = options(&mut random);
    topology::is_legal(&plane).then_some((plane, options))
}

fn options(random: &mut Random) -> Options {
    let (keep, drop) = random.pick(&[
        (true, Drop::Never),
        (true, Drop::Never),
        (true, Drop::Never),
        (false, Drop::Never),
        (false, Drop::Always),
        (true, Drop::Auto),
    ]);
    let angle: f64 = random.pick(&[60.0, 60.0, 30.0, 5.0, 100.0, 179.0]);
    Options {
        factor: random.pick(&[1.3, 1.5, 2.0, 2.0, 2.0, 3.0, 4.0]),
        levels: random.pick(&[None, None, None, Some(2), Some(7)]),
        coarsest: random.pick(&[1, 4, 20, 100]),
        nested: random.chance(0.75),
        method: random.pick(&[Method::Function, Method::Function, Method::Function, Method::Threshold, Method::Mis]),
        rules: Rules {
            beta: random.pick(&[2.0, 2.0, 2.0, 1.2, 3.0, 5.0]),
            delta: random.pick(&[0.5, 0.5, 0.0, 0.1, 0.75, 1.5]),
            gradation: random.pick(&[0.5, 0.5, 1.0, 0.25, 0.05]),
            hold: keep,
        },
        keep,
        drop,
        min_angle: random.pick(&[None, None, Some(25f64.to_radians())]),
        pool: random.chance(0.5),
        cos_feature: angle.to_radians().cos(),
    }
}

/// What this thread has worked so far; where the system does not tell, what time has passed.
fn busy() -> Duration {
    static BEGUN: LazyLock<Instant> = LazyLock::new(Instant::now);
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = text.and_then(|text| text.split(' ').next()?.parse().ok());
    nanoseconds.map_or_else(|| BEGUN.elapsed(), Duration::from_nanos)
}

/// What went wrong, in the terms of the rule that broke; `None` where nothing did.
pub fn failure(plane: &Plane, options: Options) -> Option<String> {
    let (progress, facets) = (Progress::default(), facet_rows(plane));
    let input = Input { points: &plane.points, facets: &facets, spacing: None, cells: CellRows::Short(&plane.cells) };
    let begun = busy();
    let longest = |levels: usize| SLOW.max(SLOW_LEVEL * levels as u32);
    let made = catch_unwind(AssertUnwindSafe(|| hierarchy(&input, options, &progress)));
    let took = busy().saturating_sub(begun);
    match made {
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            Some(format!("panic: {}", text.or(panic.downcast_ref::<&str>().copied()).unwrap_or("?")))
        }
        Ok(Err(error)) => Some(format!("error: {error}")),
        Ok(Ok((levels, ..))) if took > longest(levels.len()) => {
            Some(format!("slow: {took:?} for {} levels", levels.len()))
        }
        Ok(Ok((levels, ..))) => catch_unwind(AssertUnwindSafe(|| oracle::check(plane, options, &levels)))
            .unwrap_or_else(|_| Some("oracle: panic".into())),
    }
}
