"""The mesh: points, cells, facets, tags, checked once and never changed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import fields_of, index_rows, points_array, read_only, tags_array
from .quality import Quality, quality_of


@dataclass(frozen=True, eq=False)
class Topology:
    """Facets of a mesh: boundary edges first, directed with their cell on the left, then interior facets."""

    flip: NDArray[np.int64]
    facets: NDArray[np.int64]
    facet_cells: NDArray[np.int64]
    facet_given: NDArray[np.int64]
    n_boundary: int
    layer: NDArray[np.int64] | None


class Mesh:
    """A triangle mesh (d = 2) or a mesh of intervals (d = 1)."""

    def __init__(
        self,
        points: Any,
        cells: Any,
        *,
        facets: Any = None,
        facet_tags: Any = None,
        cell_tags: Any = None,
        point_data: Mapping[str, Any] | None = None,
    ) -> None:
        points = points_array(points)
        dim = points.shape[1]
        cells = index_rows("cells", cells, dim + 1, f"(m, {dim + 1})")
        facets = None if facets is None else index_rows("facets", facets, 2, "(s, 2)")
        facet_tags = None if facet_tags is None else tags_array("facet_tags", facet_tags, len(facets), "'facets'")
        cell_tags = None if cell_tags is None else tags_array("cell_tags", cell_tags, len(cells), "'cells'")
        cells = _positive(points, cells)
        topology = _topology(points, cells, facets, cell_tags)
        self._fill(points, cells, topology, facets, facet_tags, cell_tags, point_data)

    @classmethod
    def _trusted(
        cls, points: Any, cells: Any, topology: Topology, *, facets: Any, facet_tags: Any, cell_tags: Any, point_data: Any
    ) -> Mesh:
        mesh = cls.__new__(cls)
        mesh._fill(points, cells, topology, facets, facet_tags, cell_tags, point_data)
        return mesh

    def _fill(
        self, points: Any, cells: Any, topology: Topology, facets: Any, facet_tags: Any, cell_tags: Any, point_data: Any
    ) -> None:
        self.points = read_only(points)
        self.cells = read_only(cells)
        self.facets = None if facets is None else read_only(facets)
        self.facet_tags = None if facet_tags is None else read_only(facet_tags)
        self.cell_tags = None if cell_tags is None else read_only(cell_tags)
        self.point_data = fields_of(point_data, len(points))
        self.topology = topology

    @property
    def dim(self) -> int:
        """Dimension."""
        return int(self.points.shape[1])

    @property
    def n_points(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.cells)

    @property
    def boundary_facets(self) -> NDArray[np.int64]:
        """Edges with a cell on one side only, which lies on their left."""
        return self.topology.facets[: self.topology.n_boundary]

    def quality(self) -> Quality:
        """Measure counts, angles, edges and area."""
        return quality_of(self)

    def __repr__(self) -> str:
        return f"Mesh({self.n_points} points, {self.n_cells} cells, dim {self.dim})"


def _positive(points: Any, cells: Any) -> Any:
    p = points[cells]
    if points.shape[1] == 1:
        wrong = p[:, 0, 0] > p[:, 1, 0]
        return np.where(wrong[:, None], cells[:, ::-1], cells) if wrong.any() else cells
    u, v = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    wrong = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] < 0
    if wrong.any():
        cells = cells.copy()
        cells[wrong] = cells[wrong][:, [0, 2, 1]]
    return cells


def _topology(points: Any, cells: Any, facets: Any, cell_tags: Any) -> Topology:
    empty = np.empty(0, np.int64)
    n, m = len(points), len(cells)
    if points.shape[1] == 1:
        count = np.bincount(cells.ravel(), minlength=n)
        ends = np.flatnonzero(count == 1).reshape(-1, 1)
        return Topology(empty, ends, np.empty((0, 2), np.int64), np.full(len(ends), -1), len(ends), None)
    edges = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]).astype(np.int64)
    cell = np.tile(np.arange(m), 3)
    key = edges.min(1) * n + edges.max(1)
    order = np.argsort(key, kind="stable")
    start = np.flatnonzero(np.r_[True, key[order][1:] != key[order][:-1]])
    count = np.diff(np.r_[start, 3 * m])
    alone = order[start[count == 1]]
    one, two = order[start[count == 2]], order[start[count == 2] + 1]
    given_key = empty if facets is None else facets.min(1).astype(np.int64) * n + facets.max(1)
    keep = np.isin(key[one], given_key)
    if cell_tags is not None:
        keep |= cell_tags[cell[one]] != cell_tags[cell[two]]
    all_edges = np.concatenate([edges[alone], edges[one[keep]]])
    beside = np.concatenate([np.c_[cell[alone], np.full(len(alone), -1)], np.c_[cell[one[keep]], cell[two[keep]]]])
    given = np.full(len(all_edges), -1)
    if facets is not None and len(facets):
        rank = np.argsort(given_key, kind="stable")
        wanted = all_edges.min(1) * n + all_edges.max(1)
        place = np.minimum(np.searchsorted(given_key[rank], wanted), len(rank) - 1)
        given = np.where(given_key[rank][place] == wanted, rank[place], -1)
    return Topology(empty, all_edges, beside, given, len(alone), None)
