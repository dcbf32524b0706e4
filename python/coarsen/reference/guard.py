"""The quality guard: no angle of a level under a bound, with nodes of the input only.

Cells with an angle under the bound are taken worst first. For each, single changes are tried in this order: take away
one of its free nodes (not a node of a coarser level, no corner); exchange it for a candidate nearby; the same for the
nodes across its edges; insert a candidate near its off-centre; put back a facet vertex that a chord nearby spans.
The first change that takes the cell away and leaves no new cell under the bound is kept. Where there is none, chains
of changes are tried: the most promising ones, each followed by one that mends the worst cell it leaves, and once more.
Else the best single change that betters the worst cell it touches is kept. Angles between two facets are left aside,
unless the guard bent one of them.

Cells that are then still under 15 degrees are gone over again, by wider means: chains count that better a cell without
lifting it over the bound, candidates come from further away, and may come nearer to other nodes.

Points are candidates here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from .chords import Chord, chord_between, chords_of, holds, is_joined, piece, repair
from .domain import Domain
from .level import Candidates, Choice
from .patch import Cell, Patch
from .point import NONE, Bools, Floats, Point, distance, distance_2
from .triangulation import Edge

BUDGET = 0.10
"""Share of nodes that the guard may add to a level."""
TRIED = 8
"""Candidates that are tried around one place, and vertices of one chord."""
MOST_ROUNDS = 12
FOLLOWED = ((16,), (8, 4))
"""How many of the changes tried at a cell are followed by others, for chains of two and of three."""
TRIES = (5000, 5)
"""Changes that are tried in chains on any level, and those that each node allows more."""
LEAST = 15.0 * math.pi / 180.0
"""The angle that matters most, in radians: cells still under it are gone over again."""
RESERVE = 2
"""Nodes of the budget that are left for these."""
WIDER = 3.0
"""How much further away nodes are exchanged then."""
SPAN = 1.4
"""Vertices spanned by a joined chord stay within this many times the distance of a conflict with either end."""
COMFORT = 1.25
"""How much wider than the bound the angle is under which an inserted node shall see the shortest edge."""


@dataclass(frozen=True)
class Change:
    """What goes, what comes, and the chord that this splits."""

    gone: int | None = None
    new: int | None = None
    chord: int | None = None


@dataclass(frozen=True)
class Found:
    """A change that takes a cell away and leaves others under the bound: how many, and the sharpest of them."""

    bad: int
    after: float
    change: Change


@dataclass(frozen=True)
class Best:
    """Changes that leave the worst cell they touch better than it was."""

    after: tuple[float, int]
    """Cosine of the smallest angle they leave, and how many cells under the bound."""
    steps: list[tuple[Change, Cell]]
    """The changes, and the cells at which they are made."""


@dataclass(frozen=True)
class Scene:
    """The level at hand: f and places are by candidate."""

    domain: Domain
    candidates: Candidates
    f: Floats
    inside: Bools
    """Which candidates are interior and in the coarse domain."""
    seeds: Choice
    """What coarser levels hold."""
    seeded: Bools
    """The same by candidate."""


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


@dataclass(frozen=True)
class Outcome:
    """A level that was bettered: its choice and cells, and what conflicts since."""

    choice: Choice
    apex: dict[Edge, int]
    cells: list[Cell]
    crowded: dict[int, float]
    """Candidates that conflict, and beta/2 of the distance to the nearest such."""


def better(scene: Scene, rule: Rule, choice: Choice, apex: dict[Edge, int], taken: Bools) -> Outcome:
    """Better a level; one that then needs repair is done again without touching its facets."""
    outcome = Guard(scene, rule, choice, dict(apex), taken.copy(), bends=True).work()
    kept = outcome.choice.kept.copy()
    if (kept != choice.kept).any():
        facets = len(scene.domain)
        interior = np.isin(scene.candidates.nodes, outcome.choice.interior)
        interior[:facets] = False
        repair(scene.domain, kept, scene.candidates.points[interior], wide=False)
        if (kept != outcome.choice.kept).any():
            return Guard(scene, rule, choice, dict(apex), taken.copy(), bends=False).work()
    return outcome


class Guard:
    """A level at work: chords, and which candidates the triangulation holds and may lose."""

    def __init__(
        self, scene: Scene, rule: Rule, choice: Choice, apex: dict[Edge, int], taken: Bools, *, bends: bool
    ) -> None:
        self.scene, self.rule, self.choice, self.taken, self.bends = scene, rule, choice, taken, bends
        self.domain, self.candidates, self.f = scene.domain, scene.candidates, scene.f
        facets, count = len(self.domain), int(taken.sum())
        points = [(float(x), float(y)) for x, y in self.candidates.points]
        ends = [chord.vertices for chord in choice.chords]
        self.patch = Patch(points, self.candidates.nodes.tolist(), apex, ends)
        self.chords = list(choice.chords)
        self.chords_before: list[int] = []
        self.sides = np.bincount([chord.chain for chord in choice.chords], minlength=len(self.domain.chains))
        self.free = ~scene.seeded
        self.free[:facets] &= bends & ~self.domain.corner
        self.sharp = math.cos(rule.min_angle)
        self.is_last = False
        self.steps: list[tuple[Change, Cell]] = []
        self.best: Best | None = None
        self.added = 0
        self.budget = int(BUDGET * (count - scene.seeds.surplus)) - scene.seeds.surplus
        self.tries_left = TRIES[0] + TRIES[1] * count
        self.gone: list[int] = []
        self.brought: list[int] = []
        self.inserted: set[int] = set()

    def work(self) -> Outcome:
        """Better the level."""
        self._lift(self.rule.min_angle)
        self.is_last = True
        self.tries_left += TRIES[0]
        self._lift(min(self.rule.min_angle, LEAST))
        facets = len(self.domain)
        choice = replace(
            self.choice,
            kept=self.taken[:facets].copy(),
            interior=self.candidates.nodes[facets:][self.taken[facets:]],
            held=dict(self.choice.held),
            surplus=max(self.scene.seeds.surplus + self.added, 0),
        )
        choice.chords = chords_of(self.domain, choice.kept)
        return Outcome(choice, self.patch.apex, self.patch.cells(), self._crowded())

    def _lift(self, bound: float) -> None:
        """Go over the cells under a bound until none is left, or nothing helps."""
        self.sharp = math.cos(bound)
        bad = self._bad(self.patch.cells())
        for _ in range(MOST_ROUNDS):
            if not bad:
                break
            bad = self._round(bad)

    def _may_add(self) -> bool:
        """Whether the budget allows one more node."""
        return self.added < self.budget - (0 if self.is_last else RESERVE)

    def _bad(self, cells: Iterable[Cell]) -> set[Cell]:
        return {self.patch.canonical(*cell) for cell in cells if self.patch.sharpness(cell) > self.sharp}

    def _round(self, bad: set[Cell]) -> set[Cell]:
        """Pass over the cells under the bound, worst first; return those that the pass made."""
        queue = sorted(bad, key=lambda cell: (-self.patch.sharpness(cell), self.patch.sorted_names(cell)))
        waiting, made = set(queue), set()
        for cell in queue:
            if cell in waiting and self._mend(cell):
                gone, new = self.patch.touched()
                waiting -= set(gone)  # one that comes back waits for the next round
                made |= self._bad(new)
                self._keep()
        return {cell for cell in made if self.patch.has(cell) and self.patch.sharpness(cell) > self.sharp}

    def _mend(self, cell: Cell) -> bool:
        """Try to better one cell; changes that are kept are left at hand."""
        found: list[Found] = []
        self.best = None
        if self._try_each(cell, found):
            return True
        found.sort(key=lambda one: (one.bad, one.after))
        if any(self._follow(cell, found, widths) for widths in FOLLOWED):
            return True
        best: Best | None = self.best
        return best is not None and all(self._apply(change, at) for change, at in best.steps)

    def _follow(self, cell: Cell, found: list[Found], widths: tuple[int, ...]) -> bool:
        """Follow the most promising changes by one that mends the worst cell they leave, and so on."""
        for one in found[: widths[0]]:
            if self.tries_left == 0 or not self._apply(one.change, cell):
                continue
            self.steps.append((one.change, cell))
            left = self.patch.difference()[1]
            if left:
                worst = min(left, key=lambda cell: (-self.patch.sharpness(cell), self.patch.sorted_names(cell)))
                then: list[Found] = []
                if self._try_each(worst, then):
                    self.steps.clear()
                    return True
                then.sort(key=lambda one: (one.bad, one.after))
                if len(widths) > 1 and self._follow(worst, then, widths[1:]):
                    return True
            self.steps.pop()
            self._undo(one.change)
        return False

    def _try_each(self, cell: Cell, found: list[Found]) -> bool:
        """Try each change at a cell; add those that take it away but leave others under the bound to `found`."""
        for change in self._changes(cell):
            if self.gone or self.brought:
                self.tries_left = max(self.tries_left - 1, 0)
            if not self._apply(change, cell):
                continue
            if not self.patch.has(cell):
                before, made = self.patch.difference()
                sharp = [self.patch.sharpness(new) for new in made]
                after = max(sharp, default=-1.0)
                if after <= self.sharp:
                    return True
                bad = sum(s > self.sharp for s in sharp)
                is_best = self.best is None or (after, bad) < self.best.after
                if after < before and is_best and (self.is_last or not self.steps):
                    self.best = Best((after, bad), [*self.steps, (change, cell)])
                found.append(Found(bad, after, change))
            self._undo(change)
        return False

    def _changes(self, cell: Cell) -> Iterator[Change]:
        """Yield changes in the order in which they are tried."""
        yield from self._of_nodes(cell)
        edges = [(cell[k], cell[k - 2]) for k in range(3)]
        yield from self._of_nodes([NONE if self.patch.is_closed(u, v) else self.patch.apex[v, u] for u, v in edges])
        if self._may_add():
            centre, reach = self._off_centre(cell)
            yield from (Change(new=k) for k in self._near(np.array(centre), reach))
        if self.bends and self._may_add():
            for c in self.patch.chords_near(cell):
                chain, start, stop = self.domain.chains[self.chords[c].chain], self.chords[c].start, self.chords[c].stop
                # all of a few, else a few that lie evenly
                count = min(stop - start - 1, TRIED)
                for j in range(1, count + 1):
                    v = chain.vertex(start + (stop - start) * j // (count + 1))
                    if not self.taken[v] and v not in self.gone:
                        yield Change(new=v, chord=c)

    def _of_nodes(self, nodes: Iterable[int]) -> Iterator[Change]:
        """Yield changes that take away or exchange the free ones among some nodes; what a chain brought stays."""
        free = [v for v in nodes if v != NONE and self.free[v] and v not in self.brought]
        yield from (Change(v) for v in free)
        for v in free:
            if v >= len(self.domain):
                reach = (WIDER if self.is_last else 1.0) * float(self.f[v]) / self.rule.beta
                yield from (Change(v, k) for k in self._near(self.candidates.points[v], reach))

    # --- making a change -------------------------------------------------------------------------------------------

    def _apply(self, change: Change, cell: Cell) -> bool:
        """Make a change at a cell; False, and nothing changed, where it can't be made."""
        self.patch.begin()
        self.chords_before.append(len(self.chords))
        out, new = change.gone, change.new
        if out is not None:
            made = self.patch.touched()[1] if self._leave(out) else []
            if not made:
                self._roll_back()
                return False
            cell = min(made, key=self.patch.sorted_names)
        if new is not None and not self._join(new, change.chord, cell):
            self._roll_back()
            return False
        if new is not None:
            self.taken[new] = self.free[new] = True
            self.inserted.add(new)
            self.brought.append(new)
            self.added += self._weight(new)
        if out is not None:
            self.taken[out] = False
            self.gone.append(out)
            self.added -= self._weight(out)
        return True

    def _undo(self, change: Change) -> None:
        self._roll_back()
        if change.new is not None:
            self.taken[change.new] = False
            self.brought.pop()
            self.added -= self._weight(change.new)
        if change.gone is not None:
            self.taken[change.gone] = True
            self.gone.pop()
            self.added += self._weight(change.gone)

    def _keep(self) -> None:
        self.patch.keep()
        self.chords_before, self.gone, self.brought = [], [], []

    def _roll_back(self) -> None:
        self.patch.roll_back()
        before = self.chords_before.pop()
        new = len(self.chords) - before
        if new:
            # two new chords took the place of one, or one that of two
            self.sides[self.chords[-1].chain] += 1 if new == 1 else -1
            del self.chords[before:], self.patch.is_fresh[before:]

    def _weight(self, k: int) -> int:
        """Return the number of nodes that a candidate stands for."""
        return len(self.domain.copies[k]) if k < len(self.domain) else 1

    def _join(self, new: int, chord: int | None, cell: Cell) -> bool:
        p, f = self.candidates.points, self.f
        room = 0.0 if self.is_last else self.rule.room

        def fits(w: int) -> bool:
            near = (f[new] + f[w]) / self.rule.beta
            return bool(distance(p[new], p[w]) >= room * near)

        if chord is None:
            return self.patch.insert(new, cell, fits)
        old = self.chords[chord]
        chain, (a, b) = self.domain.chains[old.chain], old.vertices
        at = next(k for k in range(old.start + 1, old.stop) if chain.vertex(k) == new)
        is_fresh = self.patch.is_fresh[chord] or self.patch.turn(a, b, new) != 0
        self._add_chord(old.chain, old.start, at, is_fresh)
        self._add_chord(old.chain, at, old.stop, is_fresh)
        self.sides[old.chain] += 1
        last = len(self.chords)
        is_clear = all(self._is_clear(one, new) for one in self.chords[-2:])
        return is_clear and self.patch.split(new, (a, b), (last - 2, last - 1), fits)

    def _leave(self, v: int) -> bool:
        if v >= len(self.domain):
            return self.patch.remove(v)
        ends = sorted({self.patch.chord_at[v, w] for w in self.patch.around[v]})
        if len(ends) != 2:
            return False
        if self.chords[ends[0]].vertices[0] == v:
            ends.reverse()
        one, two = (self.chords[c] for c in ends)
        if one.chain != two.chain or one.vertices[1] != v or two.vertices[0] != v:
            return False
        chain = self.domain.chains[one.chain]
        if (chain.closed or chain.vertices[0] == chain.vertices[-1]) and self.sides[one.chain] < 4:
            return False
        a, b = one.vertices[0], two.vertices[1]
        is_fresh = self.patch.turn(a, v, b) != 0 or any(self.patch.is_fresh[c] for c in ends)
        self._add_chord(one.chain, one.start, one.stop + two.stop - two.start, is_fresh)
        self.sides[one.chain] -= 1
        new = self.chords[-1]
        is_valid = self._is_dense(new) and not is_joined(self.domain, new) and self._is_clear(new, v)
        return is_valid and self.patch.merge(v, a, b, len(self.chords) - 1)

    def _add_chord(self, chain: int, start: int, stop: int, is_fresh: bool) -> None:
        length = len(self.domain.chains[chain].vertices)
        turns = 0 if start < length else length
        self.chords.append(chord_between(self.domain, chain, start - turns, stop - turns))
        self.patch.is_fresh.append(is_fresh)

    def _is_dense(self, new: Chord) -> bool:
        """Whether the vertices that a chord spans are near enough to either end."""
        p, f, spanned = self.domain.points, self.f, piece(self.domain, new)
        near = [distance(p[spanned], p[end]) <= SPAN * ((f[spanned] + f[end]) / self.rule.beta) for end in new.vertices]
        return bool((near[0] | near[1]).all())

    def _is_clear(self, new: Chord, but: int) -> bool:
        """Whether the region between a chord and its piece of chain holds no kept point, one vertex left aside."""
        if new.deviation_2 == 0.0:
            return True
        kept = np.flatnonzero(self.taken)
        kept = kept[~np.isin(kept, [but, *new.vertices])]
        return not holds(self.domain, new, self.candidates.points[kept]).any()

    def _near(self, place: Floats, reach: float) -> list[int]:
        """Return allowed candidates nearest to a place, nearest first, ties by node."""
        d_2 = distance_2(self.candidates.points, place)
        found = np.flatnonzero((np.sqrt(d_2) < reach) & self.scene.inside & ~self.taken)
        found = found[~np.isin(found, self.gone)]
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
        # the circumcentre relative to the middle of the shortest edge lies on its bisector; a sliver may have none
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            ux = float(np.float64(ey * short - dy * long) / (2.0 * double_area))
            uy = float(np.float64(dx * long - ex * short) / (2.0 * double_area))
        height = (ux * -dy + uy * dx) / math.sqrt(short)
        comfortable = 0.5 * math.sqrt(short) / math.tan(0.5 * COMFORT * self.rule.min_angle)
        height = height if height < comfortable else comfortable
        place = (
            a[0] + 0.5 * dx - dy / math.sqrt(short) * height,
            a[1] + 0.5 * dy + dx / math.sqrt(short) * height,
        )
        if self.is_last:
            radius, longest = math.sqrt(ux * ux + uy * uy), max(lengths)
            return place, radius if radius < longest else longest
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
