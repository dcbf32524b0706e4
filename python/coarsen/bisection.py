r"""Longest-edge bisection of right isosceles triangles, the way the paper's own mesh was made.

A cell is a row ``(a, b, c)``, counter-clockwise, whose right angle is at its newest node ``a``; its longest edge is
``bc``. Bisection halves that edge, so every descendant is right and isosceles again, and its midpoints are exact in
floats (Rivara 1984; Mitchell 1991). A round marks cells, then marks the longest edge of every cell that has a marked
edge until nothing changes (the closure), then splits each cell into two, three or four at once::

            a                    a
           / \                  /|\
          /   \      ->        / | \        a cell whose legs are marked too
         /     \              /\ | /\       is split into four
        b-------c            b--\|/--c
            m                    m

All steps are whole-array steps: a million nodes take some seconds.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def bisected(points: Floats, cells: Ints, size: Callable[[Floats], Floats], n_points: int) -> tuple[Floats, Ints]:
    """Bisect where cells are large against a wished size, until the mesh has `n_points` nodes or just under.

    Parameters
    ----------
    points, cells : (n, 2) float, (m, 3) int
        The initial mesh; the right angle of every cell at its first node, and every inner longest edge the longest of
        both its cells.
    size : callable, (m, 2) -> (m,)
        The wished size at a place, up to a constant. Cells are split in the order of area / size².
    n_points : int
        Nodes wanted; the initial mesh is returned where it has as many already.

    Returns
    -------
    points, cells
        Old nodes come first, unmoved.
    """

    def excess_of(points: Floats, cells: Ints) -> Floats:
        corners = points[cells]
        legs = corners[:, 1] - corners[:, 0]
        return np.asarray((legs * legs).sum(axis=1) / size(corners.mean(axis=1)) ** 2)

    excess = excess_of(points, cells)
    place = np.unique(points, axis=0, return_inverse=True)[1].ravel()  # nodes of a slit share theirs
    while True:
        edges, ends = _edges(cells, len(points))
        pair, n_pairs = _pairs(place, ends)
        sides = pair[edges]
        room = n_points - len(points)
        order = np.argsort(-excess, kind="stable")
        wanted = int(np.count_nonzero(excess > excess.max() / 2))
        marked = _closed(sides, order[:wanted], n_pairs)[pair]
        if marked.sum() > room:  # the last rounds: the longest prefix of `order` that still fits
            low, high = 0, wanted
            while high - low > 1:
                middle = (low + high) // 2
                if _closed(sides, order[:middle], n_pairs)[pair].sum() <= room:
                    low = middle
                else:
                    high = middle
            if low == 0:
                return points, cells
            marked = _closed(sides, order[:low], n_pairs)[pair]
        stays = ~marked[edges[:, 0]]
        points, cells = _split(points, cells, edges, ends, marked)
        place = np.concatenate([place, place.max() + 1 + pair[marked]])
        whole = np.count_nonzero(stays)  # these come first
        excess = np.concatenate([excess[stays], excess_of(points, cells[whole:])])


def _pairs(place: Ints, ends: Ints) -> tuple[Ints, int]:
    """Return a number for every edge, one for both banks of a slit: these are marked together."""
    ends = place[ends]
    low, high = ends.min(axis=1), ends.max(axis=1)
    unique, inverse = np.unique(low * (place.max() + 1) + high, return_inverse=True)
    return inverse.ravel(), len(unique)


def _edges(cells: Ints, n_points: int) -> tuple[Ints, Ints]:
    """Edge numbers of every cell, (m, 3), column k opposite to node k, and the ends (e, 2) of every edge."""
    tails, heads = cells[:, [1, 2, 0]].ravel(), cells[:, [2, 0, 1]].ravel()
    keys = np.minimum(tails, heads) * n_points + np.maximum(tails, heads)
    unique, inverse = np.unique(keys, return_inverse=True)
    return inverse.reshape(-1, 3), np.column_stack(np.divmod(unique, n_points))


def _closed(edges: Ints, chosen: Ints, n_edges: int) -> Bools:
    """Mark the longest edges of the chosen cells and of every cell that has a marked edge."""
    marked = np.zeros(n_edges, dtype=bool)
    marked[edges[chosen, 0]] = True
    while True:
        open_ = (marked[edges[:, 1]] | marked[edges[:, 2]]) & ~marked[edges[:, 0]]
        if not open_.any():
            return marked
        marked[edges[open_, 0]] = True


def _split(points: Floats, cells: Ints, edges: Ints, ends: Ints, marked: Bools) -> tuple[Floats, Ints]:
    """Split cells with a marked longest edge, and halves whose longest edges are marked too; whole cells come first."""
    middles = np.full(len(ends), -1, dtype=np.int64)
    middles[marked] = len(points) + np.arange(np.count_nonzero(marked))
    points = np.concatenate([points, points[ends[marked]].mean(axis=1)])
    middle = middles[edges]
    split = middle[:, 0] >= 0
    (a, b, c), (m, m_ca, m_ab) = cells[split].T, middle[split].T
    whole = [cells[~split]]
    for first, second, cut in (
        (a, b, m_ab),
        (c, a, m_ca),
    ):  # halves: right angle at m, longest edge first-second
        again = cut >= 0
        whole.append(np.column_stack([m, first, second])[~again])
        right, old, p, q = cut[again], m[again], first[again], second[again]
        whole += [np.column_stack([right, old, p]), np.column_stack([right, q, old])]
    return points, np.concatenate(whole)
