"""Layers of stretched cells, as they are made along walls of flows, thinned until cells are no needles.

Interior nodes of needles (cells of angles under `NEEDLE_DEG`) are selected once more by the conflict rule with half the
needle's length as the spacing; and a node over a wall whose angle over the wall's ends is that small is taken out.
"""

from __future__ import annotations

import math

import numpy as np

from .drop_trim import Trimmed, edges_of
from .selection import greedy

NEEDLE_DEG = 7.5
"""Cells under this angle are needles, in degrees."""
BETA = 2.0
"""With this two nodes conflict that are nearer than the mean of their spacings."""
SHARE = 0.5
"""Spacing of the nodes that stay, as a share of the needle's length."""


def thinned(trimmed: Trimmed, facets: int) -> set[int]:
    """Return the interior sites that go so that needles vanish; `facets` is the number of facet vertices."""
    room: dict[int, float] = {}
    over: set[int] = set()
    for cell in trimmed.alive():
        if trimmed.angle(cell) >= NEEDLE_DEG:
            continue
        p = trimmed.corners(cell)
        sides = [(p[k], p[(k + 1) % 3]) for k in range(3)]
        length = [math.sqrt((b[0] - a[0]) * (b[0] - a[0]) + (b[1] - a[1]) * (b[1] - a[1])) for a, b in sides]
        for k, (u, v) in enumerate(edges_of(cell)):
            room[cell[k]] = max(room.get(cell[k], 0.0), SHARE * max(length))
            opposite = cell[(k + 2) % 3]
            is_wall = trimmed.across(u, v) is None and (u, v) in trimmed.on_edge
            if is_wall and length[k] > min(length) and trimmed.sites[opposite] >= facets:
                over.add(opposite)
    marked = sorted(set(room) - over)
    if not marked:
        return over
    inside = [k for k, s in enumerate(marked) if trimmed.sites[s] >= facets]
    inside.sort(key=lambda k: (-room[marked[k]], trimmed.sites[marked[k]]))
    keep = [k for k, s in enumerate(marked) if trimmed.sites[s] < facets]
    points = np.array([trimmed.points[s] for s in marked], np.float64)
    rooms = np.array([room[s] for s in marked])
    stays = greedy(points, rooms, BETA, np.array(inside, np.int64), np.array(keep, np.int64))
    return over | {marked[k] for k in set(inside) - set(stays.tolist())}
