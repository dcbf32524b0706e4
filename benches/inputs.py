"""Meshes of any size for the benches: made by a formula, so that no rival's triangulation favours anyone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SEED = 19970105
JITTER = 0.2  # of the lattice width; up to 0.25 no cell can fold

Points = NDArray[np.float64]
Cells = NDArray[np.int64]


def lattice(columns: int, rows: int) -> tuple[Points, Cells]:
    """Return a jittered lattice of unit width over [0, columns-1] x [0, rows-1], each square cut in two.

    Nodes come row by row; boundary nodes move along the boundary only, corners not at all.
    """
    y, x = np.divmod(np.arange(columns * rows), columns)
    points = np.column_stack([x, y]).astype(float)
    move = np.random.default_rng(SEED).uniform(-JITTER, JITTER, points.shape)
    move[(x == 0) | (x == columns - 1), 0] = 0
    move[(y == 0) | (y == rows - 1), 1] = 0
    move[((x == 0) | (x == columns - 1)) & ((y == 0) | (y == rows - 1))] = 0
    a = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    b, c, d = a + 1, a + columns + 1, a + columns
    return points + move, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def quasi_uniform(n: int) -> tuple[Points, Cells]:
    """Return a unit square of about `n` nodes, all edges of about one length."""
    side = max(3, round(np.sqrt(n)))
    points, cells = lattice(side, side)
    return points / (side - 1), cells


def graded(n: int, ratio: float = 1e4) -> tuple[Points, Cells]:
    """Return a quarter of an annulus of about `n` nodes whose radii, and so whose edges, span `ratio`.

    The image of a lattice under exp, which is conformal: graded without being stretched.
    """
    aspect = np.log(ratio) / (np.pi / 2)
    rows = max(3, round(np.sqrt(n / aspect)))
    points, cells = lattice(max(3, round(n / rows)), rows)
    width = (np.pi / 2) / (rows - 1)
    radius = np.exp(points[:, 0] * width) / ratio
    angle = points[:, 1] * width
    # exp keeps orientation: (log radius, angle) is a right-handed frame
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), cells


def shuffled(points: Points, cells: Cells) -> tuple[Points, Cells]:
    """Return the same mesh with its nodes and cells in random order."""
    rng = np.random.default_rng(SEED)
    order = rng.permutation(len(points))
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return points[order], place[cells][rng.permutation(len(cells))]
