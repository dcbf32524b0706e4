"""Shape and size of a mesh (Definitions 2.1 and 2.2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .mesh import Mesh

PERCENTILES = (1, 5, 25, 50, 75, 95, 99)


@dataclass(frozen=True)
class Quality:
    """Counts, angles in degrees, edge lengths and area of a mesh."""

    n_points: int
    n_cells: int
    min_angle: float
    max_angle: float
    angles: dict[int, float]
    min_edge: float
    max_edge: float
    area: float
    loops_closed: int = 0
    area_gained: float = 0.0
    area_lost: float = 0.0
    dropped: bool = field(default=False, repr=False)


def quality_of(mesh: Mesh) -> Quality:
    """Measure a mesh."""
    corners = mesh.points[mesh.cells]
    if mesh.dim == 1:
        lengths = np.abs(corners[:, 1, 0] - corners[:, 0, 0])
        return Quality(
            mesh.n_points, mesh.n_cells, np.nan, np.nan, {}, lengths.min(), lengths.max(), float(lengths.sum())
        )
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = np.sqrt((edges**2).sum(-1))
    back = -np.roll(edges, 1, axis=1)
    cross = edges[..., 0] * back[..., 1] - edges[..., 1] * back[..., 0]
    angles = np.degrees(np.arctan2(np.abs(cross), (edges * back).sum(-1)))
    area = 0.5 * float(cross[:, 0].sum())
    percentiles = dict(zip(PERCENTILES, np.percentile(angles, PERCENTILES).tolist(), strict=True))
    return Quality(
        mesh.n_points,
        mesh.n_cells,
        float(angles.min()),
        float(angles.max()),
        percentiles,
        float(lengths.min()),
        float(lengths.max()),
        area,
    )
