"""Spacing of a balanced quadtree (section 6.2, after Bern, Eppstein and Gilbert), d = 1 to 3.

The root is the cube at the least coordinates `lo` whose side S is the least power of two over the extent. Points are
put on a grid of 2^42 cells an axis, and all the rest is integer arithmetic; points in one of its cells count as one.

- Split every cell that holds a point while another point lies in the 3^d cells of its level around it.
- Balance: with a split cell all its neighbours of its level exist, that is, their parents are split.
- The spacing at x is 15/16 of the side of the leaf that holds x.
"""

from __future__ import annotations

import itertools
import math
import sys

import numpy as np

from .point import Floats, Ints

DEPTH = 42
SHARE = 15 / 16

Cell = tuple[int, ...]


def quadtree(points: Floats, at: Floats | None = None, threads: int | None = None) -> Floats:
    """Return the spacing of the quadtree of the points, shape (n, d), at `at` or at themselves."""
    at = points if at is None else at
    if len(points) == 0:
        return np.full(len(at), np.inf)
    low = points.min(axis=0)
    side = _power_of_two_above(float((points.max(axis=0) - low).max()))
    split = split_cells(_grid_cells(points, low, side))
    if not split:
        return np.full(len(at), np.inf)
    found = np.empty(len(at))
    for k, cell in enumerate(map(tuple, _grid_cells(at, low, side).tolist())):
        level = 0
        while level < len(split) and _ancestor(cell, level) in split[level]:
            level += 1
        found[k] = SHARE * (side * 0.5**level)
    return found


def split_cells(grid_cells: Ints) -> list[set[Cell]]:
    """Return the split cells of the balanced tree, level by level, for points in these cells of the grid."""
    points = sorted(set(map(tuple, grid_cells.tolist())))
    split: list[set[Cell]] = []
    while len(points) > 1 and len(split) < DEPTH:
        level = len(split)
        held: dict[Cell, int] = {}
        for point in points:
            cell = _ancestor(point, level)
            held[cell] = held.get(cell, 0) + 1
        crowded = {
            cell
            for cell, count in held.items()
            if count > 1 or any(other in held for other in _around(cell) if other != cell)
        }
        # a point whose cell isn't crowded crowds nobody else's on finer levels: being neighbours is mutual
        points = [point for point in points if _ancestor(point, level) in crowded]
        split.append(crowded)
    while split and not split[-1]:
        split.pop()
    for level in range(len(split) - 1, 0, -1):
        for cell in split[level]:
            for neighbour in _around(cell):
                if all(0 <= i < 2**level for i in neighbour):
                    split[level - 1].add(tuple(i // 2 for i in neighbour))
    return split


def _grid_cells(x: Floats, low: Floats, side: float) -> Ints:
    cells = 2.0**DEPTH
    return np.clip((x - low) / side * cells, 0.0, cells - 1.0).astype(np.int64)


def _power_of_two_above(x: float) -> float:
    if not (0.0 < x < math.inf):
        return 1.0
    exponent = math.frexp(x)[1]
    return max(math.ldexp(1.0, exponent), sys.float_info.min) if exponent <= sys.float_info.max_exp - 1 else math.inf


def _ancestor(cell: Cell, level: int) -> Cell:
    """Return the cell of a level that holds a cell of the grid."""
    return tuple(i >> (DEPTH - level) for i in cell)


def _around(cell: Cell) -> itertools.product[Cell]:
    """Return the 3^d cells around a cell, itself among them."""
    return itertools.product(*[(i - 1, i, i + 1) for i in cell])
