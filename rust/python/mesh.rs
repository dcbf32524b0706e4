//! Bindings of `mesh`.

use super::arrays::rows;
use super::run::run;
use crate::error::Error;
use crate::mesh::{self, Facet, Topology, line, quality};
use crate::point::NONE;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Adds this file's functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(check_mesh, m)?)?;
    m.add_function(wrap_pyfunction!(cell_quality, m)?)
}

/// Cells as users give them.
#[derive(FromPyObject)]
enum Cells<'py> {
    Narrow(PyReadonlyArray2<'py, i32>),
    Wide(PyReadonlyArray2<'py, i64>),
}

#[pyfunction]
fn check_mesh<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    cells: Cells<'py>,
    facets: Option<PyReadonlyArray2<'py, i64>>,
    cell_tags: Option<PyReadonlyArray1<'py, i64>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyDict>> {
    if points.shape()[1] == 1 {
        check_line(py, &points, &cells, facets.as_ref(), cell_tags.as_ref(), threads)
    } else {
        check_plane(py, &points, &cells, facets.as_ref(), cell_tags.as_ref(), threads)
    }
}

fn check_plane<'py>(
    py: Python<'py>,
    points: &PyReadonlyArray2<'py, f64>,
    cells: &Cells<'py>,
    facets: Option<&PyReadonlyArray2<'py, i64>>,
    cell_tags: Option<&PyReadonlyArray1<'py, i64>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyDict>> {
    let points = rows("points", points)?;
    let facets = facets.map(|facets| rows("facets", facets)).transpose()?;
    let tags = cell_tags.map(|tags| tags.as_slice()).transpose()?;
    let topology = match cells {
        Cells::Narrow(cells) => {
            let cells = rows::<i32, 3>("cells", cells)?;
            run(py, threads, None, |_| mesh::check(points, cells, facets, tags).map_err(Error::Mesh))?
        }
        Cells::Wide(cells) => {
            let cells = rows::<i64, 3>("cells", cells)?;
            run(py, threads, None, |_| mesh::check(points, cells, facets, tags).map_err(Error::Mesh))?
        }
    };
    wrap(py, topology)
}

fn check_line<'py>(
    py: Python<'py>,
    points: &PyReadonlyArray2<'py, f64>,
    cells: &Cells<'py>,
    facets: Option<&PyReadonlyArray2<'py, i64>>,
    cell_tags: Option<&PyReadonlyArray1<'py, i64>>,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyDict>> {
    let points = rows("points", points)?;
    let facets = facets.map(|facets| rows("facets", facets)).transpose()?;
    let tags = cell_tags.map(|tags| tags.as_slice()).transpose()?;
    let topology = match cells {
        Cells::Narrow(cells) => {
            let cells = rows::<i32, 2>("cells", cells)?;
            run(py, threads, None, |_| line::check(points, cells, facets, tags).map_err(Error::Mesh))?
        }
        Cells::Wide(cells) => {
            let cells = rows::<i64, 2>("cells", cells)?;
            run(py, threads, None, |_| line::check(points, cells, facets, tags).map_err(Error::Mesh))?
        }
    };
    wrap(py, topology)
}

fn index(i: u32) -> i64 {
    if i == NONE { -1 } else { i64::from(i) }
}

fn index_array<'py, const D: usize, const K: usize>(
    py: Python<'py>,
    facets: &[Facet<D>],
    row: impl Fn(&Facet<D>) -> [u32; K],
) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let flat: Vec<i64> = facets.iter().flat_map(|facet| row(facet).map(index)).collect();
    flat.into_pyarray(py).reshape([facets.len(), K])
}

fn indices<'py>(py: Python<'py>, indices: impl Iterator<Item = u32>) -> Bound<'py, PyArray1<i64>> {
    indices.map(index).collect::<Vec<_>>().into_pyarray(py)
}

fn wrap<const D: usize>(py: Python<'_>, topology: Topology<D>) -> PyResult<Bound<'_, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("flip", indices(py, topology.flip.into_iter()))?;
    out.set_item("facets", index_array(py, &topology.facets, |facet| facet.nodes)?)?;
    out.set_item("facet_cells", index_array(py, &topology.facets, |facet| facet.cells)?)?;
    out.set_item("facet_given", indices(py, topology.facets.iter().map(|facet| facet.given)))?;
    out.set_item("n_boundary", topology.n_boundary)?;
    out.set_item("layer", topology.layer.map(|layer| indices(py, layer.into_iter())))?;
    Ok(out)
}

type Measured<'py> = (Bound<'py, PyArray1<f64>>, f64, f64, f64);

#[pyfunction]
fn cell_quality<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    cells: Cells<'py>,
    percentiles: PyReadonlyArray1<'py, f64>,
) -> PyResult<Measured<'py>> {
    let (points, percentiles) = (rows("points", &points)?, percentiles.as_slice()?);
    let found = match &cells {
        Cells::Narrow(cells) => {
            let cells = rows::<i32, 3>("cells", cells)?;
            run(py, None, None, |_| Ok(quality::quality(points, cells, percentiles)))?
        }
        Cells::Wide(cells) => {
            let cells = rows::<i64, 3>("cells", cells)?;
            run(py, None, None, |_| Ok(quality::quality(points, cells, percentiles)))?
        }
    };
    Ok((found.angles_deg.into_pyarray(py), found.min_edge, found.max_edge, found.area))
}
