"""What lies at a point of the plane: inside the mesh or not, and in which material.

The answer is seen from a point that is known to lie inside: every facet edge that the line of sight crosses may change
it. Signs are exact and a vertex on the line of sight counts as left of it, so a line through vertices crosses every
closed loop an even number of times if its ends are on one side.
"""

from __future__ import annotations

import numpy as np

from .domain import Domain
from .point import Point, signs


class Sight:
    """The facet edges of a domain, to be looked across."""

    def __init__(self, domain: Domain) -> None:
        edges = [(c, edge) for c, chain in enumerate(domain.chains) for edge in chain.edges]
        self.chain = np.array([c for c, _ in edges], np.int64)
        self.edges = [edge for _, edge in edges]
        ends = domain.points[[edge.vertices for edge in self.edges]].reshape(-1, 2, 2)
        self.a, self.b = ends[:, 0], ends[:, 1]
        self.low, self.high = ends.min(axis=1), ends.max(axis=1)

    def look(self, eye: Point, tag: int, x: Point, is_gone: list[bool]) -> int | None:
        """Return the tag of the cell at x, None outside, seen from a point in a cell of the given tag.

        Chains that are gone are not seen.
        """
        start, stop = np.array(eye), np.array(x)
        near = (self.low <= np.maximum(start, stop)).all(axis=1) & (np.minimum(start, stop) <= self.high).all(axis=1)
        near &= ~np.array(is_gone, np.bool_)[self.chain]
        at = np.flatnonzero(near)
        a, b = self.a[at], self.b[at]
        from_side, to_side = signs(a, b, start) > 0, signs(a, b, stop) > 0
        crossed = (signs(start, stop, a) >= 0) != (signs(start, stop, b) >= 0)
        crossed &= from_side != to_side
        inside, latest, seen = True, 0.0, tag
        for k in np.flatnonzero(crossed):
            left, right = self.edges[at[k]].sides
            inside ^= left.is_inside != right.is_inside
            side = left if to_side[k] else right
            before, after = _turn(a[k], b[k], start), _turn(a[k], b[k], stop)
            time = before / (before - after) if before != after else 0.0
            if side.is_inside and time >= latest:
                latest, seen = time, side.cell_tag
        return seen if inside else None


def _turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    """Return twice the area of a triangle, rounded."""
    return float((a[0] - c[0]) * (b[1] - c[1]) - (a[1] - c[1]) * (b[0] - c[0]))
