"""The gap of the domain at its facet vertices.

The gap at p is the distance to the nearest facet vertex q that is near in space but not along the facets:
``|p - q| < GAMMA * length``, with the length measured along their common chain, through a junction that their chains
share, or infinite. At a corner the nearest other corner bounds it too: both stay, and the edge between them with them.
A closed chain bounds it by a quarter of its length: three vertices stay on it, whatever the spacing.
"""

from __future__ import annotations

import numpy as np

from .domain import Domain
from .point import Floats, distance
from .spacing import nearest

GAMMA = 0.65
LOOP = 4.0

Way = tuple[int, float, float]
"""A way from a vertex into a chain: the chain, the arc at which it enters, the length before it."""


def gaps(domain: Domain) -> Floats:
    """Return the gap at every facet vertex, infinite where there is none."""
    gap = np.full(len(domain), np.inf)
    if not len(domain):
        return gap
    # all places on chains, one chain after the other
    start = np.cumsum([0] + [len(chain.vertices) for chain in domain.chains])
    vertex = np.concatenate([chain.vertices for chain in domain.chains])
    points = domain.points[vertex]
    for v in range(len(domain)):
        along = np.full(len(vertex), np.inf)
        for c, arc, before in ways(domain, v):
            chain, own = domain.chains[c], slice(start[c], start[c + 1])
            length = np.abs(chain.arc[: len(chain.vertices)] - arc)
            if chain.closed:
                length = np.minimum(length, chain.length - length)
            along[own] = np.minimum(along[own], before + length)
        through = distance(points, domain.points[v])
        near = (vertex != v) & (through < GAMMA * along)
        gap[v] = np.min(through, where=near, initial=np.inf)
    corners = np.flatnonzero(domain.corner)
    gap[corners] = np.minimum(gap[corners], nearest(domain.points[corners]))
    for chain in domain.chains:
        if chain.closed:
            gap[chain.vertices] = np.minimum(gap[chain.vertices], chain.length / LOOP)
    return gap


def ways(domain: Domain, v: int) -> list[Way]:
    """Return the ways along the facets from a vertex into its chain and into those that share a junction with it."""
    c, k = domain.place[v]
    chain = domain.chains[c]
    arc = float(chain.arc[k])
    if chain.closed:
        return [(c, arc, 0.0)]
    if v in domain.ends:
        return _entries(domain, v, 0.0)
    ends = _entries(domain, chain.vertices[0], arc) + _entries(domain, chain.vertices[-1], chain.length - arc)
    return [(c, arc, 0.0), *ends]


def _entries(domain: Domain, junction: int, before: float) -> list[Way]:
    return [(c, domain.chains[c].length if at_end else 0.0, before) for c, at_end in domain.ends[junction]]
