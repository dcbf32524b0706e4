"""Chords of the facet chains, and what makes a choice of facet vertices a valid coarse domain.

A chord joins two kept vertices that follow each other along a chain. The coarse domain is valid where no two chords
cross or overlap and where the region between a chord and its piece of chain holds no other kept point. Where levels
shall be well shaped (`wide`), chords may not narrow the domain either: where two of them meet inside it under less than
20 degrees, the farthest vertex of one is put back if that widens the angle.

Repair goes in rounds: every offending chord gets back the vertex of its piece that is farthest from it.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from .domain import Chain, Domain, segment_distance_2, segments_cross
from .point import Bools, Floats, Ints, signs

NARROW = 0.3639702342662024
"""Tangent of 20 degrees."""


@dataclass(frozen=True)
class Chord:
    """A chord of a chain, from one kept position to the next; positions of closed chains run on past the end."""

    chain: int
    start: int
    stop: int
    vertices: tuple[int, int]
    farthest: int
    """The vertex between them that is farthest from the chord (the first of equals)."""
    deviation_2: float
    """Squared distance of that vertex; 0.0 where the chord is the chain."""

    @property
    def splits(self) -> bool:
        """Whether there is a vertex to put back."""
        return self.stop > self.start + 1


def repair(domain: Domain, kept: Bools, obstacles: Floats, wide: bool) -> list[Chord]:
    """Add to `kept` the vertices that make it a valid coarse domain, and return its chords.

    `obstacles`, shape (k, 2), are kept points that are no facet vertices.
    """
    _keep_enough(domain, kept)
    while True:
        chords = chords_of(domain, kept)
        bad = offending(domain, chords, kept, obstacles)
        bad += [c for c, chord in enumerate(chords) if is_joined(domain, chord)]
        if not bad and wide:
            bad = _narrow(domain, chords)
        if not bad:
            return chords
        for c in bad:
            kept[chords[c].farthest] = True


def chords_of(domain: Domain, kept: Bools) -> list[Chord]:
    """Return the chords between consecutive kept vertices."""
    chords = []
    for c, chain in enumerate(domain.chains):
        positions = np.flatnonzero(kept[chain.vertices]).tolist()
        if chain.closed and positions:
            positions.append(positions[0] + len(chain.vertices))
        for start, stop in itertools.pairwise(positions):
            chords.append(chord_between(domain, c, start, stop))
    return chords


def chord_between(domain: Domain, c: int, start: int, stop: int) -> Chord:
    """Return the chord of a chain between two positions."""
    chain = domain.chains[c]
    ends = (chain.vertex(start), chain.vertex(stop))
    between = [chain.vertex(k) for k in range(start + 1, stop)]
    far, deviation_2 = _farthest(domain, between, *ends) if between else (ends[0], 0.0)
    return Chord(c, start, stop, ends, far, deviation_2)


def _farthest(domain: Domain, vertices: list[int], a: int, b: int) -> tuple[int, float]:
    """Return the vertex that is farthest from the segment between two vertices, and its squared distance."""
    from_segment = segment_distance_2(domain.points[vertices], domain.points[a], domain.points[b])
    k = int(np.argmax(from_segment))
    return vertices[k], float(from_segment[k])


def _keep_enough(domain: Domain, kept: Bools) -> None:
    """Keep three vertices of a loop, the ends of an open chain, and one more of a slit with both ends shared."""
    for chain in domain.chains:
        if not chain.closed and chain.vertices[0] != chain.vertices[-1]:
            kept[[chain.vertices[0], chain.vertices[-1]]] = True
            (left, right), (left_end, right_end) = chain.edges[0].sides, chain.edges[-1].sides
            is_slit = not chain.edges[0].interior and left.tail == right.tail and left_end.head == right_end.head
            last = len(chain.vertices) - 1
            if is_slit and last > 1 and not kept[chain.vertices[1:last]].any():
                middle = int(np.searchsorted(chain.arc, chain.length / 2.0))
                kept[chain.vertices[min(max(middle, 1), last - 1)]] = True
            continue
        kept[chain.vertices[-1]] |= not chain.closed
        # the junction at both ends of a loop counts once
        held = [v for v in (chain.vertices if chain.closed else chain.vertices[1:]) if kept[v]][:3]
        while len(held) < 3:
            others = [v for v in chain.vertices if v not in held[:2]]
            held.append(_farthest(domain, others, held[0], held[min(1, len(held) - 1)])[0] if held else others[0])
            kept[held[-1]] = True


def is_joined(domain: Domain, chord: Chord) -> bool:
    """Whether a chord of a slit has the same nodes on both sides: the slit would be an edge like any other."""
    chain = domain.chains[chord.chain]
    first, last = chain.edge(chord.start), chain.edge(chord.stop - 1)
    (left, right), (left_end, right_end) = first.sides, last.sides
    return not first.interior and left.tail == right.tail and left_end.head == right_end.head


def offending(
    domain: Domain, chords: list[Chord], kept: Bools, obstacles: Floats, fresh: Bools | None = None
) -> list[int]:
    """Return the chords to be split, ascending. Those that are not `fresh` are known to be valid among themselves."""
    splits = np.array([chord.splits for chord in chords], np.bool_)
    if fresh is not None:
        splits &= fresh
    bad = _crossing(domain, chords, splits)
    points = np.concatenate([domain.points[kept], obstacles])
    vertex = np.concatenate([np.flatnonzero(kept), np.full(len(obstacles), -1)])
    for c, chord in enumerate(chords):
        if splits[c] and chord.deviation_2 > 0.0 and not bad[c]:
            bad[c] = (holds(domain, chord, points) & ~np.isin(vertex, chord.vertices)).any()
    first = 0
    while first < len(chords):
        chain = domain.chains[chords[first].chain]
        run = [c for c in range(first, len(chords)) if chords[c].chain == chords[first].chain]
        first = run[-1] + 1
        if chain.closed and not bad[run].any() and is_flipped(domain, chain, [chords[c] for c in run]):
            widest = max(run, key=lambda c: (chords[c].deviation_2, -c))
            bad[widest] = chords[widest].splits
    return [int(c) for c in np.flatnonzero(bad)]


def _crossing(domain: Domain, chords: list[Chord], splits: Bools) -> Bools:
    """Of any two chords that cross, the one that deviates more from its chain is marked, the first of equals.

    Only those that `splits` admits are marked.
    """
    bad = np.zeros(len(chords), np.bool_)
    ends = domain.points[[chord.vertices for chord in chords]].reshape(-1, 2, 2)
    low, high = ends.min(axis=1), ends.max(axis=1)
    deviation_2 = np.array([chord.deviation_2 for chord in chords])
    for i in np.flatnonzero(splits):
        touching = ((low <= high[i]) & (low[i] <= high)).all(axis=1)
        touching[: i + 1] &= ~splits[: i + 1]  # a pair that both split is met once
        others = np.flatnonzero(touching)
        others = others[segments_cross(ends[i, 0], ends[i, 1], ends[others, 0], ends[others, 1])]
        for j in others:
            bad[j if splits[j] and deviation_2[j] > deviation_2[i] else i] = True
    return bad


def piece(domain: Domain, chord: Chord) -> Ints:
    """Return the facet vertices of the piece of chain that a chord spans, both ends included."""
    chain = domain.chains[chord.chain]
    return np.array([chain.vertex(k) for k in range(chord.start, chord.stop + 1)])


def holds(domain: Domain, chord: Chord, points: Floats) -> Bools:
    """Whether points, shape (k, 2), lie in the region between a chord and its piece of chain, or on the chord."""
    polygon = domain.points[piece(domain, chord)]
    result = np.zeros(len(points), np.bool_)
    near = np.flatnonzero(((polygon.min(axis=0) <= points) & (points <= polygon.max(axis=0))).all(axis=1))
    p, a, b = points[near], polygon[0], polygon[-1]
    odd = np.zeros(len(near), np.bool_)
    if len(near):
        for u, v in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            odd ^= _crosses_ray(u, v, p)
        odd |= (signs(a, b, p) == 0) & (segment_distance_2(p, a, b) == 0.0)
    result[near] = odd
    return result


def _crosses_ray(a: Floats, b: Floats, p: Floats) -> Bools:
    """Whether the ray from p to the right crosses the edge a b (upper end excluded); exact."""
    crosses: Bools = (a[1] > p[:, 1]) != (b[1] > p[:, 1])
    turn = signs(a, b, p[crosses])
    crosses[crosses] = turn > 0 if b[1] > a[1] else turn < 0
    return crosses


def is_flipped(domain: Domain, chain: Chain, chords: list[Chord]) -> bool:
    """Whether the chords of a closed chain are all there and run the other way round."""
    whole = all(one.stop == two.start for one, two in itertools.pairwise(chords))
    if not whole or chords[-1].stop != chords[0].start + len(chain.vertices):
        return False
    chord_area = area_2(domain.points[[chord.vertices[0] for chord in chords]])
    return (chord_area > 0.0) != (area_2(domain.points[chain.vertices]) > 0.0)


def area_2(loop: Floats) -> float:
    """Return twice the signed area of a loop, measured from its first point."""
    x, y = (loop - loop[0]).T
    return float(np.cumsum(x[:-1] * y[1:] - y[:-1] * x[1:])[-1]) if len(loop) > 1 else 0.0


def _narrow(domain: Domain, chords: list[Chord]) -> list[int]:
    """Return chords that meet another one inside the domain under a narrow angle that their farthest vertex widens."""
    # around each vertex: (chord, whether it ends there)
    around: dict[int, list[tuple[int, bool]]] = defaultdict(list)
    for c, chord in enumerate(chords):
        around[chord.vertices[0]].append((c, False))
        around[chord.vertices[1]].append((c, True))
    bad = set()
    for v, ends in around.items():
        ways = [domain.points[chords[c].vertices[not at_end]] - domain.points[v] for c, at_end in ends]
        for i, (one, d) in enumerate(zip(ends, ways, strict=True)):
            chord = chords[one[0]]
            edge = domain.chains[chord.chain].edge(chord.start)
            # seen from the vertex, the counter-clockwise side of a chord that ends here is its right
            if not edge.sides[one[1]].is_inside:
                continue
            for j, (two, e) in enumerate(zip(ends, ways, strict=True)):
                tangent = _angle_tangent(d, e)
                if i == j or tangent is None or tangent >= NARROW:
                    continue
                between = [k for k, f in enumerate(ways) if k not in {i, j} and _cross(d, f) > 0 and _cross(f, e) > 0]
                if not between:
                    bad |= _widening(domain, chords, v, tangent, (one[0], two[0]), (d, e))
    return sorted(bad)


def _widening(
    domain: Domain, chords: list[Chord], v: int, tangent: float, pair: tuple[int, int], ways: tuple[Floats, Floats]
) -> set[int]:
    """Return the chord of a pair, counter-clockwise around v, whose farthest vertex widens their angle more."""
    best: tuple[float, int] | None = None
    for k, c in enumerate(pair):
        if not chords[c].splits:
            continue
        f = domain.points[chords[c].farthest] - domain.points[v]
        d, e = (f, ways[1]) if k == 0 else (ways[0], f)
        wider = _angle_tangent(d, e) if _cross(d, e) > 0 else 0.0
        wider = np.inf if wider is None else wider  # beyond a right angle there is no tangent: wide enough
        if wider > tangent and (best is None or wider > best[0]):
            best = (wider, c)
    return set() if best is None else {best[1]}


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _angle_tangent(a: Floats, b: Floats) -> float | None:
    """Return the tangent of the angle from a counter-clockwise to b; None where that is not under a right angle."""
    sine, cosine = _cross(a, b), float(a[0] * b[0] + a[1] * b[1])
    return sine / cosine if sine > 0.0 and cosine > 0.0 else None
