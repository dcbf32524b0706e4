"""A constrained Delaunay triangulation that is changed locally, and changed back.

Cocircular ties are broken as if the lifting of the point with the lowest node were raised a little, so the
triangulation is unique, and so is all that follows from it.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Sequence

from .point import Point, in_circle, orient
from .triangulation import Edge

MOST_STEPS = 256
"""Steps of a walk after which a point counts as not found."""
MOST_GONE = 24
"""Cells that a change takes away on one side of a chord, at the most: filling a hole takes time cubic in them."""

Cell = tuple[int, int, int]
Fits = Callable[[int], bool]


def encloses(points: Sequence[Point], names: Sequence[int], cell: Cell, d: int) -> bool:
    """Whether d lies in the circle through a cell, given from its corner of the lowest name on; ties broken by name."""
    sign = in_circle(*(points[v] for v in (*cell, d)))
    if sign:
        return sign > 0
    a, b, c = cell
    # raising the lowest lifts the plane at d where d's barycentric coordinate for it is positive
    return names[d] >= names[a] and orient(points[b], points[c], points[d]) > 0


class Patch:
    """The triangulation; ``apex[u, v]`` is left of u v, ``chord_at[u, v]`` the chord there, seen from either side."""

    def __init__(
        self, points: list[Point], names: list[int], apex: dict[Edge, int], chords: Iterable[tuple[int, int]]
    ) -> None:
        self.points, self.names, self.apex = points, names, apex
        self.chord_at: dict[Edge, int] = {}
        self.around: dict[int, set[int]] = defaultdict(set)
        """Other ends of the chords at a point."""
        self.is_fresh: list[bool] = []
        """Whether a chord runs where the level had none before: its angles count."""
        self.log: list[tuple[Cell | Edge, float | int | None]] = []
        """Cells with their sharpness where they went, None where they came; edges with the chord they had, or None."""
        self.starts: list[int] = []
        self.start: dict[int, int] = dict(apex.keys())
        for c, (a, b) in enumerate(chords):
            self.is_fresh.append(False)
            self.set_chord(a, b, c)
        self._break_ties()
        self.keep()

    def canonical(self, u: int, v: int, w: int) -> Cell:
        """Return a cell from its corner of the lowest name on."""
        least = min((u, v, w), key=self.names.__getitem__)
        return (u, v, w) if least == u else (v, w, u) if least == v else (w, u, v)

    def cells(self) -> list[Cell]:
        """Return every cell once."""
        return [(u, v, w) for (u, v), w in self.apex.items() if self.canonical(u, v, w)[0] == u]

    def sorted_names(self, cell: Cell) -> list[int]:
        """Return the names of a cell's corners, ascending."""
        return sorted(self.names[v] for v in cell)

    # --- changes at hand -------------------------------------------------------------------------------------------

    def keep(self) -> None:
        """Keep the changes at hand for good."""
        self.log, self.starts = [], []

    def begin(self) -> None:
        """Start a change, after those at hand."""
        self.starts.append(len(self.log))

    def roll_back(self) -> None:
        """Undo the last of the changes at hand."""
        start = self.starts.pop()
        while len(self.log) > start:
            what, before = self.log.pop()
            if len(what) == 2:
                self._put_chord(*what, before if before is None else int(before))
            elif before is None:
                self._unset(what)
            else:
                self._set(what)

    def touched(self) -> tuple[dict[Cell, float], list[Cell]]:
        """Return the cells taken away, with their sharpness then, and those made; what came back is both."""
        first: dict[Cell, float | None] = {}
        for what, before in self.log:
            if len(what) == 3:
                first.setdefault(what, before)
        gone = {cell: before for cell, before in first.items() if before is not None}
        return gone, [cell for cell in first if self.has(cell)]

    def difference(self) -> tuple[float, list[Cell]]:
        """Return the greatest sharpness taken away, and the cells made, those left out that are there as before."""
        gone, made = self.touched()
        same = {cell for cell in made if gone.get(cell) == self.sharpness(cell)}
        lost = [before for cell, before in gone.items() if cell not in same]
        return max(lost, default=-1.0), [cell for cell in made if cell not in same]

    def _set(self, cell: Cell) -> None:
        u, v, w = cell
        self.apex[u, v], self.apex[v, w], self.apex[w, u] = w, u, v
        self.start[u], self.start[v], self.start[w] = v, w, u

    def _unset(self, cell: Cell) -> None:
        u, v, w = cell
        del self.apex[u, v], self.apex[v, w], self.apex[w, u]

    def add(self, u: int, v: int, w: int) -> Cell:
        """Add a cell, as part of the change at hand."""
        cell = self.canonical(u, v, w)
        self._set(cell)
        self.log.append((cell, None))
        return cell

    def take(self, u: int, v: int, w: int) -> None:
        """Take a cell away, as part of the change at hand."""
        cell = self.canonical(u, v, w)
        self.log.append((cell, self.sharpness(cell)))
        self._unset(cell)

    def set_chord(self, a: int, b: int, chord: int | None) -> None:
        """Lay a chord along an edge, or take it away, as part of the change at hand."""
        self.log.append(((a, b), self.chord_at.get((a, b))))
        self._put_chord(a, b, chord)

    def _put_chord(self, a: int, b: int, chord: int | None) -> None:
        for u, v in ((a, b), (b, a)):
            if chord is None:
                del self.chord_at[u, v]
                self.around[u].discard(v)
            else:
                self.chord_at[u, v] = chord
                self.around[u].add(v)

    # --- geometry --------------------------------------------------------------------------------------------------

    def has(self, cell: Cell) -> bool:
        """Whether a cell is there."""
        return self.apex.get(cell[:2]) == cell[2]

    def turn(self, u: int, v: int, w: int) -> int:
        """Return the sign of a triangle of points."""
        return orient(self.points[u], self.points[v], self.points[w])

    def is_closed(self, u: int, v: int) -> bool:
        """Whether there is a chord along an edge, or nothing beyond."""
        return (u, v) in self.chord_at or (v, u) not in self.apex

    def sharpness(self, cell: Cell) -> float:
        """Return the cosine of the smallest angle of a cell, those between two chords that were there left aside."""
        p = [self.points[v] for v in cell]
        edges = [(p[k - 2][0] - p[k][0], p[k - 2][1] - p[k][1]) for k in range(3)]
        length = [math.sqrt(x * x + y * y) for x, y in edges]
        chords = [self.chord_at.get((cell[k], cell[k - 2])) for k in range(3)]
        is_old = [chord is not None and not self.is_fresh[chord] for chord in chords]
        most = -1.0
        for k in range(3):
            (ax, ay), (bx, by) = edges[k], edges[k - 1]
            if not (is_old[k] and is_old[k - 1]):
                most = max(most, -(ax * bx + ay * by) / (length[k] * length[k - 1]))
        return most

    def in_circle(self, cell: Cell, d: int) -> bool:
        """Whether d lies in the circle through a cell, ties broken by name."""
        return encloses(self.points, self.names, self.canonical(*cell), d)

    def _break_ties(self) -> None:
        """Flip edges until the triangulation is the one that the tie rule asks for."""
        waiting = list(self.apex)
        while waiting:
            u, v = waiting.pop()
            if (u, v) not in self.apex or self.is_closed(u, v):
                continue
            w, x = self.apex[u, v], self.apex[v, u]
            if self.in_circle((u, v, w), x) and self.turn(w, u, x) > 0 and self.turn(x, v, w) > 0:
                self.take(u, v, w)
                self.take(v, u, x)
                self.add(w, u, x)
                self.add(x, v, w)
                waiting += [(u, x), (x, v), (v, w), (w, u)]

    def _locate(self, p: Point, cell: Cell) -> Cell | None:
        """Walk to the cell that holds a point; None where a wall is in the way."""
        for step in range(MOST_STEPS):
            u, v, w = self.canonical(*cell)
            for i in range(3):
                a, b = [(u, v), (v, w), (w, u)][(i + step) % 3]
                if orient(self.points[a], self.points[b], p) < 0:
                    break
            else:
                return cell
            if self.is_closed(a, b):
                return None
            cell = (b, a, self.apex[b, a])
        return None

    def _cavity(self, p: int, first: Cell) -> tuple[list[Cell], list[Edge]]:
        """Return the cells in whose circle a point lies, from one of them on, and the edges around them.

        There are no edges where the cells are too many.
        """
        cavity = [self.canonical(*first)]
        waiting, rim = deque([first]), []
        while waiting:
            if len(cavity) > MOST_GONE:
                return cavity, []
            u, v, w = waiting.popleft()
            for a, b in ((u, v), (v, w), (w, u)):
                if self.is_closed(a, b):
                    rim.append((a, b, True))
                    continue
                beyond = self.canonical(b, a, self.apex[b, a])
                if beyond not in cavity and self.in_circle(beyond, p):
                    cavity.append(beyond)
                    waiting.append(beyond)
                elif beyond not in cavity:
                    rim.append((a, b, False))
        # a cell may join the cavity after an edge to it was taken for rim
        return cavity, [(a, b) for a, b, wall in rim if wall or self.canonical(b, a, self.apex[b, a]) not in cavity]

    # --- points ----------------------------------------------------------------------------------------------------

    def insert(self, p: int, start: Cell, fits: Fits) -> bool:
        """Insert a point, walking from a cell; False where it can't be. `fits` is asked of its neighbours to be."""
        first = self._locate(self.points[p], start)
        if first is None:
            return False
        cavity, rim = self._cavity(p, first)
        if len(rim) != len(cavity) + 2 or not all(self.turn(a, b, p) > 0 and fits(a) for a, b in rim):
            return False
        for cell in cavity:
            self.take(*cell)
        for a, b in rim:
            self.add(a, b, p)
        return True

    def remove(self, p: int) -> bool:
        """Remove a point with no chord at it. Where False, the change at hand must be rolled back."""
        first = v = self.start[p]
        loop: list[int] = []
        while True:
            if (p, v) in self.chord_at or (p, v) not in self.apex:
                return False
            loop.append(v)
            if len(loop) > MOST_GONE:
                return False
            v = self.apex[p, v]
            if v == first:
                break
        for k, v in enumerate(loop):
            self.take(p, v, loop[(k + 1) % len(loop)])
        return self._clip(loop) is not None

    def _clip(self, loop: list[int]) -> list[Cell] | None:
        """Fill a hole, ear by ear; None where it can't be."""
        made = []
        while len(loop) > 2:
            for k in range(len(loop)):
                ear = (loop[k], loop[(k + 1) % len(loop)], loop[(k + 2) % len(loop)])
                if self.turn(*ear) > 0 and not any(self.in_circle(ear, q) for q in loop if q not in ear):
                    break
            else:
                return None
            made.append(self.add(*ear))
            loop.remove(ear[1])
        return made

    # --- chords ----------------------------------------------------------------------------------------------------

    def chords_near(self, cell: Cell) -> list[int]:
        """Return the chords at the edges of a cell, then at those of its neighbours."""
        u, v, w = cell
        edges = [(u, v), (v, w), (w, u)]
        for a, b in edges[:]:
            if not self.is_closed(a, b):
                x = self.apex[b, a]
                edges += [(a, x), (x, b), (b, a)]
        return list(dict.fromkeys(self.chord_at[edge] for edge in edges if edge in self.chord_at))

    def split(self, p: int, ends: Edge, into: tuple[int, int], fits: Fits) -> bool:
        """Split a chord at a point; False, and nothing changed, where it can't be."""
        fans = []
        for a, b in (ends, ends[::-1]):
            if (a, b) in self.apex:
                fan = self._fan(p, a, b, fits)
                if fan is None:
                    return False
                fans.append(fan)
        for cavity, _, _ in fans:
            for cell in cavity:
                self.take(*cell)
        a, b = ends
        self.set_chord(a, b, None)
        self.set_chord(a, p, into[0])
        self.set_chord(p, b, into[1])
        for cavity, rim, stays in fans:
            if stays:
                self.add(*cavity[0])
            for u, v in rim:
                self.add(u, v, p)
        return True

    def _fan(self, p: int, a: int, b: int, fits: Fits) -> tuple[list[Cell], list[Edge], bool] | None:
        """Return what a point at a chord changes on the left, the edges around, and whether the cell there stays."""
        cell = (a, b, self.apex[a, b])
        takes = self.in_circle(cell, p)
        if self.turn(a, b, p) > 0 and not takes:
            return None
        cavity, rim = self._cavity(p, cell) if takes else ([], [(b, a)])
        rim = [edge for edge in rim if edge != (a, b)]
        seen = len(rim) == len(cavity) + 1 and all(self.turn(u, v, p) > 0 for u, v in rim)
        if not seen or not all(fits(u) and fits(v) for u, v in rim):
            return None
        return (cavity, rim, False) if takes else ([self.canonical(*cell)], rim, True)

    def merge(self, p: int, a: int, b: int, into: int) -> bool:
        """Join the chords a p and p b. Where False, the change at hand must be rolled back."""
        loops = []
        for start, end in ((b, a), (a, b)):
            if (p, start) not in self.apex:
                continue
            loop = self._half_star(p, start, end)
            if loop is None or len(loop) == 2 or any(self.turn(end, start, v) <= 0 for v in loop[1:-1]):
                return False
            loops.append(loop)
        for loop in loops:
            for u, v in itertools.pairwise(loop):
                self.take(p, u, v)
        for end in (a, b):
            self.set_chord(p, end, None)
        self.set_chord(a, b, into)
        made: list[Cell] = []
        for loop in loops:
            cells = self._clip(loop)
            if cells is None:
                return False
            made += cells
        # where the domain grew, the cells around may no longer be Delaunay
        return all(self._is_delaunay(cell) for cell in made)

    def _half_star(self, p: int, start: int, end: int) -> list[int] | None:
        """Return the points around a point from one end of a chord to another, counter-clockwise."""
        loop = [start]
        while len(loop) <= MOST_GONE:
            v = self.apex[p, loop[-1]]
            loop.append(v)
            if v == end:
                return loop
            if self.is_closed(v, p):
                return None
        return None

    def _is_delaunay(self, cell: Cell) -> bool:
        u, v, w = cell
        edges = [(a, b) for a, b in ((u, v), (v, w), (w, u)) if not self.is_closed(a, b)]
        return not any(self.in_circle(cell, self.apex[b, a]) for a, b in edges)
