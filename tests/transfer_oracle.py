"""Where the nodes of a mesh may lie in a coarser one, by what is connected: slow, and knows no walks.

A pair of a fine and a coarse cell that overlap is a place where both meshes are. Pairs are joined over an edge of the
one mesh that runs through the cell of the other; so no slit, wall or gap of either is crossed. Pairs around a shared
node are the right ones, and what is joined to them. (Around the tip of a slit the two meshes' slits may leave in
different directions: then the pairs around it fall apart, and say nothing. Where parts of the fine mesh only touch,
each speaks for itself.)

What no right pair covers of the fine mesh falls into pieces; each piece meets the boundary of the coarse mesh in edges
of its own, or in nodes of both: those that its nodes may be carried to. Where a piece meets nothing, its side was
dropped altogether, and no place is right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

TINY = 1e-9


def turned(a, b, c):
    return (b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0]


def depths(one, other):
    """How deep triangles overlap (broadcast): distance to the best separating line, negative where apart."""
    least = np.full(np.broadcast_shapes(one.shape[:-2], other.shape[:-2]), np.inf)
    for a, b in ((one, other), (other, one)):
        for k in range(3):
            p, q = a[..., k, :], a[..., (k + 1) % 3, :]
            length = np.hypot(*np.moveaxis(q - p, -1, 0))
            most = np.max([turned(p, q, b[..., j, :]) for j in range(3)], axis=0) / length
            least = np.minimum(least, most)
    return least


def clipped(p, q, triangle):
    """The interval of the segments p -> q inside of the triangles (broadcast); empty where low >= high."""
    low, high = 0.0, 1.0
    for k in range(3):
        a, b = triangle[..., k, :], triangle[..., (k + 1) % 3, :]
        length = np.hypot(*np.moveaxis(b - a, -1, 0))
        s, t = turned(a, b, p) / length, turned(a, b, q) / length
        with np.errstate(divide="ignore", invalid="ignore"):
            at = s / (s - t)
        low = np.where((s < 0) & (t >= 0), np.maximum(low, at), low)
        high = np.where((s >= 0) & (t < 0), np.minimum(high, at), high)
        low = np.where((s <= 0) & (t <= 0), 2.0, low)
    return low, high


def half_edges(cells):
    """(cell, number) by directed edge."""
    return {(int(cell[k]), int(cell[(k + 1) % 3])): (c, k) for c, cell in enumerate(cells) for k in range(3)}


def components(n, pairs):
    pairs = np.array(pairs, dtype=int).reshape(-1, 2)
    return connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)[1]


def fans(cells, edges, v):
    """Cells around a node, by fan: those that are joined over edges there."""
    found = []
    around = np.flatnonzero((cells == v).any(axis=1)).tolist()
    while around:
        fan = [around.pop()]
        for cell in fan:
            for k in range(3):
                a, b = int(cells[cell][k]), int(cells[cell][(k + 1) % 3])
                other = edges.get((b, a), (-1, 0))[0]
                if v in (a, b) and other in around:
                    around.remove(other)
                    fan.append(other)
        found.append(sorted(fan))
    return found


@dataclass
class Oracle:
    """By fine node: coarse cells that hold it on its side; where none does, what its piece meets of the boundary.

    Neither, where its side was dropped altogether.
    """

    right: list[list[int]]
    walls: list[list[tuple[int, int]]]
    unsure: bool


def oracle(points, cells, coarse_points, coarse_cells, shared) -> Oracle:
    scale = max(np.ptp(points, axis=0).max(), 1e-300)
    points, coarse_points = (points - points[0]) / scale, (coarse_points - points[0]) / scale
    fine, coarse = points[cells], coarse_points[coarse_cells]
    depth = depths(fine[:, None], coarse[None])
    # touches are no overlaps; what is between the two, and flat cells, would have to be told exactly
    flat = min(depths(cells, cells).min() for cells in (fine, coarse)) < TINY
    unsure = bool(flat or ((np.abs(depth) > 1e-13) & (np.abs(depth) < TINY)).any())
    f, c = np.nonzero(depth > TINY)
    number = {pair: i for i, pair in enumerate(zip(f.tolist(), c.tolist(), strict=True))}
    mine, others = half_edges(cells), half_edges(coarse_cells)
    # joined pairs
    joined = []
    cells_of_fine = [np.flatnonzero(depth[i] > TINY) for i in range(len(cells))]
    cells_of_coarse = [np.flatnonzero(depth[:, j] > TINY) for j in range(len(coarse_cells))]
    for (a, b), (i, _) in mine.items():
        if a < b and (b, a) in mine:
            j = mine[b, a][0]
            both = np.intersect1d(cells_of_fine[i], cells_of_fine[j])
            low, high = clipped(points[a], points[b], coarse[both])
            joined += [(number[i, k], number[j, k]) for k in both[high - low > TINY].tolist()]
    for (a, b), (i, _) in others.items():
        if a < b and (b, a) in others:
            j = others[b, a][0]
            both = np.intersect1d(cells_of_coarse[i], cells_of_coarse[j])
            low, high = clipped(coarse_points[a], coarse_points[b], fine[both])
            joined += [(number[k, i], number[k, j]) for k in both[high - low > TINY].tolist()]
    # an edge of both: the line passes from one pair into another at once
    inner = [(a, b) for a, b in others if (b, a) in others]
    if inner:
        p, q = coarse_points[[a for a, _ in inner]], coarse_points[[b for _, b in inner]]
        d = q - p
        length = np.hypot(d[:, 0], d[:, 1])
        for (a, b), (i, _) in mine.items():
            if (b, a) not in mine:
                continue
            off = np.maximum(np.abs(turned(p, q, points[a])), np.abs(turned(p, q, points[b]))) / length
            s, t = (((points[v] - p) * d).sum(axis=1) / length**2 for v in (a, b))
            for at in np.flatnonzero((off < 1e-13) & (np.minimum(t, 1) - np.maximum(s, 0) > TINY)):
                one, two = inner[at], inner[at][::-1]
                ends = (i, others[one][0]), (mine[b, a][0], others[two][0])
                if ends[0] in number and ends[1] in number:
                    joined.append((number[ends[0]], number[ends[1]]))
    group = components(len(number), joined)
    # anchors
    near = {}
    for one, two in joined:
        near.setdefault(one, []).append(two)
        near.setdefault(two, []).append(one)
    around = [np.flatnonzero((cells == v).any(axis=1)) for v in range(len(points))]
    coarse_around = [np.flatnonzero((coarse_cells == s).any(axis=1)) for s in range(len(coarse_points))]
    good = set()
    for s, v in enumerate(shared.tolist()):
        for fan in fans(cells, mine, v) if v >= 0 else ():
            local = [number[i, j] for i in fan for j in coarse_around[s].tolist() if (i, j) in number]
            seen = local[:1]
            for pair in seen:
                seen += [other for other in near.get(pair, []) if other in local and other not in seen]
            if len(seen) == len(local):
                good |= set(group[local].tolist())
    is_right = np.isin(group, list(good))
    right_of = [[] for _ in cells]
    for i, j, ok in zip(f.tolist(), c.tolist(), is_right.tolist(), strict=True):
        if ok:
            right_of[i].append(j)
    shared_at = {v: s for s, v in enumerate(shared.tolist()) if v >= 0}
    right = []
    for v, x in enumerate(points):
        # a node of both is where it is
        found = set(coarse_around[shared_at[v]].tolist()) if v in shared_at else set()
        for i in around[v].tolist():
            for j in right_of[i]:
                t = coarse[j]
                inside = min(turned(t[k], t[(k + 1) % 3], x) / np.hypot(*(t[(k + 1) % 3] - t[k])) for k in range(3))
                if inside >= -1e-13:
                    found.add(j)
        right.append(sorted(found))
    # pieces of what is not covered
    met = [[] for _ in cells]
    for i in range(len(cells)):
        for j in right_of[i]:
            for k in range(3):
                a, b = int(coarse_cells[j][k]), int(coarse_cells[j][(k + 1) % 3])
                if (b, a) not in others:
                    low, high = clipped(coarse_points[a], coarse_points[b], fine[i])
                    if high - low > TINY:
                        met[i].append((a, b))
    links = []
    for (a, b), (i, _) in mine.items():
        if (b, a) in mine and a > b:
            continue
        ends = [i] + ([mine[b, a][0]] if (b, a) in mine else [])
        spans = []
        for end in ends:
            for j in right_of[end]:
                low, high = clipped(points[a], points[b], coarse[j])
                # also along its sides
                if high - low > TINY:
                    spans.append((float(low), float(high)))
                else:
                    for k in range(3):
                        p, q = coarse[j][k], coarse[j][(k + 1) % 3]
                        off = [abs(turned(p, q, x)) / np.hypot(*(q - p)) for x in (points[a], points[b])]
                        if max(off) < 1e-13:
                            d = points[b] - points[a]
                            s = sorted(float((x - points[a]) @ d / (d @ d)) for x in (p, q))
                            spans.append((max(s[0], 0.0), min(s[1], 1.0)))
        for one, two in (ends, ends[::-1]) if len(ends) == 2 else ():
            for held in right_of[two]:
                for k in range(3):
                    p, q = int(coarse_cells[held][k]), int(coarse_cells[held][(k + 1) % 3])
                    d = coarse_points[q] - coarse_points[p]
                    off = [
                        abs(turned(coarse_points[p], coarse_points[q], x)) / np.hypot(*d)
                        for x in (points[a], points[b])
                    ]
                    s = sorted(float((x - coarse_points[p]) @ d / (d @ d)) for x in (points[a], points[b]))
                    if (q, p) not in others and max(off) < 1e-13 and min(s[1], 1) - max(s[0], 0) > TINY:
                        met[one].append((p, q))
        reach, hole = 0.0, 0.0
        for low, high in sorted(spans):
            hole = max(hole, low - reach)
            reach = max(reach, high)
        hole = max(hole, 1.0 - reach)
        if hole > 1e-9 and len(ends) == 2:
            links.append(ends)
    piece = components(len(cells), links)
    walls_of = {}
    for i in range(len(cells)):
        # a node of both is a point of the coarse mesh, also where no right pair reaches it
        reached = set(coarse_cells[right_of[i]].ravel().tolist())
        bare = {shared_at[v] for v in cells[i].tolist() if v in shared_at} - reached
        walls_of.setdefault(piece[i], set()).update(met[i], ((s, s) for s in bare))
    walls = []
    for v in range(len(points)):
        found = set()
        if not right[v]:
            for i in around[v].tolist():
                found |= walls_of[piece[i]]
        walls.append(sorted(found))
    return Oracle(right, walls, unsure)
