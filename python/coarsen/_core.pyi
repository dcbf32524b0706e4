"""The Rust core; `coarsen.reference` offers the same functions in NumPy."""

from collections.abc import Callable
from typing import Any, Protocol, final

import numpy as np
import numpy.typing as npt

from coarsen.multilevel import FacetArrays
from coarsen.options import Options

_Floats = npt.NDArray[np.float64]
_Indices = npt.NDArray[np.int64]
_Cells = npt.NDArray[np.int32] | _Indices
_Report = Callable[[str, int, int], None]
# levels, why it stopped, spacing of the finest level
_Made = tuple[list[dict[str, Any]], str, _Floats]

__all__ = [
    "Cycle",
    "__version__",
    "cell_quality",
    "check_mesh",
    "clusters",
    "coarsened",
    "conflict_graph",
    "delaunay",
    "extended",
    "filtered_blocks",
    "galerkin",
    "hierarchy",
    "independent_set",
    "line_hierarchy",
    "nearest",
    "nearest_at",
    "overlap",
    "prolongation",
    "quadtree",
    "skeleton_independent_set",
    "slow",
    "stage",
    "threshold",
]

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
def skeleton_independent_set(n_points: int, cells: _Cells) -> _Indices: ...
def delaunay(points: _Floats, facets: _Indices | None) -> _Indices: ...
def check_mesh(
    points: _Floats, cells: _Cells, facets: _Indices | None, cell_tags: _Indices | None, threads: int | None
) -> dict[str, Any]: ...
def cell_quality(points: _Floats, cells: _Cells, percentiles: _Floats) -> tuple[_Floats, float, float, float]: ...
def hierarchy(
    points: _Floats,
    cells: _Indices,
    facets: FacetArrays,
    spacing: _Floats | None,
    options: Options,
    progress: _Report | None,
    threads: int | None,
) -> _Made: ...
def line_hierarchy(
    points: _Floats,
    cells: _Indices,
    cell_tags: _Indices | None,
    spacing: _Floats | None,
    options: Options,
    progress: _Report | None,
    threads: int | None,
) -> _Made: ...

_Narrow = npt.NDArray[np.int32]
_Rows = tuple[_Narrow, _Narrow, _Floats]  # indptr, indices, data

class _Csr(Protocol):
    indptr: _Narrow
    indices: _Narrow
    data: _Floats
    shape: tuple[int, int]

def prolongation(
    points: _Floats,
    cells: _Cells,
    boundary: _Indices,
    coarse_points: _Floats,
    coarse_cells: _Cells,
    injection: _Indices,
    threads: int | None,
) -> tuple[_Rows, _Indices, _Floats, _Indices]: ...
def overlap(
    points: _Floats,
    cells: _Cells,
    boundary: _Indices,
    coarse_points: _Floats,
    coarse_cells: _Cells,
    injection: _Indices,
    threads: int | None,
) -> _Rows: ...
def galerkin(a: _Csr, p: _Csr, least: float, threads: int | None) -> tuple[_Rows, _Rows]: ...
def filtered_blocks(
    a: _Csr, first: _Indices, points: _Floats, size: int, least: float, threads: int | None
) -> _Rows: ...
def extended(
    a: _Csr,
    p: _Csr,
    coarse: npt.NDArray[np.bool_],
    loose: npt.NDArray[np.bool_],
    component: npt.NDArray[np.int64],
) -> tuple[_Rows, npt.NDArray[np.int64]]: ...
def stage(
    a: _Csr, p: _Csr, coarse: npt.NDArray[np.bool_], least: float, left: float, threads: int | None
) -> tuple[_Rows, _Rows, npt.NDArray[np.int64]]: ...
def slow(a: _Csr, coarse: npt.NDArray[np.bool_], left: float) -> npt.NDArray[np.int64]: ...
def clusters(a: _Csr, threads: int | None) -> tuple[_Indices, _Indices]: ...

@final
class Cycle:
    def __new__(
        cls,
        stages: list[tuple[_Csr, _Csr, _Csr, npt.NDArray[np.int64]]],
        coarsest: _Csr,
        twice: int | None = None,
        threads: int | None = None,
    ) -> Cycle: ...
    def solve(
        self, a: _Csr, b: _Floats, tolerance: float, iterations: int, accelerated: bool, threads: int | None
    ) -> tuple[_Floats, _Floats]: ...
    def precondition(self, r: _Floats, threads: int | None) -> _Floats: ...
