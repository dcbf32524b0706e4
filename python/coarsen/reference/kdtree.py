"""Points in blocks of neighbours: what the Rust core's k-d tree is, one level deep; and that tree's own parts.

Median splits along the widest side make blocks of at most `SIZE` points with their tight boxes. A search compares boxes
first and points only where a box can hold an answer. The distance to a box is made of the operations that make the
distance to a point, so that in floats, too, it never exceeds the distance to a point inside: searches are exact.
"""

from __future__ import annotations

import numpy as np

from .point import Floats, Ints

SIZE = 64

LEAF = 24
"""The most points in a leaf of the core's tree."""


class Blocks:
    """Blocks of points, shape (n, d): ``members[k]`` are the indices in block k, ``low[k]``, ``high[k]`` its box."""

    def __init__(self, points: Floats) -> None:
        self.points = points
        self.members: list[Ints] = []
        waiting = [np.arange(len(points))] if len(points) else []
        while waiting:
            some = waiting.pop()
            if len(some) <= SIZE:
                self.members.append(some)
                continue
            axis = int(np.argmax(np.ptp(points[some], axis=0)))
            some = some[np.argsort(points[some, axis], kind="stable")]
            waiting += [some[len(some) // 2 :], some[: len(some) // 2]]
        d = points.shape[1]
        self.low = np.array([points[some].min(axis=0) for some in self.members]).reshape(-1, d)
        self.high = np.array([points[some].max(axis=0) for some in self.members]).reshape(-1, d)

    def __len__(self) -> int:
        return len(self.members)

    def distances_2(self, low: Floats, high: Floats) -> Floats:
        """Return the squared distance of every block's box to one box (to a point where low is high)."""
        with np.errstate(under="ignore", over="ignore"):
            total = np.zeros(len(self.members))
            for k in range(self.points.shape[1]):
                gap = np.maximum(np.maximum(self.low[:, k] - high[k], low[k] - self.high[:, k]), 0.0)
                total = total + gap * gap
        return total

    def least(self, values: Floats) -> Floats:
        """Return the least of some values, shape (n,), in every block."""
        return np.array([values[some].min() for some in self.members])

    def greatest(self, values: Floats) -> Floats:
        """Return the greatest of some values, shape (n,), in every block."""
        return np.array([values[some].max() for some in self.members])


def parts(points: Floats, most: int) -> list[Ints]:
    """Return the nodes of one depth of the core's tree, of up to `most` points each: their members, ascending.

    Median splits along the first widest side of the tight box, ties by index; node j of depth k has the points of rank
    ``j n >> k`` to ``(j + 1) n >> k``. No node is smaller than a leaf.
    """
    n = len(points)
    nodes = [np.arange(n)]
    while -(-n // len(nodes)) > max(most, LEAF):
        halves = []
        for j, node in enumerate(nodes):
            end = [(k * n) // (2 * len(nodes)) for k in (2 * j, 2 * j + 1)]
            some = points[node]
            axis = int(np.argmax(some.max(axis=0) - some.min(axis=0)))
            ranked = node[_order(some[:, [axis]], node)]
            halves += [np.sort(half) for half in np.split(ranked, [end[1] - end[0]])]
        nodes = halves
    return nodes


def leaf_order(points: Floats) -> Ints:
    """Return the points by leaves of the core's tree; within a leaf by coordinates, then index."""
    return np.concatenate([leaf[_order(points[leaf], leaf)] for leaf in parts(points, LEAF)])


def _order(points: Floats, index: Ints) -> Ints:
    """Return the order of points by coordinates, then index; -0.0 goes before 0.0."""
    keys: list[Ints | Floats] = [index]
    for x in points.T[::-1]:
        keys += [~np.signbit(x), x]
    return np.lexsort(keys)
