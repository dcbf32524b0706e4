"""Spacing functions (Miller, Talmor, Teng 1997, Definitions 3.2 to 3.4 and section 6.2), in one to three dimensions.

A spacing function tells how far apart points should be at every place. All of them here are computed exactly: both
backends return the minimum of the same rounded formula, bit for bit, whatever the number of threads. Distances are
``sqrt(dx*dx + dy*dy)`` in this order, without fused operations.
"""

from __future__ import annotations

from collections.abc import Sized

import numpy.typing as npt

from coarsen.arguments import FloatArray, factor_over_1, number, points_array, spacing_array, thread_count
from coarsen.backend import backend as chosen


def nearest(
    points: npt.ArrayLike, *, at: npt.ArrayLike | None = None, backend: str = "rust", threads: int | None = None
) -> FloatArray:
    """Return NN_P, the distance to the nearest other point (Definition 3.2).

    Coincident points count as one: only distances over 0 are taken. Anywhere else it is the radius of the smallest
    closed ball about x that holds two points at different locations.

    Parameters
    ----------
    points : array_like, shape (n, d), d from 1 to 3
        Finite coordinates.
    at : array_like, shape (k, d), optional
        Where to ask, anywhere; the points themselves if not given.
    backend : {"rust", "numpy"}
        Which of the twins works; the values are the same bit for bit.
    threads : int, optional
        At least 1; None takes all cores. The values don't depend on it.

    Returns
    -------
    ndarray, shape (n,) or (k,), float64
        In the unit of the coordinates; infinite where there is only one location.

    Raises
    ------
    ValueError
        If an argument has another shape or dtype, isn't finite or is out of its range.

    Notes
    -----
    O(n log n) for bounded density.

    Examples
    --------
    >>> import coarsen.spacing
    >>> coarsen.spacing.nearest([[0.0, 0.0], [3.0, 4.0], [3.0, 6.0]])
    array([5., 2., 2.])
    >>> coarsen.spacing.nearest([[0.0], [1.0], [1.0], [4.0]], at=[[0.25]])
    array([0.75])
    """
    points = points_array(points)
    core, threads = chosen(backend), thread_count(threads)
    spacing: FloatArray
    if at is None:
        spacing = core.nearest(points, threads)
    else:
        spacing = core.nearest_at(points, points_array(at, "at", points.shape[1]), threads)
    return spacing


def coarsened(
    points: npt.ArrayLike,
    g: npt.ArrayLike,
    factor: float,
    *,
    gradation: float = 1.0,
    at: npt.ArrayLike | None = None,
    backend: str = "rust",
    threads: int | None = None,
) -> FloatArray:
    r"""Return the C-coarsening of a spacing g (Definition 3.3).

    .. math:: f(x) = \min_{p \in P} \; ( C \, g(p) + L \, \|p - x\| ),

    the largest L-Lipschitz function at or under C g at the points.

    Parameters
    ----------
    points : array_like, shape (n, d), d from 1 to 3
        P, at least one point, finite coordinates.
    g : array_like, shape (n,)
        The spacing at the points, at least 0.
    factor : float
        C > 1.
    gradation : float
        The slope L in (0, 1]; 1 is the paper's.
    at : array_like, shape (k, d), optional
        Where to ask, anywhere; the points themselves if not given.
    backend : {"rust", "numpy"}
        Which of the twins works; the values are the same bit for bit.
    threads : int, optional
        At least 1; None takes all cores. The values don't depend on it.

    Returns
    -------
    ndarray, shape (n,) or (k,), float64
        In the unit of the coordinates: the least of ``factor*g[p] + gradation*distance``.

    Raises
    ------
    ValueError
        If an argument has another shape or dtype, isn't finite or is out of its range.

    Notes
    -----
    O(n log n) for spacings that vary like the distances of the points; exact for any.

    Examples
    --------
    >>> import coarsen.spacing
    >>> coarsen.spacing.coarsened([[0.0], [1.0], [3.0]], [1.0, 1.0, 2.0], 4.0)
    array([4., 4., 6.])
    """
    points = points_array(points)
    g = spacing_array("g", g, len(points))
    factor = factor_over_1(factor)
    gradation = number("gradation", gradation, "a number in (0, 1]", over=0.0, upto=1.0)
    at = None if at is None else points_array(at, "at", points.shape[1])
    spacing: FloatArray = chosen(backend).coarsened(points, g, factor, gradation, at, thread_count(threads))
    return spacing


def threshold(g: npt.ArrayLike, factor: float, *, backend: str = "rust") -> FloatArray:
    """Return the threshold coarsening ``max(g, C min g)`` of a spacing (Definition 3.4).

    Parameters
    ----------
    g : array_like, shape (n,)
        The spacing at the points, at least 0.
    factor : float
        C > 1.
    backend : {"rust", "numpy"}
        Which of the twins works; the values are the same bit for bit.

    Returns
    -------
    ndarray, shape (n,), float64
        In the unit of g.

    Raises
    ------
    ValueError
        If an argument has another shape or dtype or is out of its range.

    Examples
    --------
    >>> import coarsen.spacing
    >>> coarsen.spacing.threshold([1.0, 1.5, 3.0], 2.0)
    array([2., 2., 3.])
    """
    g = spacing_array("g", g, len(g) if isinstance(g, Sized) else 0)
    spacing: FloatArray = chosen(backend).threshold(g, factor_over_1(factor))
    return spacing


def quadtree(
    points: npt.ArrayLike, *, at: npt.ArrayLike | None = None, backend: str = "rust", threads: int | None = None
) -> FloatArray:
    """Return the spacing of a balanced quadtree of the points (section 6.2); an octree for d = 3.

    A cell is split while it holds a point and the 3^d cells of its level around it hold another; then leaves that
    share a face, an edge or a corner are made to differ by at most one level. The spacing at x is 15/16 of the side
    of the leaf that holds x: constant within a leaf, and never over :func:`nearest` at the points.

    Parameters
    ----------
    points : array_like, shape (n, d), d from 1 to 3
        Finite coordinates. Points nearer to each other than 2^-42 of the extent count as one.
    at : array_like, shape (k, d), optional
        Where to ask; the points themselves if not given. Outside the root the nearest leaf answers.
    backend : {"rust", "numpy"}
        Which of the twins works; the values are the same bit for bit.
    threads : int, optional
        At least 1; None takes all cores. The values don't depend on it.

    Returns
    -------
    ndarray, shape (n,) or (k,), float64
        In the unit of the coordinates; infinite where there is only one location.

    Raises
    ------
    ValueError
        If an argument has another shape or dtype, isn't finite or is out of its range.

    Notes
    -----
    The root is the cube at the least coordinates ``lo`` whose side S is the least power of two over the extent. The
    cell of x on a grid of 2^42 cells an axis is ``floor((x - lo) / S * 2**42)`` clipped to the root; the rest is
    integer arithmetic. O(n + leaves) times the depth.

    References
    ----------
    Bern, Eppstein, Gilbert, "Provably good mesh generation", J. Comput. System Sci. 48 (1994).

    Examples
    --------
    >>> import coarsen.spacing
    >>> coarsen.spacing.quadtree([[0.0], [1.0], [8.0]])
    array([0.46875, 0.46875, 3.75   ])
    """
    points = points_array(points)
    at = None if at is None else points_array(at, "at", points.shape[1])
    spacing: FloatArray = chosen(backend).quadtree(points, at, thread_count(threads))
    return spacing
