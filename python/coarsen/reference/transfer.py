"""Interpolation, overlap and Galerkin's products, as the core makes them, by plain loops.

A fine node is located from a neighbour that was located before: the coarse cells that the edge between the two runs
through are looked at, from the neighbour's cell on and never over the coarse boundary. If none of them holds the node,
it takes the nearest point of the boundary edges there, sliding along the wall as long as that is nearer. The order of
the nodes is the core's: in rounds, from inner nodes first, then from boundary nodes, tips and touching corners last.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from .point import Floats, Ints, Point, orient

Rows = tuple[Any, Any, Any]
Place = tuple[int, int, tuple[float, ...]]
"""Cell, the number of its edge that the point lies beyond (3: none, 4: a node), weights of its corners."""

INSIDE, BEYOND_NODE = 3, 4


class _Coarse:
    """A mesh to walk in: for each directed edge its cell, for each node its cells."""

    def __init__(self, points: Floats, cells: Ints) -> None:
        self.points: list[Point] = [(x, y) for x, y in points.tolist()]
        self.cells: list[list[int]] = cells.tolist()
        self.cell_of: dict[tuple[int, int], tuple[int, int]] = {}
        self.around: dict[int, list[int]] = {}
        for c, cell in enumerate(self.cells):
            for k in range(3):
                self.cell_of[cell[k], cell[(k + 1) % 3]] = (c, k)
                self.around.setdefault(cell[k], []).append(c)

        self.walls: dict[int, list[tuple[int, Point, bool]]] = {}

    def between(self, points: Floats, boundary: Ints, injection: Ints) -> None:
        """Note where a finer mesh ends at the nodes it shares: neighbour, its point, whether the edge comes in."""
        place = {v: c for c, v in enumerate(injection.tolist()) if v >= 0}
        for a, b in boundary.tolist():
            for v, other, comes_in in ((a, b, False), (b, a, True)):
                if v in place:
                    x, y = points[other].tolist()
                    self.walls.setdefault(place[v], []).append((other, (x, y), comes_in))

    def part(self, node: int, to: int, v: Point, edge: tuple[int, int]) -> bool:
        """Whether the finer mesh ends on the way from the direction of its node to that of a boundary edge."""
        o, ends = self.points[node], [self.cells[edge[0]][(edge[1] + j) % 3] for j in range(2)]
        goes_out = ends[0] == node
        q = self.points[ends[1] if goes_out else ends[0]]
        return any(
            comes_in == goes_out
            and not (other != to and _turn(o, v, p) == 0)
            and _comes_before(o, v, p, q, leftwards=goes_out)
            for other, p, comes_in in self.walls.get(node, [])
        )

    def ends(self, c: int, k: int) -> tuple[Point, Point]:
        return self.points[self.cells[c][k]], self.points[self.cells[c][(k + 1) % 3]]

    def across(self, c: int, k: int) -> tuple[int, int] | None:
        cell = self.cells[c]
        return self.cell_of.get((cell[(k + 1) % 3], cell[k]))

    def is_tip(self, node: int) -> bool:
        fans, angle = 0, 0.0
        for c in self.around[node]:
            k = self.cells[c].index(node)
            fans += self.across(c, k) is None
            p, a, b = (np.array(self.points[self.cells[c][(k + j) % 3]]) for j in range(3))
            (ux, uy), (vx, vy) = a - p, b - p
            angle += float(np.arctan2(ux * vy - uy * vx, ux * vx + uy * vy))
        return fans > 1 or (fans == 1 and angle > 1.5 * np.pi)

    def on_boundary(self, c: int, k: int, *, forward: bool) -> tuple[int, int]:
        """Return the boundary edge after or before a boundary edge."""
        step = 1 if forward else 2
        k = (k + step) % 3
        while (other := self.across(c, k)) is not None:
            c, k = other[0], (other[1] + step) % 3
        return c, k


def _turn(o: Point, v: Point, p: Point) -> int:
    """Quarter of the turn from v to p about o: 0 and 2 are on the line, 1 is left of it and 3 right."""
    side = orient(o, v, p)
    if side != 0:
        return 1 if side > 0 else 3
    return 0 if (v[0] - o[0]) * (p[0] - o[0]) + (v[1] - o[1]) * (p[1] - o[1]) > 0 else 2


def _comes_before(o: Point, v: Point, p: Point, q: Point, *, leftwards: bool) -> bool:
    """Whether p comes before q in a turn about o from v on."""
    one, two = (_turn(o, v, x) if leftwards else (4 - _turn(o, v, x)) % 4 for x in (p, q))
    between = orient(o, p, q)
    return one < two or (one == two and one % 2 == 1 and (between > 0 if leftwards else between < 0))


def _holds(mesh: _Coarse, c: int, x: Point) -> bool:
    return all(orient(*mesh.ends(c, k), x) >= 0 for k in range(3))


def _rounding(x: Point) -> float:
    return 4 * np.finfo(float).eps * max(abs(x[0]), abs(x[1]))


def _foot(mesh: _Coarse, c: int, k: int, x: Point) -> tuple[float, float]:
    """Return how far along an edge its point nearest to x is, and the distance."""
    (ax, ay), (bx, by) = mesh.ends(c, k)
    dx, dy = bx - ax, by - ay
    t = min(max(((x[0] - ax) * dx + (x[1] - ay) * dy) / (dx * dx + dy * dy), 0.0), 1.0)
    return t, float(np.hypot(ax + t * dx - x[0], ay + t * dy - x[1]))


def _along(mesh: _Coarse, c: int, k: int, x: Point) -> tuple[float, ...]:
    t = _foot(mesh, c, k, x)[0]
    weights = [0.0, 0.0, 0.0]
    weights[k], weights[(k + 1) % 3] = 1.0 - t, 1.0 - (1.0 - t)
    return tuple(weights)


def _inside(mesh: _Coarse, c: int, x: Point) -> Place:
    a, b, p = (np.array(mesh.points[i]) for i in mesh.cells[c])
    whole = (b - a)[0] * (p - a)[1] - (b - a)[1] * (p - a)[0]
    area, on = [], []
    for k in range(3):
        (ux, uy), (vx, vy) = mesh.ends(c, (k + 1) % 3)
        twice = (vx - ux) * (x[1] - uy) - (vy - uy) * (x[0] - ux)
        exact = orient((ux, uy), (vx, vy), x)
        area.append(max(twice, 0.0))
        on.append(exact <= 0 or twice <= _rounding(x) * np.hypot(vx - ux, vy - uy))
    if sum(on) == 0 or whole <= 0:
        return c, INSIDE, tuple(w / sum(area) for w in area)
    if sum(on) == 1:
        return c, INSIDE, _along(mesh, c, (on.index(True) + 1) % 3, x)
    # at a corner, or in a needle far from any
    away = [float(np.hypot(px - x[0], py - x[1])) for px, py in (a, b, p)]
    if min(away) <= _rounding(x):
        return c, INSIDE, tuple(float(k == away.index(min(away))) for k in range(3))
    lines = [(k + 1) % 3 for k in range(3) if on[k]] or [0, 1, 2]
    return c, INSIDE, _along(mesh, c, min(lines, key=lambda k: (_foot(mesh, c, k, x)[1], k)), x)


def _outside(mesh: _Coarse, c: int, k: int, x: Point) -> Place:
    """Slide along the wall from a boundary edge to the nearest point, never around an end of the wall or a gap."""

    def way(edge: tuple[int, int]) -> Floats:
        a, b = mesh.ends(*edge)
        return np.array([b[0] - a[0], b[1] - a[1]])

    first, (t, best) = way((c, k)), _foot(mesh, c, k, x)
    at = (c, k)
    for forward in (True, False):
        edge, passed = (c, k), float(np.hypot(*first)) * (1 - t if forward else t)
        while passed <= 3 * best:
            if mesh.cells[edge[0]][(edge[1] + forward) % 3] in mesh.walls:
                break
            edge = mesh.on_boundary(*edge, forward=forward)
            if edge == (c, k) or way(edge) @ first <= 0:
                break
            distance = _foot(mesh, *edge, x)[1]
            if distance < best:
                best, at = distance, edge
            passed += float(np.hypot(*way(edge)))
    beyond = INSIDE if best <= _rounding(x) else at[1]
    return at[0], beyond, _along(mesh, *at, x)


def _touches(u: Point, v: Point, a: Point, b: Point) -> bool:
    """Whether two segments have a point in common."""
    one, two = orient(u, v, a), orient(u, v, b)
    three, four = orient(a, b, u), orient(a, b, v)
    if one * two > 0 or three * four > 0:
        return False
    if one == two == three == four == 0:
        low = [max(min(u[d], v[d]), min(a[d], b[d])) for d in range(2)]
        high = [min(max(u[d], v[d]), max(a[d], b[d])) for d in range(2)]
        return low[0] <= high[0] and low[1] <= high[1]
    return True


def _is_on(u: Point, v: Point, p: Point) -> bool:
    return orient(u, v, p) == 0 and all(min(u[d], v[d]) <= p[d] <= max(u[d], v[d]) for d in range(2))


def _is_parted(mesh: _Coarse, u: Point, to: int, v: Point, edge: tuple[int, int]) -> bool:
    """Whether the line from u to v meets the edge in one of its nodes, and the finer mesh ends between the two."""
    nodes = [mesh.cells[edge[0]][(edge[1] + j) % 3] for j in range(2)]
    return any(_is_on(u, v, mesh.points[node]) and mesh.part(node, to, v, edge) for node in nodes)


def _walk(mesh: _Coarse, u: Point, place: Place, to: int, v: Point) -> Place:
    """Locate v, which is node `to` of the finer mesh (or -1), from its neighbour u."""
    c, beyond, weights = place
    if beyond == BEYOND_NODE:
        return place
    start, node = [c], -1
    if beyond < INSIDE:
        a, b = mesh.ends(c, beyond)
        left, right = orient(u, v, a), orient(u, v, b)
        if orient(a, b, v) < 0 or orient(a, b, u) >= 0 or left < 0 or right > 0:
            return _outside(mesh, c, beyond, v)
        if left == 0 or right == 0:
            node = mesh.cells[c][beyond if left == 0 else (beyond + 1) % 3]
            u = mesh.points[node]
    elif max(weights) == 1.0:
        node = mesh.cells[c][weights.index(1.0)]
    if node >= 0:
        start = mesh.around[node]
    seen, queue, hit = set(start), list(start), []
    while queue:
        cell = queue.pop(0)
        if _holds(mesh, cell, v):
            return _inside(mesh, cell, v)
        for k in range(3):
            a, b = mesh.ends(cell, k)
            other = mesh.across(cell, k)
            if other is None:
                if orient(a, b, v) < 0 and _touches(u, v, a, b):
                    hit.append((cell, k))
            elif other[0] not in seen and _touches(u, v, a, b):
                seen.add(other[0])
                queue.append(other[0])
    away = [edge for edge in hit if not _is_parted(mesh, u, to, v, edge)]
    if hit and not away:
        first = min(hit)
        end = next(i for i in range(2) if _is_on(u, v, mesh.ends(*first)[i]))
        node = mesh.cells[first[0]][(first[1] + end) % 3]
        cell = mesh.around[node][0]
        return cell, BEYOND_NODE, tuple(float(i == node) for i in mesh.cells[cell])
    hit = away
    if not hit:
        # a little off by rounding: all boundary edges of the cells that were looked at
        hit = [(cell, k) for cell in seen for k in range(3) if mesh.across(cell, k) is None]
    if not hit:
        return _anywhere(mesh, v)
    at = min(hit, key=lambda edge: (_foot(mesh, edge[0], edge[1], v)[1], edge))
    return _outside(mesh, *at, v)


def _anywhere(mesh: _Coarse, x: Point) -> Place:
    for c in range(len(mesh.cells)):
        if _holds(mesh, c, x):
            return _inside(mesh, c, x)
    edges = [(c, k) for c in range(len(mesh.cells)) for k in range(3) if mesh.across(c, k) is None]
    c, k = min(edges, key=lambda edge: _foot(mesh, edge[0], edge[1], x)[1])
    return c, INSIDE if _foot(mesh, c, k, x)[1] <= _rounding(x) else k, _along(mesh, c, k, x)


def _off(mesh: _Coarse, place: Place, x: Point) -> float:
    """Return the distance of a point from its place, 0 inside."""
    c, beyond, weights = place
    if beyond == INSIDE:
        return 0.0
    at = np.array(weights) @ np.array([mesh.points[i] for i in mesh.cells[c]])
    return float(np.hypot(*(at - np.array(x))))


def _located(
    points: Floats, cells: Ints, boundary: Ints, mesh: _Coarse, injection: Ints
) -> tuple[list[Place], list[int]]:
    x: list[Point] = [(a, b) for a, b in points.tolist()]
    near: list[set[int]] = [set() for _ in x]
    for a, b, c in cells.tolist():
        near[a] |= {b, c}
        near[b] |= {c, a}
        near[c] |= {a, b}
    mesh.between(points, boundary, injection)
    on_boundary = set(boundary.ravel().tolist())
    place: dict[int, Place] = {}
    for c, v in enumerate(injection.tolist()):
        if v >= 0 and c in mesh.around:
            cell = mesh.around[c][0]
            place[v] = (cell, INSIDE, tuple(float(i == c) for i in mesh.cells[cell]))
    tails, count = np.unique(boundary[:, 0], return_counts=True)
    touching = set(tails[count > 1].tolist()) - set(place)
    lost: set[int] = set()

    def may_start(u: int, grade: int) -> bool:
        if u not in place:
            return False
        if u not in on_boundary or grade == 2:
            return True
        c, _, weights = place[u]
        tip = max(weights) == 1.0 and mesh.is_tip(mesh.cells[c][weights.index(1.0)])
        return grade == 1 and not tip and u not in touching

    grade = 0
    missing = [v for v in range(len(x)) if v not in place]
    while missing:
        found: dict[int, tuple[int, Place]] = {}
        for v in missing:
            starts = [(place[u][1] != INSIDE, u) for u in near[v] if may_start(u, grade)]
            if starts:
                u = min(starts)[1]
                found[v] = (u, _walk(mesh, x[u], place[u], v, x[v]))
        if not found and grade == 2:
            v = missing[0]
            found[v] = (v, _anywhere(mesh, x[v]))
            lost |= {v} if found[v][1][1] != INSIDE else set()
        grade = 0 if found else grade + 1
        for v, (u, at) in found.items():
            place[v] = at
            lost |= {v} if u in lost and at[1] != INSIDE else set()
        missing = [v for v in missing if v not in place]

    looked = {v: [u for u in sorted(near[v]) if may_start(u, 1)] for v in range(len(x)) if place[v][1] != INSIDE}
    for _ in range(8):
        better = {}
        for v, others in looked.items():
            best, least = place[v], _off(mesh, place[v], x[v])
            for u in others:
                other = _walk(mesh, x[u], place[u], v, x[v])
                distance = _off(mesh, other, x[v])
                if distance < (1 - 1e-9) * least:
                    best, least = other, distance
            if best != place[v]:
                better[v] = best
        if not better:
            break
        place |= better
    return [place[v] for v in range(len(x))], sorted(lost)


def prolongation(
    points: Floats,
    cells: Ints,
    boundary: Ints,
    coarse_points: Floats,
    coarse_cells: Ints,
    injection: Ints,
    _threads: int | None,
) -> tuple[Rows, Ints, Floats, Ints]:
    """Interpolate a coarse mesh at the nodes of a finer one: rows, nodes outside, their distances, lost nodes."""
    mesh = _Coarse(coarse_points, coarse_cells)
    places, lost = _located(points, cells, boundary, mesh, injection)
    indptr, indices, values = [0], [], []
    outside, distances = [], []
    for v, place in enumerate(places):
        c, beyond, weights = place
        row = sorted((i, w) for i, w in zip(mesh.cells[c], weights, strict=True) if w > 0)
        indices += [i for i, _ in row]
        values += [w for _, w in row]
        indptr.append(len(indices))
        if beyond != INSIDE:
            outside.append(v)
            distances.append(_off(mesh, place, (points[v, 0], points[v, 1])))
    rows = (np.array(indptr, np.int32), np.array(indices, np.int32), np.array(values, float))
    return rows, np.array(outside, np.int64), np.array(distances, float), np.array(lost, np.int64)


def _common(one: Floats, other: Floats) -> float:
    """Area that two triangles share: the first one cut by the sides of the second."""
    polygon = one
    for k in range(3):
        a, b = other[k], other[(k + 1) % 3]
        side = (b - a)[0] * (polygon - a)[:, 1] - (b - a)[1] * (polygon - a)[:, 0]
        kept = []
        for i, p in enumerate(polygon):
            j = (i + 1) % len(polygon)
            if side[i] >= 0:
                kept.append(p)
            if side[i] * side[j] < 0:
                kept.append(p + side[i] / (side[i] - side[j]) * (polygon[j] - p))
        if len(kept) <= 2:
            return 0.0
        polygon = np.array(kept)
    x, y = (polygon - polygon[0]).T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def overlap(
    points: Floats,
    cells: Ints,
    boundary: Ints,
    coarse_points: Floats,
    coarse_cells: Ints,
    injection: Ints,
    _threads: int | None,
) -> Rows:
    """Return the areas that finer cells share with coarse cells, without crossing the coarse boundary."""
    mesh = _Coarse(coarse_points, coarse_cells)
    places, _ = _located(points, cells, boundary, mesh, injection)
    indptr, indices, values = [0], [], []
    for cell in cells.tolist():
        corners = points[cell]
        x, y = corners.mean(axis=0)
        tip = {
            i: max(places[i][2]) == 1.0 and mesh.is_tip(mesh.cells[places[i][0]][places[i][2].index(1.0)]) for i in cell
        }
        start = min(cell, key=lambda i: (tip[i], places[i][1] != INSIDE, i))
        home = _walk(mesh, (points[start, 0], points[start, 1]), places[start], -1, (x, y))
        queue = [home[0]] if home[1] == INSIDE else sorted({home[0], *(places[i][0] for i in cell)})
        first, seen, shared = set(queue), set(queue), {}
        (ux, uy), (vx, vy) = corners[1] - corners[0], corners[2] - corners[0]
        touch = 1e-13 * abs(ux * vy - uy * vx) / 2
        while queue:
            c = queue.pop(0)
            area = _common(corners, coarse_points[coarse_cells[c]])
            if area > touch:
                shared[c] = area
            if area > touch or c in first:
                for k in range(3):
                    other = mesh.across(c, k)
                    if other is not None and other[0] not in seen:
                        seen.add(other[0])
                        queue.append(other[0])
        shared = shared or {home[0]: 0.0}
        indices += sorted(shared)
        values += [shared[c] for c in sorted(shared)]
        indptr.append(len(indices))
    return np.array(indptr, np.int32), np.array(indices, np.int32), np.array(values, float)


def galerkin(a: Any, p: Any, least: float, _threads: int | None) -> tuple[Rows, Rows]:
    """Return p.T and p.T @ a @ p by rows, without its weak entries."""
    restriction = p.T.tocsr()
    made = (restriction @ a @ p).tocsr()
    out = []
    for matrix in (restriction, _filtered(made, least)):
        matrix.sort_indices()
        out.append((matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32), matrix.data))
    return out[0], out[1]


def stage(a: Any, p: Any, coarse: Any, least: float, left: float, threads: int | None) -> tuple[Rows, Rows, Ints]:
    """Return the same, and the unknowns that are slow."""
    return (*galerkin(a, p, least, threads), slow(a, coarse, left))


def slow(a: Any, coarse: Any, left: float) -> Ints:
    """Return where two symmetric sweeps between the coarse unknowns, which stay 0, leave more of errors of 1."""
    e = np.where(coarse, 0.0, 1.0)
    free = np.flatnonzero(~coarse).tolist()
    for i in 2 * (free + free[::-1]):
        columns, values = (part[a.indptr[i] : a.indptr[i + 1]] for part in (a.indices, a.data))
        own = values[columns == i].sum()
        if own != 0:
            e[i] -= values @ e[columns] / own
    return np.flatnonzero(np.abs(e) > left)


def _filtered(a: Any, least: float) -> Any:
    """Hand weak couplings w (u_i - u_j)² on to the way over the neighbour k that both are coupled to most.

    They become 2 w (u_i - u_k)² + 2 w (u_k - u_j)²; repulsions go to the diagonal. Couplings without a way stay.
    """
    from scipy.sparse import csr_matrix

    rows: list[dict[int, float]] = [
        dict(zip(a.indices[s:e].tolist(), a.data[s:e].tolist(), strict=True)) for s, e in pairwise(a.indptr)
    ]
    own = a.diagonal()

    def weak(i: int, j: int, size: float) -> bool:
        return bool(size * size < least * least * (own[i] * own[j]))

    found = []
    for i, row in enumerate(rows):
        for j in sorted(j for j in row if j > i):
            back = rows[j].get(i, 0.0)
            half = (row[j] + back) / 2.0
            if not weak(i, j, max(abs(row[j]), abs(back))):
                continue
            ways = [
                (-min(-row[k], -rows[j][k]), k)
                for k in row.keys() & rows[j].keys() - {i, j}
                if max(row[k], rows[j][k]) < 0 and not weak(i, k, row[k]) and not weak(j, k, rows[j][k])
            ]
            if half > 0 or ways:
                found.append((i, j, min(ways)[1] if half <= 0 else None, half))
    gone = [(i, j, rows[i].pop(j, 0.0)) for one, two, *_ in found for i, j in ((one, two), (two, one))]
    for i, _, value in gone:
        if i in rows[i]:
            rows[i][i] += value
    for one, two, k, half in found:
        if k is None:
            continue
        for i in (one, two):
            for s, t in ((i, k), (k, i)):
                if t in rows[s] and s in rows[s]:
                    rows[s][t] += 2.0 * half
                    rows[s][s] -= 2.0 * half
    indptr = np.concatenate([[0], np.cumsum([len(row) for row in rows])])
    indices = np.array([j for row in rows for j in row], dtype=np.int32)
    return csr_matrix((np.array([value for row in rows for value in row.values()]), indices, indptr), shape=a.shape)
