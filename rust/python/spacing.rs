//! Bindings of `spacing` and `quadtree`.

use super::arrays::{by_dimension, rows, values};
use super::run::run;
use crate::kdtree::KdTree;
use crate::{quadtree, spacing};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

type Floats<'py> = Bound<'py, PyArray1<f64>>;

#[pyfunction]
fn nearest<'py>(py: Python<'py>, points: PyReadonlyArray2<'py, f64>, threads: Option<usize>) -> PyResult<Floats<'py>> {
    by_dimension!(points, D => {
        let points = rows::<f64, D>("points", &points)?;
        Ok(run(py, threads, None, |progress| spacing::nearest(&KdTree::new(points), progress))?.into_pyarray(py))
    })
}

#[pyfunction]
fn nearest_at<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    at: PyReadonlyArray2<'py, f64>,
    threads: Option<usize>,
) -> PyResult<Floats<'py>> {
    by_dimension!(points, D => {
        let (points, at) = (rows::<f64, D>("points", &points)?, rows::<f64, D>("at", &at)?);
        Ok(run(py, threads, None, |progress| spacing::nearest_at(&KdTree::new(points), at, progress))?.into_pyarray(py))
    })
}

#[pyfunction]
fn coarsened<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    g: PyReadonlyArray1<'py, f64>,
    factor: f64,
    gradation: f64,
    at: Option<PyReadonlyArray2<'py, f64>>,
    threads: Option<usize>,
) -> PyResult<Floats<'py>> {
    by_dimension!(points, D => {
        let points = rows::<f64, D>("points", &points)?;
        let g = values("g", &g, points.len())?;
        let at = at.as_ref().map(|at| rows::<f64, D>("at", at)).transpose()?;
        let f = run(py, threads, None, |progress| spacing::coarsened(points, g, factor, gradation, at, progress))?;
        Ok(f.into_pyarray(py))
    })
}

#[pyfunction]
fn threshold<'py>(py: Python<'py>, g: PyReadonlyArray1<'py, f64>, factor: f64) -> PyResult<Floats<'py>> {
    let g = values("g", &g, g.as_array().len())?;
    Ok(py.detach(|| spacing::threshold(g, factor)).into_pyarray(py))
}

#[pyfunction(name = "quadtree")]
fn quadtree_spacing<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    at: Option<PyReadonlyArray2<'py, f64>>,
    threads: Option<usize>,
) -> PyResult<Floats<'py>> {
    by_dimension!(points, D => {
        let points = rows::<f64, D>("points", &points)?;
        let at = at.as_ref().map(|at| rows::<f64, D>("at", at)).transpose()?;
        let spacing = run(py, threads, None, |progress| quadtree::spacing(points, at.unwrap_or(points), progress))?;
        Ok(spacing.into_pyarray(py))
    })
}

/// Adds this file's functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(nearest, m)?)?;
    m.add_function(wrap_pyfunction!(nearest_at, m)?)?;
    m.add_function(wrap_pyfunction!(coarsened, m)?)?;
    m.add_function(wrap_pyfunction!(threshold, m)?)?;
    m.add_function(wrap_pyfunction!(quadtree_spacing, m)?)
}
