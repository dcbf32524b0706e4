//! The border to Python: check, detach, one core call, wrap. Nothing in the core imports it.

mod arrays;
mod level;
mod mesh;
mod run;
mod selection;
mod spacing;
mod transfer;

use crate::error::Error;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        let text = error.to_string();
        match error {
            Error::Mesh(broken) => Python::attach(|py| {
                let (rule, array, index, more) = broken.place();
                let class = py.import("coarsen.errors").and_then(|module| module.getattr("MeshError"));
                match class.and_then(|class| class.call1((text, rule, array, index, more))) {
                    Ok(exception) => PyErr::from_value(exception),
                    Err(error) => error,
                }
            }),
            Error::Argument(_) => PyValueError::new_err(text),
            Error::Stopped => pyo3::exceptions::PyKeyboardInterrupt::new_err(text),
            Error::Internal(_) => PyRuntimeError::new_err(text),
        }
    }
}

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    mesh::register(m)?;
    spacing::register(m)?;
    selection::register(m)?;
    level::register(m)?;
    transfer::register(m)
}
