"""Meshes made by code, of any size: for the demo, for examples, tests and benches.

Every function takes the wished number of nodes first and returns a :class:`coarsen.Mesh` of about as many. All are
deterministic; a seed, where there is one, chooses among many.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from .bisection import Floats, Ints, bisected
from .coast import coast
from .mesh import Mesh

__all__ = [
    "coast",
    "crack_plate",
    "graded_square",
    "interface",
    "line",
    "lshape",
    "plate_with_holes",
    "ring",
    "square",
]

DEFAULT_SEED = 1997


def crack_plate(n: int = 5120, *, exponent: float = 0.75) -> Mesh:
    """Make the paper's example: a unit square with a slit from the middle of its left side to the centre.

    Refined towards the tip of the slit by longest-edge bisection; every triangle is 45-45-90. The nodes of the slit are
    doubled, the tip (0.5, 0.5) is single::

        +-----------+
        |           |
        ======+     |     slit
        |           |
        +-----------+

    Parameters
    ----------
    n : int
        About as many nodes, at least 12.
    exponent : float
        Edges at a distance r from the tip are about as long as r to this power. 0.75 spreads the interpolation error of
        the crack's solution, of the order r^(1/2), evenly, and is what the paper's mesh measures; in [0, 0.9].

    Examples
    --------
    >>> import coarsen
    >>> mesh = coarsen.gallery.crack_plate(1000)
    >>> 990 <= mesh.n_points <= 1000
    True
    """
    points = np.array(
        [
            [0.5, 0.5],
            [1, 0.5],
            [1, 1],
            [0.5, 1],
            [0, 1],
            [0, 0.5],
            [0, 0.5],
            [0, 0],
            [0.5, 0],
            [1, 0],
        ],
        dtype=float,
    )
    # around the tip 0: right angles at the middles of the sides, every longest edge a diagonal through the tip;
    # node 5 is the upper bank of the slit's mouth, node 6 the lower
    cells = np.array(
        [
            [1, 2, 0],
            [3, 0, 2],
            [3, 4, 0],
            [5, 0, 4],
            [6, 7, 0],
            [8, 0, 7],
            [8, 9, 0],
            [1, 0, 9],
        ]
    )
    return Mesh(*bisected(points, cells, _distance_power(points[0], exponent), _at_least(n, 12)))


def lshape(n: int = 5000, *, exponent: float = 2 / 3) -> Mesh:
    """Make an L: the square (-1, 1)² without its lower right quarter, graded to the re-entrant corner at the origin.

    Parameters
    ----------
    n : int
        About as many nodes, at least 8.
    exponent : float
        Edges at a distance r from the corner are about as long as r to this power; 2/3 is the corner's own.
    """
    points = np.array(
        [[0, 0], [1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1]],
        dtype=float,
    )
    cells = np.array([[1, 2, 0], [3, 0, 2], [3, 4, 0], [5, 0, 4], [5, 6, 0], [7, 0, 6]])
    return Mesh(*bisected(points, cells, _distance_power(points[0], exponent), _at_least(n, 8)))


def graded_square(n: int = 10_000, ratio: float = 1e4) -> Mesh:
    """Make a unit square whose edges grow in proportion to the distance from the point (1/4, 1/4).

    Parameters
    ----------
    n : int
        About as many nodes, at least 16 for every doubling in `ratio`.
    ratio : float
        The longest edge is at least this many times as long as the shortest one (and at most about 16 times more).

    Raises
    ------
    ValueError
        If `n` nodes are too few for the ratio.
    """
    if not 1 <= ratio <= 1e12:
        raise ValueError(f"'ratio' is {ratio}, expected 1 <= ratio <= 1e12")
    centre = np.array([0.25, 0.25])
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]], dtype=float)
    cells = np.array([[4, 0, 1], [4, 1, 2], [4, 2, 3], [4, 3, 0]])
    _at_least(n, max(16, int(16 * math.log2(ratio))))
    inner = 1.0 / ratio
    while True:
        made = bisected(points, cells, partial(_distance_at_least, centre=centre, least=inner), n)
        corners = made[0][made[1]]
        lengths = np.hypot(*np.moveaxis(corners - np.roll(corners, 1, axis=1), -1, 0))
        if lengths.max() >= ratio * lengths.min():
            return Mesh(*made)
        inner /= 2


def square(n: int = 2500, *, seed: int | None = None) -> Mesh:
    """Make a unit square on a lattice, each of its small squares cut along its shorter diagonal.

    Parameters
    ----------
    n : int
        About as many nodes, at least 4.
    seed : int, optional
        Moves every inner node by up to 0.25 lattice steps at random: an irregular mesh. None: the plain lattice.
    """
    k = max(1, round(math.sqrt(_at_least(n, 4))) - 1)
    x, y = np.meshgrid(np.arange(k + 1), np.arange(k + 1), indexing="ij")
    lattice = np.stack([x, y], axis=-1).astype(float)
    if seed is not None:
        shift = np.random.default_rng(seed).uniform(-0.25, 0.25, lattice.shape)
        shift[[0, -1], :, 0] = 0
        shift[:, [0, -1], 1] = 0
        lattice += shift
    points = lattice.reshape(-1, 2) / k
    return Mesh(points, _cut(points, np.arange(len(points)).reshape(k + 1, k + 1)))


def ring(n: int = 3000, *, inner: float = 0.3) -> Mesh:
    """Make a ring of outer radius 1 about the origin, its cells nearly equilateral and growing outwards.

    Parameters
    ----------
    n : int
        About as many nodes, at least 12.
    inner : float
        The inner radius, in (0, 1).
    """
    if not 0 < inner < 1:
        raise ValueError(f"'inner' is {inner}, expected 0 < inner < 1")
    depth = -math.log(inner)  # rows r, r q, r q², ... with log q = √3/2 · 2π/around: height of an equilateral triangle
    around = max(6, round(math.sqrt(_at_least(n, 12) * math.sqrt(3) * math.pi / depth)))
    rows = max(1, round(depth * around / (math.sqrt(3) * math.pi)))
    row, step = np.meshgrid(np.arange(rows + 1), np.arange(around), indexing="ij")
    angle = 2 * math.pi * (step + row % 2 / 2) / around
    radius = np.exp(depth * (row / rows - 1))
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2)
    nodes = np.arange(len(points)).reshape(rows + 1, around)
    nodes = np.concatenate([nodes, nodes[:, :1]], axis=1)
    return Mesh(points, _cut(points, nodes))


def plate_with_holes(n: int = 8000, holes: tuple[int, int] = (3, 3), *, seed: int = DEFAULT_SEED) -> Mesh:
    """Make a plate of unit squares, each with a round hole of random size and place.

    Parameters
    ----------
    n : int
        About as many nodes, at least 32 a hole.
    holes : (int, int)
        Columns and rows of holes.
    seed : int
        Chooses radii in [0.1, 0.3] and centres.
    """
    columns, rows = holes
    if columns < 1 or rows < 1:
        raise ValueError(f"'holes' is {holes}, expected two positive numbers")
    _at_least(n, 32 * columns * rows)
    random = np.random.default_rng(seed)
    places = [(i, j) for i in range(columns) for j in range(rows)]
    radii = random.uniform(0.1, 0.3, len(places))
    centres = 0.5 + random.uniform(-0.12, 0.12, (len(places), 2))

    def layers(k: int) -> Ints:
        return np.maximum(2, np.round((0.56 - radii) * k)).astype(np.int64)

    k = 2
    while (4 * (k + 1) * layers(k + 1)).sum() <= n:
        k += 1
    parts = [
        _around_hole(np.array(place), k, centres[h], radii[h], layers(k)[h], circle=h + 1)
        for h, place in enumerate(places)
    ]
    return Mesh(*_joined(parts))


def interface(n: int = 3000, *, radius: float = 0.25) -> Mesh:
    """Make a unit square with a disc of another material in its middle: cell tag 1 outside, 2 inside.

    The circle between the two is a facet chain that every level keeps.

    Parameters
    ----------
    n : int
        About as many nodes, at least 40.
    radius : float
        Radius of the disc, in [0.1, 0.4].
    """
    if not 0.1 <= radius <= 0.4:
        raise ValueError(f"'radius' is {radius}, expected 0.1 <= radius <= 0.4")
    _at_least(n, 40)

    def layers(k: int) -> int:
        return max(2, round((0.56 - radius) * k))

    k = 2
    while 4 * (k + 1) * layers(k + 1) + (k + 2) ** 2 <= n:
        k += 1
    outside = _around_hole(np.zeros(2, dtype=np.int64), k, np.array([0.5, 0.5]), radius, layers(k))
    inside = _disc(k, np.array([0.5, 0.5]), radius)
    tags = np.repeat([1, 2], [len(outside[1]), len(inside[1])])
    return Mesh(*_joined([outside, inside]), cell_tags=tags, cell_names={1: "outside", 2: "inside"})


def line(n: int = 100, *, growth: float = 1.0) -> Mesh:
    """Make a line of n nodes (d = 1), each edge `growth` times as long as the one before.

    ``line(n, growth=2.0)`` is the paper's example of section 2.3: nodes at 2^i - 1, exactly. With growth 1 it is the
    unit interval in equal parts.

    Examples
    --------
    >>> import coarsen
    >>> coarsen.gallery.line(5, growth=2.0).points.ravel()
    array([ 0.,  1.,  3.,  7., 15.])
    """
    steps = np.arange(_at_least(n, 2), dtype=float)
    if not growth > 0 or abs(math.log2(growth)) * n > 1000:
        raise ValueError(f"'growth' is {growth}, expected a positive number with growth**n within the range of floats")
    points = steps / (n - 1) if growth == 1 else (growth**steps - 1) / (growth - 1)
    nodes = np.arange(n)
    return Mesh(points[:, None], np.column_stack([nodes[:-1], nodes[1:]]))


# --- parts -----------------------------------------------------------------------------------------------------------


def _at_least(n: int, least: int) -> int:
    if n < least:
        raise ValueError(f"'n' is {n}, expected n >= {least}")
    return int(n)


def _distance_at_least(x: Floats, centre: Floats, least: float) -> Floats:
    return np.asarray(np.maximum(np.hypot(*(x - centre).T), least))


def _distance_power(centre: Floats, exponent: float) -> Callable[[Floats], Floats]:
    if not 0 <= exponent <= 0.9:
        raise ValueError(f"'exponent' is {exponent}, expected 0 <= exponent <= 0.9")
    return lambda x: np.asarray(np.hypot(*(x - centre).T) ** exponent)


def _cut(points: Floats, nodes: Ints) -> Ints:
    """Triangles of a lattice of nodes: each of its cells cut along the shorter diagonal, alternating where equal."""
    a, b, c, d = (part.ravel() for part in (nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]))
    rising, falling = (np.hypot(*(points[p] - points[q]).T) for p, q in ((a, c), (b, d)))
    alternate = np.add.outer(*(np.arange(steps - 1) for steps in nodes.shape)).ravel() % 2 == 1
    fall = np.where(np.isclose(rising, falling, rtol=1e-9, atol=0), alternate, falling < rising)[:, None]
    first = np.where(fall, np.column_stack([a, b, d]), np.column_stack([a, b, c]))
    second = np.where(fall, np.column_stack([b, c, d]), np.column_stack([a, c, d]))
    return np.concatenate([first, second])


def _rim(k: int) -> Ints:
    """Return the 4k places on the rim of a square of k × k steps, counter-clockwise from its lower left corner."""
    up, stay = np.arange(k), np.zeros(k, dtype=np.int64)
    sides = [(up, stay), (stay + k, up), (k - up, stay + k), (stay, k - up)]
    return np.concatenate([np.column_stack(side) for side in sides])


Part = tuple[Floats, Ints, Ints]
"""Points, cells, and a place (x, y, kind) for each node: equal places are one node; kind < 0: a node of its own."""


def _around_hole(corner: Ints, k: int, centre: Floats, radius: float, layers: int, *, circle: int = 1) -> Part:
    """Return the square at `corner` outside a circle: 4k rays from its rim to the circle, which has that number.

    Layers shrink towards the circle as the rays close up.
    """
    rim = _rim(k)
    outer = rim / k
    angle = np.arctan2(*(outer - centre).T[::-1])
    arc = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    depth = np.linspace(0, 1, layers + 1)
    depth = (1 - (2 * math.pi * radius / 4) ** depth) / (1 - 2 * math.pi * radius / 4)  # 0 on the rim, 1 on the circle
    points = corner + outer[None] + depth[:, None, None] * (arc - outer)[None]
    points[-1] = corner + arc
    nodes = np.arange((layers + 1) * 4 * k).reshape(layers + 1, 4 * k)
    places = np.full((layers + 1, 4 * k, 3), -1, dtype=np.int64)
    places[0, :, :2], places[0, :, 2] = corner * k + rim, 0
    places[-1, :, :2], places[-1, :, 2] = rim, circle
    closed = np.concatenate([nodes, nodes[:, :1]], axis=1)
    points = points.reshape(-1, 2)
    return points, _cut(points, closed.T), places.reshape(-1, 3)


def _disc(k: int, centre: Floats, radius: float) -> Part:
    """Return a lattice of k × k steps laid into a circle, its rim at the same angles as the rays of `_around_hole`.

    Along a ray from the middle a node keeps its share of the way to the rim: squares become circles.
    """
    i, j = np.meshgrid(np.arange(k + 1), np.arange(k + 1), indexing="ij")
    x = np.stack([2 * i / k - 1, 2 * j / k - 1], axis=-1)
    largest = np.abs(x).max(axis=-1)
    length = np.hypot(x[..., 0], x[..., 1])
    # between a square in the middle and a circle at the rim
    round_ = x * np.divide(largest, length, out=np.ones_like(length), where=length > 0)[..., None]
    shape = largest[..., None] ** 2
    points = centre + radius * (shape * round_ + (1 - shape) * x * (1 / math.sqrt(2) + 0.15))
    places = np.full((k + 1, k + 1, 3), -1, dtype=np.int64)
    rim = _rim(k)
    places[rim[:, 0], rim[:, 1]] = np.column_stack([rim, np.ones(4 * k, dtype=np.int64)])
    nodes = np.arange((k + 1) ** 2).reshape(k + 1, k + 1)
    points = points.reshape(-1, 2)
    return points, _cut(points, nodes), places.reshape(-1, 3)


def _joined(parts: list[Part]) -> tuple[Floats, Ints]:
    """One mesh of several parts: nodes of equal places become one."""
    points, places = (np.concatenate([part[i] for part in parts]) for i in (0, 2))
    starts = np.cumsum([0] + [len(part[0]) for part in parts[:-1]])
    cells = np.concatenate([part[1] + start for part, start in zip(parts, starts, strict=True)])
    single = places[:, 2] < 0
    places[single] = np.column_stack([np.flatnonzero(single), np.zeros(single.sum()), np.full(single.sum(), -1)])
    _, first, inverse = np.unique(places, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)  # number the nodes as they first come
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return points[first[order]], rank[inverse.ravel()][cells]
