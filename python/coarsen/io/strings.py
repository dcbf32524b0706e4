"""Facets as strings of nodes: each as long as it goes, ends at a node of one or of more than two facets, or closed."""

from __future__ import annotations

from collections import defaultdict
from typing import Any


def node_strings(facets: Any) -> list[list[int]]:
    """Chain directed or undirected edges; a closed string repeats its first node at its end.

    Strings keep the direction of the edge they start with; the order is that of the edges.
    """
    edges = [(int(a), int(b)) for a, b in facets]
    at: dict[int, list[int]] = defaultdict(list)
    for number, (a, b) in enumerate(edges):
        at[a].append(number)
        at[b].append(number)
    used = [False] * len(edges)

    def walk(first: int, start: int) -> list[int]:
        nodes, edge, node = [start], first, start
        while True:
            used[edge] = True
            a, b = edges[edge]
            node = b if node == a else a
            nodes.append(node)
            following = [other for other in at[node] if not used[other]]
            if len(at[node]) != 2 or not following:
                return nodes
            edge = following[0]

    strings = []
    for number, (a, b) in enumerate(edges):  # first those with ends, from their first node on, then the rings
        if used[number]:
            continue
        if len(at[a]) != 2:
            strings.append(walk(number, a))
        elif len(at[b]) != 2 and not _leads_from(edges, at, number):
            strings.append(walk(number, b)[::-1])
    strings += [walk(number, a) for number, (a, _) in enumerate(edges) if not used[number]]
    return strings


def _leads_from(edges: list[tuple[int, int]], at: dict[int, list[int]], last: int) -> bool:
    """Whether the string that ends with this edge starts with an edge directed along it, which starts the walk."""
    edge, node = last, edges[last][0]
    while len(at[node]) == 2:
        edge = next(other for other in at[node] if other != edge)
        a, b = edges[edge]
        node = b if node == a else a
    return edges[edge][0] == node
