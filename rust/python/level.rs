//! Bindings of the triangulation and of the hierarchy.

use super::run::run;
use crate::domain::FacetRow;
use crate::error::Error;
use crate::hierarchy::{CellRows, Drop, Input, Level, Method, Options, Stopped, hierarchy};
use crate::layers::hierarchy_in_layers;
use crate::level::Rules;
use crate::line::{self, LineLevel};
use crate::point::{NONE, Point};
use crate::progress::Progress;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

/// Rows that one thread widens in one go.
const WIDENED_AT_ONCE: usize = 4096;

/// Adds this file's functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(py_delaunay, m)?)?;
    m.add_function(wrap_pyfunction!(py_line_hierarchy, m)?)?;
    m.add_function(wrap_pyfunction!(py_hierarchy, m)?)
}

fn rows<'a, T: numpy::Element, const K: usize>(
    name: &str,
    array: &'a PyReadonlyArray2<'_, T>,
) -> PyResult<&'a [[T; K]]> {
    let shape = numpy::PyUntypedArrayMethods::shape(&**array).to_vec();
    let wrong = || Error::Argument(format!("'{name}' has shape {shape:?}, expected (n, {K}) in C order"));
    if shape[1] != K || !numpy::PyUntypedArrayMethods::is_c_contiguous(&**array) {
        return Err(wrong().into());
    }
    let (whole, rest) = array.as_slice().map_err(|_| wrong())?.as_chunks::<K>();
    if rest.is_empty() { Ok(whole) } else { Err(wrong().into()) }
}

/// By this thread alone: one that waits for rayon outside of [`run`] waits for ever in a forked process.
fn index_array<'py, const K: usize>(py: Python<'py>, rows: &[[u32; K]]) -> PyResult<Bound<'py, PyArray2<i64>>> {
    array(py, rows.iter().map(widened).collect())
}

fn array<'py, const K: usize>(py: Python<'py>, rows: Vec<[i64; K]>) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let n = rows.len();
    rows.into_flattened().into_pyarray(py).reshape([n, K])
}

/// Rows of indices as NumPy has them, by all threads: within [`run`] only.
fn wide<const K: usize>(rows: &[[u32; K]]) -> Vec<[i64; K]> {
    rows.par_iter().with_min_len(WIDENED_AT_ONCE).map(widened).collect()
}

fn widened<const K: usize>(row: &[u32; K]) -> [i64; K] {
    row.map(|i| if i == NONE { -1 } else { i64::from(i) })
}

#[pyfunction(name = "delaunay")]
fn py_delaunay<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    facets: Option<PyReadonlyArray2<'py, i64>>,
) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let points: &[Point<2>] = rows("points", &points)?;
    let edges: Vec<[u32; 2]> = match &facets {
        Some(facets) => rows::<i64, 2>("facets", facets)?.iter().map(|row| row.map(|i| i as u32)).collect(),
        None => Vec::new(),
    };
    array(py, run(py, None, None, |_| Ok(wide(&crate::triangulation::delaunay(points, &edges)?)))?)
}

/// The options that the core needs, by the names of `coarsen.options.Options`.
#[derive(FromPyObject)]
struct PyOptions {
    factor: f64,
    levels: Option<usize>,
    coarsest: usize,
    nested: bool,
    method: String,
    beta: f64,
    delta: f64,
    gradation: f64,
    min_angle: Option<f64>,
    features: String,
    candidates: String,
    feature_angle: f64,
}

/// Degrees that the guard works for where nothing is said, but with `features="plain"`.
const MIN_ANGLE: f64 = 25.0;

impl PyOptions {
    fn core(&self) -> Options {
        Options {
            factor: self.factor,
            levels: self.levels,
            coarsest: self.coarsest,
            nested: self.nested,
            method: match self.method.as_str() {
                "threshold" => Method::Threshold,
                "mis" => Method::Mis,
                _ => Method::Function,
            },
            rules: Rules {
                beta: self.beta,
                delta: self.delta,
                gradation: self.gradation,
                hold: matches!(self.features.as_str(), "keep" | "auto"),
            },
            keep: matches!(self.features.as_str(), "keep" | "auto"),
            drop: match self.features.as_str() {
                "drop" => Drop::Always,
                "auto" => Drop::Auto,
                _ => Drop::Never,
            },
            min_angle: self
                .min_angle
                .or((self.features != "plain").then_some(MIN_ANGLE))
                .map(f64::to_radians)
                .filter(|&angle| angle > 0.0),
            pool: self.candidates == "pool",
            cos_feature: self.feature_angle.to_radians().cos(),
        }
    }
}

/// Facets of a mesh, as the hierarchy takes them.
#[derive(FromPyObject)]
struct PyFacets<'py> {
    facets: PyReadonlyArray2<'py, i64>,
    /// Tags of left and right cell.
    cell_tags: PyReadonlyArray2<'py, i64>,
    /// Tag of a given facet.
    tags: PyReadonlyArray1<'py, i64>,
    given: PyReadonlyArray1<'py, bool>,
    n_boundary: usize,
    /// Layer of each node, where parts overlap.
    layer: Option<PyReadonlyArray1<'py, u8>>,
}

impl PyFacets<'_> {
    fn rows(&self) -> PyResult<Vec<FacetRow>> {
        let nodes = rows::<i64, 2>("facets", &self.facets)?;
        let cell_tags = rows::<i64, 2>("cell_tags", &self.cell_tags)?;
        let (tags, given) = (self.tags.as_slice()?, self.given.as_slice()?);
        let row = |k: usize| FacetRow {
            nodes: nodes[k].map(|i| i as u32),
            cell_tags: (cell_tags[k][0], (k >= self.n_boundary).then_some(cell_tags[k][1])),
            given: given[k].then_some(tags[k]),
        };
        Ok((0..nodes.len()).map(row).collect())
    }
}

fn index_rows<const K: usize>(array: &PyReadonlyArray2<'_, i64>) -> PyResult<Vec<[u32; K]>> {
    Ok(rows::<i64, K>("cells", array)?.iter().map(|row| row.map(|i| i as u32)).collect())
}

fn name_of(stopped: Stopped) -> &'static str {
    match stopped {
        Stopped::Levels => "levels",
        Stopped::Coarsest => "coarsest",
        Stopped::Stalled => "stalled",
    }
}

type Made<'py> = (Vec<Bound<'py, PyDict>>, &'static str, Bound<'py, PyArray1<f64>>);

#[pyfunction(name = "hierarchy")]
#[allow(clippy::too_many_arguments)]
fn py_hierarchy<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    cells: PyReadonlyArray2<'py, i64>,
    facets: PyFacets<'py>,
    spacing: Option<PyReadonlyArray1<'py, f64>>,
    options: PyOptions,
    progress: Option<Bound<'py, PyAny>>,
    threads: Option<usize>,
) -> PyResult<Made<'py>> {
    let spacing = spacing.as_ref().map(|s| s.as_slice()).transpose()?;
    let layer = facets.layer.as_ref().map(|layer| layer.as_slice()).transpose()?;
    let facets = facets.rows()?;
    let cells = CellRows::Long(rows("cells", &cells)?);
    let input = Input { points: rows("points", &points)?, cells, facets: &facets, spacing };
    let options = options.core();
    let work = |progress: &Progress| match layer {
        Some(layer) => hierarchy_in_layers(&input, layer, options, progress),
        None => hierarchy(&input, options, progress),
    };
    let work = |progress: &Progress| {
        let (levels, stopped, g) = work(progress)?;
        Ok((levels.into_iter().map(Wide::new).collect::<Vec<_>>(), stopped, g))
    };
    let (levels, stopped, g) = run(py, threads, progress.as_ref(), work)?;
    let levels = levels.into_iter().map(|level| wrap(py, level)).collect::<PyResult<_>>()?;
    Ok((levels, name_of(stopped), g.into_pyarray(py)))
}

/// A level with what is large of it, its nodes and cells, as NumPy has them.
struct Wide {
    nodes: Vec<i64>,
    cells: Vec<[i64; 3]>,
    /// The rest.
    level: Level,
}

impl Wide {
    fn new(mut level: Level) -> Self {
        let (nodes, cells) = (std::mem::take(&mut level.mesh.nodes), std::mem::take(&mut level.mesh.cells));
        let nodes = nodes.as_chunks::<1>().0;
        Wide { nodes: wide(nodes).into_flattened(), cells: wide(&cells), level }
    }
}

#[pyfunction(name = "line_hierarchy")]
#[allow(clippy::too_many_arguments)]
fn py_line_hierarchy<'py>(
    py: Python<'py>,
    points: PyReadonlyArray2<'py, f64>,
    cells: PyReadonlyArray2<'py, i64>,
    cell_tags: Option<PyReadonlyArray1<'py, i64>>,
    spacing: Option<PyReadonlyArray1<'py, f64>>,
    options: PyOptions,
    progress: Option<Bound<'py, PyAny>>,
    threads: Option<usize>,
) -> PyResult<Made<'py>> {
    let spacing = spacing.as_ref().map(|s| s.as_slice()).transpose()?;
    let tags = cell_tags.as_ref().map(|s| s.as_slice()).transpose()?;
    let (points, cells) = (rows("points", &points)?, index_rows(&cells)?);
    let options = options.core();
    let work = |progress: &Progress| line::hierarchy(points, &cells, tags, spacing, options, progress);
    let (levels, stopped, g) = run(py, threads, progress.as_ref(), work)?;
    let levels = levels.into_iter().map(|level| wrap_line(py, level)).collect::<PyResult<_>>()?;
    Ok((levels, name_of(stopped), g.into_pyarray(py)))
}

fn wrap_line<'py>(py: Python<'py>, level: LineLevel) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    out.set_item("nodes", level.nodes.iter().map(|&i| i64::from(i)).collect::<Vec<_>>().into_pyarray(py))?;
    out.set_item("cells", index_array(py, &level.cells)?)?;
    out.set_item("cell_tags", level.cell_tags.into_pyarray(py))?;
    out.set_item("factor", level.factor)?;
    out.set_item("spacing", level.spacing.into_pyarray(py))?;
    Ok(out)
}

fn wrap<'py>(py: Python<'py>, Wide { nodes, cells, level }: Wide) -> PyResult<Bound<'py, PyDict>> {
    let out = PyDict::new(py);
    let mesh = level.mesh;
    out.set_item("nodes", nodes.into_pyarray(py))?;
    out.set_item("cells", array(py, cells)?)?;
    out.set_item("cell_tags", mesh.cell_tags.into_pyarray(py))?;
    out.set_item("facets", index_array(py, &mesh.facets)?)?;
    out.set_item("facet_cells", index_array(py, &mesh.facet_cells)?)?;
    out.set_item("given", flags(py, mesh.facet_tags.iter().map(|tag| tag.is_some())))?;
    out.set_item(
        "facet_tags",
        mesh.facet_tags.iter().map(|tag| tag.unwrap_or(0)).collect::<Vec<_>>().into_pyarray(py),
    )?;
    out.set_item("n_boundary", mesh.n_boundary)?;
    out.set_item("factor", level.factor)?;
    out.set_item("spacing", level.spacing.into_pyarray(py))?;
    out.set_item("visits", level.visits)?;
    if let Some(dropped) = level.dropped {
        let what = PyDict::new(py);
        what.set_item("loops_closed", dropped.loops_closed)?;
        what.set_item("area_gained", dropped.area_gained)?;
        what.set_item("area_lost", dropped.area_lost)?;
        out.set_item("dropped", what)?;
    }
    Ok(out)
}

fn flags<'py>(py: Python<'py>, values: impl Iterator<Item = bool>) -> Bound<'py, PyArray1<bool>> {
    values.collect::<Vec<_>>().into_pyarray(py)
}
