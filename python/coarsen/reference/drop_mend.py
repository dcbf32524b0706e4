"""Slivers that can't be peeled off: a node of each is taken out, the one whose star is best without it.

The star of a node without the node is a polygon. Of all its triangulations the constrained Delaunay one has the
greatest smallest angle, so that angle is found by dynamic programming over the polygon's diagonals, and no
triangulation is made for a node that stays. What the whole triangulation makes of it is seen in the next round.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from .drop_trim import Trimmed, after, before_corner, least_angle
from .patch import Cell
from .point import Point, orient

MOST_CORNERS = 24
"""Stars with more corners are not considered."""

THINS, BETTER, MENDS = 0, 1, 2
"""What taking out a site does to its star: no better, but the shortest edge of a sliver is gone; better, though not all
well; no sliver is left."""


def victims(trimmed: Trimmed, limit_deg: float, cost: Callable[[int], int]) -> set[int]:
    """Return sites to be taken out so that cells under a limit vanish, no two of them in one star.

    Of the corners of a sliver the one goes whose loss gains most, of equals the one that costs least, of equals the one
    that leaves the best star, of equals the lowest.
    """
    bad = sorted((trimmed.angle(cell), cell) for cell in trimmed.label if trimmed.angle(cell) < limit_deg)
    touched: set[int] = set()
    found = set()
    for _, cell in bad:
        best: tuple[tuple[int, int, float], int, list[int]] | None = None
        for s in cell:
            star = _star(trimmed, cell, s)
            if star is None or s in touched or not touched.isdisjoint(star[1]):
                continue
            cells, link = star
            before = min(trimmed.angle(one) for one in cells)
            left = best_angle([trimmed.points[v] for v in link])
            if left >= limit_deg:
                gain = MENDS
            elif left > before:
                gain = BETTER
            elif _is_short(trimmed, cell, s):
                gain = THINS
            else:
                continue
            value = (gain, -cost(s), left)
            if best is None or value > best[0]:
                best = value, s, link
        if best is not None:
            _, s, link = best
            touched.update(link)
            touched.add(s)
            found.add(s)
    return found


def _is_short(trimmed: Trimmed, cell: Cell, s: int) -> bool:
    """Whether a corner of a cell is an end of its shortest edge."""
    p, q, r = (trimmed.points[v] for v in (s, after(cell, s), before_corner(cell, s)))
    return _length_2(q, r) > min(_length_2(p, q), _length_2(p, r))


def _length_2(a: Point, b: Point) -> float:
    dx, dy = a[0] - b[0], a[1] - b[1]
    return dx * dx + dy * dy


def _star(trimmed: Trimmed, cell: Cell, s: int) -> tuple[list[Cell], list[int]] | None:
    """Return the cells around a corner of a cell, and the polygon of their other corners.

    None where they are in several sectors, or the polygon has too few corners or too many.
    """
    star = trimmed.sector(cell, s)
    if sum(one in trimmed.label for one in trimmed.around(cell, s)) != len(star):
        return None
    link = [after(one, s) for one in star]
    if trimmed.across(s, link[0]) is None:
        link.append(before_corner(star[-1], s))
    return (star, link) if 3 <= len(link) <= MOST_CORNERS else None


def best_angle(polygon: list[Point]) -> float:
    """Return the smallest angle of the best triangulation of a polygon, 0 where it has none."""
    n = len(polygon)
    best = [[math.inf] * n for _ in range(n)]
    for span in range(2, n):
        for i in range(n - span):
            j = i + span
            best[i][j] = 0.0
            for k in range(i + 1, j):
                a, b, c = polygon[i], polygon[k], polygon[j]
                own = least_angle(a, b, c) if orient(a, b, c) > 0 else 0.0
                best[i][j] = max(best[i][j], min(own, best[i][k], best[k][j]))
    return best[0][n - 1]
