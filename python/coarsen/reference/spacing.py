"""Spacing functions (Miller, Talmor, Teng 1997, Definitions 3.2 to 3.4), by definition.

Each is a minimum over all points of one rounded formula; blocks of points that can't hold the minimum are passed over.
"""

from __future__ import annotations

import numpy as np

from .kdtree import Blocks
from .point import Floats, distance, distance_2


def nearest(points: Floats, threads: int | None = None) -> Floats:
    """Return NN_P at the points, shape (n,): the least distance over 0 to another point (Definition 3.2).

    Infinite where all points are at one location.
    """
    blocks = Blocks(points)
    g_2 = np.full(len(points), np.inf)
    for low, high, own in zip(blocks.low, blocks.high, blocks.members, strict=True):
        bound = blocks.distances_2(low, high)
        for k in np.argsort(bound, kind="stable"):
            if bound[k] >= g_2[own].max():
                break
            found = distance_2(points[own, None], points[None, blocks.members[k]])
            found[found == 0.0] = np.inf
            g_2[own] = np.minimum(g_2[own], found.min(axis=1))
    g: Floats = np.sqrt(g_2)
    return g


def nearest_at(points: Floats, at: Floats, threads: int | None = None) -> Floats:
    """Return NN_P at any locations, shape (k,): the radius of the smallest closed ball with two points of P in it.

    With p the point nearest to x, that is the least distance from x to a point apart from p.
    """
    radius = np.full(len(at), np.inf)
    for k in range(len(at) if len(points) else 0):
        from_x = distance_2(points, at[k])
        first = points[np.argmin(from_x)]
        apart = distance_2(points, first) > 0.0
        radius[k] = np.sqrt(np.min(from_x, where=apart, initial=np.inf))
    return radius


def coarsened(
    points: Floats, g: Floats, factor: float, gradation: float, at: Floats | None = None, threads: int | None = None
) -> Floats:
    """Return the C-coarsening min_p ( C g(p) + L |p - x| ) at `at`, or at the points (Definition 3.3).

    The paper's slope is L = 1.
    """
    return capped(points, g, None, factor, gradation, points if at is None else at)


def capped(points: Floats, g: Floats, cap: Floats | None, factor: float, gradation: float, at: Floats) -> Floats:
    """Return min_p ( min(C g(p), cap(p)) + L |p - x| ): the C-coarsening, held under `cap` where that is given."""
    with np.errstate(over="ignore"):
        weight = factor * g
    if cap is not None:
        weight = np.minimum(weight, cap)
    sites, queries = Blocks(points), Blocks(at)
    least = sites.least(weight)
    f = np.full(len(at), np.inf)
    for low, high, own in zip(queries.low, queries.high, queries.members, strict=True):
        bound = least + gradation * np.sqrt(sites.distances_2(low, high))
        for k in np.argsort(bound, kind="stable"):
            if bound[k] >= f[own].max():
                break
            some = sites.members[k]
            cones = weight[some] + gradation * distance(at[own, None], points[None, some])
            f[own] = np.minimum(f[own], cones.min(axis=1))
    return f


def threshold(g: Floats, factor: float) -> Floats:
    """Return max(g, C min g), shape (n,) (Definition 3.4)."""
    return np.maximum(g, factor * np.min(g, initial=np.inf))
