//! Work on a pool of threads while the interpreter stays free: progress, Ctrl-C, number of threads.
//!
//! The pools are kept between calls, for starting threads costs more than a small call. They are the package's own and
//! not rayon's global one, since a forked process (multiprocessing's default on Linux before Python 3.14) inherits a pool
//! without its threads: the process is part of the key.

use crate::error::Error;
use crate::progress::Progress;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

const WAKE: Duration = Duration::from_millis(25);

/// More threads than this are never started, whatever is asked for; results don't depend on it.
const MOST_THREADS: usize = 512;

/// Pools kept beside the last one used.
const POOLS_KEPT: usize = 3;

type Key = (u32, Option<usize>);
static POOLS: Mutex<Vec<(Key, Arc<ThreadPool>)>> = Mutex::new(Vec::new());

/// Runs `work` in a pool of `threads` (None: all cores) with the interpreter lock released. The calling thread wakes
/// every 25 ms to let signals through and to call `report(stage, done, total)`; an exception there stops the work.
/// A panic of `work` becomes [`Error::Internal`].
pub fn run<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    report: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Progress) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let pool = pool(threads)?;
    let progress = Progress::default();
    let report = report.map(|r| r.clone().unbind());
    py.detach(|| {
        let (sender, receiver) = channel();
        let shared = &progress;
        pool.in_place_scope(|scope| {
            scope.spawn(move |_| {
                let result = catch_unwind(AssertUnwindSafe(|| work(shared)));
                // nobody listens any more once a signal or `report` has raised
                let _ = sender.send(result.unwrap_or_else(|panic| Err(Error::Internal(said(&*panic)))));
            });
            loop {
                match receiver.recv_timeout(WAKE) {
                    Ok(result) => return result.map_err(PyErr::from),
                    Err(RecvTimeoutError::Disconnected) => {
                        return Err(Error::Internal("the working thread gave no answer".into()).into());
                    }
                    Err(RecvTimeoutError::Timeout) => {
                        if let Err(error) = Python::attach(|py| listen(py, report.as_ref(), shared)) {
                            shared.stop();
                            return Err(error);
                        }
                    }
                }
            }
        })
    })
}

/// Lets signals through and tells how far the work is.
fn listen(py: Python<'_>, report: Option<&Py<PyAny>>, progress: &Progress) -> PyResult<()> {
    py.check_signals()?;
    if let Some(report) = report {
        report.call1(py, progress.read())?;
    }
    Ok(())
}

/// The pool of this process for that many threads.
fn pool(threads: Option<usize>) -> Result<Arc<ThreadPool>, Error> {
    let key = (std::process::id(), threads.map(|count| count.min(MOST_THREADS)));
    if threads == Some(0) {
        return Err(Error::Argument("'threads' is 0, expected None or at least 1".into()));
    }
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(place) = pools.iter().position(|(known, _)| *known == key) {
        let known = pools.remove(place);
        pools.insert(0, known.clone());
        return Ok(known.1);
    }
    let builder = ThreadPoolBuilder::new().thread_name(|i| format!("coarsen-{i}")).num_threads(key.1.unwrap_or(0));
    let built = builder.build().map_err(|error| Error::Internal(format!("no pool of threads: {error}")))?;
    // a pool of a parent process is without threads and must not be taken apart here
    let (own, inherited) = pools.drain(..).partition(|((process, _), _)| *process == key.0);
    std::mem::forget::<Vec<(Key, Arc<ThreadPool>)>>(inherited);
    *pools = own;
    pools.truncate(POOLS_KEPT);
    let built = Arc::new(built);
    pools.insert(0, (key, Arc::clone(&built)));
    Ok(built)
}

/// The message of a panic.
fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a panic without a message".into())
}
