"""Conflict graph (Definition 3.5) and greedy maximal independent sets.

Two points conflict where ``0 < |p - q| < (f(p) + f(q)) / beta``, strictly. Points at a distance of 0 count as one: they
don't conflict with each other, so the two sides of a slit stay or go together.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .kdtree import Blocks, parts
from .point import Bools, Floats, Ints, distance

TILE = 16_384
"""The most points of a tile, until there are `MOST_TILES` of them."""

MOST_TILES = 256

ROOM = 1.0 + 1e-9
"""Room for rounding in "inside its tile by more than f / beta"."""


def _conflict(points: Floats, f: Floats, beta: float, one: Ints | int, others: Ints) -> Bools:
    between = distance(points[one], points[others])
    conflict: Bools = (between > 0.0) & (between < (f[one] + f[others]) / beta)
    return conflict


def conflict_graph(points: Floats, f: Floats, beta: float, threads: int | None = None) -> Ints:
    """Return the edges of the conflict graph, shape (e, 2): each once, i < j, sorted."""
    blocks = Blocks(points)
    most = blocks.greatest(f)
    edges = [np.empty((0, 2), np.int64)]
    for k, own in enumerate(blocks.members):
        near = np.sqrt(blocks.distances_2(blocks.low[k], blocks.high[k])) < (most[k] + most) / beta
        for other in np.flatnonzero(near):
            i, j = np.nonzero(_conflict(points, f, beta, own[:, None], blocks.members[other][None]))
            pairs = np.column_stack([own[i], blocks.members[other][j]])
            edges.append(pairs[pairs[:, 0] < pairs[:, 1]])
    graph = np.concatenate(edges)
    return graph[np.lexsort((graph[:, 1], graph[:, 0]))]


def greedy(points: Floats, f: Floats, beta: float, order: Ints, keep: Ints) -> Ints:
    """Return those of `order` that join: each in turn, unless it conflicts with one that is in, as all of `keep` are.

    Points in neither list take no part, whatever their f.
    """
    free = np.zeros(len(points), np.bool_)
    free[order] = True
    free[keep] = False
    taking_part = np.union1d(order, keep)
    blocks = Blocks(points[taking_part])
    most = blocks.greatest(f[taking_part])
    members = [taking_part[some] for some in blocks.members]
    selected = []
    for count, i in enumerate(np.concatenate([keep, order]).astype(np.int64)):
        if count >= len(keep):
            if not free[i]:
                continue
            selected.append(i)
            free[i] = False
        near = np.sqrt(blocks.distances_2(points[i], points[i])) < (f[i] + most) / beta
        for k in np.flatnonzero(near):
            others = members[k][free[members[k]]]
            free[others[_conflict(points, f, beta, i, others)]] = False
    return np.array(selected, np.int64)


def rank(order: Ints, f: Floats) -> Ints:
    """Return candidates by descending f in steps of an eighth of an octave, ties by candidate."""
    ranked: Ints = order[np.lexsort((order, -_step(f[order])))]
    return ranked


def _step(f: Floats) -> Ints:
    """Return the step of a spacing: exponent and first three bits of the mantissa."""
    return f.view(np.int64) >> 49


def greedy_in_tiles(points: Floats, f: Floats, beta: float, order: Ints, keep: Ints) -> Ints:
    """Return a maximal independent set among `order` after all of `keep`, ascending.

    The order is that of `rank`, but within a step those candidates come first that lie inside their tile by more than
    f / beta, tile by tile: such ones of different tiles never conflict, so that the core works on all tiles at once.
    """
    tiles = parts(points, max(TILE, -(-len(points) // MOST_TILES)))
    place = np.full(len(points), len(tiles))
    low, high = points.min(axis=0), points.max(axis=0)
    for number, tile in enumerate(tiles):
        own = points[tile]
        below, above = own.min(axis=0), own.max(axis=0)
        reach = (f[tile] * ROOM)[:, None]
        deep = (below == low) | ((own - below) * beta > reach)
        deep &= (above == high) | ((above - own) * beta > reach)
        place[tile[deep.all(axis=1)]] = number
    return np.sort(greedy(points, f, beta, order[np.lexsort((order, place[order], -_step(f[order])))], keep))


def greedy_after(points: Floats, f: Floats, beta: float, order: Ints, keep: Ints, first: Ints) -> Ints:
    """Return a maximal independent set among `order` after all of `keep`, ascending: those of `first` before others."""
    begun = greedy(points, f, beta, np.intersect1d(order, first), keep)
    others = greedy_in_tiles(points, f, beta, np.setdiff1d(order, first), np.concatenate([keep, begun]))
    return np.sort(np.concatenate([begun, others]))


def conflicting(points: Floats, f: Floats, beta: float, of: Ints, others: Ints) -> Ints:
    """Return those of `others` that conflict with one of `of`, ascending."""
    if not len(others):
        return others
    blocks = Blocks(points[others])
    most = blocks.greatest(f[others])
    found = np.zeros(len(points), np.bool_)
    for i in of.tolist():
        near = np.sqrt(blocks.distances_2(points[i], points[i])) < (f[i] + most) / beta
        for k in np.flatnonzero(near):
            some = others[blocks.members[k]]
            found[some[_conflict(points, f, beta, i, some)]] = True
    return np.flatnonzero(found)


def independent_set(
    points: Floats, f: Floats, beta: float, rank: Ints | None, keep: Ints | None, threads: int | None = None
) -> Ints:
    """Return the greedy maximal independent set of all points by (rank, index) after `keep`, ascending."""
    n = len(points)
    order = np.arange(n) if rank is None else np.lexsort((np.arange(n), rank))
    kept = np.empty(0, np.int64) if keep is None else keep
    return np.union1d(kept, greedy(points, f, beta, order, kept))


def skeleton_independent_set(n_points: int, cells: npt.NDArray[np.integer]) -> Ints:
    """Return the greedy maximal independent set by index on the edges of a mesh: the baseline of Table 2."""
    around: list[set[int]] = [set() for _ in range(n_points)]
    for cell in cells.tolist():
        for node in cell:
            around[node].update(cell)
    blocked: set[int] = set()
    selected = []
    for node in range(n_points):
        if node not in blocked:
            selected.append(node)
            blocked |= around[node]
    return np.array(selected, np.int64)
