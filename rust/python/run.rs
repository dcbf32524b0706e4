//! Work on another thread while the interpreter stays free: progress, Ctrl-C, number of threads.

use crate::error::Error;
use crate::progress::Progress;
use pyo3::prelude::*;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

const WAKE: Duration = Duration::from_millis(25);

/// Runs `work` in a pool of `threads` (None: all cores) with the interpreter lock released. The calling thread wakes
/// every 25 ms to let signals through and to call `report(stage, done, total)`.
pub fn run<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    report: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Progress) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let progress = Progress::default();
    let report = report.map(|r| r.clone().unbind());
    py.detach(|| {
        std::thread::scope(|scope| {
            let (sender, receiver) = channel();
            let shared = &progress;
            scope.spawn(move || {
                let result = match threads {
                    None => work(shared),
                    Some(count) => match rayon::ThreadPoolBuilder::new().num_threads(count).build() {
                        Ok(pool) => pool.install(|| work(shared)),
                        Err(error) => Err(Error::Internal(error.to_string())),
                    },
                };
                // the receiver outlives this thread unless it was stopped by an exception of `report`
                let _ = sender.send(result);
            });
            loop {
                match receiver.recv_timeout(WAKE) {
                    Ok(result) => return result.map_err(PyErr::from),
                    Err(RecvTimeoutError::Disconnected) => {
                        return Err(Error::Internal("the working thread panicked".into()).into());
                    }
                    Err(RecvTimeoutError::Timeout) => {
                        let heard = Python::attach(|py| {
                            py.check_signals()?;
                            if let Some(report) = &report {
                                report.call1(py, progress.read())?;
                            }
                            Ok(())
                        });
                        if let Err(error) = heard {
                            progress.stop();
                            return Err(error);
                        }
                    }
                }
            }
        })
    })
}
