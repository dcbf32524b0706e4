"""Mending a mesh that breaks a rule, as far as that can be done without guessing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import index_rows, points_array, tags_array
from .errors import MeshError
from .mesh import Mesh

TRIES = 64
"""Places merged one by one before all are merged at once."""


@dataclass(frozen=True, eq=False)
class Repairs:
    """What `repaired` did.

    Attributes
    ----------
    orphans : int
        Nodes that no cell named, dropped.
    merged : int
        Nodes that shared coordinates with another one and were no side of a slit, merged into it.
    repeated, zero_area, duplicates : int
        Cells that named a node twice, had no area, or had the nodes of an earlier cell; dropped.
    turned : int
        Cells that were clockwise, turned.
    facets : int
        Given facets that were no edge of the mesh any more, or a second time the same; dropped.
    nodes : (n,) int64 array
        Index in the mesh of each given point; -1 where it was dropped.
    cells : (m,) int64 array
        Index in the mesh of each given cell; -1 where it was dropped.
    """

    orphans: int
    merged: int
    repeated: int
    zero_area: int
    duplicates: int
    turned: int
    facets: int
    nodes: NDArray[np.int64]
    cells: NDArray[np.int64]

    def __str__(self) -> str:
        done = [
            (self.orphans, "node in no cell dropped", "nodes in no cell dropped"),
            (self.merged, "coincident node merged", "coincident nodes merged"),
            (self.repeated, "cell with a repeated node dropped", "cells with a repeated node dropped"),
            (self.zero_area, "cell of zero area dropped", "cells of zero area dropped"),
            (self.duplicates, "duplicate cell dropped", "duplicate cells dropped"),
            (self.turned, "clockwise cell turned", "clockwise cells turned"),
            (self.facets, "given facet dropped", "given facets dropped"),
        ]
        return ", ".join(f"{n} {one if n == 1 else many}" for n, one, many in done if n) or "nothing to mend"

    def __repr__(self) -> str:
        return f"Repairs({self})"


def repaired(
    points: Any,
    cells: Any,
    *,
    facets: Any = None,
    facet_tags: Any = None,
    cell_tags: Any = None,
    point_data: Mapping[str, Any] | None = None,
    facet_names: Mapping[int, str] | None = None,
    cell_names: Mapping[int, str] | None = None,
) -> tuple[Mesh, Repairs]:
    """Mend a mesh: drop what means nothing, merge what is doubled without being a slit.

    Nodes in no cell, cells that name a node twice or have no area, and repeated cells are dropped; clockwise cells are
    turned. Nodes that share coordinates are merged where they are no two sides of a slit: all of them if the cells are
    a soup of triangles, each with nodes of its own; otherwise those that make the mesh illegal. Slits stay.

    Parameters
    ----------
    points, cells, facets, facet_tags, cell_tags, point_data, facet_names, cell_names
        As for `Mesh`. Nodes that are merged take coordinates and nodal fields of the first of them.

    Returns
    -------
    mesh : Mesh
    report : Repairs
        What was done, with the maps from old nodes and cells to new ones.

    Raises
    ------
    MeshError
        If the mesh breaks a rule that can't be mended: coordinates that aren't finite, indices out of range, an edge
        with three different cells, overlapping cells, hanging nodes.

    Examples
    --------
    >>> import coarsen
    >>> points = [[0, 0], [1, 0], [0, 1], [7, 7], [1, 0], [0, 1], [1, 1]]
    >>> mesh, report = coarsen.Mesh.repaired(points, [[0, 1, 2], [4, 6, 5], [2, 0, 1], [0, 4, 1]])
    >>> print(report)
    1 node in no cell dropped, 1 cell of zero area dropped, 1 duplicate cell dropped
    >>> mesh.n_points, mesh.n_cells
    (6, 2)
    """
    points = points_array(points)
    dim = points.shape[1]
    cells = index_rows("cells", cells, dim + 1, f"(m, {dim + 1})").astype(np.int64)
    if facets is not None:
        facets = index_rows("facets", facets, dim, f"(s, {dim})").astype(np.int64)
    if facet_tags is not None and facets is not None:
        facet_tags = tags_array("facet_tags", facet_tags, len(facets), "'facets'")
    if cell_tags is not None:
        cell_tags = tags_array("cell_tags", cell_tags, len(cells), "'cells'")
    for name, rows in (("cells", cells), ("facets", facets)):
        if rows is not None and len(rows) and (rows.min() < 0 or rows.max() >= len(points)):
            # the core says which
            Mesh(points, cells, facets=facets)
            raise MeshError(f"'{name}' has an index out of range", rule="index out of range", array=name)
    mend = _Mending(points, cells)
    mend.drop_bad_cells()
    mend.merge_until_legal()
    names = {"facet_names": facet_names, "cell_names": cell_names}
    return mend.result(facets, facet_tags, cell_tags, point_data, names)


class _Mending:
    """A mesh while it is mended: `node` maps nodes to those that stand for them, `kept` says which cells stay."""

    def __init__(self, points: NDArray[np.float64], cells: NDArray[np.int64]) -> None:
        self.points = points
        self.cells = cells
        self.node = np.arange(len(points))
        self.kept = np.ones(len(cells), dtype=np.bool_)
        self.counts = {"repeated": 0, "zero_area": 0, "duplicates": 0}

    def drop(self, name: str, bad: NDArray[np.bool_]) -> None:
        bad = bad & self.kept
        self.counts[name] += int(np.count_nonzero(bad))
        self.kept &= ~bad

    def drop_bad_cells(self) -> None:
        cells = self.node[self.cells]
        ordered = np.sort(cells, axis=1)
        self.drop("repeated", (ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
        self.drop("zero_area", _flat(self.points, cells))
        alive = np.flatnonzero(self.kept)
        _, first = np.unique(ordered[alive], axis=0, return_index=True)
        again = np.ones(len(alive), dtype=np.bool_)
        again[first] = False
        bad = np.zeros(len(cells), dtype=np.bool_)
        bad[alive[again]] = True
        self.drop("duplicates", bad)

    def compact(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Nodes that stay, and the cells in terms of them."""
        cells = self.node[self.cells[self.kept]]
        nodes, inverse = np.unique(cells, return_inverse=True)
        return nodes, inverse.reshape(cells.shape)

    def merge_until_legal(self) -> None:
        """Merge coincident nodes where the core finds them to be no slit, or everywhere where that is not enough."""
        place = _places(self.points)
        for _ in range(TRIES):
            nodes, cells = self.compact()
            try:
                Mesh(self.points[nodes], cells)
            except MeshError as error:
                if error.rule == "zero area":
                    mended = self._drop_crowding()
                elif error.rule == "coincident nodes" and error.index is not None and not _is_soup(error):
                    mended = self._merge_at(place, int(nodes[error.index])) or self._merge_all(place)
                else:
                    begun = bool((self.node != np.arange(len(self.node))).any())
                    mended = (begun or error.rule == "coincident nodes") and self._merge_all(place)
                if not mended:
                    raise
                self.drop_bad_cells()
            else:
                return
        self._merge_all(place)
        self.drop_bad_cells()

    def _drop_crowding(self) -> bool:
        """Drop cells without an area, but for rounding, that share an edge with two others."""
        cells = self.node[self.cells]
        alive = np.flatnonzero(self.kept)
        sides = np.sort(np.concatenate([cells[alive][:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
        _, edge, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
        crowded = (count[edge.reshape(-1)] > 2).reshape(3, -1).any(axis=0)
        corners = self.points[cells[alive]]
        lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        flat = area <= 4 * np.finfo(np.float64).eps * np.abs(corners).max(axis=(1, 2)) * lengths
        bad = np.zeros(len(cells), dtype=np.bool_)
        bad[alive[crowded & flat]] = True
        self.drop("zero_area", bad)
        return bool(bad.any())

    def _merge_at(self, place: NDArray[np.int64], node: int) -> bool:
        twins = np.flatnonzero(place == place[node])
        return self._merge(twins, np.full(len(twins), twins.min()))

    def _merge_all(self, place: NDArray[np.int64]) -> bool:
        used = np.unique(self.cells[self.kept])
        first = np.full(len(self.points), len(self.points))
        np.minimum.at(first, place[used], used)
        return self._merge(used, first[place[used]])

    def _merge(self, nodes: NDArray[np.int64], into: NDArray[np.int64]) -> bool:
        before = self.node[nodes]
        self.node[nodes] = into
        return bool((before != into).any())

    def result(
        self, facets: Any, facet_tags: Any, cell_tags: Any, point_data: Any, names: dict[str, Any]
    ) -> tuple[Mesh, Repairs]:
        nodes, cells = self.compact()
        new = np.full(len(self.points), -1)
        new[nodes] = np.arange(len(nodes))
        used = np.zeros(len(self.points), dtype=np.bool_)
        used[self.cells.ravel()] = True
        given = 0 if facets is None else len(facets)
        if facets is not None:
            facets, stay = _edges_that_stay(new[self.node[facets]], cells)
            facet_tags = None if facet_tags is None else facet_tags[stay]
        mesh = Mesh(
            self.points[nodes],
            cells,
            facets=facets,
            facet_tags=facet_tags,
            cell_tags=None if cell_tags is None else cell_tags[self.kept],
            point_data=None if point_data is None else {k: np.asarray(v)[nodes] for k, v in point_data.items()},
            **names,
        )
        row = np.full(len(self.cells), -1)
        row[self.kept] = np.arange(len(cells))
        report = Repairs(
            orphans=int(np.count_nonzero(new[self.node] < 0)),
            merged=int(np.count_nonzero((self.node != np.arange(len(self.node))) & (new[self.node] >= 0))),
            turned=len(mesh.topology.flip),
            facets=given - (0 if facets is None else len(facets)),
            nodes=new[self.node],
            cells=row,
            **self.counts,
        )
        return mesh, report


def _is_soup(error: MeshError) -> bool:
    return "doubled" in str(error)


def _places(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return a number for each point that equal points share."""
    _, place = np.unique(points, axis=0, return_inverse=True)
    numbers: NDArray[np.int64] = place.reshape(len(points)).astype(np.int64)
    return numbers


def _flat(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which cells have no area, exactly."""
    from fractions import Fraction

    corners = points[cells]
    if points.shape[1] == 1:
        return np.asarray(corners[:, 0, 0] == corners[:, 1, 0])
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    with np.errstate(all="ignore"):
        left, right = u[:, 0] * v[:, 1], u[:, 1] * v[:, 0]
        flat = ~(np.abs(left - right) > 1e-14 * (np.abs(left) + np.abs(right)))
    # where rounding could decide, rational numbers do
    for k in np.flatnonzero(flat):
        if np.isfinite(corners[k]).all():
            a, b, c = [[Fraction(x) for x in corner] for corner in corners[k].tolist()]
            flat[k] = (b[0] - a[0]) * (c[1] - a[1]) == (b[1] - a[1]) * (c[0] - a[0])
        else:
            flat[k] = False
    return flat


def _edges_that_stay(
    facets: NDArray[np.int64], cells: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return facets that are edges of cells, each once, and their rows."""
    width = facets.shape[1]
    if width == 1:
        edges = np.unique(cells)[:, None]
    else:
        sides = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
        edges = np.unique(np.sort(sides, axis=1), axis=0)
    both, where = np.unique(np.concatenate([edges, np.sort(facets, axis=1)]), axis=0, return_inverse=True)
    where = where.reshape(-1)
    known = np.zeros(len(both), dtype=np.bool_)
    known[where[: len(edges)]] = True
    row = where[len(edges) :]
    _, first = np.unique(row, return_index=True)
    stay = np.sort(first[known[row[first]]])
    return facets[stay], stay
