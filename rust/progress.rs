//! What a long call says while it works, and how it is stopped.
//!
//! The core writes stage and count here and asks [`Progress::check`] at least every few milliseconds; whoever started the
//! call reads them from another thread, and may ask it to stop.

use crate::error::Error;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

/// The stages of a hierarchy, in the order in which they are first met.
pub const STAGES: [&str; 6] = ["domain", "spacing", "selection", "triangulation", "guard", "transfer"];

/// Shared between the working thread and the one that watches.
#[derive(Debug, Default)]
pub struct Progress {
    stage: AtomicUsize,
    done: AtomicU64,
    total: AtomicU64,
    stop: AtomicBool,
}

impl Progress {
    /// Enters a stage (an index into [`STAGES`]) of `total` steps.
    pub fn enter(&self, stage: usize, total: u64) -> Result<(), Error> {
        self.stage.store(stage, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
        self.check()
    }

    /// Adds to the steps done.
    pub fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    /// Fails with [`Error::Stopped`] once a stop was asked for.
    pub fn check(&self) -> Result<(), Error> {
        if self.stop.load(Ordering::Relaxed) { Err(Error::Stopped) } else { Ok(()) }
    }

    /// Asks the working thread to stop.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Stage, steps done, steps in all; never more done than there are, though a stage may take more than was foreseen.
    pub fn read(&self) -> (&'static str, u64, u64) {
        let stage = self.stage.load(Ordering::Relaxed).min(STAGES.len() - 1);
        let total = self.total.load(Ordering::Relaxed);
        (STAGES[stage], self.done.load(Ordering::Relaxed).min(total), total)
    }
}
