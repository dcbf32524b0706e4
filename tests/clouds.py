"""Random small point sets of every kind that has ever broken a geometric program."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np


def _uniform(rng, n, d):
    return rng.random((n, d))


def _graded(rng, n, d):
    """Over six decades."""
    return 10.0 ** rng.uniform(-6, 0, (n, 1)) * rng.choice([-1.0, 1.0], (n, d)) * rng.random((n, d))


def _lattice(rng, n, d):
    side = max(2, round(n ** (1 / d)))
    return rng.permutation(np.stack(np.meshgrid(*[np.arange(float(side))] * d), axis=-1).reshape(-1, d))[:n]


def _collinear(rng, n, d):
    """Runs on a few lines, exactly so where steps are whole."""
    start, step = rng.integers(-4, 5, (3, d)) * 8, rng.integers(-2, 3, (3, d))
    line = rng.integers(0, 3, n)
    return (start[line] + rng.integers(0, 12, (n, 1)) * step[line]).astype(float)


def _cocircular(rng, n, d):
    """Exactly on one circle about the origin, from Pythagorean triples, and the centre."""
    a, b = rng.choice([(3, 4), (5, 0), (4, 3), (0, 5)], n).T * 13
    points = np.zeros((n, d))
    points[:, 0] = a * rng.choice([-1, 1], n)
    if d > 1:
        points[:, 1] = b * rng.choice([-1, 1], n)
    points[0] = 0.0
    return points


def _far(rng, n, d):
    return rng.random((n, d)) + 1e6


def _tiny(rng, n, d):
    return rng.random((n, d)) * 1e-6


def _near_lattice(rng, n, d):
    """A lattice disturbed in the last places."""
    points = _lattice(rng, n, d) / 7 + 0.1
    return points + rng.integers(-2, 3, points.shape) * np.spacing(points)


KINDS: dict[str, Callable] = {
    "uniform": _uniform,
    "graded": _graded,
    "lattice": _lattice,
    "collinear": _collinear,
    "cocircular": _cocircular,
    "far": _far,
    "tiny": _tiny,
    "near lattice": _near_lattice,
}


def clouds(seed: int, count: int, d: int, *, most: int = 60, distinct: bool = False) -> Iterator[np.ndarray]:
    """Yield `count` point sets of 1 to `most` points, kind by kind; some with repeated points unless `distinct`."""
    rng = np.random.default_rng(seed)
    kinds = list(KINDS.values())
    for k in range(count):
        points = kinds[k % len(kinds)](rng, int(rng.integers(1, most + 1)), d)
        if distinct:
            points = rng.permutation(np.unique(points, axis=0))
        elif k % 3 == 0:
            points = points[rng.integers(0, len(points), len(points))]
        yield np.ascontiguousarray(points)
