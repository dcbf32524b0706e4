"""Points in blocks of neighbours: what the Rust core's k-d tree is, one level deep.

Median splits along the widest side make blocks of at most `SIZE` points with their tight boxes. A search compares boxes
first and points only where a box can hold an answer. The distance to a box is made of the operations that make the
distance to a point, so that in floats, too, it never exceeds the distance to a point inside: searches are exact.
"""

from __future__ import annotations

import numpy as np

from .point import Floats, Ints

SIZE = 64


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
