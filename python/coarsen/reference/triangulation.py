"""Constrained Delaunay triangulation: incremental (Bowyer 1981, Watson 1981), constraints by flips (Sloan 1993).

A triangle (u, v, w), counter-clockwise, is stored as three entries ``apex[u, v] = w``: what lies to the left of each of
its edges. Outside the convex hull lie *ghost* triangles (v, u, GHOST), one on every edge of the hull, so that every
directed edge has a triangle and the outside needs no rule of its own. All signs are exact.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from .kdtree import Blocks
from .point import Floats, Ints, Point, in_circle, orient

GHOST = -1

Edge = tuple[int, int]


class Triangulation:
    """Delaunay triangulation of distinct points in the plane, not all on one line; constrained after `constrain`."""

    def __init__(self, points: Floats) -> None:
        self.points: list[Point] = [(float(x), float(y)) for x, y in points]
        self.apex: dict[Edge, int] = {}
        self.constrained: set[Edge] = set()
        self._neighbours: dict[int, int] = {}
        # neighbours follow each other in the order of the blocks: walks are short
        order = [int(i) for i in np.concatenate(Blocks(points).members)]
        first = self._first_triangle(order)
        self.last: Edge = first[:2]
        u, v, w = first
        for a, b in ((u, v), (v, w), (w, u)):
            self._add(b, a, GHOST)
        self._add(u, v, w)
        for p in order:
            if p not in first:
                self._insert(p)

    def _first_triangle(self, order: Sequence[int]) -> tuple[int, int, int]:
        u, v = order[0], order[1]
        for w in order[2:]:
            turn = orient(self.points[u], self.points[v], self.points[w])
            if turn:
                return (u, v, w) if turn > 0 else (v, u, w)
        raise ValueError("all points lie on one line")

    def _add(self, u: int, v: int, w: int) -> None:
        self.apex[u, v], self.apex[v, w], self.apex[w, u] = w, u, v

    def _remove(self, u: int, v: int, w: int) -> None:
        del self.apex[u, v], self.apex[v, w], self.apex[w, u]

    def _turn(self, u: int, v: int, w: int) -> int:
        return orient(self.points[u], self.points[v], self.points[w])

    def _encloses(self, u: int, v: int, w: int, p: int) -> bool:
        """Whether the open circumcircle of a triangle holds p; a ghost's is the half plane beyond its edge."""
        if GHOST not in (u, v, w):
            return in_circle(self.points[u], self.points[v], self.points[w], self.points[p]) > 0
        while w != GHOST:
            u, v, w = v, w, u
        turn = self._turn(u, v, p)
        return turn > 0 or (turn == 0 and _is_between(self.points[u], self.points[v], self.points[p]))

    def _locate(self, p: int) -> tuple[int, int, int]:
        """Walk from the last triangle to one whose circle holds p: across an edge while p lies beyond it."""
        u, v = self.last
        w = self.apex[u, v]
        if GHOST in (u, v, w):
            while w != GHOST:
                u, v, w = v, w, u
            u, v = v, u
            w = self.apex[u, v]
        while w != GHOST:
            for a, b in ((u, v), (v, w), (w, u)):
                if self._turn(a, b, p) < 0:
                    u, v, w = b, a, self.apex[b, a]
                    break
            else:
                return u, v, w
        return u, v, w

    def _insert(self, p: int) -> None:
        """Take away every triangle whose circle holds p, and join p to the edges of the cavity."""
        u, v, w = self._locate(p)
        for q in (u, v, w):
            if q != GHOST and self.points[q] == self.points[p]:
                raise ValueError(f"point {max(p, q)} repeats point {min(p, q)} at {self.points[p]}")
        self._remove(u, v, w)
        waiting = [(u, v), (v, w), (w, u)]
        rim = []
        while waiting:
            a, b = waiting.pop()
            beyond = self.apex.get((b, a))
            if beyond is None:
                continue  # the triangle beyond has gone already
            if self._encloses(b, a, beyond, p):
                self._remove(b, a, beyond)
                waiting += [(a, beyond), (beyond, b)]
            else:
                rim.append((a, b))
        for a, b in rim:
            self._add(a, b, p)
        self.last = next((a, b) for a, b in rim if GHOST not in (a, b))

    def _flip(self, u: int, v: int) -> Edge:
        """Replace the edge u v of two triangles by the other diagonal of their quadrangle, and return that."""
        w, x = self.apex[u, v], self.apex[v, u]
        self._remove(u, v, w)
        self._remove(v, u, x)
        self._add(w, x, v)
        self._add(x, w, u)
        return w, x

    def constrain(self, a: int, b: int) -> bool:
        """Make a b an edge that stays; False where it passes through a point or crosses one that stays."""
        if (a, b) not in self.apex:
            crossed = self._crossed(a, b)
            if crossed is None:
                return False
            self._settle(self._flip_away(a, b, crossed), {(a, b), (b, a)})
        self.constrained |= {(a, b), (b, a)}
        return True

    def _crossed(self, a: int, b: int) -> list[Edge] | None:
        """Return the edges that the open segment a b crosses, from a on; None where it can't become an edge."""
        u, v = self._first_crossed(a, b)
        crossed: list[Edge] = []
        while True:
            if u == v or (u, v) in self.constrained:
                return None
            crossed.append((u, v))
            w = self.apex[v, u]
            if w == b:
                return crossed
            turn = self._turn(a, b, w)
            if turn == 0:
                return None
            u, v = (w, v) if turn < 0 else (u, w)

    def _first_crossed(self, a: int, b: int) -> Edge:
        """Return the edge opposite a, right end first, that the segment crosses first; u, u where it hits a point u."""
        u = start = self._neighbour(a)
        while True:
            v = self.apex[a, u]
            if GHOST not in {u, v}:
                right, left = self._turn(a, b, u), self._turn(a, b, v)
                if right <= 0 < left or right < 0 <= left:
                    if right < 0 < left:
                        return u, v
                    on = u if right == 0 else v
                    if _is_between(self.points[a], self.points[b], self.points[on]):
                        return on, on
            u = v
            if u == start:
                raise ValueError(f"no edge is crossed from point {a} to point {b}")

    def _neighbour(self, a: int) -> int:
        """Return a neighbour of a, looked up in a table that is renewed when a flip has made it wrong."""
        if (a, self._neighbours.get(a, a)) not in self.apex:
            self._neighbours = dict(self.apex.keys())
        return self._neighbours[a]

    def _flip_away(self, a: int, b: int, crossed: list[Edge]) -> list[Edge]:
        """Flip crossed edges, those of convex quadrangles first, until none crosses a b; return the new edges."""
        new: list[Edge] = []
        waiting = list(crossed)
        while waiting:
            u, v = waiting.pop(0)
            w, x = self.apex[u, v], self.apex[v, u]
            if self._turn(w, x, v) <= 0 or self._turn(x, w, u) <= 0:
                waiting.append((u, v))
                continue
            w, x = self._flip(u, v)
            sides = [0 if q in (a, b) else self._turn(a, b, q) for q in (w, x)]
            (waiting if sides[0] * sides[1] < 0 else new).append((w, x))
        return new

    def _settle(self, edges: Iterable[Edge], stay: set[Edge]) -> None:
        """Flip edges that are not Delaunay, and what they leave so, but those that stay (Lawson)."""
        waiting = list(edges)
        while waiting:
            u, v = waiting.pop()
            if (u, v) not in self.apex or (u, v) in stay or (u, v) in self.constrained:
                continue
            w, x = self.apex[u, v], self.apex[v, u]
            if GHOST in (w, x) or not self._encloses(u, v, w, x):
                continue
            self._flip(u, v)
            waiting += [(u, x), (x, v), (v, w), (w, u)]

    def triangles(self) -> list[tuple[int, int, int]]:
        """Return every triangle but the ghosts once, counter-clockwise, from its lowest point."""
        return [(u, v, w) for (u, v), w in self.apex.items() if GHOST < u < min(v, w) and w != GHOST]


def _is_between(a: Point, b: Point, p: Point) -> bool:
    """Whether p, known to be on the line through a and b, lies strictly between them."""
    return min(a, b) < p < max(a, b)


def delaunay(points: Floats, facets: Ints | None = None) -> Ints:
    """Return the cells, shape (m, 3), of the Delaunay triangulation of the convex hull, with the given edges in it.

    Raises
    ------
    ValueError
        Where points repeat, or a facet crosses another or passes through a point.
    """
    edges = [] if facets is None else facets.tolist()
    for row, ends in enumerate(edges):
        for i in ends:
            if not 0 <= i < len(points):
                raise ValueError(f"'facets' row {row} names point {i} of {len(points)}")
    _check_distinct(points)
    if is_one_line(points):
        return np.empty((0, 3), np.int64)
    triangulation = Triangulation(points)
    for row, (a, b) in enumerate(edges):
        if a == b or not triangulation.constrain(a, b):
            raise ValueError(f"'facets' row {row} (points {a} and {b}) crosses another facet or passes through a point")
    return np.array(triangulation.triangles(), np.int64).reshape(-1, 3)


def _check_distinct(points: Floats) -> None:
    _, first, inverse = np.unique(points, axis=0, return_index=True, return_inverse=True)
    repeated = np.flatnonzero(first[inverse.ravel()] != np.arange(len(points)))
    if len(repeated):
        i = int(repeated[0])
        raise ValueError(f"point {i} repeats point {first[inverse.ravel()[i]]} at {points[i].tolist()}")


def is_one_line(points: Floats) -> bool:
    """Whether all points (distinct) lie on one line."""
    if len(points) < 3:
        return True
    a, b = ((float(x), float(y)) for x, y in points[:2])
    return all(orient(a, b, (float(x), float(y))) == 0 for x, y in points[2:])
