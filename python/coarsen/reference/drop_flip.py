"""Edges that stopped being facets.

A chord whose two sides ended in one material is an edge like any other, and so must be Delaunay. The cells were
triangulated with every valid chord as a constraint, before it was known which of them still bound anything; flips end
at the constrained Delaunay triangulation of the facets that are left, and no smallest angle of two cells gets worse.
"""

from __future__ import annotations

from collections.abc import Callable

from .drop_trim import Trimmed, canonical, edges_of
from .patch import Cell
from .triangulation import Edge


def free_moot_chords(trimmed: Trimmed, stays: Callable[[int], bool]) -> None:
    """Free the chords that bound nothing; `stays` says which are facets whatever lies beside them."""

    def is_of_one_material(u: int, v: int) -> bool:
        other = trimmed.across(u, v)
        own = canonical(u, v, trimmed.apex[u, v])
        return other is not None and own in trimmed.label and trimmed.label[own] == trimmed.label[other]

    freed: list[Edge] = []
    for cell in trimmed.alive():
        for u, v in edges_of(cell):
            if (u, v) in trimmed.on_edge and not stays(trimmed.on_edge[u, v][0]) and is_of_one_material(u, v):
                del trimmed.on_edge[u, v], trimmed.on_edge[v, u]
                freed.append((u, v))
    trimmed.settle(freed, lambda u, v: (u, v) not in trimmed.on_edge and is_of_one_material(u, v))


def close_slits(trimmed: Trimmed, corners: dict[Cell, list[int]]) -> bool:
    """Make slits with the same nodes on both sides edges like any other; whether there were any.

    `corners` are the nodes of each cell of the level.
    """
    closed = set()
    for cell, own in corners.items():
        for k, (u, v) in enumerate(edges_of(cell)):
            other = trimmed.beyond(u, v)
            if other not in corners or (u, v) not in trimmed.on_edge:
                continue
            chord = trimmed.on_edge[u, v][0]
            ends = [corners[other][other.index(s)] for s in (u, v)]
            if trimmed.is_slit[chord] and ends == [own[k], own[(k + 1) % 3]]:
                closed.add(chord)
    for chord in closed:
        trimmed.is_slit[chord] = False
    return bool(closed)
