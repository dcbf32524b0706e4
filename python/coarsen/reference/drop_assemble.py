"""The mesh of a level from its cells: copies of doubled vertices, facets with their tags, what was dropped."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .chords import Chord
from .domain import Domain, Side
from .drop_flip import close_slits, free_moot_chords
from .drop_label import copy_at
from .drop_parts import Parts, part_again
from .drop_trim import Trimmed, after, before_corner, edges_of
from .level import Choice, LevelMesh
from .loose import places, strips
from .patch import Cell
from .point import NONE
from .triangulation import Edge


@dataclass(frozen=True)
class Dropped:
    """What a level of a simplified domain lacks or has too much."""

    loops_closed: int = 0
    """Boundary loops of the input less those of the level."""
    area_gained: float = 0.0
    """Area of the level outside the input."""
    area_lost: float = 0.0
    """Area of the input outside the level."""

    def as_dict(self) -> dict[str, Any]:
        """Return it as it crosses the border to `coarsen.multilevel`."""
        return asdict(self)


@dataclass(frozen=True)
class Origin:
    """What levels are compared with: the input's domain, parts, area and boundary loops."""

    domain: Domain
    parts: Parts
    area: float
    loops: int


def loops(boundary: Iterable[Iterable[int]]) -> int:
    """Return the number of connected pieces of a boundary, by nodes."""
    around: dict[int, list[int]] = defaultdict(list)
    for a, b in boundary:
        around[a].append(b)
        around[b].append(a)
    seen: set[int] = set()
    count = 0
    for first in around:
        if first not in seen:
            count += 1
            waiting = [first]
            while waiting:
                node = waiting.pop()
                if node not in seen:
                    seen.add(node)
                    waiting += around[node]
    return count


def assemble(
    origin: Origin, choice: Choice, trimmed: Trimmed, is_allowed: Callable[[int], bool]
) -> tuple[LevelMesh, Dropped]:
    """Make the mesh of a level. Copies are chosen among the nodes that `is_allowed` admits."""
    domain, chords = origin.domain, choice.chords
    while True:
        corners = _corners(origin, choice, trimmed, is_allowed)
        if part_again(trimmed, corners):
            continue
        if not close_slits(trimmed, corners):
            break
        free_moot_chords(trimmed, lambda c: is_given(domain, chords[c]))
    cells = list(corners)
    nodes = np.unique(np.array(list(corners.values()), np.int64))
    rows = np.searchsorted(nodes, np.array(list(corners.values()), np.int64)).reshape(-1, 3)
    # edges by their nodes, each with its cells and where they have it
    beside: dict[Edge, list[tuple[int, int]]] = defaultdict(list)
    for t, row in enumerate(rows.tolist()):
        for k in range(3):
            a, b = row[k], row[(k + 1) % 3]
            beside[min(a, b), max(a, b)].append((t, k))
    facets: tuple[list[Any], list[Any]] = ([], [])
    """Boundary and interior: ends, cells, tag."""
    for ends in sorted(beside):
        (t, k), *others = beside[ends]
        if len(others) > 1:
            raise RuntimeError(f"an edge of nodes {ends} with {len(others) + 1} cells")
        edge = edges_of(cells[t])[k]
        row = [int(rows[t, k]), int(rows[t, (k + 1) % 3])]
        known = trimmed.on_edge.get(edge)
        tag = None if known is None else attribute(domain, chords[known[0]], known[1])
        if not others:
            if known is None:
                tag = _nearby(domain, [trimmed.sites[s] for s in edge])
            facets[0].append((row, [t, NONE], tag))
            continue
        other = others[0][0]
        if tag is None and known is not None:
            tag = attribute(domain, chords[known[0]], 1 - known[1])
        if tag is not None or trimmed.label[cells[t]] != trimmed.label[cells[other]]:
            facets[1].append((row, [t, other], tag))
    both = facets[0] + facets[1]
    mesh = LevelMesh(
        nodes,
        rows,
        np.array([trimmed.label[cell] for cell in cells], np.int64),
        np.array([row for row, _, _ in both], np.int64).reshape(-1, 2),
        np.array([sides for _, sides, _ in both], np.int64).reshape(-1, 2),
        np.array([tag is not None for _, _, tag in both], np.bool_),
        np.array([tag or 0 for _, _, tag in both], np.int64),
        len(facets[0]),
    )
    return mesh, _dropped(origin, choice, trimmed, mesh)


def _corners(
    origin: Origin, choice: Choice, trimmed: Trimmed, is_allowed: Callable[[int], bool]
) -> dict[Cell, list[int]]:
    """Return the nodes of each cell of the level.

    The cells around a doubled vertex fall into sectors between rim and slits; a sector has the copy that the chord at
    its end has on this side, or the lowest that is allowed.
    """
    domain, parts = origin.domain, origin.parts
    facets = len(domain)
    corners = {cell: [NONE] * 3 for cell in trimmed.alive()}
    for cell, own in corners.items():
        for k, s in enumerate(cell):
            site = trimmed.sites[s]
            if site >= facets:
                own[k] = site - facets
                continue
            copies = domain.copies[site]
            if len(copies) == 1:
                own[k] = copies[0]
            if own[k] != NONE:
                continue
            sector = trimmed.sector(cell, s)
            ends = [((s, after(sector[0], s)), True), ((before_corner(sector[-1], s), s), False)]
            asked = [
                copy_at(domain, choice, *trimmed.on_edge[edge], at_start=at_start)
                for edge, at_start in ends
                if edge in trimmed.on_edge
            ]
            fitting = [
                node
                for node in [*asked, *copies]
                if node != NONE and is_allowed(node) and parts.has(node, trimmed.part[cell])
            ]
            if not fitting:
                raise RuntimeError(f"no copy of facet vertex {site} is left")
            for one in sector:
                corners[one][one.index(s)] = fitting[0]
    return corners


def attribute(domain: Domain, chord: Chord, side: int) -> int | None:
    """Return the facet tag of the longest part of a chord's piece on one of its sides; None where not given."""
    chain = domain.chains[chord.chain]
    side = side if chain.edge(chord.start).sides[side].is_inside else 1 - side
    positions = [k % len(chain.edges) for k in range(chord.start, chord.stop)]
    return _longest((chain.edges[k].sides[side], float(chain.arc[k + 1] - chain.arc[k])) for k in positions)


def is_given(domain: Domain, chord: Chord) -> bool:
    """Whether the user gave a facet along a chord, on one of its sides."""
    return any(attribute(domain, chord, side) is not None for side in (0, 1))


def _nearby(domain: Domain, sites: list[int]) -> int | None:
    """Return the facet tag of a rim edge that is no chord.

    It is that of the boundary between its ends, the shorter way, where they lie on one chain, or else of the boundary
    at one of them.
    """
    at = [places(domain, site) if site < len(domain) else [] for site in sites]
    at = [[(c, k) for c, k in some if not domain.chains[c].edges[0].interior] for some in at]

    def parts(c: int, positions: Iterable[int]) -> Iterable[tuple[Side, float]]:
        chain = domain.chains[c]
        for k in positions:
            side = next((side for side in chain.edges[k].sides if side.is_inside), None)
            if side is not None:
                yield side, float(chain.arc[k + 1] - chain.arc[k])

    for c, a in at[0]:
        b = next((k for other, k in at[1] if other == c), None)
        if b is None:
            continue
        chain = domain.chains[c]
        low, high = min(a, b), max(a, b)
        if chain.closed and 2.0 * (chain.arc[high] - chain.arc[low]) > chain.length:
            return _longest(parts(c, [*range(high, len(chain.edges)), *range(low)]))
        return _longest(parts(c, range(low, high)))
    for c, k in [*at[0], *at[1]]:
        return _longest(parts(c, [min(k, len(domain.chains[c].edges) - 1)]))
    return None


def _longest(sides: Iterable[tuple[Side, float]]) -> int | None:
    """Return the tag of the longest part of some sides, each with its length."""
    lengths: dict[int | None, float] = {}
    for side, length in sides:
        tag = side.tag if side.given else None
        lengths[tag] = lengths.get(tag, 0.0) + length
    return max(lengths, key=lengths.__getitem__, default=None)


def _dropped(origin: Origin, choice: Choice, trimmed: Trimmed, mesh: LevelMesh) -> Dropped:
    """Return what the level lacks.

    Between a chord and its chain areas are exact; what remains of the difference of areas is put down to gain or to
    loss as its sign says.
    """
    rim = {
        trimmed.on_edge[edge][0]
        for cell in trimmed.alive()
        for edge in edges_of(cell)
        if edge in trimmed.on_edge and trimmed.across(*edge) is None
    }
    gained = lost = 0.0
    for c in sorted(rim):
        chord = choice.chords[c]
        left, right = strips(origin.domain, chord)
        inside = [side.is_inside for side in origin.domain.chains[chord.chain].edge(chord.start).sides]
        # where the chain lies left of the chord, what is between is right of the chain
        if inside == [True, False]:
            gained, lost = gained + left, lost + right
        elif inside == [False, True]:
            gained, lost = gained + right, lost + left
    rest = trimmed.area() - origin.area - (gained - lost)
    boundary = mesh.facets[: mesh.n_boundary].tolist()
    return Dropped(max(origin.loops - loops(boundary), 0), gained + max(rest, 0.0), lost + max(-rest, 0.0))
