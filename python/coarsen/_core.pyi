"""The Rust core; `coarsen.reference` offers the same functions in NumPy."""

from typing import Protocol

import numpy as np
import numpy.typing as npt

_Floats = npt.NDArray[np.float64]
_Indices = npt.NDArray[np.int64]

__version__: str

def nearest(points: _Floats, threads: int | None) -> _Floats: ...
def nearest_at(points: _Floats, at: _Floats, threads: int | None) -> _Floats: ...
def coarsened(
    points: _Floats, g: _Floats, factor: float, gradation: float, at: _Floats | None, threads: int | None
) -> _Floats: ...
def threshold(g: _Floats, factor: float) -> _Floats: ...
def quadtree(points: _Floats, at: _Floats | None, threads: int | None) -> _Floats: ...
def conflict_graph(points: _Floats, f: _Floats, beta: float, threads: int | None) -> _Indices: ...
def independent_set(
    points: _Floats, f: _Floats, beta: float, rank: _Indices | None, keep: _Indices | None, threads: int | None
) -> _Indices: ...
def skeleton_independent_set(n_points: int, cells: npt.NDArray[np.int32] | _Indices) -> _Indices: ...

_Narrow = npt.NDArray[np.int32]
_Cells = _Narrow | _Indices
_Rows = tuple[_Narrow, _Narrow, _Floats]  # indptr, indices, data

class _Csr(Protocol):
    indptr: _Narrow
    indices: _Narrow
    data: _Floats
    shape: tuple[int, int]

def prolongation(
    points: _Floats,
    cells: _Cells,
    coarse_points: _Floats,
    coarse_cells: _Cells,
    injection: _Indices,
    threads: int | None,
) -> tuple[_Rows, _Indices, _Floats, _Indices]: ...
def overlap(
    points: _Floats,
    cells: _Cells,
    coarse_points: _Floats,
    coarse_cells: _Cells,
    injection: _Indices,
    threads: int | None,
) -> _Rows: ...
def galerkin(a: _Csr, p: _Csr, threads: int | None) -> tuple[_Rows, _Rows]: ...
