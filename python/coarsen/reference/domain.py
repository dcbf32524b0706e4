"""The facets of a planar domain: vertices, chains, corners, slits; see ``rust/domain/mod.rs`` for the sketch of a slit.

A *facet edge* is an edge that every coarser mesh must keep as part of a union of its own edges: the boundary, edges
between cells of different tags, edges that the user gave. Nodes that share coordinates are one *facet vertex* with
several *copies*; both sides of a slit are then one line of facet edges, each with a left and a right side of its own.

A *chain* is a maximal path of facet edges through vertices where exactly two of them meet; it is closed or ends at
*junctions*. A vertex is *fixed* where the topology or the attributes change, and a *corner* (P0 of Figure 2) where it
is fixed or the chain turns by more than `feature_angle`.
"""

from __future__ import annotations

import copy
import itertools
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from .point import NONE, Bools, Floats, Ints, distance, signs


class FacetArrays(Protocol):
    """Facets of a mesh as `coarsen.multilevel` hands them over: boundary first, the (first) cell on the left."""

    @property
    def facets(self) -> Ints:
        """Nodes, (s, 2)."""

    @property
    def cell_tags(self) -> Ints:
        """Tags of left and right cell, (s, 2)."""

    @property
    def tags(self) -> Ints:
        """Tags of given facets, (s,)."""

    @property
    def given(self) -> Bools:
        """Which facets the user gave, (s,)."""

    @property
    def n_boundary(self) -> int:
        """How many are boundary."""

    @property
    def layer(self) -> npt.NDArray[np.integer] | None:
        """Layer of each node, where parts overlap."""


@dataclass(frozen=True)
class Side:
    """What lies on one side of a facet edge u -> v."""

    tail: int = NONE
    """Node at u in the cell of this side; none where there is no cell."""
    head: int = NONE
    cell_tag: int = 0
    given: bool = False
    tag: int = 0

    @property
    def is_inside(self) -> bool:
        """Whether a cell lies on this side."""
        return self.tail != NONE

    def turned(self) -> Side:
        """Return the side as the edge v -> u has it."""
        return replace(self, tail=self.head, head=self.tail)

    def continues(self, after: Side) -> bool:
        """Whether the side of the next edge along a chain is of the same kind, at the same node."""
        return (self.head, self.cell_tag, self.given, self.tag) == (after.tail, after.cell_tag, after.given, after.tag)


@dataclass(frozen=True)
class FacetEdge:
    """A facet edge between two facet vertices, with its left and right side."""

    vertices: tuple[int, int]
    sides: tuple[Side, Side]
    interior: bool
    """Whether cells of both sides share it (an interface), rather than end at it (boundary or slit)."""

    def turned(self) -> FacetEdge:
        """Return the edge in the other direction."""
        (u, v), (left, right) = self.vertices, self.sides
        return FacetEdge((v, u), (right.turned(), left.turned()), self.interior)


@dataclass(frozen=True)
class Chain:
    """A maximal path of facet edges through vertices of degree two."""

    vertices: list[int]
    """A closed chain does not repeat its first."""
    edges: list[FacetEdge]
    """Edge k leads from vertex k to vertex k + 1, turned along the chain."""
    arc: Floats
    """Length up to vertex k; the last is the whole length."""
    closed: bool

    def vertex(self, position: int) -> int:
        """Return the facet vertex at a position, which may run past the end of a closed chain."""
        return self.vertices[position % len(self.vertices)]

    def edge(self, position: int) -> FacetEdge:
        """Return the facet edge that leaves a position."""
        return self.edges[position % len(self.edges)]

    @property
    def length(self) -> float:
        """Length of the whole chain."""
        return float(self.arc[-1])


class Domain:
    """The facets of a mesh.

    Attributes
    ----------
    points : (v, 2) coordinates of the facet vertices
    copies : the nodes at every facet vertex, ascending; the first represents it
    chains : all facet edges, as chains
    place : for every facet vertex its first place, (chain, position)
    fixed, corner : (v,) bool
    ends : the chains that end at a vertex, (chain, whether at its end)
    """

    def __init__(self, points: Floats, facets: FacetArrays, cos_feature: float) -> None:
        self.copies, vertex_of = weld(points, facets.facets)
        self.points = points[[copies[0] for copies in self.copies]].reshape(-1, 2)
        self.chains = self._trace(join(facets, vertex_of))
        self.place: dict[int, tuple[int, int]] = {}
        self.ends: dict[int, list[tuple[int, bool]]] = defaultdict(list)
        for c, chain in enumerate(self.chains):
            for k, v in enumerate(chain.vertices):
                self.place.setdefault(v, (c, k))
            if not chain.closed:
                self.ends[chain.vertices[0]].append((c, False))
                self.ends[chain.vertices[-1]].append((c, True))
        self.fixed = np.zeros(len(self), np.bool_)
        self.corner = np.zeros(len(self), np.bool_)
        self._classify(cos_feature)

    def __len__(self) -> int:
        return len(self.copies)

    def thinned(self, kept: Bools) -> Domain:
        """Return the same facets drawn through kept vertices only, which must be enough for all chains."""
        thin = copy.copy(self)
        thin.chains = [self._thinned(chain, kept) for chain in self.chains]
        return thin

    def _thinned(self, chain: Chain, kept: Bools) -> Chain:
        positions = [k for k, v in enumerate(chain.vertices) if kept[v]]
        vertices = [chain.vertices[k] for k in positions]
        if chain.closed:
            positions.append(positions[0] + len(chain.vertices))
        edges, arc = [], [0.0]
        for start, stop in itertools.pairwise(positions):
            first, last = chain.edge(start), chain.edge(stop - 1)
            left, right = (replace(one, head=other.head) for one, other in zip(first.sides, last.sides, strict=True))
            ends = (first.vertices[0], last.vertices[1])
            edges.append(FacetEdge(ends, (left, right), first.interior))
            arc.append(arc[-1] + float(distance(self.points[ends[0]], self.points[ends[1]])))
        return Chain(vertices, edges, np.array(arc), chain.closed)

    def _trace(self, edges: list[FacetEdge]) -> list[Chain]:
        around: list[list[int]] = [[] for _ in self.copies]
        for e, edge in enumerate(edges):
            for v in edge.vertices:
                around[v].append(e)
        used: set[int] = set()
        chains = []
        through = [len(some) == 2 for some in around]
        # from junctions first, then the closed chains that are left
        starts = [(e, v) for v, some in enumerate(around) if not through[v] for e in some]
        starts += [(some[0], v) for v, some in enumerate(around) if through[v]]
        for first, start in starts:
            if first in used:
                continue
            vertices, chain, e, at = [start], [], first, start
            while True:
                used.add(e)
                chain.append(edges[e] if edges[e].vertices[0] == at else edges[e].turned())
                at = chain[-1].vertices[1]
                closed = through[start] and at == start
                if closed:
                    break
                vertices.append(at)
                if not through[at]:
                    break
                one, two = around[at]
                e = two if e == one else one
            ends = self.points[[v for edge in chain for v in edge.vertices]]
            arc = np.concatenate([[0.0], np.cumsum(distance(ends[0::2], ends[1::2]))])
            chains.append(Chain(vertices, chain, arc, closed))
        return chains

    def _classify(self, cos_feature: float) -> None:
        for chain in self.chains:
            for k, v in enumerate(chain.vertices):
                if not chain.closed and k in {0, len(chain.vertices) - 1}:
                    self.fixed[v] = True
                    continue
                before, after = chain.edges[k - 1], chain.edges[k]
                same = before.interior == after.interior
                same &= all(old.continues(new) for old, new in zip(before.sides, after.sides, strict=True))
                self.fixed[v] = not same
                p, q, r = self.points[[before.vertices[0], v, after.vertices[1]]].tolist()
                self.corner[v] = _turns_more(p, q, r, cos_feature)
        self.corner |= self.fixed


def _turns_more(p: list[float], q: list[float], r: list[float], cosine: float) -> bool:
    """Whether the path p, q, r turns at q by more than the angle of the given cosine."""
    ax, ay = q[0] - p[0], q[1] - p[1]
    bx, by = r[0] - q[0], r[1] - q[1]
    lengths = float(np.sqrt(ax * ax + ay * ay)) * float(np.sqrt(bx * bx + by * by))
    return ax * bx + ay * by < cosine * lengths


def weld(points: Floats, facets: Ints) -> tuple[list[list[int]], dict[int, int]]:
    """Group facet nodes by coordinates, groups in the order of their lowest node; also the group of each node."""
    groups: dict[tuple[float, float], list[int]] = defaultdict(list)
    for node in np.unique(facets).tolist():
        groups[float(points[node, 0]), float(points[node, 1])].append(node)
    copies = list(groups.values())
    return copies, {node: v for v, group in enumerate(copies) for node in group}


def join(facets: FacetArrays, vertex_of: dict[int, int]) -> list[FacetEdge]:
    """Join the rows that lie on one pair of vertices into facet edges, sorted by their vertices."""
    edges: dict[tuple[int, int], FacetEdge] = {}
    for row, (a, b) in enumerate(facets.facets.tolist()):
        given, interior = bool(facets.given[row]), row >= facets.n_boundary
        left = Side(a, b, int(facets.cell_tags[row, 0]), given, int(facets.tags[row]) if given else 0)
        right = replace(left, cell_tag=int(facets.cell_tags[row, 1])) if interior else Side()
        edge = FacetEdge((vertex_of[a], vertex_of[b]), (left, right), interior)
        edge = edge if edge.vertices[0] <= edge.vertices[1] else edge.turned()
        known = edges.get(edge.vertices)
        if known is None:
            edges[edge.vertices] = edge
            continue
        if any(new.is_inside and old.is_inside for new, old in zip(edge.sides, known.sides, strict=True)):
            raise RuntimeError(f"two cells on one side of the facet between nodes {a} and {b}")
        left, right = (new if new.is_inside else old for new, old in zip(edge.sides, known.sides, strict=True))
        edges[edge.vertices] = replace(known, sides=(left, right))
    return [edges[key] for key in sorted(edges)]


def segment_distance_2(p: Floats, a: Floats, b: Floats) -> Floats:
    """Return squared distances of points, shape (..., 2), to the segment from a to b, measured from the nearer end.

    Along a segment 1e15 times as long as the distance, rounding would hide it.
    """
    dx, dy = b[0] - a[0], b[1] - a[1]
    px, py, qx, qy = p[..., 0] - a[0], p[..., 1] - a[1], p[..., 0] - b[0], p[..., 1] - b[1]
    first = px * px + py * py <= qx * qx + qy * qy
    dx, dy = np.where(first, dx, -dx), np.where(first, dy, -dy)
    px, py = np.where(first, px, qx), np.where(first, py, qy)
    length_2 = dx * dx + dy * dy
    with np.errstate(invalid="ignore", divide="ignore"):
        t = np.where(length_2 > 0.0, np.clip((px * dx + py * dy) / length_2, 0.0, 1.0), 0.0)
    ex, ey = px - t * dx, py - t * dy
    result: Floats = ex * ex + ey * ey
    return result


def segments_cross(a: Floats, b: Floats, c: Floats, d: Floats) -> Bools:
    """Whether the segment a b and each of the segments c d, shape (k, 2), share a point that is not an end of both."""
    c1, d1, a1, b1 = signs(a, b, c), signs(a, b, d), signs(c, d, a), signs(c, d, b)
    crossing = (c1 * d1 < 0) & (a1 * b1 < 0)
    # an end of one in the interior of the other, or an overlap of collinear ones
    crossing |= (c1 == 0) & _strictly_between(c, a, b)
    crossing |= (d1 == 0) & _strictly_between(d, a, b)
    crossing |= (a1 == 0) & _strictly_between(a, c, d)
    crossing |= (b1 == 0) & _strictly_between(b, c, d)
    crossing |= ((a == c) & (b == d)).all(axis=-1) | ((a == d) & (b == c)).all(axis=-1)
    return crossing


def _strictly_between(p: Floats, a: Floats, b: Floats) -> Bools:
    """Whether p, known to be on the line through a and b, lies between them and is neither."""
    inside = ((np.minimum(a, b) <= p) & (p <= np.maximum(a, b))).all(axis=-1)
    result: Bools = inside & ~(p == a).all(axis=-1) & ~(p == b).all(axis=-1)
    return result
