//! Bindings of `selection`.

use super::arrays::{by_dimension, cells as cell_rows, index_array, index_rows, indices, rows, values};
use super::run::run;
use crate::error::Error;
use crate::kdtree::KdTree;
use crate::selection;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray};
use pyo3::prelude::*;

type Indices<'py> = Bound<'py, PyArray1<i64>>;

#[pyfunction]
fn conflict_graph<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    f: PyReadonlyArray1<'py, f64>,
    beta: f64,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyArray2<i64>>> {
    by_dimension!(points, D => {
        let points = rows::<f64, D>("points", &points)?;
        let f = values("f", &f, points.len())?;
        let graph = |progress: &_| selection::conflict_graph(&KdTree::new(points), f, beta, progress);
        index_rows(py, &run(py, threads, None, graph)?)
    })
}

#[pyfunction]
fn independent_set<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    f: PyReadonlyArray1<'py, f64>,
    beta: f64,
    rank: Option<PyReadonlyArray1<'py, i64>>,
    keep: Option<PyReadonlyArray1<'py, i64>>,
    threads: Option<usize>,
) -> PyResult<Indices<'py>> {
    by_dimension!(points, D => {
        let points = rows::<f64, D>("points", &points)?;
        let f = values("f", &f, points.len())?;
        let rank = rank.as_ref().map(|rank| values("rank", rank, points.len())).transpose()?;
        let keep = keep.as_ref().map(|keep| indices("keep", keep, points.len())).transpose()?.unwrap_or_default();
        let set = |progress: &_| selection::independent_set(&KdTree::new(points), f, beta, rank, &keep, progress);
        Ok(index_array(py, &run(py, threads, None, set)?))
    })
}

#[pyfunction(name = "skeleton_independent_set")]
fn skeleton<'py>(py: Python<'py>, n_points: usize, cells: &Bound<'py, PyUntypedArray>) -> PyResult<Indices<'py>> {
    let set = match numpy::PyUntypedArrayMethods::shape(cells).get(1) {
        Some(2) => selection::skeleton_independent_set(n_points, &cell_rows::<2>(cells, n_points)?),
        Some(3) => selection::skeleton_independent_set(n_points, &cell_rows::<3>(cells, n_points)?),
        Some(4) => selection::skeleton_independent_set(n_points, &cell_rows::<4>(cells, n_points)?),
        _ => return Err(Error::Argument("'cells' is no (m, d + 1) array with d from 1 to 3".into()).into()),
    };
    Ok(index_array(py, &set))
}

/// Adds this file's functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(conflict_graph, m)?)?;
    m.add_function(wrap_pyfunction!(independent_set, m)?)?;
    m.add_function(wrap_pyfunction!(skeleton, m)?)
}
