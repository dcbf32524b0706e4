"""What lies at a point of the plane: inside the mesh or not, and in which material.

The facet edge right below a point tells what lies above it. A line that sweeps from left to right holds the edges that
it meets in their order, so that one sweep answers for many points.

Signs are exact. A point on an edge counts as right of it, and one on a vertex as right of the first edge there.

A hole may be gone, closed by the material around it. What lies in it (islands) and what lies around it then see nothing
of each other.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from typing import NamedTuple

from .domain import Domain
from .loose import is_hole
from .point import NONE, Point, orient


class Spot(NamedTuple):
    """What lies at a point in the mesh or in a hole."""

    tag: int
    """Tag of the cell, in a hole of the cells around it."""
    hole: int
    """The hole that it lies in, by its chain, or none."""
    around: int
    """The innermost hole around that cell, or around those cells."""


class Sight:
    """The facet edges of a domain, to be looked at from above."""

    def __init__(self, domain: Domain) -> None:
        self.domain = domain
        self.chain = [c for c, chain in enumerate(domain.chains) for _ in chain.edges]
        self.edges = [edge for chain in domain.chains for edge in chain.edges]
        places = [(x, y) for x, y in domain.points.tolist()]
        ends = [sorted(places[v] for v in edge.vertices) for edge in self.edges]
        self.ends = [(left, right) for left, right in ends]
        """Ends of each edge from left to right, from below where it is vertical."""
        self.above = [int(places[edge.vertices[0]] != left) for edge, (left, _) in zip(self.edges, ends, strict=True)]
        """The side of each edge that lies above it."""
        self.first_at: dict[Point, int] = {}
        """The first edge at each vertex."""
        for e, pair in enumerate(self.ends):
            for place in pair:
                self.first_at.setdefault(place, e)
        self.upright: dict[float, list[tuple[float, int]]] = {}
        """Vertical edges at each x, each with its lower end, ascending."""
        self.events: list[tuple[float, bool, int]] = []
        """Where the sweep comes upon edges that are not vertical, and where it leaves them, in order."""
        for e, (left, right) in enumerate(self.ends):
            if left[0] == right[0]:
                self.upright.setdefault(left[0], []).append((left[1], e))
            else:
                self.events += [(left[0], True, e), (right[0], False, e)]
        self.events.sort()
        for edges in self.upright.values():
            edges.sort()
        self.is_hole = [is_hole(domain, c) for c in range(len(domain.chains))]
        self.hole_around = [NONE] * len(domain.chains)
        """For each chain the innermost hole that it lies in, or none."""
        self._nest()

    def _nest(self) -> None:
        places = [[(y, x) for x, y in self.domain.points[chain.vertices].tolist()] for chain in self.domain.chains]
        lowest = [(x, y) for y, x in map(min, places)]
        below = [edge for edge, _ in self._beneath(lowest)]
        # an edge below the lowest vertex of a chain is of a chain that reaches farther down
        for c in sorted(range(len(lowest)), key=lambda c: lowest[c][::-1]):
            edge = below[c]
            spot = None if edge is None else self._spot(edge, self.above[edge])
            if spot is not None:
                self.hole_around[c] = spot.around if spot.hole == NONE else spot.hole

    def look(self, eyes: list[Point], points: list[Point], is_gone: list[bool]) -> list[int | None]:
        """Return the tag of the cell at each of some points, None outside, seen from a point in the mesh each.

        Holes that are gone are closed. Takes O((s + k) log (s + k)) for s facet edges and k points.
        """
        spots = self._at(points)
        if all(hole == NONE for hole in self.hole_around):
            owns = spots
        else:
            owns = self._at(eyes)

        def closed(spot: Spot) -> int:
            return next((hole for hole in self._outward(spot.around) if is_gone[hole]), NONE)

        def tag(spot: Spot | None, own: Spot | None) -> int | None:
            if spot is None or (spot.hole != NONE and not is_gone[spot.hole]):
                return None
            return spot.tag if own is None or closed(own) == closed(spot) else None

        return list(map(tag, spots, owns))

    def _outward(self, hole: int) -> Iterator[int]:
        """Yield a hole and the holes around it."""
        while hole != NONE:
            yield hole
            hole = self.hole_around[hole]

    def _at(self, points: list[Point]) -> list[Spot | None]:
        """Return what lies at each of some points, None outside all."""
        spots = []
        for below, on in self._beneath(points):
            if on is not None:
                spots.append(self._spot(on, 1))
            else:
                spots.append(None if below is None else self._spot(below, self.above[below]))
        return spots

    def _spot(self, e: int, side: int) -> Spot | None:
        """Return what lies on a side of an edge."""
        c = self.chain[e]
        around, seen = self.hole_around[c], self.edges[e].sides[side]
        if seen.is_inside:
            return Spot(seen.cell_tag, NONE, around)
        hole = c if self.is_hole[c] else around
        if hole == NONE:
            return None
        rim = self.domain.chains[hole].edges[0]
        return Spot(next(side.cell_tag for side in rim.sides if side.is_inside), hole, self.hole_around[hole])

    def _beneath(self, points: list[Point]) -> list[tuple[int | None, int | None]]:
        """Return the next edge below each of some points, and the first edge that it lies on."""
        found: list[tuple[int | None, int | None]] = [(None, None)] * len(points)
        met: list[int] = []
        """Edges that the sweep meets, from below."""
        event = 0
        for k in sorted(range(len(points)), key=lambda k: points[k][0]):
            x = points[k]
            while event < len(self.events) and self.events[event][0] <= x[0]:
                _, comes, e = self.events[event]
                left, right = self.ends[e]
                if comes:
                    met.insert(self._count_below(met, left, right), e)
                else:
                    del met[met.index(e, self._count_below(met, right))]
                event += 1
            at = self._count_below(met, x)
            on = met[at] if at < len(met) and self._turn(met[at], x) == 0 else self._upright_at(x)
            found[k] = (met[at - 1] if at > 0 else None, self.first_at.get(x, on))
        return found

    def _count_below(self, met: list[int], *points: Point) -> int:
        """Return how many of the edges that the sweep meets lie below the first of some points that they miss."""
        return bisect_left(met, 0, key=lambda e: -next(filter(None, (self._turn(e, x) for x in points)), 0))

    def _turn(self, e: int, x: Point) -> int:
        """Return 1 where a point lies above an edge or its line, -1 below, 0 on it."""
        return orient(*self.ends[e], x)

    def _upright_at(self, x: Point) -> int | None:
        """Return the vertical edge that a point lies on, no end of it."""
        edges = self.upright.get(x[0], [])
        at = bisect_left(edges, (x[1], 0)) - 1
        if at < 0:
            return None
        e = edges[at][1]
        return e if x[1] < self.ends[e][1][1] else None
