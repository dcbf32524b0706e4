r"""An artificial coast with islands: a sea cut out of a bisected square along the zero line of a rough field.

The field is a slope from land to sea plus random waves, and ends at sea in an arc, the open boundary, as the meshes
of tidal models do. A mesh of right isosceles triangles, fine along the coast and coarser towards the open sea, is cut
along the zero line by isosurface stuffing (Labelle and Shewchuk 2007) in the plane: nodes nearer to the line than a
third of an edge are moved onto it, and what cells still cross it are cut::

        +-------+              +-------+
         \  - /                \____/        + +   two cells of a quadrilateral
          \ /          ->         cut          + -   one cell
           -
"""

from __future__ import annotations

import numpy as np

from .bisection import Bools, Floats, Ints, bisected
from .mesh import Mesh

OPEN, MAINLAND, ISLAND = -1, 20, 21
NAMES = {OPEN: "open", MAINLAND: "mainland, weak", ISLAND: "island, weak"}
"""Facet tags of :func:`coast`, ADCIRC's own, so that a ``fort.14`` of it is one."""

_WAVES = 40
_SNAP = 0.3  # share of an edge under which its node is moved onto the zero line
_RADIUS = 0.47  # of the sea's arc, about the middle of the unit square


def coast(n: int = 10_000, *, seed: int = 1997, extent: float = 100e3) -> Mesh:
    """Make a sea before a rough artificial coast with islands, fine along the coast, with depth.

    Parameters
    ----------
    n : int
        About as many nodes (within some 10 %), at least 200.
    seed : int
        Chooses the coast.
    extent : float
        Length of the square about it, in metres.

    Returns
    -------
    Mesh
        ``facet_tags`` are -1 on the open boundary, 20 on the mainland, 21 on islands; ``point_data["depth"]`` in
        metres.
    """
    if n < 200:
        raise ValueError(f"'n' is {n}, expected n >= 200")
    if not (extent > 0 and np.isfinite(extent)):
        raise ValueError(f"'extent' is {extent}, expected a positive length")
    field = _Field(seed, finest=np.sqrt(1.2 / n))
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]], dtype=float)
    quarters = np.array([[4, 0, 1], [4, 1, 2], [4, 2, 3], [4, 3, 0]])
    asked, wish = 1.5, min(n, 4000)
    for _ in range(4):  # land takes a share of the nodes that only a cut tells; a coarse one tells it nearly
        points, cells = _cut_along_zero(*bisected(corners, quarters, field.size, int(asked * wish)), field)
        close = abs(len(points) - wish) <= 0.05 * wish
        asked *= wish / len(points)
        if wish == n and close:
            break
        wish = n
    facets = _boundary(cells)
    at_sea = np.abs(np.hypot(*(points - 0.5).T) - _RADIUS) < 2e-3
    open_ = at_sea[facets].all(axis=1)
    loop = _components(len(points), facets)[facets[:, 0]]
    tags = np.where(open_, OPEN, np.where(np.isin(loop, loop[open_]), MAINLAND, ISLAND))
    depth = 2.0 + 400.0 * np.maximum(field.land(points), 0.0)
    return Mesh(
        points * extent,
        cells,
        facets=facets,
        facet_tags=tags,
        point_data={"depth": depth},
        facet_names=NAMES,
    )


class _Field:
    """Positive at sea, about the distance from the coast; random waves down to a few times the finest edge."""

    def __init__(self, seed: int, finest: float) -> None:
        random = np.random.default_rng(seed)
        shortest = max(6 * finest, 0.03)
        length = np.exp(random.uniform(np.log(shortest), np.log(0.7), _WAVES))
        direction = random.uniform(0, 2 * np.pi, _WAVES)
        self.waves = 2 * np.pi / length * np.stack([np.cos(direction), np.sin(direction)])
        self.phases = random.uniform(0, 2 * np.pi, _WAVES)
        self.heights = 0.06 * length**0.8
        self.lean = random.uniform(0, 2 * np.pi)

    def land(self, x: Floats) -> Floats:
        """Make the field without the sea's arc."""
        toward = (x - 0.5) @ np.array([np.cos(self.lean), np.sin(self.lean)])
        value = 0.4 * (toward + 0.12)
        for wave, phase, height in zip(self.waves.T, self.phases, self.heights, strict=True):
            value += height * np.sin(x @ wave + phase)
        return np.asarray(value)

    def __call__(self, x: Floats) -> Floats:
        return np.asarray(np.minimum(self.land(x), _RADIUS - np.hypot(*(x - 0.5).T)))

    def size(self, x: Floats) -> Floats:
        """Wished edge: short along the coast, longer out at sea, longest on land and outside."""
        value = self.land(x)
        outside = np.maximum(np.hypot(*(x - 0.5).T) - _RADIUS, 0)
        return np.asarray(0.012 + np.where(value > 0, 0.5 * value, -3 * value) + outside)


def _cut_along_zero(points: Floats, cells: Ints, field: _Field) -> tuple[Floats, Ints]:
    """Return the connected part, the largest, of the mesh where the field is positive."""
    value = field(points)
    points, value = _snapped(points, value, _unique_edges(cells))
    signs = np.sign(value[cells])
    flat = (signs == 0).all(axis=1)
    signs[flat & (field(points[cells].mean(axis=1)) > 0)] = 1
    kept = [cells[(signs >= 0).all(axis=1) & (signs > 0).any(axis=1)]]
    crossing = (signs > 0).any(axis=1) & (signs < 0).any(axis=1)
    cells, signs = cells[crossing], signs[crossing]
    # the odd one first: the only negative of (- + +), the only positive of (+ - -), the zero of (0 + -)
    zero = (signs == 0).any(axis=1)
    odd = np.where(
        zero,
        (signs == 0).argmax(axis=1),
        np.where(signs.sum(axis=1) > 0, signs.argmin(axis=1), signs.argmax(axis=1)),
    )
    turn = (odd[:, None] + np.arange(3)) % 3
    cells, signs = (
        np.take_along_axis(cells, turn, axis=1),
        np.take_along_axis(signs, turn, axis=1),
    )
    ends = np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [0, 2]], cells[:, [1, 2]]]), axis=1)
    ends = ends[value[ends[:, 0]] * value[ends[:, 1]] < 0]
    keys = np.unique(ends[:, 0] * len(points) + ends[:, 1])
    i, j = np.divmod(keys, len(points))
    share = (value[i] / (value[i] - value[j]))[:, None]
    cuts = (1 - share) * points[i] + share * points[j]

    def cut(p: Ints, q: Ints) -> Ints:
        key = np.minimum(p, q) * len(points) + np.maximum(p, q)
        return np.asarray(len(points) + np.searchsorted(keys, key))

    a, b, c = cells[zero & (signs[:, 1] > 0)].T
    kept.append(np.column_stack([a, b, cut(b, c)]))
    a, b, c = cells[zero & (signs[:, 1] < 0)].T
    kept.append(np.column_stack([a, cut(b, c), c]))
    a, b, c = cells[~zero & (signs[:, 0] > 0)].T
    kept.append(np.column_stack([a, cut(a, b), cut(a, c)]))
    a, b, c = cells[~zero & (signs[:, 0] < 0)].T
    ab, ac = cut(a, b), cut(a, c)
    everything = np.concatenate([points, cuts])
    first = np.hypot(*(everything[ab] - points[c]).T) <= np.hypot(*(everything[ac] - points[b]).T)
    kept.append(np.where(first[:, None], np.column_stack([ab, b, c]), np.column_stack([ab, b, ac])))
    kept.append(np.where(first[:, None], np.column_stack([ab, c, ac]), np.column_stack([b, c, ac])))
    return _largest_part(everything, np.concatenate(kept))


def _snapped(points: Floats, value: Floats, edges: Ints) -> tuple[Floats, Floats]:
    """Move nodes near the zero line onto it, nearest first, so that no cell is turned over."""
    points, value = points.copy(), value.copy()
    both = np.concatenate([edges, edges[:, ::-1]])
    while True:
        i, j = both[value[both[:, 0]] * value[both[:, 1]] < 0].T
        share = value[i] / (value[i] - value[j])
        near = share < _SNAP
        i, j, share = i[near], j[near], share[near]
        if len(i) == 0:
            return points, value
        best = np.full(len(points), np.inf)
        np.minimum.at(best, i, share)
        rival = np.full(len(points), np.inf)  # the best share among a node's neighbours
        np.minimum.at(rival, both[:, 0], best[both[:, 1]])
        # strict first by share, then by number, so that the best of all always moves
        move = (share == best[i]) & ((share < rival[i]) | ((share == rival[i]) & _lowest(best, both)[i]))
        nodes, first = np.unique(i[move], return_index=True)
        target, share = j[move][first], share[move][first]
        points[nodes] += share[:, None] * (points[target] - points[nodes])
        value[nodes] = 0.0


def _lowest(best: Floats, both: Ints) -> Bools:
    """Nodes of a lower number than every neighbour with the same best share."""
    lowest = np.ones(len(best), dtype=bool)
    tie = (best[both[:, 0]] == best[both[:, 1]]) & (both[:, 1] < both[:, 0])
    lowest[both[tie, 0]] = False
    return lowest


def _edge_keys(cells: Ints) -> tuple[Ints, Ints]:
    """Return the edges of the cells, directed, (3m, 2), and a number for each that both its directions share."""
    edges = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
    return edges, edges.min(axis=1) * (cells.max() + 1) + edges.max(axis=1)


def _unique_edges(cells: Ints) -> Ints:
    edges, keys = _edge_keys(cells)
    return np.asarray(edges[np.unique(keys, return_index=True)[1]])


def _boundary(cells: Ints) -> Ints:
    """Edges of one cell only, directed with the cell on their left."""
    edges, keys = _edge_keys(cells)
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    return np.asarray(edges[first[count == 1]])


def _components(n: int, edges: Ints) -> Ints:
    """Return the lowest node number of each node's connected part."""
    label: Ints = np.arange(n)
    while True:
        low = np.minimum(label[edges[:, 0]], label[edges[:, 1]])
        new = label.copy()
        for side in (0, 1):
            np.minimum.at(new, edges[:, side], low)
            np.minimum.at(new, label[edges[:, side]], low)
        new = new[new]
        if np.array_equal(new, label):
            return label
        label = new


def _largest_part(points: Floats, cells: Ints) -> tuple[Floats, Ints]:
    """Cells of the largest part joined edge to edge, nodes without cells dropped."""
    keys = _edge_keys(cells)[1]
    order = np.argsort(keys)
    same = keys[order[1:]] == keys[order[:-1]]
    owner = order % len(cells)
    part = _components(len(cells), np.column_stack([owner[:-1][same], owner[1:][same]]))
    cells = cells[part == np.bincount(part).argmax()]
    used, inverse = np.unique(cells, return_inverse=True)
    return points[used], inverse.reshape(-1, 3)
