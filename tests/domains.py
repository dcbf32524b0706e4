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
