"""ONE_LEVEL_COARSEN (Figure 2), on domains with facets.

(1) Classes P0 (corners), P1 (other facet vertices), P2 (interior nodes); (2) f is given at all candidates; (3) facet
vertices are selected first, P0 kept whole, then P1 greedily; vertices are put back until their chords are a valid
coarse domain; (4) the interior candidates keep away from the *coarse* facets by delta * f and stay inside; (5) a
maximal independent set of their conflict graph, after all that was kept before; (6) the constrained Delaunay
triangulation of what is kept, cells outside flooded away.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from .chords import Chord, holds, repair
from .domain import Domain, Side, segment_distance_2
from .point import NONE, Bools, Floats, Ints, distance
from .selection import conflict_graph, greedy, greedy_after, rank
from .triangulation import Edge, Triangulation

MOST_ROUNDS = 4
"""Rounds of selecting facet vertices, each after f was held down where the last left them crowded."""


@dataclass(frozen=True)
class Candidates:
    """The candidates of a level: candidate v is facet vertex v, then come interior nodes."""

    points: Floats
    nodes: Ints
    """Their nodes (the first copy of a facet vertex)."""


@dataclass(frozen=True)
class Rules:
    """The parameters of Figure 2."""

    beta: float
    delta: float
    gradation: float
    hold: bool
    """Whether f is held down where kept facet vertices are crowded."""


@dataclass
class Choice:
    """What a level keeps."""

    kept: Bools
    """By facet vertex."""
    interior: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    """Interior nodes."""
    chords: list[Chord] = field(default_factory=list)
    held: dict[int, float] = field(default_factory=dict)
    """Nodes that hold f down, and what they hold it under, on this level and the coarser ones."""
    surplus: int = 0
    """Nodes that the quality guard added, here and on the coarser levels."""

    def hold(self, node: int, room: float) -> None:
        """Have a node hold f down."""
        self.held[node] = min(room, self.held.get(node, np.inf))

    def size(self, domain: Domain) -> int:
        """Return the number of nodes, copies counted."""
        return sum(len(domain.copies[v]) for v in np.flatnonzero(self.kept)) + len(self.interior)


def select(
    domain: Domain,
    candidates: Candidates,
    f: Floats,
    seeds: Choice,
    candidate_of: Ints,
    rules: Rules,
    first: Ints | None,
) -> tuple[Choice, Floats, Bools]:
    """Select a level's nodes among the candidates, keeping `seeds`, the next coarser level's.

    A level begins with the independent set `first` of the interior candidates, where there is one.
    Also returns f as it was held, and which candidates are interior and in the coarse domain, however near to its rim.

    Where kept facet vertices conflict (corners, vertices put back, seeds), and `rules.hold` asks for it, f is held
    under beta/2 of their distance there, rising with the gradation as everywhere: cells at a short chord are small.
    """
    seeded = candidate_of[seeds.interior]
    kept = domain.corner | seeds.kept
    choice = Choice(kept, held=dict(seeds.held))
    held = {int(candidate_of[node]): room for node, room in choice.held.items()}
    f = lowered(candidates, f, held, rules.gradation)
    for round_ in range(1, MOST_ROUNDS + 1):
        keep = np.concatenate([np.flatnonzero(kept), seeded])
        order = rank(np.flatnonzero(~kept), f)
        kept[greedy(candidates.points, f, rules.beta, order, keep)] = True
        chords = repair(domain, kept, candidates.points[seeded], rules.hold)
        if not rules.hold or round_ == MOST_ROUNDS:
            break
        crowded = crowded_vertices(domain, kept, f, rules.beta)
        if not crowded:
            break
        f = lowered(candidates, f, crowded, rules.gradation)
        for v, room in crowded.items():
            choice.hold(int(candidates.nodes[v]), room)

    interior, inside = select_interior(domain, candidates, f, seeds, candidate_of, kept, chords, rules, first)
    return replace(choice, interior=interior, chords=chords), f, inside


def select_interior(
    domain: Domain,
    candidates: Candidates,
    f: Floats,
    seeds: Choice,
    candidate_of: Ints,
    kept: Bools,
    chords: list[Chord],
    rules: Rules,
    first: Ints | None,
) -> tuple[Ints, Bools]:
    """Return the seeds' interior nodes and those selected after them and the kept facet vertices: steps (4), (5).

    Also returns which candidates are interior and in the coarse domain.
    """
    seeded = candidate_of[seeds.interior]
    inside, near = places(domain, candidates, f, chords, rules.delta)
    free = inside & ~near
    free[seeded] = False
    keep = np.concatenate([np.flatnonzero(kept), seeded])
    begun = np.empty(0, np.int64) if first is None else first
    chosen = greedy_after(candidates.points, f, rules.beta, np.flatnonzero(free), keep, begun)
    return np.concatenate([seeds.interior, candidates.nodes[chosen]]), inside


def crowded_vertices(domain: Domain, kept: Bools, f: Floats, beta: float) -> dict[int, float]:
    """Return the kept facet vertices that conflict with another, and beta/2 of the distance to the nearest such."""
    vertices = np.flatnonzero(kept)
    points = domain.points[vertices]
    room = np.full(len(vertices), np.inf)
    edges = conflict_graph(points, f[vertices], beta)
    rooms = beta / 2.0 * distance(points[edges[:, 0]], points[edges[:, 1]])
    for k in (0, 1):
        np.minimum.at(room, edges[:, k], rooms)
    return {int(v): float(least) for v, least in zip(vertices, room, strict=True) if least < f[v]}


def lowered(candidates: Candidates, f: Floats, rooms: dict[int, float], gradation: float) -> Floats:
    """Return min(f, room + L |v - x|) over candidates v with their room."""
    f = f.copy()
    for v, room in rooms.items():
        f = np.minimum(f, room + gradation * distance(candidates.points[v], candidates.points))
    return f


def places(domain: Domain, candidates: Candidates, f: Floats, chords: list[Chord], delta: float) -> tuple[Bools, Bools]:
    """Whether candidates are interior nodes that lie in the coarse domain; whether they are within delta * f of it."""
    inside = np.arange(len(f)) >= len(domain)
    near = np.zeros(len(f), np.bool_)
    reach_2 = (delta * f) * (delta * f)
    for chord in chords:
        a, b = domain.points[list(chord.vertices)]
        near |= segment_distance_2(candidates.points, a, b) < reach_2
        if chord.deviation_2 > 0.0:
            inside &= ~holds(domain, chord, candidates.points)
    return inside, near


# --- from the choice to a mesh ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LevelMesh:
    """A coarse mesh in the terms of the input's nodes, as the border to `coarsen.multilevel` wants it."""

    nodes: Ints
    cells: Ints
    cell_tags: Ints
    facets: Ints
    facet_cells: Ints
    given: Bools
    facet_tags: Ints
    n_boundary: int


@dataclass(frozen=True)
class Triangulated:
    """A triangulated choice: sites are facet vertices v, then interior nodes as len(domain) + node."""

    sites: Ints
    cells: list[tuple[int, int, int]]
    apex: dict[Edge, int]
    """What lies to the left of every edge of the cells, and of nothing else."""


def triangulate(domain: Domain, points: Floats, choice: Choice) -> Triangulated:
    """Triangulate a choice; facet vertices are put back where a chord can't be an edge."""
    while True:
        vertices = np.flatnonzero(choice.kept)
        sites = np.concatenate([vertices, len(domain) + choice.interior])
        triangulation = Triangulation(np.concatenate([domain.points[vertices], points[choice.interior]]))
        site_of = {int(v): k for k, v in enumerate(vertices)}
        ends = [(site_of[chord.vertices[0]], site_of[chord.vertices[1]]) for chord in choice.chords]
        failed = [chord for chord, (a, b) in zip(choice.chords, ends, strict=True) if not triangulation.constrain(a, b)]
        if not failed:
            return Triangulated(sites, *flood(domain, choice.chords, ends, triangulation))
        for chord in failed:
            if not chord.splits:
                raise RuntimeError(f"facet edge {chord.vertices} can't be kept")
            choice.kept[chord.farthest] = True
        choice.chords = repair(domain, choice.kept, points[choice.interior], wide=False)


def flood(
    domain: Domain, chords: list[Chord], ends: list[Edge], triangulation: Triangulation
) -> tuple[list[tuple[int, int, int]], dict[Edge, int]]:
    """Return the cells inside: those left or right of a chord with cells on that side, and on up to the next wall."""
    walls: set[Edge] = set()
    waiting: list[Edge] = []
    for chord, (a, b) in zip(chords, ends, strict=True):
        edge = domain.chains[chord.chain].edge(chord.start)
        if not edge.interior:
            walls |= {(a, b), (b, a)}
        waiting += [way for way, side in zip([(a, b), (b, a)], edge.sides, strict=True) if side.is_inside]
    cells, apex = [], {}
    while waiting:
        u, v = waiting.pop()
        if (u, v) in apex:
            continue
        w = triangulation.apex[u, v]
        if w == NONE:
            raise RuntimeError("the flood of the domain left the convex hull")
        cells.append((u, v, w))
        for a, b, c in ((u, v, w), (v, w, u), (w, u, v)):
            apex[a, b] = c
            if (a, b) not in walls:
                waiting.append((b, a))
    return cells, apex


def assemble(domain: Domain, choice: Choice, level: Triangulated) -> LevelMesh:
    """Turn sites into node copies, carry tags to cells, list the facets."""
    facets = len(domain)
    vertices = level.sites[level.sites < facets]
    nodes = np.sort(np.concatenate([choice.interior, *[np.array(domain.copies[v]) for v in vertices]])).astype(np.int64)
    site_of = {int(s): k for k, s in enumerate(level.sites)}
    # what lies beside each chord: (u, v) in sites -> (chord, side)
    beside: dict[Edge, tuple[Chord, int]] = {}
    for chord in choice.chords:
        a, b = (site_of[v] for v in chord.vertices)
        beside[a, b], beside[b, a] = (chord, 0), (chord, 1)
    walls = {edge for edge, (chord, _) in beside.items() if not domain.chains[chord.chain].edge(chord.start).interior}

    def copy_at(site: int, u: int) -> int:
        """Return the node of a site in the cell left of its edge to u: turn clockwise to the wall, ask its side."""
        if level.sites[site] >= facets:
            return int(level.sites[site]) - facets
        copies = domain.copies[level.sites[site]]
        if len(copies) == 1:
            return int(copies[0])
        while (site, u) not in walls:
            u = level.apex[u, site]
        chord, side = beside[site, u]
        chain = domain.chains[chord.chain]
        first, last = chain.edge(chord.start).sides[0], chain.edge(chord.stop - 1).sides[1]
        return int(first.tail if side == 0 else last.head)

    cells = np.array([[copy_at(u, v), copy_at(v, w), copy_at(w, u)] for u, v, w in level.cells], np.int64).reshape(
        -1, 3
    )
    cell_of = {}
    for t, (u, v, w) in enumerate(level.cells):
        cell_of.update({(u, v): t, (v, w): t, (w, u): t})

    # tags come in from the sides of chords and spread up to the next chord
    tags = np.zeros(len(cells), np.int64)
    known = np.zeros(len(cells), np.bool_)
    waiting = []
    for edge, (chord, side) in beside.items():
        if edge in cell_of:
            waiting.append((cell_of[edge], domain.chains[chord.chain].edge(chord.start).sides[side].cell_tag))
    while waiting:
        t, tag = waiting.pop()
        if known[t]:
            continue
        tags[t], known[t] = tag, True
        u, v, w = level.cells[t]
        for a, b in ((u, v), (v, w), (w, u)):
            if (a, b) not in beside:
                waiting.append((cell_of[b, a], tag))

    rows: list[tuple[bool, list[int], list[int], Side]] = []
    for chord in choice.chords:
        chain = domain.chains[chord.chain]
        first, last = chain.edge(chord.start), chain.edge(chord.stop - 1)
        a, b = (site_of[v] for v in chord.vertices)
        left, right = first.sides
        if left.is_inside:
            beyond = cell_of[b, a] if first.interior else NONE
            rows.append((first.interior, [left.tail, last.sides[0].head], [cell_of[a, b], beyond], left))
        if right.is_inside and not first.interior:
            rows.append((False, [last.sides[1].head, right.tail], [cell_of[b, a], NONE], right))
    rows.sort(key=lambda row: row[0])
    return LevelMesh(
        nodes,
        np.searchsorted(nodes, cells),
        tags,
        np.searchsorted(nodes, np.array([row[1] for row in rows], np.int64).reshape(-1, 2)),
        np.array([row[2] for row in rows], np.int64).reshape(-1, 2),
        np.array([row[3].given for row in rows], np.bool_),
        np.array([row[3].tag for row in rows], np.int64),
        sum(not row[0] for row in rows),
    )
