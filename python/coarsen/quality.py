"""Shape and size of the cells of a mesh (Definitions 2.1, 2.2 and 4.5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import reduce
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .backend import backend

if TYPE_CHECKING:
    from .mesh import Mesh

PERCENTILES = (0, 1, 5, 10, 25, 50, 75, 90, 95, 99, 100)
"""Percentiles of the angles that a `Quality` holds."""

# Points and weights of a quadrature rule on a triangle, exact up to degree 5 (Radon 1948), in barycentric coordinates.
_NEAR, _FAR = (6 - 15**0.5) / 21, (6 + 15**0.5) / 21
_RULE_POINTS = np.array(
    [[1 / 3] * 3] + [[a if k != j else 1 - 2 * a for k in range(3)] for a in (_NEAR, _FAR) for j in range(3)]
)
_RULE_WEIGHTS = np.array([9 / 40] + [(155 - 15**0.5) / 1200] * 3 + [(155 + 15**0.5) / 1200] * 3)


@dataclass(frozen=True)
class Quality:
    """Counts, angles, edge lengths and area of a mesh.

    Attributes
    ----------
    n_points, n_cells : int
    min_angle, max_angle : float
        The smallest angle (the aspect ratio of Definition 2.2) and the largest, in degrees; NaN on a line.
    angles : dict of int to float
        Percentiles of all angles of all cells, in degrees, right to 0.002: ``angles[50]`` is the median. Empty on a
        line.
    min_edge, max_edge : float
        The shortest and the longest edge.
    area : float
        Sum of the cells' areas; of their lengths on a line.
    loops_closed : int or None
        Holes and islands closed on the way to this level; None where none could be (``features="keep"``).
    area_gained, area_lost : float or None
        Area inside this level but not inside the input mesh, and the other way round.
    """

    n_points: int
    n_cells: int
    min_angle: float
    max_angle: float
    angles: dict[int, float] = field(repr=False)
    min_edge: float
    max_edge: float
    area: float
    loops_closed: int | None = None
    area_gained: float | None = None
    area_lost: float | None = None

    def __repr__(self) -> str:
        return (
            f"Quality({self.n_points} points, {self.n_cells} cells, angles {self.min_angle:.2f} to "
            f"{self.max_angle:.2f} degrees, edges {self.min_edge:.3g} to {self.max_edge:.3g}, area {self.area:.6g})"
        )

    def __str__(self) -> str:
        rows = [("points", f"{self.n_points}"), ("cells", f"{self.n_cells}")]
        if self.angles:
            rows += [
                ("angles", f"{self.min_angle:.2f} to {self.max_angle:.2f} degrees, median {self.angles[50]:.2f}"),
                ("", ", ".join(f"{p} % under {self.angles[p]:.2f}" for p in (1, 5, 25, 75, 95, 99))),
            ]
        rows += [("edges", f"{self.min_edge:.6g} to {self.max_edge:.6g}"), ("area", f"{self.area:.10g}")]
        if self.loops_closed is not None:
            rows.append(("loops closed", f"{self.loops_closed}"))
        if self.area_gained is not None or self.area_lost is not None:
            rows.append(("area gained", f"{self.area_gained or 0.0:.4g}, lost {self.area_lost or 0.0:.4g}"))
        return "\n".join(f"{name:<12} {value}" for name, value in rows)


def quality_of(points: NDArray[np.float64], cells: NDArray[Any]) -> Quality:
    """Measure the cells of a mesh; O(m)."""
    if points.shape[1] == 1:
        lengths = np.abs(points[cells[:, 1], 0] - points[cells[:, 0], 0])
        edges = (float(lengths.min()), float(lengths.max()))
        return Quality(len(points), len(cells), np.nan, np.nan, {}, *edges, float(lengths.sum()))
    angles, min_edge, max_edge, area = backend("rust").cell_quality(points, cells, np.array(PERCENTILES, np.float64))
    percentiles = dict(zip(PERCENTILES, angles.tolist(), strict=True))
    return Quality(len(points), len(cells), percentiles[0], percentiles[100], percentiles, min_edge, max_edge, area)


def longest_edges(mesh: Mesh) -> NDArray[np.float64]:
    """Return the longest edge of each cell, (m,): el within the cell (Definition 2.1)."""
    columns = [np.ascontiguousarray(column) for column in mesh.points.T]  # gathers from one column stay in the cache
    corners = [[column[corner] for column in columns] for corner in mesh.cells.T]
    longest = np.zeros(mesh.n_cells)
    for one, other in combinations(corners, 2):
        np.maximum(longest, reduce(np.hypot, (np.abs(a - b) for a, b in zip(one, other, strict=True))), out=longest)
    return longest


def edge_lengths(mesh: Mesh) -> NDArray[np.float64]:
    """Return el at the nodes, (n,): the longest edge of all cells that hold the node (Definition 2.1).

    References
    ----------
    Miller, Talmor, Teng 1997, Definition 2.1.
    """
    el = np.zeros(mesh.n_points)
    longest = longest_edges(mesh)
    for corner in mesh.cells.T:
        np.maximum.at(el, corner, longest)
    return el


def cell_angles(mesh: Mesh) -> NDArray[np.float64]:
    """Return the angle at each corner of each triangle, (m, 3), in degrees."""
    corners = mesh.points[mesh.cells]
    after, before = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cross = after[..., 0] * before[..., 1] - after[..., 1] * before[..., 0]
    angles: NDArray[np.float64] = np.degrees(np.arctan2(cross, (after * before).sum(axis=2)))
    return angles


def aspect_ratios(mesh: Mesh) -> NDArray[np.float64]:
    """Return the smallest angle of each triangle, (m,), in degrees (Definition 2.2)."""
    ratios: NDArray[np.float64] = cell_angles(mesh).min(axis=1)
    return ratios


def cell_areas(mesh: Mesh) -> NDArray[np.float64]:
    """Return the area of each triangle, (m,)."""
    corners = mesh.points[mesh.cells]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas: NDArray[np.float64] = (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2
    return areas


def f_areas(
    mesh: Mesh, f: NDArray[np.float64] | Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return the f-area of each triangle, (m,): the integral of 1/f^2 over it (Definition 4.5).

    Parameters
    ----------
    mesh : Mesh
    f : (n,) array or callable points -> values
        A positive function; nodal values are taken to be linear on each triangle.

    Returns
    -------
    (m,) float64 array
        By a quadrature rule with seven points that is exact for polynomials up to degree 5.
    """
    if callable(f):
        at = np.einsum("qk,mkd->mqd", _RULE_POINTS, mesh.points[mesh.cells])
        values = np.asarray(f(at.reshape(-1, mesh.dim)), dtype=np.float64).reshape(at.shape[:2])
    else:
        values = np.asarray(f, dtype=np.float64)[mesh.cells] @ _RULE_POINTS.T
    integrals: NDArray[np.float64] = cell_areas(mesh) * (values**-2.0 @ _RULE_WEIGHTS)
    return integrals
