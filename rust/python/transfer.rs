//! Bindings of `transfer`.

use super::arrays::{GivenCells, narrowed, rows};
use super::run::run;
use crate::error::Error;
use crate::point::NONE;
use crate::transfer::prolongation::Finer;
use crate::transfer::rows::{Rows, RowsRef};
use crate::transfer::{blocks, clusters, cycle, galerkin, loose, overlap, prolongation, slow};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArray};
use pyo3::prelude::*;

/// `indptr`, `indices` and `data` of a matrix by rows.
type Matrix<'py> = (Bound<'py, PyArray1<i32>>, Bound<'py, PyArray1<i32>>, Bound<'py, PyArray1<f64>>);
type Indices<'py> = Bound<'py, PyArray1<i64>>;

fn matrix(py: Python<'_>, rows: Rows) -> Matrix<'_> {
    (rows.indptr.into_pyarray(py), rows.indices.into_pyarray(py), rows.data.into_pyarray(py))
}

/// Finer node of each coarse node, -1 for none.
fn injected(injection: &PyReadonlyArray1<'_, i64>, coarse: usize) -> Result<Vec<u32>, Error> {
    let given = super::arrays::values("injection", injection, coarse)?;
    Ok(given.iter().map(|&i| u32::try_from(i).unwrap_or(NONE)).collect())
}

/// Interpolation from a coarse mesh to the nodes of a finer one, as a matrix by rows; the nodes that lie outside of the
/// coarse mesh and their distances; the nodes of parts that the coarse mesh has not.
#[pyfunction(name = "prolongation")]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
fn py_prolongation<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    cells: Bound<'py, PyUntypedArray>,
    boundary: PyReadonlyArray2<'py, i64>,
    coarse_points: PyReadonlyArray2<'py, f64>,
    coarse_cells: Bound<'py, PyUntypedArray>,
    injection: PyReadonlyArray1<'py, i64>,
    threads: Option<usize>,
) -> PyResult<(Matrix<'py>, Indices<'py>, Bound<'py, PyArray1<f64>>, Indices<'py>)> {
    let (points, coarse_points) = (rows("points", &points)?, rows("coarse_points", &coarse_points)?);
    let (cells, coarse_cells) = (GivenCells::new(&cells)?, GivenCells::new(&coarse_cells)?);
    let (cells, coarse_cells) = (cells.rows()?, coarse_cells.rows()?);
    let boundary = narrowed("boundary", &boundary, points.len())?;
    let injection = injected(&injection, coarse_points.len())?;
    let (made, outside, lost) = run(py, threads, None, |_| {
        let (fine, coarse) = (cells.narrowed(points.len())?, coarse_cells.narrowed(coarse_points.len())?);
        let finer = Finer { points, cells: &fine, boundary: &boundary };
        let (coarse, finer) = prolongation::prepared(finer, coarse_points, &coarse, &injection)?;
        let located = prolongation::locate(finer, &coarse)?;
        let (made, outside) = prolongation::weights(points, &coarse, &located.places)?;
        Ok((made, outside, located.lost))
    })?;
    let index = |nodes: Vec<u32>| nodes.into_iter().map(i64::from).collect::<Vec<_>>().into_pyarray(py);
    let (nodes, distances): (Vec<u32>, Vec<f64>) = outside.into_iter().unzip();
    Ok((matrix(py, made), index(nodes), distances.into_pyarray(py), index(lost)))
}

/// Areas that the cells of a finer mesh share with those of a coarse one, as a matrix by rows.
#[pyfunction(name = "overlap")]
#[allow(clippy::too_many_arguments)]
fn py_overlap<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    cells: Bound<'py, PyUntypedArray>,
    boundary: PyReadonlyArray2<'py, i64>,
    coarse_points: PyReadonlyArray2<'py, f64>,
    coarse_cells: Bound<'py, PyUntypedArray>,
    injection: PyReadonlyArray1<'py, i64>,
    threads: Option<usize>,
) -> PyResult<Matrix<'py>> {
    let (points, coarse_points) = (rows("points", &points)?, rows("coarse_points", &coarse_points)?);
    let (cells, coarse_cells) = (GivenCells::new(&cells)?, GivenCells::new(&coarse_cells)?);
    let (cells, coarse_cells) = (cells.rows()?, coarse_cells.rows()?);
    let boundary = narrowed("boundary", &boundary, points.len())?;
    let injection = injected(&injection, coarse_points.len())?;
    let made = run(py, threads, None, |_| {
        let (fine, coarse) = (cells.narrowed(points.len())?, coarse_cells.narrowed(coarse_points.len())?);
        let finer = Finer { points, cells: &fine, boundary: &boundary };
        let (coarse, finer) = prolongation::prepared(finer, coarse_points, &coarse, &injection)?;
        let located = prolongation::locate(finer, &coarse)?;
        overlap::areas(points, &fine, &coarse, &located)
    })?;
    Ok(matrix(py, made))
}

/// A matrix by rows as it comes from SciPy.
#[derive(FromPyObject)]
struct PyRows<'py> {
    indptr: PyReadonlyArray1<'py, i32>,
    indices: PyReadonlyArray1<'py, i32>,
    data: PyReadonlyArray1<'py, f64>,
    shape: (usize, usize),
}

impl PyRows<'_> {
    fn view(&self, name: &str) -> PyResult<RowsRef<'_>> {
        let (indptr, indices, data) = (self.indptr.as_slice()?, self.indices.as_slice()?, self.data.as_slice()?);
        Ok(RowsRef::checked(name, self.shape.1, indptr, indices, data)?)
    }
}

/// `p.T` and `p.T @ a @ p`, by rows, entries under `least` times the roots of both diagonals moved to the diagonal.
#[pyfunction(name = "galerkin")]
fn py_galerkin<'py>(
    py: Python<'py>,
    a: PyRows<'py>,
    p: PyRows<'py>,
    least: f64,
    threads: Option<usize>,
) -> PyResult<(Matrix<'py>, Matrix<'py>)> {
    let (a, p) = (a.view("A")?, p.view("P")?);
    let (restriction, made) = run(py, threads, None, |_| galerkin::products(a, p, least))?;
    Ok((matrix(py, restriction), matrix(py, made)))
}

/// The same, and the unknowns of whose errors relaxation between the coarse ones leaves more than `left`.
#[pyfunction(name = "stage")]
#[allow(clippy::type_complexity)]
fn py_stage<'py>(
    py: Python<'py>,
    a: PyRows<'py>,
    p: PyRows<'py>,
    coarse: PyReadonlyArray1<'py, bool>,
    least: f64,
    left: f64,
    threads: Option<usize>,
) -> PyResult<(Matrix<'py>, Matrix<'py>, Indices<'py>)> {
    let (a, p, coarse) = (a.view("A")?, p.view("P")?, coarse.as_slice()?);
    let ((restriction, made), slow) = run(py, threads, None, |_| {
        // sweeps take one thread, products what is left
        let (slow, made) = rayon::join(|| slow::slow(a, coarse, left), || galerkin::products(a, p, least));
        Ok((made?, slow?))
    })?;
    let slow = slow.into_iter().map(i64::from).collect::<Vec<_>>().into_pyarray(py);
    Ok((matrix(py, restriction), matrix(py, made), slow))
}

/// `a` without the weak blocks between nodes, which `first` names the first of `size` unknowns of.
#[pyfunction(name = "filtered_blocks")]
fn py_filtered_blocks<'py>(
    py: Python<'py>,
    a: PyRows<'py>,
    first: PyReadonlyArray1<'py, i64>,
    points: PyReadonlyArray2<'py, f64>,
    size: usize,
    least: f64,
    threads: Option<usize>,
) -> PyResult<Matrix<'py>> {
    let (a, first, points) = (a.view("A")?, first.as_slice()?, rows("points", &points)?);
    let made = run(py, threads, None, |_| blocks::filtered(a, first, points, size, least))?;
    Ok(matrix(py, made))
}

/// Interpolation by the couplings of `a` for the loose rows of `p`, and the unknowns that are its additional columns.
#[pyfunction(name = "extended")]
fn py_extended<'py>(
    py: Python<'py>,
    a: PyRows<'py>,
    p: PyRows<'py>,
    coarse: PyReadonlyArray1<'py, bool>,
    loose: PyReadonlyArray1<'py, bool>,
    component: PyReadonlyArray1<'py, i64>,
) -> PyResult<(Matrix<'py>, Indices<'py>)> {
    let (a, p, coarse, marks) = (a.view("A")?, p.view("P")?, coarse.as_slice()?, loose.as_slice()?);
    let component = component.as_slice()?;
    let (made, own) = py.detach(|| loose::extended(a, p, coarse, marks, component))?;
    Ok((matrix(py, made), own.into_iter().map(i64::from).collect::<Vec<_>>().into_pyarray(py)))
}

/// Unknowns of whose errors relaxation between the coarse ones leaves more than `left`.
#[pyfunction(name = "slow")]
fn py_slow<'py>(
    py: Python<'py>,
    a: PyRows<'py>,
    coarse: PyReadonlyArray1<'py, bool>,
    left: f64,
) -> PyResult<Indices<'py>> {
    let (a, coarse) = (a.view("A")?, coarse.as_slice()?);
    let made = py.detach(|| slow::slow(a, coarse, left))?;
    Ok(made.into_iter().map(i64::from).collect::<Vec<_>>().into_pyarray(py))
}

/// Unknowns that are relaxed together: the clusters, one after the other, and where each one starts.
#[pyfunction(name = "clusters")]
fn py_clusters<'py>(py: Python<'py>, a: PyRows<'py>, threads: Option<usize>) -> PyResult<(Indices<'py>, Indices<'py>)> {
    let a = a.view("A")?;
    let made = run(py, threads, None, |_| {
        let diagonal: Vec<f64> = (0..a.len()).map(|i| a.entry(i, i)).collect();
        Ok(clusters::clusters(a, &diagonal))
    })?;
    let mut ends = vec![0];
    ends.extend(made.iter().scan(0, |end, cluster| {
        *end += cluster.0.len() as i64;
        Some(*end)
    }));
    let unknowns = made.into_iter().flat_map(|cluster| cluster.0).map(i64::from).collect::<Vec<_>>();
    Ok((unknowns.into_pyarray(py), ends.into_pyarray(py)))
}

type PyStage<'py> = (PyRows<'py>, PyRows<'py>, PyRows<'py>, PyReadonlyArray1<'py, i64>);

/// A V-cycle on matrices that `coarsen.galerkin` made.
#[pyclass(frozen, module = "coarsen._core")]
struct Cycle {
    inner: cycle::Cycle,
}

#[pymethods]
impl Cycle {
    /// `stages` are (A, P, R, slow unknowns), finest first; `coarsest` is the last A.
    #[new]
    #[pyo3(signature = (stages, coarsest, twice=None, threads=None))]
    fn new(
        py: Python<'_>,
        stages: Vec<PyStage<'_>>,
        coarsest: PyRows<'_>,
        twice: Option<usize>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let mut made = Vec::new();
        for (a, p, r, slow) in &stages {
            made.push((a.view("A")?, p.view("P")?, r.view("R")?, slow.as_slice()?));
        }
        let last = coarsest.view("A")?;
        Ok(Self { inner: run(py, threads, None, |_| cycle::Cycle::new(&made, last, twice))? })
    }

    /// The solution, and the norms of the residuals.
    #[allow(clippy::too_many_arguments, clippy::type_complexity)]
    fn solve<'py>(
        &self,
        py: Python<'py>,
        a: PyRows<'py>,
        b: PyReadonlyArray1<'py, f64>,
        tolerance: f64,
        iterations: usize,
        accelerated: bool,
        threads: Option<usize>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>)> {
        let (a, b) = (a.view("A")?, super::arrays::values("b", &b, self.inner.size())?);
        let goal = cycle::Goal { tolerance, iterations, accelerated };
        let (x, norms) = run(py, threads, None, |progress| cycle::solve(&self.inner, a, b, goal, progress))?;
        Ok((x.into_pyarray(py), norms.into_pyarray(py)))
    }

    /// One cycle on a residual.
    fn precondition<'py>(
        &self,
        py: Python<'py>,
        r: PyReadonlyArray1<'py, f64>,
        threads: Option<usize>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let r = super::arrays::values("r", &r, self.inner.size())?;
        Ok(run(py, threads, None, |_| cycle::precondition(&self.inner, r))?.into_pyarray(py))
    }
}

/// Adds this file's functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(py_prolongation, m)?)?;
    m.add_function(wrap_pyfunction!(py_overlap, m)?)?;
    m.add_function(wrap_pyfunction!(py_extended, m)?)?;
    m.add_function(wrap_pyfunction!(py_slow, m)?)?;
    m.add_function(wrap_pyfunction!(py_stage, m)?)?;
    m.add_function(wrap_pyfunction!(py_filtered_blocks, m)?)?;
    m.add_function(wrap_pyfunction!(py_clusters, m)?)?;
    m.add_class::<Cycle>()?;
    m.add_function(wrap_pyfunction!(py_galerkin, m)?)
}
