"""The cells of a level among all of a triangulation: which belong to it, and what is peeled off."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Iterator

from .patch import Cell, encloses
from .point import NONE, Point
from .triangulation import Edge, Triangulation

CRUMB = 4
"""A part of fewer cells than this is dropped where there is a larger one."""


def edges_of(cell: Cell) -> tuple[Edge, Edge, Edge]:
    """Return the edges of a cell, each with the cell on its left."""
    u, v, w = cell
    return (u, v), (v, w), (w, u)


def canonical(u: int, v: int, w: int) -> Cell:
    """Return a cell from its lowest corner on."""
    return (u, v, w) if u < min(v, w) else (v, w, u) if v < w else (w, u, v)


class Trimmed:
    """All cells of the convex hull of a level's sites, and which of them belong to the level.

    Attributes
    ----------
    sites : facet vertices v, then interior nodes as len(domain) + node, ascending; corners of cells are their indices
    points : coordinates of the sites
    apex : what lies to the left of every edge of a cell
    on_edge : the chord on an edge and the side of it that lies left of the edge (0 left, 1 right)
    is_slit : by chord, whether cells on both sides end at it
    label : tag of each cell of the level; others have none
    part : the part of the input that a cell is of, 0 where there is but one
    parts_at : the parts that each site may belong to; empty where there is but one
    """

    def __init__(self, sites: list[int], triangulation: Triangulation, on_edge: dict[Edge, tuple[int, int]]) -> None:
        self.sites, self.points, self.on_edge = sites, triangulation.points, on_edge
        self.apex = {(u, v): w for (u, v), w in triangulation.apex.items() if NONE not in (u, v, w)}
        self.is_slit: list[bool] = []
        self.label: dict[Cell, int] = {}
        self.part: dict[Cell, int] = {}
        self.parts_at: list[set[int]] = []
        self._angle: dict[Cell, float] = {}
        # of several Delaunay triangulations the one that the tie rule asks for
        self.settle(list(self.apex), lambda u, v: (u, v) not in self.on_edge)

    # --- geometry --------------------------------------------------------------------------------------------------

    def corners(self, cell: Cell) -> tuple[Point, Point, Point]:
        """Return the points of a cell."""
        u, v, w = cell
        return self.points[u], self.points[v], self.points[w]

    def angle(self, cell: Cell) -> float:
        """Return the smallest angle of a cell in degrees."""
        if cell not in self._angle:
            self._angle[cell] = least_angle(*self.corners(cell))
        return self._angle[cell]

    def area_of(self, cell: Cell) -> float:
        """Return the area of a cell."""
        return area(*self.corners(cell))

    def area(self) -> float:
        """Return the area of the level."""
        return sum(self.area_of(cell) for cell in self.alive())

    def shape(self, limit_deg: float) -> tuple[int, float]:
        """Return the number of cells under a limit, and the smallest angle."""
        angles = [self.angle(cell) for cell in self.label]
        return sum(angle < limit_deg for angle in angles), min(angles, default=math.inf)

    # --- cells and their neighbours --------------------------------------------------------------------------------

    def cells(self) -> list[Cell]:
        """Return all cells of the hull, sorted."""
        return sorted((u, v, w) for (u, v), w in self.apex.items() if u < min(v, w))

    def alive(self) -> list[Cell]:
        """Return the cells of the level, sorted."""
        return sorted(self.label)

    def beyond(self, u: int, v: int) -> Cell | None:
        """Return the cell on the right of an edge; None beyond the hull."""
        w = self.apex.get((v, u))
        return None if w is None else canonical(v, u, w)

    def across(self, u: int, v: int) -> Cell | None:
        """Return the cell of the level across an edge; None where there is none, a slit between, or another part."""
        other = self.beyond(u, v)
        if other is None or other not in self.label:
            return None
        is_slit = (u, v) in self.on_edge and self.is_slit[self.on_edge[u, v][0]]
        own = canonical(u, v, self.apex[u, v])
        return None if is_slit or self.part[own] != self.part[other] else other

    def turned(self, cell: Cell, s: int, step: Callable[[int, int], Cell | None]) -> list[Cell]:
        """Return the cells around a site, counter-clockwise, that `step` (`beyond`, `across`) leads to from one."""
        first = cell
        while True:
            before = step(s, after(first, s))
            if before is None or before == cell:
                break
            first = before
        found = [first]
        while True:
            cell = found[-1]
            following = step(before_corner(cell, s), s)
            if following is None or following == first:
                return found
            found.append(following)

    def sector(self, cell: Cell, s: int) -> list[Cell]:
        """Return the cells of the level around a site that are met from one of them without crossing rim or slit."""
        return self.turned(cell, s, self.across)

    def around(self, cell: Cell, s: int) -> list[Cell]:
        """Return all cells of the hull around a site, from one of them."""
        return self.turned(cell, s, self.beyond)

    # --- changing them ---------------------------------------------------------------------------------------------

    def settle(self, edges: Iterable[Edge], may_flip: Callable[[int, int], bool]) -> None:
        """Flip edges that are not Delaunay, ties broken by site, and what they leave so (Lawson 1977)."""
        waiting = list(edges)
        while waiting:
            u, v = waiting.pop()
            if (u, v) not in self.apex or (v, u) not in self.apex or not may_flip(u, v):
                continue
            w, x = self.apex[u, v], self.apex[v, u]
            if encloses(self.points, range(len(self.points)), canonical(u, v, w), x):
                self._flip(u, v)
                waiting += [(u, x), (x, v), (v, w), (w, u)]

    def _flip(self, u: int, v: int) -> None:
        """Replace the edge u v of two cells by the other diagonal of their quadrangle; the new cells are as the old."""
        w, x = self.apex[u, v], self.apex[v, u]
        old, other = canonical(u, v, w), canonical(v, u, x)
        del self.apex[u, v], self.apex[v, u]
        new = canonical(u, x, w), canonical(x, v, w)
        for cell in new:
            for k, edge in enumerate(edges_of(cell)):
                self.apex[edge] = cell[k - 1]
        for values in (self.label, self.part):
            if old in values:
                value = values.pop(old)
                del values[other]
                values.update(dict.fromkeys(new, value))

    def peel(self, limit_deg: float, most_area: float, *, severs: bool) -> None:
        """Take cells under a limit, and no larger than `most_area`, off the rim, the worst first.

        These are ears (two rim edges), and cells with one rim edge whose opposite corner is not on the rim, or is where
        that `severs` what the cell holds together. The level is never emptied.
        """
        rim = [0] * len(self.sites)
        """Rim edges at each site."""
        for cell in self.label:
            for u, v in edges_of(cell):
                if self.across(u, v) is None:
                    rim[u] += 1
                    rim[v] += 1
        heap = [(self.angle(cell), cell) for cell in self.label if self.angle(cell) < limit_deg]
        heapq.heapify(heap)
        while heap:
            _, cell = heapq.heappop(heap)
            if cell not in self.label or len(self.label) == 1:
                continue
            next_to = {edge: self.across(*edge) for edge in edges_of(cell)}
            on_rim = [edge for edge, other in next_to.items() if other is None]
            if not on_rim or self.area_of(cell) > most_area:
                continue
            if len(on_rim) == 1 and not severs and rim[self.apex[on_rim[0]]] > 0:
                continue
            del self.label[cell]
            for edge, other in next_to.items():
                for s in edge:
                    rim[s] += -1 if other is None else 1
                if other is not None and self.angle(other) < limit_deg:
                    heapq.heappush(heap, (self.angle(other), other))

    def drop_crumbs(self) -> None:
        """Drop parts of hardly any cells where there is a larger part."""

        def beside(cell: Cell) -> list[Cell]:
            return [other for edge in edges_of(cell) if (other := self.across(*edge)) is not None]

        parts = list(regions(self.label, beside))
        largest = max((len(part) for part in parts), default=0)
        for part in parts:
            if len(part) < min(CRUMB, largest):
                for cell in part:
                    del self.label[cell]


def regions(cells: Iterable[Cell], beside: Callable[[Cell], Iterable[Cell]]) -> Iterator[list[Cell]]:
    """Yield cells by connected regions; `beside` are those of them that a cell is connected with."""
    seen: set[Cell] = set()
    for first in cells:
        if first in seen:
            continue
        seen.add(first)
        region = [first]
        for cell in region:
            fresh = [other for other in beside(cell) if other not in seen]
            seen.update(fresh)
            region += dict.fromkeys(fresh)
        yield region


def after(cell: Cell, s: int) -> int:
    """Return the corner that follows a corner of a cell."""
    return cell[(cell.index(s) + 1) % 3]


def before_corner(cell: Cell, s: int) -> int:
    """Return the corner that comes before a corner of a cell."""
    return cell[cell.index(s) - 1]


def least_angle(a: Point, b: Point, c: Point) -> float:
    """Return the smallest angle of a triangle in degrees."""
    return min(_angle(a, b, c), _angle(b, c, a), _angle(c, a, b))


def _angle(a: Point, b: Point, c: Point) -> float:
    """Return the angle at the first corner of a triangle in degrees."""
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    return math.degrees(math.atan2(abs(ux * vy - uy * vx), ux * vx + uy * vy))


def area(a: Point, b: Point, c: Point) -> float:
    """Return the signed area of a triangle."""
    return ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0


def centroid(a: Point, b: Point, c: Point) -> Point:
    """Return the mean of three points."""
    return (a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0
