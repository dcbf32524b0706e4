//! Values written to places from all threads.

use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// The values after those of some places, no two of them equal, were written.
pub fn scattered(values: Vec<u32>, written: impl ParallelIterator<Item = (usize, u32)>) -> Vec<u32> {
    // both ways the same memory
    let open: Vec<AtomicU32> = values.into_iter().map(AtomicU32::new).collect();
    written.for_each(|(place, value)| open[place].store(value, Ordering::Relaxed));
    open.into_iter().map(AtomicU32::into_inner).collect()
}
