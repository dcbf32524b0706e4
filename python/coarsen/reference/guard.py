"""The quality guard: no angle of a level under a bound, with nodes of the input only.

Cells with an angle under the bound are taken worst first. For each, in this order: take away one of its free nodes
(interior, and not a node of a coarser level); exchange it for a candidate nearby; insert a candidate near the cell's
off-centre; take away or exchange a free node across one of its edges; put one candidate in the place of two free nodes.
The first change that takes the cell away and leaves no new cell under the bound is kept, else the best one that betters
the worst cell it touches. Angles between two facets are left aside.

Points are candidates here. Cocircular ties are broken as if the lifting of the point with the lowest node were raised a
little, so the triangulation is unique, and so is all that follows from it.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from .level import Candidates
from .point import NONE, Bools, Floats, Point, distance, distance_2, in_circle, orient
from .triangulation import Edge

BUDGET = 0.10
"""Share of nodes that the guard may add to a level."""
TRIED = 8
"""Candidates that are tried around one place."""
MOST_ROUNDS = 12
MOST_PAIRS = 100
"""Cells of a small level for which pairs of nodes are tried; a large one has a share more."""
COMFORT = 1.25
"""How much wider than the bound the angle is under which an inserted node shall see the shortest edge."""
MOST_STEPS = 256
"""Steps of a walk after which a point counts as not found."""

Cell = tuple[int, int, int]
Change = tuple[tuple[int, ...], "int | None"]
"""Nodes to take away, node to insert."""


class Patch:
    """A constrained Delaunay triangulation that is changed locally, and changed back; ``apex[u, v]`` is left of u v."""

    def __init__(self, points: list[Point], names: list[int], apex: dict[Edge, int], constrained: set[Edge]) -> None:
        self.points, self.names, self.apex, self.constrained = points, names, apex, constrained
        self.gone: list[Cell] = []
        self.made: list[Cell] = []
        self.start: dict[int, int] = dict(apex.keys())
        self._break_ties()
        self.begin()

    def canonical(self, u: int, v: int, w: int) -> Cell:
        """Return a cell from its corner of the lowest name on."""
        least = min((u, v, w), key=self.names.__getitem__)
        return (u, v, w) if least == u else (v, w, u) if least == v else (w, u, v)

    def cells(self) -> list[Cell]:
        """Return every cell once."""
        return [(u, v, w) for (u, v), w in self.apex.items() if self.canonical(u, v, w)[0] == u]

    def begin(self) -> None:
        """Start a change."""
        self.gone, self.made = [], []

    def roll_back(self) -> None:
        """Undo the change at hand."""
        for cell in self.made:
            self._unset(cell)
        for cell in self.gone:
            self._set(cell)
        self.begin()

    def _set(self, cell: Cell) -> None:
        u, v, w = cell
        self.apex[u, v], self.apex[v, w], self.apex[w, u] = w, u, v
        self.start[u], self.start[v], self.start[w] = v, w, u

    def _unset(self, cell: Cell) -> None:
        u, v, w = cell
        del self.apex[u, v], self.apex[v, w], self.apex[w, u]

    def add(self, u: int, v: int, w: int) -> None:
        """Add a cell, as part of the change at hand."""
        cell = self.canonical(u, v, w)
        self._set(cell)
        self.made.append(cell)

    def take(self, u: int, v: int, w: int) -> None:
        """Take a cell away, as part of the change at hand."""
        cell = self.canonical(u, v, w)
        self._unset(cell)
        if cell in self.made:
            self.made.remove(cell)
        else:
            self.gone.append(cell)

    def has(self, cell: Cell) -> bool:
        """Whether a cell is there."""
        return self.apex.get(cell[:2]) == cell[2]

    def turn(self, u: int, v: int, w: int) -> int:
        """Return the sign of a triangle of points."""
        return orient(self.points[u], self.points[v], self.points[w])

    def sharpness(self, cell: Cell) -> float:
        """Return the cosine of the smallest angle of a cell, angles between two constraints left aside."""
        p = [self.points[v] for v in cell]
        edges = [(p[k - 2][0] - p[k][0], p[k - 2][1] - p[k][1]) for k in range(3)]
        length = [math.sqrt(x * x + y * y) for x, y in edges]
        fixed = [(cell[k], cell[k - 2]) in self.constrained for k in range(3)]
        most = -1.0
        for k in range(3):
            (ax, ay), (bx, by) = edges[k], edges[k - 1]
            if not (fixed[k] and fixed[k - 1]):
                most = max(most, -(ax * bx + ay * by) / (length[k] * length[k - 1]))
        return most

    def in_circle(self, cell: Cell, d: int) -> bool:
        """Whether d lies in the circle through a cell, ties broken by name."""
        sign = in_circle(*(self.points[v] for v in (*cell, d)))
        if sign:
            return sign > 0
        a, b, c = self.canonical(*cell)
        if self.names[d] < self.names[a]:
            return False
        # raising the lowest lifts the plane at d where d's barycentric coordinate for it is positive
        return self.turn(b, c, d) > 0

    def _break_ties(self) -> None:
        """Flip edges until the triangulation is the one that the tie rule asks for."""
        waiting = list(self.apex)
        while waiting:
            u, v = waiting.pop()
            if (u, v) not in self.apex or (v, u) not in self.apex or (u, v) in self.constrained:
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
            if (a, b) in self.constrained or (b, a) not in self.apex:
                return None
            cell = (b, a, self.apex[b, a])
        return None

    def insert(self, p: int, start: Cell, fits: Callable[[int], bool]) -> bool:
        """Insert a point, walking from a cell; False where it can't be. `fits` is asked of its neighbours to be."""
        first = self._locate(self.points[p], start)
        if first is None:
            return False
        cavity = {self.canonical(*first)}
        waiting, rim = deque([first]), []
        while waiting:
            u, v, w = waiting.popleft()
            for a, b in ((u, v), (v, w), (w, u)):
                if (a, b) in self.constrained or (b, a) not in self.apex:
                    rim.append((a, b, True))
                    continue
                beyond = self.canonical(b, a, self.apex[b, a])
                if beyond not in cavity and self.in_circle(beyond, p):
                    cavity.add(beyond)
                    waiting.append(beyond)
                elif beyond not in cavity:
                    rim.append((a, b, False))
        # a cell may join the cavity after an edge to it was taken for rim
        rim = [(a, b, wall) for a, b, wall in rim if wall or self.canonical(b, a, self.apex[b, a]) not in cavity]
        if len(rim) != len(cavity) + 2 or not all(self.turn(a, b, p) > 0 and fits(a) for a, b, _ in rim):
            return False
        for cell in cavity:
            self.take(*cell)
        for a, b, _ in rim:
            self.add(a, b, p)
        return True

    def remove(self, p: int) -> bool:
        """Remove a point with no constraint at it. Where False, the change at hand must be rolled back."""
        first = v = self.start[p]
        loop = []
        while True:
            if (p, v) in self.constrained or (v, p) in self.constrained or (p, v) not in self.apex:
                return False
            loop.append(v)
            v = self.apex[p, v]
            if v == first:
                break
            if len(loop) > MOST_STEPS:
                return False
        for k, v in enumerate(loop):
            self.take(p, v, loop[(k + 1) % len(loop)])
        while len(loop) > 2:
            for k in range(len(loop)):
                ear = (loop[k], loop[(k + 1) % len(loop)], loop[(k + 2) % len(loop)])
                if self.turn(*ear) > 0 and not any(self.in_circle(ear, q) for q in loop if q not in ear):
                    break
            else:
                return False
            self.add(*ear)
            loop.remove(ear[1])
        return True


@dataclass(frozen=True)
class Rule:
    """What the guard may do."""

    min_angle: float
    """The bound in radians."""
    beta: float
    slope: float
    """Lipschitz constant of f."""
    room: float
    """Share of the conflict distance that an inserted node must keep: 1/C leaves the next finer level independent."""


class Guard:
    """A level at work: candidates, f at them, and which of them the triangulation holds."""

    def __init__(
        self, candidates: Candidates, f: Floats, allowed: Bools, free: Bools, taken: Bools, patch: Patch, rule: Rule
    ) -> None:
        self.candidates, self.f, self.allowed, self.free, self.taken = candidates, f, allowed, free, taken
        self.patch, self.rule = patch, rule
        self.sharp = math.cos(rule.min_angle)
        self.left = int(BUDGET * int(taken.sum()))
        self.pairs_left = MOST_PAIRS + int(taken.sum()) // MOST_PAIRS
        self.inserted: set[int] = set()

    def work(self) -> dict[int, float]:
        """Better the level; return candidates that conflict since, and beta/2 of the distance to the nearest such."""
        bad = self._bad(self.patch.cells())
        for _ in range(MOST_ROUNDS):
            bad = self._round(bad)
            if not bad:
                break
        return self._crowded()

    def _bad(self, cells: Iterable[Cell]) -> set[Cell]:
        return {self.patch.canonical(*cell) for cell in cells if self.patch.sharpness(cell) > self.sharp}

    def _round(self, bad: set[Cell]) -> set[Cell]:
        """Pass over the cells under the bound, worst first; return those that the pass made."""
        names = self.patch.names
        queue = sorted(bad, key=lambda cell: (-self.patch.sharpness(cell), sorted(names[v] for v in cell)))
        waiting, made = set(queue), set()
        for cell in queue:
            if cell in waiting and self.patch.has(cell) and self._mend(cell):
                waiting -= set(self.patch.gone)  # one that comes back waits for the next round
                made |= self._bad(self.patch.made)
                self.patch.begin()
        return {cell for cell in made if self.patch.has(cell)}

    def _mend(self, cell: Cell) -> bool:
        """Try to better one cell; a change that is kept is left at hand."""
        best: tuple[float, Change] | None = None
        for change in self._changes(cell):
            if not self._apply(change, cell):
                continue
            if not self.patch.has(cell):
                before = max(map(self.patch.sharpness, self.patch.gone), default=-1.0)
                after = max(map(self.patch.sharpness, self.patch.made), default=-1.0)
                if after <= self.sharp:
                    return True
                if after < before and (best is None or after < best[0]):
                    best = (after, change)
            self._undo(change)
        return best is not None and self._apply(best[1], cell)

    def _changes(self, cell: Cell) -> Iterator[Change]:
        """Yield changes in the order in which they are tried."""
        yield from self._of_nodes(cell)
        if self.left > 0:
            centre, reach = self._off_centre(cell)
            yield from (((), k) for k in self._near(np.array(centre), reach))
        across = []
        for k in range(3):
            u, v = cell[k], cell[k - 2]
            across.append(NONE if (u, v) in self.patch.constrained else self.patch.apex.get((v, u), NONE))
        yield from self._of_nodes(across)
        if self.pairs_left > 0:
            self.pairs_left -= 1
            free = self._free_ones([*cell, *across])
            points = self.candidates.points
            for v, w in itertools.combinations(free, 2):
                if v != w:
                    middle = 0.5 * (points[v] + points[w])
                    reach = 0.5 * float(distance(points[v], points[w]))
                    yield from (((v, w), k) for k in self._near(middle, reach))

    def _free_ones(self, nodes: Iterable[int]) -> list[int]:
        return [v for v in nodes if v != NONE and self.free[v] and self.taken[v]]

    def _of_nodes(self, nodes: Iterable[int]) -> Iterator[Change]:
        """Yield changes that take away or exchange the free ones among some nodes."""
        free = self._free_ones(nodes)
        yield from (((v,), None) for v in free)
        for v in free:
            reach = float(self.f[v]) / self.rule.beta
            yield from (((v,), k) for k in self._near(self.candidates.points[v], reach))

    def _apply(self, change: Change, cell: Cell) -> bool:
        out, new = change
        self.patch.begin()
        for v in out:
            if not self.patch.remove(v) or not self.patch.made:
                self.patch.roll_back()
                return False
            cell = min(self.patch.made, key=lambda made: sorted(self.patch.names[v] for v in made))
        if new is not None:
            p, f = self.candidates.points, self.f

            def fits(w: int) -> bool:
                near = (f[new] + f[w]) / self.rule.beta
                return bool(distance(p[new], p[w]) >= self.rule.room * near)

            if not self.patch.insert(new, cell, fits):
                self.patch.roll_back()
                return False
            self.taken[new] = self.free[new] = True
            self.inserted.add(new)
            self.left -= 1
        self.taken[list(out)] = False
        self.left += len(out)
        return True

    def _undo(self, change: Change) -> None:
        out, new = change
        self.patch.roll_back()
        if new is not None:
            self.taken[new] = False
            self.left += 1
        self.taken[list(out)] = True
        self.left -= len(out)

    def _near(self, place: Floats, reach: float) -> list[int]:
        """Return allowed candidates nearest to a place, nearest first, ties by node."""
        d_2 = distance_2(self.candidates.points, place)
        found = np.flatnonzero((np.sqrt(d_2) < reach) & self.allowed & ~self.taken)
        order = np.lexsort((self.candidates.nodes[found], d_2[found]))
        return [int(k) for k in found[order[:TRIED]]]

    def _off_centre(self, cell: Cell) -> tuple[Point, float]:
        """Return where a node would mend a cell, and how far from there one is still looked for."""
        p = [self.patch.points[v] for v in cell]
        lengths = [math.sqrt(_length_2(p[k], p[k - 2])) for k in range(3)]
        k = lengths.index(min(lengths))
        a, b, c = p[k], p[k - 2], p[k - 1]
        dx, dy = b[0] - a[0], b[1] - a[1]
        ex, ey = c[0] - a[0], c[1] - a[1]
        double_area = dx * ey - dy * ex
        short, long = dx * dx + dy * dy, ex * ex + ey * ey
        # the circumcentre relative to the middle of the shortest edge lies on its bisector
        ux, uy = (ey * short - dy * long) / (2.0 * double_area), (dx * long - ex * short) / (2.0 * double_area)
        height = (ux * -dy + uy * dx) / math.sqrt(short)
        comfortable = 0.5 * math.sqrt(short) / math.tan(0.5 * COMFORT * self.rule.min_angle)
        height = min(height, comfortable)
        place = (
            a[0] + 0.5 * dx - dy / math.sqrt(short) * height,
            a[1] + 0.5 * dy + dx / math.sqrt(short) * height,
        )
        return place, max(height, 0.5 * math.sqrt(short))

    def _crowded(self) -> dict[int, float]:
        """Return inserted candidates and those that they conflict with."""
        room: dict[int, float] = {}
        points, f = self.candidates.points, self.f
        here = np.flatnonzero(self.taken)
        for k in sorted(self.inserted):
            if not self.taken[k]:
                continue
            away = distance(points[here], points[k])
            near = (away < 2.0 * f[k] / (self.rule.beta - self.rule.slope)) & (here != k)
            near &= away < (f[k] + f[here]) / self.rule.beta
            for other, d in zip(here[near].tolist(), away[near].tolist(), strict=True):
                for end in (k, other):
                    room[end] = min(room.get(end, math.inf), self.rule.beta / 2.0 * d)
        return {k: least for k, least in room.items() if least < f[k]}


def _length_2(a: Point, b: Point) -> float:
    dx, dy = a[0] - b[0], a[1] - b[1]
    return dx * dx + dy * dy
