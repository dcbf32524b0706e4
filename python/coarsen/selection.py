"""Selection of points (Miller, Talmor, Teng 1997, Definition 3.5): conflict graph and maximal independent sets.

Two points conflict where ``0 < distance < (f[i] + f[j]) / beta``, strictly and exactly so in floats. Coincident points
count as one and don't conflict with each other: the two sides of a slit join or stay out together.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from coarsen.arguments import IntArray, index_array, number, points_array, rank_array, spacing_array, thread_count
from coarsen.backend import backend as chosen
from coarsen.triangulation import delaunay

__all__ = ["HasCells", "conflict_graph", "delaunay", "independent_set", "skeleton_independent_set"]


class HasCells(Protocol):
    """Anything with nodes and cells: a :class:`coarsen.Mesh`, a level's mesh."""

    @property
    def n_points(self) -> int:
        """How many nodes there are."""

    @property
    def cells(self) -> npt.NDArray[np.integer]:
        """Nodes of every cell, (m, d + 1)."""


def _beta(beta: float) -> float:
    return number("beta", beta, "a finite number over 1", over=1.0)


def conflict_graph(
    points: npt.ArrayLike, f: npt.ArrayLike, beta: float, *, backend: str = "rust", threads: int | None = None
) -> IntArray:
    """Return the edges of the conflict graph (Definition 3.5).

    Parameters
    ----------
    points : array_like, shape (n, d), d from 1 to 3
        Finite coordinates.
    f : array_like, shape (n,)
        A spacing at the points, at least 0; it need not be Lipschitz.
    beta : float
        β > 1.
    backend : {"rust", "numpy"}
        Which of the twins works; the edges are the same.
    threads : int, optional
        At least 1; None takes all cores. The edges don't depend on it.

    Returns
    -------
    ndarray, shape (e, 2), int64
        Every edge once, i < j, sorted.

    Raises
    ------
    ValueError
        If an argument has another shape or dtype, isn't finite or is out of its range.

    Notes
    -----
    O(n log n + e log e) for spacings that vary like the distances of the points.

    Examples
    --------
    >>> import coarsen.selection
    >>> coarsen.selection.conflict_graph([[0.0], [1.0], [3.0]], [1.0, 1.5, 2.5], 2.0)
    array([[0, 1]])
    """
    points = points_array(points)
    f = spacing_array("f", f, len(points))
    edges: IntArray = chosen(backend).conflict_graph(points, f, _beta(beta), thread_count(threads))
    return edges


def independent_set(
    points: npt.ArrayLike,
    f: npt.ArrayLike,
    beta: float,
    *,
    rank: npt.ArrayLike | None = None,
    keep: npt.ArrayLike | None = None,
    backend: str = "rust",
    threads: int | None = None,
) -> IntArray:
    """Return the greedy maximal independent set of the conflict graph.

    The points of `keep` are in from the start. Then every point, by (rank, index), joins unless it conflicts with one
    that is in.

    Parameters
    ----------
    points : array_like, shape (n, d), d from 1 to 3
        Finite coordinates.
    f : array_like, shape (n,)
        A spacing at the points, at least 0; it need not be Lipschitz.
    beta : float
        β > 1.
    rank : array_like, shape (n,), optional
        Real numbers, lower ones first; all the same if not given.
    keep : array_like, shape (k,), optional
        Indices that stay whatever conflicts they have with each other.
    backend : {"rust", "numpy"}
        Which of the twins works; the set is the same.
    threads : int, optional
        At least 1; None takes all cores. The set doesn't depend on it.

    Returns
    -------
    ndarray, shape (s,), int64
        Indices in ascending order, `keep` among them.

    Raises
    ------
    ValueError
        If an argument has another shape or dtype, isn't finite or is out of its range.

    Notes
    -----
    O(n log n + conflicts met); the graph is never built.

    Examples
    --------
    >>> import coarsen.selection
    >>> points, f = [[0.0], [1.0], [2.0], [3.0]], [1.5, 1.5, 1.5, 1.5]
    >>> coarsen.selection.independent_set(points, f, 2.0)
    array([0, 2])
    >>> coarsen.selection.independent_set(points, f, 2.0, rank=[1, 0, 0, 0])
    array([1, 3])
    >>> coarsen.selection.independent_set(points, f, 2.0, keep=[1, 2])
    array([1, 2])
    """
    points = points_array(points)
    f = spacing_array("f", f, len(points))
    ranks = None if rank is None else rank_array("rank", rank, len(points))
    kept = None if keep is None else index_array("keep", keep, len(points))
    chosen_set: IntArray = chosen(backend).independent_set(points, f, _beta(beta), ranks, kept, thread_count(threads))
    return chosen_set


def skeleton_independent_set(mesh: HasCells, *, backend: str = "rust") -> IntArray:
    """Return the greedy maximal independent set of the edges of a mesh, by index: the baseline of Table 2.

    Parameters
    ----------
    mesh : coarsen.Mesh or anything with `n_points` and `cells`
        Two nodes are adjacent where a cell holds both.
    backend : {"rust", "numpy"}
        Which of the twins works; the set is the same.

    Returns
    -------
    ndarray, shape (s,), int64
        Indices in ascending order.

    Raises
    ------
    ValueError
        If the cells are no (m, d + 1) array of node indices.

    Notes
    -----
    O(n + m).

    Examples
    --------
    >>> import types, numpy, coarsen.selection
    >>> strip = types.SimpleNamespace(n_points=5, cells=numpy.array([[0, 1, 2], [1, 3, 2], [2, 3, 4]]))
    >>> coarsen.selection.skeleton_independent_set(strip)
    array([0, 3])
    """
    n_points = int(mesh.n_points)
    cells = np.asarray(mesh.cells)
    if cells.ndim != 2 or not 2 <= cells.shape[1] <= 4 or cells.dtype.kind not in "iu":
        raise ValueError(f"'mesh.cells' has shape {cells.shape} and dtype {cells.dtype}, expected (m, d + 1) indices")
    if cells.dtype not in (np.dtype(np.int32), np.dtype(np.int64)):
        cells = cells.astype(np.int64)
    chosen_set: IntArray = chosen(backend).skeleton_independent_set(n_points, np.ascontiguousarray(cells))
    return chosen_set
