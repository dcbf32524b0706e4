"""MULTI_LEVEL_COARSEN (Figure 3).

Level i is spaced by the C^i-coarsening of the input's spacing, coarsest level first, each finer level keeping the nodes
of the coarser one, so that levels are node-nested (Lemma 3.6).

As printed, every level looks at every node. With ``candidates="pool"``, level i draws its interior nodes from a maximal
independent set made with the spacing f_i / C^m (C^m >= 4), which was drawn from the pool of level i - 1 in turn. The
first pool is made with f_1 from all nodes, where f_{1+m} / C^m is about that; elsewhere nodes are added under this. It
also serves the levels before its own that are at least about twice as coarse as it, and level 1 begins with that set.

The paper takes the number of levels as given. Without one, it is the first level whose own (not nested) mesh has at
most `coarsest` cells, or the last that is smaller than the one before by more than a twentieth.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .domain import Domain, FacetArrays
from .gap import gaps
from .guard import Rule, Scene, better
from .kdtree import leaf_order
from .level import (
    Candidates,
    Choice,
    LevelMesh,
    Rules,
    Triangulated,
    assemble,
    lowered,
    select,
    triangulate,
)
from .point import Bools, Floats, Ints
from .selection import conflicting, greedy_in_tiles
from .spacing import capped, nearest, threshold

if TYPE_CHECKING:
    from coarsen.options import Options

LEAST_RATIO = 1.9
"""How much finer than a level the pool must be that it draws from, where that pool serves several levels."""
STEEP = 0.7
"""The set that the first pool is made of is dense enough but where f_{1+m} / C^m is less than this share of f_1."""
MIN_ANGLE = 25.0
"""Degrees that the guard works for where nothing is said, but with features="plain"."""
STALL = 0.95
"""A level that keeps more than this share of the cells of the one before ends a hierarchy of open depth."""
MAX_LEVELS = 512

Report = Callable[[str, int, int], None] | None
Made = tuple[list[dict[str, Any]], str, Floats]
"""The coarser levels, finest first, why they end ("levels", "coarsest", "stalled"), and g at the nodes of the input."""


def power(factor: float, i: int) -> float:
    """Return C^i by repeated squaring, as the core does, so that both have the same bits."""
    result = 1.0
    while True:
        if i % 2:
            result *= factor
        i //= 2
        if i == 0:
            return result
        factor *= factor


def enough(options: Options, levels: int, cells: int) -> str | None:
    """Return why a hierarchy that is built from the fine side has its last level, or None."""
    if options.levels is not None:
        return "levels" if levels >= options.levels else None
    if levels >= MAX_LEVELS:
        return "stalled"
    return "coarsest" if levels > 0 and cells <= options.coarsest else None


@dataclass(frozen=True)
class Pool:
    """Candidates, their places in the finest pool, f at them (of the level it is made for), and visits."""

    candidates: Candidates
    members: Ints
    f: Floats
    visits: int


@dataclass(frozen=True)
class AtHand:
    """What a level is drawn from: a pool, f at its candidates, the candidate of every node, and visits."""

    pool: Pool
    f: Floats
    candidate_of: Ints
    visits: int
    first: Ints | None
    """An independent set of interior candidates that the level begins with."""


@dataclass(frozen=True)
class Chosen:
    """What a level keeps; f by candidate, whether candidates are in the coarse domain, what it was drawn from."""

    choice: Choice
    f: Floats
    inside: Bools
    at: AtHand


class Builder:
    """All that stays the same from level to level."""

    def __init__(
        self, points: Floats, cells: Ints, facets: FacetArrays, spacing: Floats | None, options: Options
    ) -> None:
        self.points, self.cells, self.facets, self.options = points, cells, facets, options
        self.rules = Rules(options.beta, options.delta, options.gradation, options.features in {"keep", "auto"})
        angle = options.min_angle
        if angle is None and options.features != "plain":
            angle = MIN_ANGLE
        self.min_angle = math.radians(angle) if angle else None
        self.domain = Domain(points, facets, math.cos(math.radians(options.feature_angle)))
        nodes = candidate_nodes(points, self.domain)
        finest = Candidates(points[nodes], nodes)
        self.finest = finest.points
        if spacing is None:
            self.g = nearest(finest.points)
        else:
            self.g = spacing[nodes]
            for v, copies in enumerate(self.domain.copies):
                self.g[v] = spacing[copies].min()
        self.cap = None
        if self.rules.hold:
            self.cap = np.full(len(nodes), np.inf)
            self.cap[: len(self.domain)] = gaps(self.domain)
        self.pools = [Pool(finest, np.arange(len(nodes)), np.empty(0), 0)]
        self.known: tuple[Floats, Ints] | None = None
        self.lag = min(max(math.ceil(math.log(4) / math.log(options.factor)), 1), 64)
        boundary = facets.n_boundary
        self.euler = len(points) - (3 * len(cells) + boundary) // 2 + len(cells)

    def at_nodes(self, g: Floats) -> Floats:
        """Return values of the finest candidates at all nodes, copies alike."""
        values = np.zeros(len(self.points))
        values[self.pools[0].candidates.nodes] = g
        for v, copies in enumerate(self.domain.copies):
            values[copies] = g[v]
        return values

    def spacing_in(self, i: int, pool: Pool) -> Floats:
        """Return f_i at the candidates of a pool, held under the gaps of the domain."""
        finest, factor = self.finest, power(self.options.factor, i)
        if self.options.method == "function":
            return capped(finest, self.g, self.cap, factor, self.rules.gradation, pool.candidates.points)
        f = threshold(self.g, factor)[pool.members]
        if self.cap is not None:
            free = np.full(len(finest), np.inf)
            f = np.minimum(f, capped(finest, free, self.cap, 1.0, self.rules.gradation, pool.candidates.points))
        return f

    def pool_for(self, i: int) -> int:
        """Make pools up to the one that level i draws from, and return its number."""
        if self.options.candidates != "pool":
            return 0
        is_fine = power(self.options.factor, i) < LEAST_RATIO * power(self.options.factor, 1)
        wanted = 0 if is_fine else max(i - self.lag, 1)
        while len(self.pools) <= wanted:
            self.pools.append(self.first_pool() if len(self.pools) == 1 else self.next_pool())
        return wanted

    def first_set(self) -> tuple[Floats, Ints]:
        """Return f_1 at all candidates, and the maximal independent set of the interior ones under it."""
        if self.known is None:
            f, none = self.spacing_in(1, self.pools[0]), np.empty(0, np.int64)
            order = np.arange(len(self.domain), len(f))
            self.known = f, greedy_in_tiles(self.pools[0].candidates.points, f, self.rules.beta, order, none)
        return self.known

    def first_pool(self) -> Pool:
        """Return the pool of level 1 + m: the first set, and more where that set is too thin."""
        finest, facets, level = self.pools[0], len(self.domain), 1 + self.lag
        points, finer = finest.candidates.points, power(self.options.factor, self.lag)
        f_1, first = self.first_set()
        f = np.full(len(points), np.nan)
        picked = np.concatenate([np.arange(facets), first])
        f[picked] = self.spacing_in(level, subset(finest, picked))
        steep = first[f[first] / finer < STEEP * f_1[first]]
        others = np.setdiff1d(np.arange(facets, len(points)), first)
        around = conflicting(points, f_1, self.rules.beta, steep, others)
        if len(around):
            f[around] = self.spacing_in(level, subset(finest, around))
            added = greedy_in_tiles(points, f / finer, self.rules.beta, around, first)
            picked = np.sort(np.concatenate([picked, added]))
        return replace(subset(finest, picked), f=f[picked], visits=len(first) + len(around))

    def next_pool(self) -> Pool:
        """Return the pool after the last: a maximal independent set of it, under the spacing of its level over C^m."""
        last, facets = self.pools[-1], len(self.domain)
        f = self.spacing_in(len(self.pools) + self.lag, last)
        finer = f / power(self.options.factor, self.lag)
        order, none = np.arange(facets, len(f)), np.empty(0, np.int64)
        chosen = greedy_in_tiles(last.candidates.points, finer, self.rules.beta, order, none)
        picked = np.concatenate([np.arange(facets), chosen])
        return replace(subset(last, picked), f=f[picked], visits=len(order))

    def freed(self) -> Builder:
        """Return the same builder with a spacing that is not held under the gaps of the domain."""
        free = copy.copy(self)
        free.cap, free.pools, free.known = None, self.pools[:1], None
        return free

    def draw_from(self, wanted: Ints) -> None:
        """Let all levels draw interior nodes from certain nodes only."""
        finest = self.pools[0]
        members = np.flatnonzero(
            (np.arange(len(finest.members)) < len(self.domain)) | np.isin(finest.candidates.nodes, wanted)
        )
        candidates = Candidates(finest.candidates.points[members], finest.candidates.nodes[members])
        self.pools, self.known = [Pool(candidates, members, np.empty(0), 0)], None

    def at_hand(self, i: int) -> AtHand:
        """Return what level i is drawn from."""
        p = self.pool_for(i)
        pool = self.pools[p]
        candidate_of = np.full(len(self.points), -1)
        candidate_of[pool.candidates.nodes] = np.arange(len(pool.candidates.nodes))
        for v, copies in enumerate(self.domain.copies):
            candidate_of[copies] = v
        is_first = p > 0 and i == p + self.lag
        # the level that first draws from a pool bears its cost
        visits = len(pool.candidates.nodes) + (pool.visits if is_first else 0)
        if i == 1 and self.options.candidates == "pool":
            return AtHand(pool, self.first_set()[0], candidate_of, visits, self.first_set()[1])
        return AtHand(pool, pool.f if is_first else self.spacing_in(i, pool), candidate_of, visits, None)

    def choose(self, i: int, seeds: Choice) -> Chosen:
        """Select the nodes of level i."""
        at = self.at_hand(i)
        choice, f, inside = select(self.domain, at.pool.candidates, at.f, seeds, at.candidate_of, self.rules, at.first)
        return Chosen(choice, f, inside, at)

    def draw(self, i: int, seeds: Choice) -> tuple[Chosen, Triangulated]:
        """Select, triangulate and better level i."""
        chosen = self.choose(i, seeds)
        choice, candidates, candidate_of = chosen.choice, chosen.at.pool.candidates, chosen.at.candidate_of
        level = triangulate(self.domain, self.points, choice)
        if self.min_angle is None:
            return chosen, level
        facets = len(self.domain)
        inner = level.sites >= facets
        sites = level.sites.copy()
        sites[inner] = candidate_of[level.sites[inner] - facets]
        apex = {(int(sites[u]), int(sites[v])): int(sites[w]) for (u, v), w in level.apex.items()}
        taken = np.zeros(len(candidates.points), np.bool_)
        taken[sites] = True
        seeded = np.zeros(len(taken), np.bool_)
        seeded[:facets] = seeds.kept
        seeded[candidate_of[seeds.interior]] = True
        slope = 1.0 if self.options.method == "threshold" else self.rules.gradation
        rule = Rule(self.min_angle, self.rules.beta, slope, max(1.0 / self.options.factor, 0.5))
        scene = Scene(self.domain, candidates, chosen.f, chosen.inside, seeds, seeded)
        done = better(scene, rule, choice, apex, taken)
        for k, room in done.crowded.items():
            done.choice.hold(int(candidates.nodes[k]), room)
        f = lowered(candidates, chosen.f, done.crowded, self.rules.gradation)
        chosen = replace(chosen, choice=done.choice, f=f)
        taken[:facets] = done.choice.kept
        taken[facets:] = np.isin(candidates.nodes[facets:], done.choice.interior)
        here = np.flatnonzero(taken)
        index = {int(k): s for s, k in enumerate(here)}
        apex = {(index[u], index[v]): index[w] for (u, v), w in done.apex.items()}
        cells = [(index[u], index[v], index[w]) for u, v, w in done.cells]
        sites = np.where(here < facets, here, facets + candidates.nodes[here])
        return chosen, Triangulated(sites, cells, apex)

    def level(self, i: int, seeds: Choice) -> tuple[dict[str, Any], Choice]:
        """Make level i."""
        chosen, level = self.draw(i, seeds)
        mesh = assemble(self.domain, chosen.choice, level)
        spacing = chosen.f[chosen.at.candidate_of[mesh.nodes]]
        return as_dict(mesh, power(self.options.factor, i), spacing, chosen.at.visits), chosen.choice

    def n_cells(self, i: int) -> int:
        """Return the number of cells of level i on its own, by Euler's formula."""
        choice = self.choose(i, self.no_seeds()).choice
        boundary = 0
        for chord in choice.chords:
            edge = self.domain.chains[chord.chain].edge(chord.start)
            boundary += 0 if edge.interior else sum(side.is_inside for side in edge.sides)
        return max(2 * (choice.size(self.domain) - self.euler) - boundary, 0)

    def no_seeds(self) -> Choice:
        """Return a choice of nothing."""
        return Choice(np.zeros(len(self.domain), np.bool_))

    def roughly(self) -> int:
        """Return a depth to begin a search with: pools tell it without a selection on the fine levels."""
        depth = 1
        if self.options.candidates == "pool":
            # a pool of interior nodes holds about C^2m nodes for each of its level
            share, facets = power(self.options.factor, 2 * self.lag), len(self.domain)
            while True:
                p = self.pool_for(depth)
                now, before = (len(self.pools[q].members) - facets for q in (p, max(p - 1, 0)))
                if now <= share * self.options.coarsest or (p > 0 and now > STALL * before) or depth == MAX_LEVELS:
                    break
                depth += 1
        return depth

    def depth(self) -> int:
        """Return the depth of a hierarchy of open depth."""
        coarsest, sizes = self.options.coarsest, {0: len(self.cells)}

        def size(i: int) -> int:
            if i not in sizes:
                sizes[i] = self.n_cells(i)
            return sizes[i]

        depth = self.roughly()
        while depth > 1 and not (size(depth - 1) > coarsest and size(depth) <= STALL * size(depth - 1)):
            depth -= 1
        while True:
            now = size(depth)
            if now <= coarsest:
                return depth
            if depth == MAX_LEVELS or size(depth + 1) > STALL * now:
                # not even the first level may be worth having
                return depth if depth > 1 or now <= STALL * len(self.cells) else 0
            depth += 1

    def levels(self, depth: int, seeds: Choice) -> list[dict[str, Any]]:
        """Make levels 1 to `depth`, coarsest first, keeping the nodes of `seeds`; return them finest first."""
        levels: list[dict[str, Any]] = []
        for i in range(depth, 0, -1):
            level, choice = self.level(i, seeds)
            seeds = choice if self.options.nested else seeds
            levels.insert(0, level)
        return levels

    def build(self) -> Made:
        """Build the levels."""
        depth = self.depth() if self.options.levels is None else self.options.levels
        return self.ended(self.levels(depth, self.no_seeds()))

    def ended(self, levels: list[dict[str, Any]]) -> Made:
        """Return levels as a hierarchy: one of open depth ends at the first of at most `coarsest` cells."""
        g = self.at_nodes(self.g)
        if self.options.levels is not None:
            return levels, "levels", g
        for k, level in enumerate(levels):
            if len(level["cells"]) <= self.options.coarsest:
                return levels[: k + 1], "coarsest", g
        return levels, "stalled", g


def candidate_nodes(points: Floats, domain: Domain) -> Ints:
    """Return the nodes of the candidates: facet vertices, then interior nodes by leaves of the tree of all of them."""
    on_facet = np.zeros(len(points), np.bool_)
    for copies in domain.copies:
        on_facet[copies] = True
    first = np.array([copies[0] for copies in domain.copies], np.int64)
    nodes = np.concatenate([first, np.flatnonzero(~on_facet)])
    order = leaf_order(points[nodes])
    return np.concatenate([first, nodes[order[order >= len(first)]]])


def subset(pool: Pool, picked: Ints) -> Pool:
    """Return some of a pool's candidates as a pool, without f."""
    candidates = Candidates(pool.candidates.points[picked], pool.candidates.nodes[picked])
    return Pool(candidates, pool.members[picked], np.empty(0), 0)


def as_dict(mesh: LevelMesh, factor: float, spacing: Floats, visits: int) -> dict[str, Any]:
    """Return a level as it crosses the border to `coarsen.multilevel`."""
    return {**vars(mesh), "factor": factor, "spacing": spacing, "visits": visits}
