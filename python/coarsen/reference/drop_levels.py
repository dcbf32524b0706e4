"""The levels that drop features: selected coarse to fine, settled fine to coarse, and where they begin and end."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .drop import Ground, Settled, Terms, select
from .drop_assemble import Dropped
from .hierarchy import MAX_LEVELS, STALL, Builder, Made, as_dict, power
from .level import Candidates, Choice
from .point import Bools, Floats, Ints

MOST_TRIES = 40
"""Tries of a spacing a quarter as large where a level has no cell."""
DENSER = 1.2
"""A maximal independent set drawn from a set that is hardly denser has holes: there nodes may be this much nearer."""


@dataclass(frozen=True)
class Plan:
    """A selected level; f at the facet vertices, and at nodes inside."""

    choice: Choice
    at_facets: Floats
    at_interior: dict[int, float]
    visits: int


class Dropping:
    """The levels of a builder that drop features, drawn from the nodes that `wanted` admits where it is given."""

    def __init__(self, builder: Builder, wanted: Ints | None) -> None:
        self.builder, self.domain, self.options = builder, builder.domain, builder.options
        self.barred = np.zeros(len(self.domain), np.bool_)
        rules = builder.rules
        if wanted is not None:
            self.barred[:] = [not np.isin(copies, wanted).any() for copies in self.domain.copies]
            builder.draw_from(wanted)
            rules = replace(rules, beta=rules.beta * DENSER)
        self.terms = Terms(rules, math.cos(math.radians(self.options.feature_angle)), self.barred)

    def depth(self) -> int:
        """Return the first level of so few nodes that no triangulation of them has more than `coarsest` cells."""

        def is_enough(i: int) -> bool:
            choice = self.plan(i, self.builder.no_seeds()).choice
            sites = int(choice.kept.sum()) + len(choice.interior)
            # n points have at most 2 n - 5 triangles; the last level has one at least
            return 2 * sites <= self.options.coarsest + 5 or sites <= 3

        depth = self.builder.roughly()
        if is_enough(depth):
            while depth > 1 and is_enough(depth - 1):
                depth -= 1
        else:
            while depth < MAX_LEVELS and not is_enough(depth):
                depth += 1
        return depth

    def plan(self, i: int, seeds: Choice) -> Plan:
        """Select level i."""
        at = self.builder.at_hand(i)
        choice = select(self.domain, at.pool.candidates, at.f, seeds, at.candidate_of, self.terms)
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
        ground = Ground(self.domain, builder.points, builder.cells, builder.facets, self.terms.cos_feature)
        allowed = self._nodes(finer["nodes"]) if finer is not None and options.nested else None
        before = len(builder.cells) if finer is None else len(finer["cells"])
        is_open = options.levels is None
        sites = len(builder.pools[0].members) - int(self.barred.sum())
        visits = 0
        levels: list[dict[str, Any]] = []
        for k in range(len(plans)):
            visits += plans[k].visits
            # most of those left out are known before they are made
            if is_open and k + 1 < len(plans) and self._sites(plans[k].choice, allowed) > STALL * sites:
                continue
            choice, made = ground.settle(plans[k].choice, plans[k].at_facets, allowed)
            plans[k] = replace(plans[k], choice=choice)
            if made is None:
                again = self._denser(ground, first + k, plans[k - 1] if k > 0 else None, allowed)
                if again is not None:
                    plans[k], made = again
            factor = power(options.factor, first + k)
            if made is None:
                last = levels[-1] if levels else finer
                if last is None:
                    raise RuntimeError("no level of the domain has a cell")
                if not is_open:
                    levels.append({"dropped": Dropped().as_dict(), **last, "factor": factor})
                continue
            mesh, dropped = made
            now = len(mesh.cells)
            is_last = is_open and now <= options.coarsest
            if is_open and not is_last and now > STALL * before:
                continue
            spacing = self._spacing(ground, plans[k], mesh.nodes)
            if options.nested:
                allowed = self._nodes(mesh.nodes)
            before, sites = now, self._sites(plans[k].choice, None)
            levels.append({**as_dict(mesh, factor, spacing, visits), "dropped": dropped.as_dict()})
            visits = 0
            if is_last:
                break
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

    def _denser(self, ground: Ground, i: int, finer: Plan | None, allowed: Bools | None) -> tuple[Plan, Settled] | None:
        """Make a level in place of level i, which has no cell.

        It is drawn from the nodes of the finer plan, or of all that levels draw from, with a spacing made smaller until
        there is a cell.
        """
        facets, pool = len(self.domain), self.builder.pools[0]
        if finer is None:
            spacing, nodes = self.builder.spacing_in(i - 1, pool), pool.candidates.nodes
        else:
            inside = np.sort(finer.choice.interior)
            known = [finer.at_interior.get(node, 0.0) for node in inside.tolist()]
            spacing = np.concatenate([finer.at_facets, known])
            nodes = np.concatenate([pool.candidates.nodes[:facets], inside])
        candidates = Candidates(self.builder.points[nodes], nodes)
        none = np.empty(0, np.int64)
        for attempt in range(MOST_TRIES):
            f = spacing * (self.options.factor * 0.25**attempt)
            choice = select(self.domain, candidates, f, self.builder.no_seeds(), none, self.terms)
            choice, made = ground.settle(choice, f[:facets], allowed)
            if made is not None:
                at_interior = dict(zip(nodes[facets:].tolist(), f[facets:].tolist(), strict=True))
                return Plan(choice, f[:facets], at_interior, len(nodes)), made
        return None


def build_dropping(builder: Builder) -> Made:
    """Build the levels of ``features="drop"``, or of ``"auto"``, which keeps features while that is worth it."""
    options, wanted = builder.options, builder.options.levels
    if options.features == "drop":
        dropping = Dropping(builder, None)
        return builder.ended(dropping.levels(1, dropping.depth() if wanted is None else wanted, None))
    last, is_enough = last_worth_keeping(builder)
    levels = builder.levels(last)
    finer = levels[-1] if levels else None
    dropping = Dropping(builder.freed(), finer["nodes"] if finer is not None and options.nested else None)
    depth = wanted if wanted is not None else last if is_enough else max(dropping.depth(), last + 1)
    return builder.ended(levels + dropping.levels(last + 1, depth, finer))


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
