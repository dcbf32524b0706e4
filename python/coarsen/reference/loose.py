"""Chords and corners where the domain need not be kept in all its features.

Instead of putting vertices back (see `chords`), chords that would make an invalid domain are given up: those that
cross another, that have a kept point between them and their piece of chain, or whose piece changes its kind.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .chords import Chord, area_2, chords_of, is_flipped, offending, piece
from .domain import Chain, Domain, segment_distance_2
from .point import Bools, Floats, Ints, Point


def valid_chords(domain: Domain, kept: Bools, f: Floats, obstacles: Floats, known: list[Chord]) -> list[Chord]:
    """Return the valid ones among the chords of the kept vertices that leave their chain by no more than the spacing f.

    `obstacles`, shape (k, 2), are kept points that are no facet vertices. The chords `known` are valid, and none but
    fewer vertices and obstacles are kept since: they are not given up for the sake of a new one.
    """

    def place(chord: Chord) -> tuple[int, int, int]:
        n = len(domain.chains[chord.chain].vertices)
        return chord.chain, chord.start % n, chord.stop % n

    settled = {place(chord) for chord in known}
    chords = []
    for chord in chords_of(domain, kept):
        a, b = chord.vertices
        reach = max(f[a], f[b])
        if a != b and chord.deviation_2 <= reach * reach and _is_uniform(domain, chord):
            chords.append(chord)
    chords = _without_flat(domain, chords)
    while True:
        fresh = np.array([place(chord) not in settled for chord in chords], np.bool_)
        bad = set(offending(domain, chords, kept, obstacles, fresh))
        if not bad:
            return chords
        chords = [chord for c, chord in enumerate(chords) if c not in bad]


def _is_uniform(domain: Domain, chord: Chord) -> bool:
    """Whether a piece of chain is of one kind: boundary, slit or interface, with cells on the same sides."""
    chain = domain.chains[chord.chain]

    def kind(k: int) -> tuple[Any, ...]:
        edge = chain.edge(k)
        return edge.interior, [(side.is_inside, side.cell_tag) for side in edge.sides]

    return all(kind(k) == kind(chord.start) for k in range(chord.start + 1, chord.stop))


def _without_flat(domain: Domain, chords: list[Chord]) -> list[Chord]:
    """Leave out the chords of closed chains with only two kept vertices or turned the other way round."""
    result = []
    for c, chain in enumerate(domain.chains):
        run = [chord for chord in chords if chord.chain == c]
        if run and not (chain.closed and (len(run) < 3 or is_flipped(domain, chain, run))):
            result += run
    return result


def specks(domain: Domain, f: Floats) -> list[bool]:
    """Whether each chain is one of its own (a loop, a slit inside) and no larger than the spacing f."""

    def is_speck(chain: Chain) -> bool:
        tips = all(len(domain.ends.get(v, ())) <= 1 for v in (chain.vertices[0], chain.vertices[-1]))
        extent = np.ptp(domain.points[chain.vertices], axis=0).max()
        return (chain.closed or tips) and bool(extent <= f[chain.vertices].max())

    return [is_speck(chain) for chain in domain.chains]


def is_hole(domain: Domain, c: int) -> bool:
    """Whether a closed chain bounds a hole."""
    chain = domain.chains[c]
    left, right = (side.is_inside for side in chain.edges[0].sides)
    # the domain lies on the right of a hole that is run through counter-clockwise
    return chain.closed and left != right and (area_2(domain.points[chain.vertices]) > 0.0) == right


def stands_out(domain: Domain, v: int, reach: float, cos_feature: float) -> float | None:
    """Return how far a vertex stands out of the boundary; None where that does not bend by more than the feature angle.

    It is looked at with steps of length `reach`, a quarter of the chain at most: the distance of the vertex from the
    line between the points a step before and a step after, in steps. Junctions and changes of attributes always stand
    out by a half.
    """
    c, k = domain.place[v]
    chain = domain.chains[c]
    fixed = 0.5 if domain.fixed[v] else None
    if v in domain.ends:
        return fixed
    arc = float(chain.arc[k])
    reach = min(reach, chain.length / 4.0)
    p = (float(domain.points[v, 0]), float(domain.points[v, 1]))
    a, b = point_along(domain, chain, arc - reach), point_along(domain, chain, arc + reach)
    lengths = _distance(a, p) * _distance(p, b)
    if lengths == 0.0 or not math.isfinite(lengths):
        return fixed
    cosine = ((p[0] - a[0]) * (b[0] - p[0]) + (p[1] - a[1]) * (b[1] - p[1])) / lengths
    if cosine >= cos_feature:
        return fixed
    height = math.sqrt(segment_distance_2(np.array(p), np.array(a), np.array(b))) / reach
    return max(height, fixed or 0.0)


def _distance(a: Point, b: Point) -> float:
    dx, dy = a[0] - b[0], a[1] - b[1]
    return math.sqrt(dx * dx + dy * dy)


def point_along(domain: Domain, chain: Chain, arc: float) -> Point:
    """Return the point of a chain at an arc length, which runs around a closed one and stops at an open one's ends."""
    arc = arc % chain.length if chain.closed else min(max(arc, 0.0), chain.length)
    k = min(max(int(np.searchsorted(chain.arc, arc, side="right")), 1), len(chain.edges)) - 1
    a, b = domain.points[list(chain.edges[k].vertices)].tolist()
    before, after = chain.arc[k : k + 2].tolist()
    t = (arc - before) / (after - before)
    return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])


def places(domain: Domain, v: int) -> list[tuple[int, int]]:
    """Return where a vertex lies: chain and position, for each chain that it is on."""
    if v not in domain.ends:
        return [domain.place[v]]
    return [(c, len(domain.chains[c].vertices) - 1 if at_end else 0) for c, at_end in domain.ends[v]]


def strips(domain: Domain, chord: Chord) -> tuple[float, float]:
    """Return the areas between a chord and its piece of chain, where the chain lies left and where it lies right."""
    along: Ints = piece(domain, chord)
    a, b = domain.points[along[0]].tolist(), domain.points[along[-1]].tolist()
    length = _distance((a[0], a[1]), (b[0], b[1]))
    ux, uy = (b[0] - a[0]) / length, (b[1] - a[1]) / length
    areas = [0.0, 0.0]
    last_s, last_h = 0.0, 0.0
    for x, y in domain.points[along[1:]].tolist():
        s, h = (x - a[0]) * ux + (y - a[1]) * uy, (y - a[1]) * ux - (x - a[0]) * uy
        for k, (start, stop) in enumerate(((last_h, h), (-last_h, -h))):
            f, t = max(start, 0.0), max(stop, 0.0)
            share = 1.0 if (start > 0.0) == (stop > 0.0) else abs(f - t) / abs(start - stop)
            areas[k] += (s - last_s) * share * (f + t) / 2.0
        last_s, last_h = s, h
    return max(areas[0], 0.0), max(areas[1], 0.0)
