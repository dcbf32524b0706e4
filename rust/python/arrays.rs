//! NumPy arrays as slices of the core, without a copy, and indices back.
//!
//! Dtype, order and finiteness are seen to in Python (where they are converted or refused with words); what is checked
//! here is what the core relies on, so that no call from anywhere can make it panic.

use crate::error::Error;
use numpy::{Element, IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Runs `$body` with the constant `$d` set to the dimension of `$points`, an (n, d) array with d from 1 to 3.
macro_rules! by_dimension {
    ($points:expr, $d:ident => $body:expr) => {
        match numpy::PyUntypedArrayMethods::shape(&*$points)[1] {
            1 => {
                const $d: usize = 1;
                $body
            }
            2 => {
                const $d: usize = 2;
                $body
            }
            3 => {
                const $d: usize = 3;
                $body
            }
            d => Err(crate::error::Error::Argument(format!("'points' has dimension {d}, expected 1, 2 or 3")).into()),
        }
    };
}
pub(super) use by_dimension;

fn is_plain(array: &Bound<'_, PyUntypedArray>, name: &str) -> Result<(), Error> {
    if array.is_c_contiguous() { Ok(()) } else { Err(Error::Argument(format!("'{name}' is not C-contiguous"))) }
}

/// The rows of an (n, K) array; fewer than 2³² − 1 of them, since the core's indices are `u32`.
pub fn rows<'a, T: Element, const K: usize>(
    name: &str,
    array: &'a PyReadonlyArray2<'_, T>,
) -> Result<&'a [[T; K]], Error> {
    is_plain(array.as_untyped(), name)?;
    let (n, columns) = (array.shape()[0], array.shape()[1]);
    if columns != K {
        return Err(Error::Argument(format!("'{name}' has shape ({n}, {columns}), expected (n, {K})")));
    }
    if n >= u32::MAX as usize {
        return Err(Error::Argument(format!("'{name}' has {n} rows, expected fewer than 2**32 - 1")));
    }
    let flat = array.as_slice().map_err(|error| Error::Argument(format!("'{name}': {error}")))?;
    Ok(flat.as_chunks::<K>().0)
}

/// An (n,) array.
pub fn values<'a, T: Element>(name: &str, array: &'a PyReadonlyArray1<'_, T>, n: usize) -> Result<&'a [T], Error> {
    is_plain(array.as_untyped(), name)?;
    if array.len() != n {
        return Err(Error::Argument(format!("'{name}' has shape ({},), expected ({n},)", array.len())));
    }
    array.as_slice().map_err(|error| Error::Argument(format!("'{name}': {error}")))
}

/// Indices under `n`.
pub fn indices(name: &str, array: &PyReadonlyArray1<'_, i64>, n: usize) -> Result<Vec<u32>, Error> {
    let narrow = |(k, &i): (usize, &i64)| match u32::try_from(i) {
        Ok(index) if (index as usize) < n => Ok(index),
        _ => Err(Error::Argument(format!("'{name}[{k}]' is {i}, expected an index from 0 to {}", n as i64 - 1))),
    };
    array.as_array().iter().enumerate().map(narrow).collect()
}

/// The cells of a mesh of `n` nodes, from int32 or int64.
pub fn cells<const K: usize>(array: &Bound<'_, PyUntypedArray>, n: usize) -> PyResult<Vec<[u32; K]>> {
    Ok(match GivenCells::new(array)? {
        GivenCells::Int32(array) => narrowed("cells", &array, n)?,
        GivenCells::Int64(array) => narrowed("cells", &array, n)?,
    })
}

/// Rows of nodes of a mesh of `n`.
pub fn narrowed<T: Element + Copy + Into<i64>, const K: usize>(
    name: &str,
    array: &PyReadonlyArray2<'_, T>,
    n: usize,
) -> Result<Vec<[u32; K]>, Error> {
    let mut narrow = Vec::with_capacity(array.shape()[0]);
    for (r, row) in rows::<T, K>(name, array)?.iter().enumerate() {
        let row = row.map(Into::into);
        if let Some(node) = outside(&row, n) {
            return Err(no_node(name, r, node, n));
        }
        narrow.push(row.map(|i| i as u32));
    }
    Ok(narrow)
}

/// The first node of a row that a mesh of `n` does not have.
fn outside(row: &[i64], n: usize) -> Option<i64> {
    row.iter().copied().find(|&i| i < 0 || i >= n as i64)
}

fn no_node(name: &str, r: usize, node: i64, n: usize) -> Error {
    Error::Argument(format!("'{name}[{r}]' names node {node}, expected an index from 0 to {}", n as i64 - 1))
}

/// Cells as NumPy has them, read where they are.
pub enum GivenCells<'py> {
    Int32(PyReadonlyArray2<'py, i32>),
    Int64(PyReadonlyArray2<'py, i64>),
}

impl<'py> GivenCells<'py> {
    /// Of an array of int32 or int64.
    pub fn new(array: &Bound<'py, PyUntypedArray>) -> Result<Self, Error> {
        if let Ok(array) = array.cast::<PyArray2<i32>>() {
            return Ok(Self::Int32(array.readonly()));
        }
        match array.cast::<PyArray2<i64>>() {
            Ok(array) => Ok(Self::Int64(array.readonly())),
            Err(_) => Err(Error::Argument("'cells' is not an (m, d + 1) array of int32 or int64".into())),
        }
    }

    /// Their rows, which other threads may read.
    pub fn rows<const K: usize>(&self) -> Result<WideRows<'_, K>, Error> {
        Ok(match self {
            Self::Int32(array) => WideRows::Int32(rows("cells", array)?),
            Self::Int64(array) => WideRows::Int64(rows("cells", array)?),
        })
    }
}

/// Rows of nodes as NumPy has them.
#[derive(Clone, Copy)]
pub enum WideRows<'a, const K: usize> {
    Int32(&'a [[i32; K]]),
    Int64(&'a [[i64; K]]),
}

impl<const K: usize> WideRows<'_, K> {
    /// As the core has them, in a mesh of `n` nodes; on all threads of the pool that it is called in.
    pub fn narrowed(self, n: usize) -> Result<Vec<[u32; K]>, Error> {
        match self {
            Self::Int32(rows) => narrowed_rows(rows, n),
            Self::Int64(rows) => narrowed_rows(rows, n),
        }
    }
}

fn narrowed_rows<T: Copy + Into<i64> + Sync, const K: usize>(
    rows: &[[T; K]],
    n: usize,
) -> Result<Vec<[u32; K]>, Error> {
    let bad = AtomicUsize::new(usize::MAX);
    let narrow = |(r, row): (usize, &[T; K])| {
        let row = row.map(Into::into);
        if outside(&row, n).is_some() {
            bad.fetch_min(r, Ordering::Relaxed);
        }
        row.map(|i| i as u32)
    };
    let narrow = rows.par_iter().enumerate().with_min_len(4096).map(narrow).collect();
    let r = bad.into_inner();
    match rows.get(r).and_then(|row| outside(&row.map(Into::into), n)) {
        Some(node) => Err(no_node("cells", r, node, n)),
        None => Ok(narrow),
    }
}

/// The core's indices as an int64 array.
pub fn index_array<'py>(py: Python<'py>, indices: &[u32]) -> Bound<'py, PyArray1<i64>> {
    indices.iter().map(|&i| i64::from(i)).collect::<Vec<_>>().into_pyarray(py)
}

/// Rows of the core's indices as an (n, K) int64 array.
pub fn index_rows<'py, const K: usize>(py: Python<'py>, rows: &[[u32; K]]) -> PyResult<Bound<'py, PyArray2<i64>>> {
    index_array(py, rows.as_flattened()).reshape([rows.len(), K])
}
