"""What results are checked against: definitions by brute force, and properties of a level by exact arithmetic.

Nothing here knows how the package computes anything; only exact signs (`coarsen.reference.point`) are shared, and those
have tests of their own against rational numbers.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from fractions import Fraction

import numpy as np

from coarsen.reference.point import in_circle, signs

# --- spacing and selection, by definition ----------------------------------------------------------------------------


def distances(a, b):
    """All distances |a_i - b_j|, sqrt(dx*dx + dy*dy) in this order."""
    total = np.zeros((len(a), len(b)))
    for k in range(a.shape[1]):
        difference = a[:, None, k] - b[None, :, k]
        total = total + difference * difference
    return np.sqrt(total)


def brute_nearest(points):
    """Definition 3.2 at the points; coincident ones count as one."""
    between = distances(points, points)
    return np.where(between > 0, between, np.inf).min(axis=1)


def brute_coarsened(points, g, factor, gradation=1.0, at=None):
    """Definition 3.3."""
    return (factor * g[None] + gradation * distances(points if at is None else at, points)).min(axis=1)


def brute_conflicts(points, f, beta):
    """Definition 3.5 as a matrix; coincident points don't conflict."""
    between = distances(points, points)
    return (between > 0) & (between < (f[:, None] + f[None]) / beta)


def brute_greedy(conflicts, order, keep=()):
    """The greedy set over a conflict matrix, `keep` included, ascending."""
    inside = np.zeros(len(conflicts), bool)
    inside[list(keep)] = True
    for i in order:
        inside[i] |= not (conflicts[i] & inside).any()
    return np.flatnonzero(inside)


def assert_is_lipschitz(points, f, slope=1.0):
    rounding = 8 * np.finfo(float).eps * (np.abs(f).max(initial=0.0) + np.abs(points).max(initial=0.0))
    steepest = np.abs(f[:, None] - f[None]) - slope * distances(points, points)
    assert (steepest <= rounding).all(), f"f is not {slope}-Lipschitz, by {steepest.max()}"


def assert_is_spaced(points, f, beta, exempt=()):
    """Definition 3.1: f(p) + f(q) <= beta |p - q| for any two locations, unless both are exempt."""
    bad = brute_conflicts(points, f, beta)
    free = np.zeros(len(points), bool)
    free[list(exempt)] = True
    bad &= ~(free[:, None] & free[None])
    assert not bad.any(), f"points {np.argwhere(bad)[0]} are nearer than their spacing allows"


def assert_is_mis(points, f, beta, selected, candidates=None, exempt=()):
    """`selected` is independent (but among `exempt`) and no candidate could be added."""
    selected = np.asarray(selected)
    place = {int(i): k for k, i in enumerate(selected)}
    assert_is_spaced(points[selected], f[selected], beta, [place[int(i)] for i in exempt if int(i) in place])
    out = np.setdiff1d(np.arange(len(points)) if candidates is None else candidates, selected)
    for some in np.array_split(out, max(1, len(out) * len(selected) // 2_000_000)):
        between = distances(points[some], points[selected])
        blocked = ((between > 0) & (between < (f[some, None] + f[None, selected]) / beta)).any(axis=1)
        # one that coincides with a selected point is in with it, not out: it can be no candidate of its own
        assert blocked.all(), f"point {some[~blocked][0]} conflicts with none that was selected"


# --- triangulations --------------------------------------------------------------------------------------------------


def directed_edges(cells):
    """Edges (3m, 2) of counter-clockwise cells and the cell of each; opposite corners are `cells` rolled by one."""
    edges = np.concatenate([cells[:, [1, 2]], cells[:, [2, 0]], cells[:, [0, 1]]])
    return edges, np.tile(np.arange(len(cells)), 3), cells.T.ravel()


def assert_is_conforming(points, cells):
    """Cells are positive, every directed edge belongs to one cell, no node is without a cell."""
    turn = signs(points[cells[:, 0]], points[cells[:, 1]], points[cells[:, 2]])
    assert (turn > 0).all(), f"cell {np.flatnonzero(turn <= 0)[0]} is not positive"
    edges, _, _ = directed_edges(cells)
    unique = np.unique(edges, axis=0)
    assert len(unique) == len(edges), "two cells on one side of an edge"
    assert len(np.unique(cells)) == len(points), "a node without a cell"


def circle_signs(points, a, b, c, d):
    """`in_circle` of index arrays: a filter on arrays, exact arithmetic for what it can't tell."""
    pa, pb, pc = (points[k] - points[d] for k in (a, b, c))
    total = size = 0.0
    for p, q, r in ((pa, pb, pc), (pb, pc, pa), (pc, pa, pb)):
        lift = (p * p).sum(axis=1)
        total = total + lift * (q[:, 0] * r[:, 1] - q[:, 1] * r[:, 0])
        size = size + lift * (np.abs(q[:, 0] * r[:, 1]) + np.abs(q[:, 1] * r[:, 0]))
    result = np.sign(total).astype(int)
    for k in np.flatnonzero(~(np.abs(total) > 4e-15 * size + 1e-290)):
        result[k] = in_circle(*(tuple(map(float, points[i[k]])) for i in (a, b, c, d)))
    return result


def assert_is_delaunay(points, cells, constraints=()):
    """Every edge of two cells that is no constraint is locally Delaunay, exactly; constraints are edges."""
    assert_edges_exist(cells, constraints)
    fixed = {frozenset(map(int, edge)) for edge in constraints}
    edges, _, apex = directed_edges(cells)
    opposite = {(u, v): w for (u, v), w in zip(edges.tolist(), apex.tolist(), strict=True)}
    inner = [
        (u, v, w, opposite[v, u])
        for (u, v), w in opposite.items()
        if u < v and (v, u) in opposite and frozenset((u, v)) not in fixed
    ]
    if inner:
        bad = circle_signs(points, *np.array(inner).T) > 0
        assert not bad.any(), f"edge {inner[int(np.argmax(bad))][:2]} is not Delaunay ({bad.sum()} of {len(bad)})"


def assert_edges_exist(cells, wanted):
    there = {frozenset(edge) for edge in directed_edges(np.asarray(cells))[0].tolist()}
    for edge in wanted:
        assert frozenset(map(int, edge)) in there, f"no cell has the edge {edge}"


def area_2(points, cells):
    """Twice the exact area of some cells, or of closed polygons of any length, as a rational number."""
    total = Fraction(0)
    for cell in np.asarray(cells).tolist():
        ring = [tuple(map(Fraction, points[i])) for i in cell]
        total += sum(p[0] * q[1] - p[1] * q[0] for p, q in zip(ring, ring[1:] + ring[:1], strict=True))
    return total


# --- levels ----------------------------------------------------------------------------------------------------------


def components(n, pairs):
    """Number of components of a graph on those of n nodes that have an edge."""
    parent = list(range(n))

    def root(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    touched = set()
    for a, b in np.asarray(pairs).reshape(-1, 2).tolist():
        touched |= {a, b}
        parent[root(a)] = root(b)
    return len({root(i) for i in touched})


def topology_of(mesh):
    """Euler characteristic, boundary loops, parts by nodes, parts by edges."""
    cells = np.asarray(mesh.cells)
    edges, owner, _ = directed_edges(cells)
    by_edge = {(u, v): c for (u, v), c in zip(edges.tolist(), owner.tolist(), strict=True)}
    n_edges = len({frozenset(edge) for edge in by_edge})
    shared = [(c, by_edge[v, u]) for (u, v), c in by_edge.items() if (v, u) in by_edge]
    alone = [(c, c) for c in range(len(cells))]
    boundary = [edge for edge in by_edge if edge[::-1] not in by_edge]
    return {
        "Euler characteristic": mesh.n_points - n_edges + len(cells),
        "boundary loops": components(mesh.n_points, boundary),
        "parts by nodes": components(mesh.n_points, cells[:, [0, 1, 1, 2]].reshape(-1, 2)),
        "parts by edges": components(len(cells), shared + alone),
    }


def crossing(points, segments):
    """The first two segments that share a point which is no end of both, or None; copies of a segment share all."""
    a, b = points[segments[:, 0]], points[segments[:, 1]]
    low, high = np.minimum(a, b), np.maximum(a, b)
    order = np.argsort(low[:, 0], kind="stable")
    reach = np.searchsorted(low[order, 0], high[order, 0], side="right")
    for k, i in enumerate(order):
        near = order[k + 1 : reach[k]]
        near = near[(low[near, 1] <= high[i, 1]) & (high[near, 1] >= low[i, 1])]
        if not len(near):
            continue
        one, two = signs(a[i], b[i], a[near]), signs(a[i], b[i], b[near])
        three, four = signs(a[near], b[near], a[i]), signs(a[near], b[near], b[i])
        same = lambda p, q: (p == q).all(axis=-1)  # noqa: E731
        shared = [[same(p[i], q[near]) for q in (a, b)] for p in (a, b)]
        twins = (shared[0][0] & shared[1][1]) | (shared[0][1] & shared[1][0])
        proper = (one * two < 0) & (three * four < 0)
        # an end of one within the other
        touch = np.zeros(len(near), bool)
        for turn, p, s, t in ((one, a[near], a[i], b[i]), (two, b[near], a[i], b[i])):
            touch |= (turn == 0) & _strictly_between(p, s, t)
        for turn, p in ((three, a[i]), (four, b[i])):
            touch |= (turn == 0) & _strictly_between(p, a[near], b[near])
        bad = (proper | touch) & ~twins
        if bad.any():
            return int(i), int(near[int(np.argmax(bad))])
    return None


def _strictly_between(p, s, t):
    """Whether p, on the line through s and t, lies between them and is neither."""
    inside = ((np.minimum(s, t) <= p) & (p <= np.maximum(s, t))).all(axis=-1)
    return inside & ~(p == s).all(axis=-1) & ~(p == t).all(axis=-1)


def pieces_of(fine_facets, level_facets, kept):
    """For every facet of a level the rows of the fine facets that it stands for, in order; every fine row is used once.

    A row u -> v of the level is a chord: from u along fine rows, directed alike, through nodes that weren't kept, to v.
    """
    leaving = defaultdict(list)
    for row, (u, v) in enumerate(fine_facets.tolist()):
        leaving[u].append((row, v))
    unused = set(range(len(fine_facets)))
    found = []
    for u, v in level_facets.tolist():
        ways = []
        for first in leaving[u]:
            rows, at = [first[0]], first[1]
            while at not in kept and len(leaving[at]) == 1 and len(rows) <= len(fine_facets):
                row, at = leaving[at][0]
                rows.append(row)
            if at == v and set(rows) <= unused:
                ways.append(rows)
        assert ways, f"the facet {u} -> {v} is no chord of the finer facets"
        rows = min(ways, key=len)
        unused -= set(rows)
        found.append(rows)
    return found, unused


def odd_crossings(polygon, points):
    """Whether each point is inside a polygon by the even-odd rule, exactly."""
    odd = np.zeros(len(points), bool)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        spans = np.flatnonzero((a[1] > points[:, 1]) != (b[1] > points[:, 1]))
        if len(spans):
            turn = signs(a, b, points[spans])
            odd[spans] ^= turn > 0 if b[1] > a[1] else turn < 0
    return odd


def assert_is_valid_level(level, fine, *, delaunay=True):
    """All that API.md promises of any level that keeps the domain (every value of `features` but "drop")."""
    mesh, nodes = level.mesh, np.asarray(level.nodes)
    points, cells = mesh.points, np.asarray(mesh.cells)
    assert (np.diff(nodes) > 0).all(), "nodes are not ascending"
    assert np.array_equal(points, fine.points[nodes]), "a point has moved"
    assert_is_conforming(points, cells)
    assert topology_of(mesh) == topology_of(fine)
    top, fine_top = mesh.topology, fine.topology
    kept = set(nodes.tolist())

    # coincident nodes (slits, walls) stay or go together
    places = defaultdict(set)
    for i in np.unique(fine_top.facets):
        places[tuple(fine.points[i] + 0.0)].add(int(i))
    for copies in places.values():
        assert not (copies & kept) or copies <= kept, f"of the coincident nodes {copies} only some were kept"

    # every facet is a chord, every fine facet has one
    facets = nodes[top.facets]
    b, fine_b = top.n_boundary, fine_top.n_boundary
    rows, left_over = pieces_of(fine_top.facets[:fine_b], facets[:b], kept)
    assert not left_over, f"{len(left_over)} boundary facets have no chord"
    both = np.concatenate([fine_top.facets[fine_b:], fine_top.facets[fine_b:, ::-1]])
    half = len(fine_top.facets) - fine_b
    # interior rows are directed anew on every level: each is met once, in one of its directions
    inner, left_over = interior_pieces(fine_top.facets[fine_b:], facets[b:], kept)
    assert not left_over, f"{len(left_over)} interior facets have no chord"
    assert len(both) == 2 * half

    # tags of cells and facets
    if fine.cell_tags is not None:
        for k, piece in enumerate(rows):
            here, there = mesh.cell_tags[top.facet_cells[k, 0]], fine.cell_tags[fine_top.facet_cells[piece, 0]]
            assert (there == here).all(), f"facet {k} has cells of tag {here} beside it, the finer one {there}"
        for k, piece in enumerate(inner):
            for row, forward in piece:
                here = mesh.cell_tags[top.facet_cells[b + k]]
                there = fine.cell_tags[fine_top.facet_cells[fine_b + row]][:: 1 if forward else -1]
                assert (here == there).all(), f"facet {b + k} has tags {here} beside it, the finer one {there}"
        edges, owner, _ = directed_edges(cells)
        known = {frozenset(edge) for edge in top.facets.tolist()}
        by_edge = {(u, v): c for (u, v), c in zip(edges.tolist(), owner.tolist(), strict=True)}
        for (u, v), c in by_edge.items():
            other = by_edge.get((v, u))
            if other is not None and mesh.cell_tags[c] != mesh.cell_tags[other]:
                assert frozenset((u, v)) in known, f"tags change across the edge {u} {v}, which is no facet"
    if fine.facet_tags is not None:
        all_rows = [*rows, *[[fine_b + row for row, _ in piece] for piece in inner]]
        for k, piece in enumerate(all_rows):
            given = fine_top.facet_given[piece]
            assert ((given >= 0) == (top.facet_given[k] >= 0)).all(), f"facet {k}: given and not given"
            if top.facet_given[k] >= 0:
                assert (fine.facet_tags[given] == mesh.facet_tags[top.facet_given[k]]).all(), f"facet {k}: tag"

    if top.layer is None:
        assert crossing(points, top.facets) is None, f"facets {crossing(points, top.facets)} cross"
        assert_own_sides(points, fine, nodes, top, rows, [[row for row, _ in piece] for piece in inner])
    if delaunay:
        assert_is_delaunay(points, cells, top.facets)


def interior_pieces(fine_facets, level_facets, kept):
    """As `pieces_of` for undirected rows: (row, whether it runs along) for every facet of the level."""
    around = defaultdict(list)
    for row, (u, v) in enumerate(fine_facets.tolist()):
        around[u].append((row, v, True))
        around[v].append((row, u, False))
    unused = set(range(len(fine_facets)))
    found = []
    for u, v in level_facets.tolist():
        ways = []
        for first in around[u]:
            piece, at = [(first[0], first[2])], first[1]
            while at not in kept and len(around[at]) == 2:
                row, at, forward = next(step for step in around[at] if step[0] != piece[-1][0])
                piece.append((row, forward))
            if at == v and {row for row, _ in piece} <= unused:
                ways.append(piece)
        assert ways, f"the interior facet {u} - {v} is no chord of the finer facets"
        piece = min(ways, key=len)
        unused -= {row for row, _ in piece}
        found.append(piece)
    return found, unused


def assert_own_sides(points, fine, nodes, top, boundary, interior):
    """No kept node lies in the region between a chord and its piece of the finer facets."""
    order = np.argsort(points[:, 0], kind="stable")
    for k, piece in enumerate([*boundary, *[[top_row + fine.topology.n_boundary for top_row in p] for p in interior]]):
        if len(piece) == 1:
            continue
        on_piece = np.unique(fine.topology.facets[piece])
        corners = _path(fine.topology.facets[piece], int(nodes[top.facets[k, 0]]))
        polygon = fine.points[corners]
        low, high = polygon.min(axis=0), polygon.max(axis=0)
        span = slice(
            *np.searchsorted(points[order, 0], [low[0], high[0]], side="left"),
        )
        near = order[span]
        near = near[(points[near, 1] >= low[1]) & (points[near, 1] <= high[1])]
        ends = fine.points[[corners[0], corners[-1]]]
        own = (points[near, None] == ends[None]).all(axis=-1).any(axis=-1) | np.isin(nodes[near], on_piece)
        near = near[~own]
        if len(near):
            inside = odd_crossings(polygon, points[near])
            assert not inside.any(), f"node {nodes[near[int(np.argmax(inside))]]} is on the wrong side of facet {k}"


def _path(rows, start):
    path = [start]
    for u, v in rows.tolist():
        path.append(v if u == path[-1] else u)
    return path


def assert_node_nested(levels):
    """Every level's nodes are nodes of the finer ones."""
    for finer, coarser in itertools.pairwise(levels):
        lost = np.setdiff1d(coarser.nodes, finer.nodes)
        assert not len(lost), f"node {lost[0]} of a coarser level is missing on the finer one"
