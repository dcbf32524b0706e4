"""Delaunay triangulations of points in the plane, plain or constrained."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from coarsen.arguments import IntArray, index_array, points_array
from coarsen.backend import backend as chosen


def delaunay(points: npt.ArrayLike, facets: npt.ArrayLike | None = None, *, backend: str = "rust") -> IntArray:
    """Return the cells of the Delaunay triangulation of the convex hull of points.

    Parameters
    ----------
    points : array_like, shape (n, 2)
        Finite coordinates, all different.
    facets : array_like, shape (s, 2), optional
        Edges that the triangulation must have: the constrained Delaunay triangulation. They may meet at points only.
    backend : {"rust", "numpy"}
        Which of the twins works. Where four points or more lie on one circle they may cut the hull of these
        differently.

    Returns
    -------
    ndarray, shape (m, 3), int64
        Nodes of every cell, counter-clockwise. None at all where all points lie on one line.

    Raises
    ------
    ValueError
        If points repeat, a facet crosses another or passes through a point, or an argument has another shape or dtype,
        isn't finite or is out of its range.

    Notes
    -----
    O(n log n) for bounded density.

    Examples
    --------
    >>> import coarsen
    >>> sorted(map(sorted, coarsen.delaunay([[0, 0], [2, 0], [3, 1], [0, 1]]).tolist()))
    [[0, 1, 3], [1, 2, 3]]
    >>> sorted(map(sorted, coarsen.delaunay([[0, 0], [2, 0], [3, 1], [0, 1]], facets=[[0, 2]]).tolist()))
    [[0, 1, 2], [0, 2, 3]]
    """
    points = points_array(points, dim=2)
    edges = None if facets is None else _facets_array(facets, len(points))
    cells: IntArray = chosen(backend).delaunay(points, edges)
    return cells


def _facets_array(facets: npt.ArrayLike, n: int) -> IntArray:
    try:
        array = np.asarray(facets)
    except ValueError as error:
        raise ValueError(f"'facets' is no array of shape (s, 2): {error}") from None
    if array.size == 0:
        return np.empty((0, 2), dtype=np.int64)
    if array.ndim != 2 or array.shape[1] != 2:
        raise ValueError(f"'facets' has shape {array.shape}, expected (s, 2)")
    return np.ascontiguousarray(index_array("facets", array.ravel(), n).reshape(-1, 2))
