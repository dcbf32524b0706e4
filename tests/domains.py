"""Random small domains: parts of triangulations, with holes, islands, pinches and tags of their own making."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import coarsen
from clouds import clouds
from coarsen import reference


def domains(seed: int, count: int, *, most: int = 150) -> Iterator[coarsen.Mesh]:
    """Yield legal meshes: triangulations of random points with cells taken out and tags in patches."""
    rng = np.random.default_rng(seed)
    made = 0
    for points in clouds(seed, 100 * count, 2, most=most, distinct=True):
        cells = reference.delaunay(points, None)
        if len(cells) < 8:
            continue
        middle = points[cells].mean(axis=1)
        size = np.ptp(middle, axis=0).max() + 1e-300
        wave = rng.normal(size=(2, 3)) * 4 / size
        field = np.sin(middle @ wave + rng.uniform(0, 6, 3)).sum(axis=1)
        keep = field > np.quantile(field, rng.uniform(0, 0.6))
        if made % 4 == 0:
            keep &= rng.random(len(cells)) > 0.05
        cells = cells[keep]
        if len(cells) < 4:
            continue
        tags = None if made % 3 else (np.sin((middle[keep] @ wave)[:, 0]) > 0.3).astype(np.int64)
        facets = cells[rng.integers(0, len(cells), 3)][:, :2] if made % 5 == 0 else None
        used, cells = np.unique(cells, return_inverse=True)
        facets = None if facets is None else np.searchsorted(used, facets)
        yield coarsen.Mesh(points[used], cells.reshape(-1, 3), cell_tags=tags, facets=facets)
        made += 1
        if made == count:
            return


def river(seed: int, along: int, across: int) -> coarsen.Mesh:
    """A winding channel of `along` times `across` nodes, as wide as 0.5 at the most, a tenth of that in places."""
    rng = np.random.default_rng(seed)
    way = np.linspace(0, 16 * np.pi, along)
    middle = np.stack([way, 4 * np.sin(way)], axis=1)
    ahead = np.gradient(middle, axis=0)
    aside = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1) / np.hypot(*ahead.T)[:, None]
    half = np.interp(way, np.linspace(0, way[-1], 48), rng.uniform(0.025, 0.25, 48))
    points = middle[:, None] + np.linspace(-1, 1, across)[:, None] * (half[:, None] * aside)[:, None]
    a = (np.arange(along - 1)[:, None] * across + np.arange(across - 1)).ravel()
    cells = np.concatenate([np.stack([a, a + across, a + across + 1], 1), np.stack([a, a + across + 1, a + 1], 1)])
    return coarsen.Mesh(points.reshape(-1, 2), cells)
