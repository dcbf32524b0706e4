"""The levels that drop features: selected coarse to fine, settled fine to coarse, and where they begin and end."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .drop import Ground, Settled
from .drop_assemble import Dropped
from .drop_parts import parts_of
from .drop_select import Terms, select_facets, select_inside
from .hierarchy import MAX_LEVELS, STALL, Builder, Made, Pool, as_dict, power
from .level import Candidates, Choice
from .point import Bools, Floats, Ints
from .spacing import capped

MOST_TRIES = 40
"""Tries of a spacing a quarter as large where a level has no cell."""
DENSER = 1.2
"""A maximal independent set drawn from a set that is hardly denser has holes: there nodes may be this much nearer."""
STEEP = 0.05
"""Where a level changes the area by this share of it more than the finer one, one between is made if that does not."""
BETWEEN = 3
"""Spacings that are tried for it, after the level's own: it may do with other nodes."""
WORTH_A_LEVEL = 0.8
"""How many of the finer level's cells it may have at most."""
FEW = 16
"""Facet vertices are thinned until the coarsest level has about this many cells for each."""


@dataclass(frozen=True)
class Plan:
    """A selected level; f at the facet vertices, and at nodes inside."""

    choice: Choice
    at_facets: Floats
    at_interior: dict[int, float]
    visits: int


class Dropping:
    """The levels of a builder that drop features."""

    def __init__(self, builder: Builder) -> None:
        self.builder, self.domain, self.options = builder, builder.domain, builder.options
        self.barred = np.zeros(len(self.domain), np.bool_)
        self.parts = parts_of(self.domain, len(builder.points), builder.cells)
        cosine = math.cos(math.radians(self.options.feature_angle))
        self.terms = Terms(builder.rules, 1.0, cosine, self.barred, self.parts)
        self.facets: dict[int, Bools] = {}

    def draw_from(self, wanted: Ints) -> None:
        """Let all levels draw from certain nodes only."""
        self.barred[:] = [not np.isin(copies, wanted).any() for copies in self.domain.copies]
        self.builder.draw_from(wanted)
        self.terms = replace(self.terms, denser=DENSER)

    def depth(self) -> int:
        """Return the first level of so few nodes that no triangulation of them has more than `coarsest` cells."""

        def is_enough(i: int) -> bool:
            choice = self.plan(i, self.builder.no_seeds()).choice
            sites = int(choice.kept.sum()) + len(choice.interior)
            # n points have at most 2 n - 5 triangles; the last level has one at least
            return 2 * sites <= self.options.coarsest + 5 or sites <= 3

        return first_enough(1, self.builder.roughly(), is_enough)

    def plan_facets(self, first: int, last: int | None) -> Bools:
        """Select the facet vertices of levels `first` to `last`, or until few are left; return the first level's.

        Coarsest level first and all before any interior node: a level then has what the coarser ones need, also where
        it is drawn from few nodes.
        """
        facets, options = len(self.domain), self.options
        finest = self.builder.pools[0].candidates
        candidates = Candidates(finest.points[:facets], finest.nodes[:facets])
        pool = Pool(candidates, np.arange(facets), np.empty(0), 0)
        none = np.zeros(facets, np.bool_)

        def selected(i: int, seeds: Bools) -> Bools:
            return select_facets(self.domain, candidates, self.builder.spacing_in(i, pool), seeds, self.terms)

        few = max(options.coarsest // FEW, 3)
        if last is None:
            about = (i for i in range(first, MAX_LEVELS) if facets <= few * power(options.factor, i))
            last = first_enough(first, next(about, MAX_LEVELS), lambda i: int(selected(i, none).sum()) <= few)
        kept = none
        for i in range(last, first - 1, -1):
            kept = selected(i, kept if options.nested else none)
            self.facets[i] = kept
        return kept

    def plan(self, i: int, seeds: Choice) -> Plan:
        """Select level i."""
        at = self.builder.at_hand(i)
        kept = self.facets[min(max(i, min(self.facets)), max(self.facets))].copy()
        candidates, terms = at.pool.candidates, self.terms
        choice = select_inside(self.domain, candidates, at.f, kept, seeds, at.candidate_of, terms, at.first)
        at_interior = dict(zip(choice.interior.tolist(), at.f[at.candidate_of[choice.interior]].tolist(), strict=True))
        return Plan(choice, at.f[: len(self.domain)], at_interior, at.visits)

    def levels(self, first: int, depth: int, finer: dict[str, Any] | None) -> list[dict[str, Any]]:
        """Make levels `first` to `depth` after level `finer`, or after the input.

        With an open depth a level that would hardly be smaller than the one before is left out, and the levels end at
        the first of at most `coarsest` cells.
        """
        builder, options = self.builder, self.options
        plans: list[Plan] = []
        for i in range(depth, first - 1, -1):
            seeds = plans[0].choice if plans and options.nested else builder.no_seeds()
            plans.insert(0, self.plan(i, seeds))
        ground = Ground(self.domain, builder.points, builder.cells, builder.facets, self.parts, self.terms.cos_feature)
        allowed = self._nodes(finer["nodes"]) if finer is not None and options.nested else None
        before = len(builder.cells) if finer is None else len(finer["cells"])
        is_open = options.levels is None
        sites = len(builder.pools[0].members) - int(self.barred.sum())
        visits = 0
        levels: list[dict[str, Any]] = []
        was = None if finer is None else finer.get("dropped")
        change = 0.0 if was is None else abs(was["area_gained"] - was["area_lost"])
        k, done, has_between = 0, None, False
        while k < len(plans):
            visits += 0 if has_between else plans[k].visits
            # most of those left out are known before they are made
            if is_open and k + 1 < len(plans) and self._sites(plans[k].choice, allowed) > STALL * sites:
                k, has_between = k + 1, False
                continue
            choice, made = ground.settle(plans[k].choice, plans[k].at_facets, allowed)
            plan = replace(plans[k], choice=choice)
            if made is None:
                again = self._denser(ground, first + k, done, allowed)
                if again is not None:
                    plan, made = again
            factor = power(options.factor, first + k)
            if made is None:
                last = levels[-1] if levels else finer
                if last is None:
                    raise RuntimeError("no level of the domain has a cell")
                if not is_open:
                    levels.append({"dropped": Dropped().as_dict(), **last, "factor": factor})
                k, has_between = k + 1, False
                continue
            most = change + STEEP * ground.area
            is_steep = is_open and abs(made[1].area_gained - made[1].area_lost) > most
            tries = 0 if has_between else BETWEEN
            has_between = False
            if is_steep:
                bounds = (tries, WORTH_A_LEVEL * before, most)
                found = self._between(ground, first + k, (plans[k].choice, done), allowed, bounds)
                if found is not None:
                    share, plan, made = found
                    has_between, factor = share < 1.0, factor * share
            mesh, dropped = made
            now = len(mesh.cells)
            is_last = is_open and now <= options.coarsest
            if is_open and not is_last and now > STALL * before:
                k += 1
                continue
            spacing = self._spacing(ground, plan, mesh.nodes)
            if options.nested:
                allowed = self._nodes(mesh.nodes)
            before, sites, change = now, self._sites(plan.choice, None), abs(dropped.area_gained - dropped.area_lost)
            levels.append({**as_dict(mesh, factor, spacing, visits), "dropped": dropped.as_dict()})
            visits, done = 0, plan
            if is_last:
                break
            k += not has_between
        return levels

    def _nodes(self, nodes: Ints) -> Bools:
        result = np.zeros(len(self.builder.points), np.bool_)
        result[nodes] = True
        return result

    def _sites(self, choice: Choice, allowed: Bools | None) -> int:
        """Return how many facet vertices and interior nodes a choice keeps that are allowed."""
        if allowed is None:
            return int(choice.kept.sum()) + len(choice.interior)
        vertices = [v for v in np.flatnonzero(choice.kept) if allowed[self.domain.copies[v]].any()]
        return len(vertices) + int(allowed[choice.interior].sum())

    @staticmethod
    def _spacing(ground: Ground, plan: Plan, nodes: Ints) -> Floats:
        vertex_of, inside = ground.vertex_of, plan.at_interior
        return np.array(
            [plan.at_facets[vertex_of[i]] if i in vertex_of else inside.get(i, 0.0) for i in nodes.tolist()]
        )

    def _source(self, finer: Plan | None) -> Candidates:
        """Return the nodes of the finer plan, or all that levels draw from."""
        pool = self.builder.pools[0]
        nodes = pool.candidates.nodes
        if finer is not None:
            nodes = np.concatenate([nodes[: len(self.domain)], np.sort(finer.choice.interior)])
        return Candidates(self.builder.points[nodes], nodes)

    def _anew(
        self, ground: Ground, source: Candidates, f: Floats, seeds: Choice, allowed: Bools | None
    ) -> tuple[Plan, Settled] | None:
        """Make a level from a source, keeping those of `seeds` that are in it."""
        facets, terms = len(self.domain), self.terms
        if allowed is not None:
            barred = np.array([not allowed[copies].any() for copies in self.domain.copies], np.bool_)
            terms = replace(terms, barred=barred)
        kept = select_facets(self.domain, source, f, seeds.kept & ~terms.barred, terms)
        candidate_of = np.full(len(self.builder.points), -1)
        candidate_of[source.nodes[facets:]] = np.arange(facets, len(source.nodes))
        seeds = replace(seeds, interior=seeds.interior[candidate_of[seeds.interior] >= 0])
        choice = select_inside(self.domain, source, f, kept, seeds, candidate_of, terms)
        choice, made = ground.settle(choice, f[:facets], allowed)
        if made is None:
            return None
        at_interior = dict(zip(source.nodes[facets:].tolist(), f[facets:].tolist(), strict=True))
        return Plan(choice, f[:facets], at_interior, len(source.nodes)), made

    def _denser(self, ground: Ground, i: int, finer: Plan | None, allowed: Bools | None) -> tuple[Plan, Settled] | None:
        """Make a level in place of level i, which has no cell: with the finer spacing, reduced until there is one."""
        source = self._source(finer)
        if finer is None:
            spacing = self.builder.spacing_in(i - 1, self.builder.pools[0])
        else:
            inside = source.nodes[len(self.domain) :].tolist()
            spacing = np.concatenate([finer.at_facets, [finer.at_interior.get(node, 0.0) for node in inside]])
        for attempt in range(MOST_TRIES):
            f = spacing * (self.options.factor * 0.25**attempt)
            made = self._anew(ground, source, f, self.builder.no_seeds(), allowed)
            if made is not None:
                return made
        return None

    def _between(
        self,
        ground: Ground,
        i: int,
        seeds_finer: tuple[Choice, Plan | None],
        allowed: Bools | None,
        bounds: tuple[int, float, float],
    ) -> tuple[float, Plan, Settled] | None:
        """Make a level before level i, or in place of it.

        It has the largest spacing that keeps to the bounds of cells and of area, and keeps what there is of the nodes
        of level i, so that this may still be made from it.
        """
        if self.options.method == "threshold":
            return None
        seeds, finer = seeds_finer
        most_tries, most_cells, most_change = bounds
        source, builder = self._source(finer), self.builder
        for attempt in range(most_tries + 1):
            share = self.options.factor ** (-attempt / (BETWEEN + 1))
            factor = share * power(self.options.factor, i)
            f = capped(builder.finest, builder.g, builder.cap, factor, builder.rules.gradation, source.points)
            found = self._anew(ground, source, f, seeds, allowed)
            if found is None:
                continue
            plan, made = found
            if len(made[0].cells) > most_cells:
                break
            if abs(made[1].area_gained - made[1].area_lost) <= most_change:
                return share, plan, made
        return None


def build_dropping(builder: Builder) -> Made:
    """Build the levels of ``features="drop"``, or of ``"auto"``, which keeps features while that is worth it."""
    options, wanted = builder.options, builder.options.levels
    if options.features == "drop":
        dropping = Dropping(builder)
        dropping.plan_facets(1, wanted)
        return builder.ended(dropping.levels(1, dropping.depth() if wanted is None else wanted, None))
    last, is_enough = last_worth_keeping(builder)
    dropping, seeds = Dropping(builder.freed()), builder.no_seeds()
    if not is_enough:
        # what the levels that drop features are to keep, so that they have it to draw from
        facets = dropping.plan_facets(last + 1, wanted)
        seeds.kept[:] = facets & options.nested
    levels = builder.levels(last, seeds)
    finer = levels[-1] if levels else None
    if finer is not None and options.nested:
        dropping.draw_from(finer["nodes"])
    depth = wanted if wanted is not None else last if is_enough else max(dropping.depth(), last + 1)
    return builder.ended(levels + dropping.levels(last + 1, depth, finer))


def first_enough(first: int, guess: int, is_enough: Callable[[int], bool]) -> int:
    """Return the first level from `first` on that is coarse enough, searched for from a guess on."""
    level = guess
    if is_enough(level):
        while level > first and is_enough(level - 1):
            level -= 1
    else:
        while level < MAX_LEVELS and not is_enough(level):
            level += 1
    return level


def last_worth_keeping(builder: Builder) -> tuple[int, bool]:
    """Return how many levels keep features and still take a good part of the cells away; whether they are enough.

    A good part is a quarter for a factor of 2, and a third of what an unbounded domain would lose for any other.
    """
    options = builder.options
    share = 1.0 - (1.0 - 1.0 / power(options.factor, 2)) / 3.0
    most = MAX_LEVELS if options.levels is None else options.levels
    before = len(builder.cells)
    for i in range(1, most + 1):
        now = builder.n_cells(i)
        if now > share * before:
            return i - 1, False
        if options.levels is None and now <= options.coarsest:
            return i, True
        before = now
    return most, True
