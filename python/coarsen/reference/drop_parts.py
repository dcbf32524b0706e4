"""Parts of the input, which no level joins.

Cells that share an edge are of one part; parts may touch at single nodes or along lines of doubled nodes. A cell of a
level is of a part that all three of its corners belong to, and where there is none it is no cell: a gap between two
parts stays open however narrow it is. Cells of different parts are no neighbours, even where they share an edge of
vertices: each has its own copies there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .domain import Domain
from .drop_trim import Trimmed, edges_of
from .patch import Cell
from .point import Ints


@dataclass(frozen=True)
class Parts:
    """The parts of a mesh: those that each node belongs to, named by their first cells."""

    of_node: list[set[int]]
    count: int
    group: Ints
    """For each node a number of its part, the same for parts that share a place."""

    def has(self, node: int, part: int) -> bool:
        """Whether a cell of a part may have a node."""
        return self.count == 1 or part in self.of_node[node]


def parts_of(domain: Domain, n_points: int, cells: Ints) -> Parts:
    """Return the parts of a mesh."""
    rows = [(a, b, c) for a, b, c in cells.tolist()]
    left = {edge: t for t, cell in enumerate(rows) for edge in edges_of(cell)}
    part = [-1] * len(rows)
    of_node: list[set[int]] = [set() for _ in range(n_points)]
    for first in range(len(rows)):
        if part[first] >= 0:
            continue
        part[first] = first
        waiting = [first]
        while waiting:
            t = waiting.pop()
            for node in rows[t]:
                of_node[node].add(first)
            for u, v in edges_of(rows[t]):
                other = left.get((v, u))
                if other is not None and part[other] < 0:
                    part[other] = first
                    waiting.append(other)
    root = {name: name for name in part}

    def top(name: int) -> int:
        while root[name] != name:
            name = root[name]
        return name

    for copies in domain.copies:
        first, *others = sorted({top(name) for node in copies for name in of_node[node]})
        for name in others:
            root[top(name)] = top(first)
    group = np.array([top(min(names, default=0)) for names in of_node], np.int64)
    return Parts(of_node, len(set(part)), group)


def tell_parts(
    parts: Parts,
    domain: Domain,
    trimmed: Trimmed,
    is_allowed: Callable[[int], bool],
    beside: Callable[[Cell], int | None],
) -> None:
    """Tell the part of each cell of a level from the nodes that `is_allowed` admits; cells of none are taken out.

    `beside` is a node that the chord beside a cell has on the cell's side.
    """
    if parts.count == 1:
        trimmed.part = dict.fromkeys(trimmed.cells(), 0)
        return
    facets = len(domain)
    for site in trimmed.sites:
        nodes = [site - facets] if site >= facets else [node for node in domain.copies[site] if is_allowed(node)]
        trimmed.parts_at.append(set().union(*(parts.of_node[node] for node in nodes)))
    unsure: list[tuple[Cell, set[int]]] = []
    trimmed.part = dict.fromkeys(trimmed.cells(), -1)
    for cell in trimmed.cells():
        common = common_parts(trimmed, cell)
        if not common:
            trimmed.label.pop(cell, None)
        elif len(common) == 1:
            trimmed.part[cell] = min(common)
        else:
            node = beside(cell)
            own = set() if node is None else parts.of_node[node]
            if len(own) == 1 and own <= common:
                trimmed.part[cell] = min(own)
            else:
                unsure.append((cell, common))
    # what several parts could have is of the part next to it
    while unsure:
        left = []
        for cell, common in unsure:
            free = [edge for edge in edges_of(cell) if edge not in trimmed.on_edge]
            next_to = [other for edge in free if (other := trimmed.beyond(*edge)) is not None]
            found = [trimmed.part[other] for other in next_to if trimmed.part[other] in common]
            if found:
                trimmed.part[cell] = found[0]
            else:
                left.append((cell, common))
        if len(left) == len(unsure):
            cell, common = left.pop()
            trimmed.part[cell] = min(common)
        unsure = left


def common_parts(trimmed: Trimmed, cell: Cell) -> set[int]:
    """Return the parts that all corners of a cell belong to."""
    u, v, w = (trimmed.parts_at[s] for s in cell)
    return u & v & w


def fits(trimmed: Trimmed, cell: Cell, part: int) -> bool:
    """Whether a cell could be of a part."""
    return not trimmed.parts_at or part in common_parts(trimmed, cell)


def part_again(trimmed: Trimmed, corners: dict[Cell, list[int]]) -> bool:
    """Take out one of two cells of different parts that share an edge of nodes, the smaller; whether there were any.

    `corners` are the nodes of each cell of the level.
    """
    beside: dict[tuple[int, int], Cell] = {}
    lost = set()
    for cell, nodes in corners.items():
        for a, b in edges_of((nodes[0], nodes[1], nodes[2])):
            other = beside.setdefault((min(a, b), max(a, b)), cell)
            if trimmed.part[other] != trimmed.part[cell]:
                lost.add(other if trimmed.area_of(other) < trimmed.area_of(cell) else cell)
    for cell in lost:
        del trimmed.label[cell]
    return bool(lost)
