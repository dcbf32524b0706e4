"""Which nodes a level of a simplified domain keeps.

Facet vertices come before interior nodes, all under the conflict rule: those that stand out at the scale of f (those
that do so at f/2 too may be twice as near to each other), those that stand out at f/2 only, then the other vertices of
walls and those of interfaces as they follow each other along their chains, last the farthest vertices of wall chords
that change the area by more than `COSTLY`. Vertices of parts that share no vertex do not conflict, and a part that is
no larger than f has no nodes at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .chords import chords_of
from .domain import Domain
from .drop_parts import Parts
from .level import Candidates, Choice, Rules, select_interior
from .loose import is_hole, specks, stands_out, strips, valid_chords
from .point import Bools, Floats, Ints
from .selection import greedy

COSTLY = 0.01
"""A chord that changes the area by a larger share than this is split."""
NEARER = 0.5
"""How near vertices that split a chord may be to each other, and to others."""
PUT_BACK = 3
"""Rounds of that."""


@dataclass(frozen=True)
class Terms:
    """What selection goes by; `barred` are the facet vertices that may not be kept."""

    rules: Rules
    denser: float
    """By how much nodes may be nearer inside."""
    cos_feature: float
    barred: Bools
    parts: Parts


def select_inside(
    domain: Domain,
    candidates: Candidates,
    f: Floats,
    kept: Bools,
    seeds: Choice,
    candidate_of: Ints,
    terms: Terms,
    first: Ints | None = None,
) -> Choice:
    """Select a level's interior nodes beside its facet vertices, keeping the interior nodes of `seeds`.

    The set `first`, with which a level begins, is maximal for the plain beta only.
    """
    facets, rules = len(domain), replace(terms.rules, beta=terms.rules.beta * terms.denser)
    chords = valid_chords(domain, kept, f[:facets], candidates.points[candidate_of[seeds.interior]], [])
    first = first if terms.denser == 1.0 else None
    interior, _ = select_interior(domain, candidates, f, seeds, candidate_of, kept, chords, rules, first)
    lost = _no_larger(domain, terms.parts, specks(domain, f[:facets]))
    interior = (
        interior[[min(terms.parts.of_node[node]) not in lost for node in interior.tolist()]] if lost else interior
    )
    return Choice(kept, interior, chords)


def select_facets(domain: Domain, candidates: Candidates, f: Floats, seeds: Bools, terms: Terms) -> Bools:
    """Select a level's facet vertices, keeping `seeds` (those of the next coarser level)."""
    facets = len(domain)
    kept: Bools = seeds.copy()
    is_speck = specks(domain, f[:facets])
    room = f.copy()
    corners: list[tuple[float, int]] = []
    lesser: list[tuple[float, int]] = []
    rest: set[int] = set()

    def may_stay(v: int) -> bool:
        return not terms.barred[v] and not is_speck[domain.place[v][0]]

    for v in range(facets):
        if kept[v] or not may_stay(v):
            continue
        at_f, at_half = (stands_out(domain, v, scale * float(f[v]), terms.cos_feature) for scale in (1.0, 0.5))
        if at_f is not None:
            corners.append((-at_f, v))
            if at_half is not None:
                room[v] /= 2.0
        elif at_half is not None:
            lesser.append((-at_half, v))
        else:
            rest.add(v)
    points = candidates.points
    if terms.parts.count > 1:
        # each group of parts on a plane of its own, farther apart than any two points conflict
        height = np.zeros(len(points))
        height[:facets] = terms.parts.group[candidates.nodes[:facets]] * (2.0 * f[:facets].max(initial=0.0))
        points = np.column_stack([points, height])

    def join(order: list[int], spacing: Floats) -> bool:
        joined = greedy(points, spacing, terms.rules.beta, np.array(order, np.int64), np.flatnonzero(kept))
        kept[joined] = True
        return len(joined) > 0

    join([v for _, v in sorted(corners)], room)
    walk = along_chains(domain, rest, kept)
    is_inner = [domain.chains[domain.place[v][0]].edges[0].interior for v in walk]
    walls = [v for v, inner in zip(walk, is_inner, strict=True) if not inner]
    interfaces = [v for v, inner in zip(walk, is_inner, strict=True) if inner]
    join([v for _, v in sorted(lesser)] + walls + interfaces, f)
    most = COSTLY * _area(domain)
    for _ in range(PUT_BACK):
        if not join(costly(domain, kept, f, most, may_stay), NEARER * f):
            break
    return kept


def _is_outer(domain: Domain, c: int) -> bool:
    left, right = domain.chains[c].edges[0].sides
    return left.is_inside != right.is_inside


def _no_larger(domain: Domain, parts: Parts, is_speck: list[bool]) -> set[int]:
    """Return the parts whose outer boundary is a speck."""
    lost = set()
    for c, chain in enumerate(domain.chains):
        if is_speck[c] and _is_outer(domain, c) and not is_hole(domain, c):
            lost.add(min(parts.of_node[next(side.tail for side in chain.edges[0].sides if side.is_inside)]))
    return lost


def along_chains(domain: Domain, asked: set[int], kept: Bools) -> list[int]:
    """Return facet vertices in their order along the chains, the longest first, each from its first kept vertex on."""
    walk: dict[int, None] = {}
    for c in sorted(range(len(domain.chains)), key=lambda c: -domain.chains[c].arc[-1]):
        vertices = domain.chains[c].vertices
        start = next((k for k, v in enumerate(vertices) if kept[v]), 0)
        walk.update((int(v), None) for v in [*vertices[start:], *vertices[:start]] if v in asked)
    return list(walk)


def costly(domain: Domain, kept: Bools, f: Floats, most: float, may_stay: Callable[[int], bool]) -> list[int]:
    """Return the farthest vertices of wall chords that change the area by more than `most`, the costliest first."""
    found = []
    for chord in chords_of(domain, kept):
        if (
            chord.vertices[0] == chord.vertices[1]
            or chord.deviation_2 <= 0.0
            or not may_stay(chord.farthest)
            or not _is_outer(domain, chord.chain)
        ):
            continue
        a, b = chord.vertices
        reach = max(float(f[a]), float(f[b]))
        cost = sum(strips(domain, chord))
        if chord.deviation_2 <= reach * reach and cost > most:
            found.append((-cost, chord.farthest))
    return [v for _, v in sorted(found)]


def _area(domain: Domain) -> float:
    ox, oy = domain.points[0] if len(domain) else (0.0, 0.0)
    total = 0.0
    for chain in domain.chains:
        for edge in chain.edges:
            (ax, ay), (bx, by) = ((domain.points[v][0] - ox, domain.points[v][1] - oy) for v in edge.vertices)
            total += (int(edge.sides[0].is_inside) - int(edge.sides[1].is_inside)) * (ax * by - ay * bx) / 2.0
    return total
