"""What a file says, before it is a mesh: the only place that turns the one into the other.

Readers fill a :class:`Draft` and judge nothing. Here quadrilaterals are refused or cut, tetrahedra and surfaces
refused, a constant height dropped; the rest is judged by :class:`coarsen.Mesh` itself.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError
from ..mesh import Mesh

log = logging.getLogger("coarsen")

_HIGHER_ORDER = {
    "triangle6": 3,
    "triangle7": 3,
    "triangle10": 3,
    "line3": 2,
    "line4": 2,
    "quad8": 4,
    "quad9": 4,
}
"""Curved cells and how many of their first nodes are their corners."""

_PLANE = {"triangle": 3, "quad": 4}


@dataclass(eq=False, repr=False)
class Draft:
    """Points, blocks of cells by kind, facets, tags, nodal fields, as a file has them, 0-based.

    Attributes
    ----------
    points : (n, 1 | 2 | 3) float
    blocks : list of (kind, (m, k) int, tags (m,) int or None)
        Kinds as meshio calls them: ``"triangle"``, ``"line"``, ``"quad"``, ``"tetra"``, …; for the cells of the mesh.
    facets, facet_tags : (s, 2) int and (s,) int, or None
    point_data : dict of (n, …) arrays
    facet_names, cell_names : dict, tag -> name
    """

    points: NDArray[Any]
    blocks: list[tuple[str, NDArray[Any], NDArray[Any] | None]]
    facets: NDArray[Any] | None = None
    facet_tags: NDArray[Any] | None = None
    point_data: dict[str, NDArray[Any]] = field(default_factory=dict)
    facet_names: dict[int, str] = field(default_factory=dict)
    cell_names: dict[int, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        facets = "" if self.facets is None else f", {len(self.facets)} facets"
        cells = "".join(f", {len(cells)} {kind}" for kind, cells, _ in self.blocks)
        return f"Draft({len(self.points)} points{cells}{facets})"

    def mesh(self, *, split_quads: bool = False, repair: bool = False) -> tuple[Mesh, str]:
        """Return the mesh and, as text, what a repair did (empty without one).

        Raises
        ------
        MeshError
            If the cells are no triangles (nor, in one dimension, edges), or break a rule of a legal mesh.
        """
        blocks = [(kind, np.asarray(cells), tags) for kind, cells, tags in self.blocks if len(cells)]
        blocks = self._corners(blocks, repair=repair)
        kinds = {kind for kind, _, _ in blocks}
        odd = sorted(kinds - _PLANE.keys() - {"line"})
        if odd:
            raise MeshError(_refusal(odd, blocks))
        if kinds & _PLANE.keys():
            points = _flat(np.asarray(self.points), dim=2)
            blocks = [block for block in blocks if block[0] != "line"]
            cells, tags = _triangles(points, blocks, split_quads=split_quads)
        elif kinds:
            points, cells, tags = (
                _flat(np.asarray(self.points), dim=1),
                *_joined(blocks, 2),
            )
        else:
            raise MeshError("no cells: there is neither a triangle nor an edge in it")
        facets, facet_tags = _once(self.facets, self.facet_tags)
        if np.shape(cells)[1] == 2:
            facets = facet_tags = None
        given = {
            "facets": facets,
            "facet_tags": facet_tags,
            "cell_tags": tags,
            "point_data": self.point_data or None,
            "facet_names": None if facet_tags is None else self.facet_names,
            "cell_names": None if tags is None else self.cell_names,
        }
        if repair:
            mesh, report = Mesh.repaired(points, cells, **given)
            log.info("repaired: %s", report)
            return mesh, str(report)
        return Mesh(points, cells, **given), ""

    def _corners(self, blocks: list[Any], *, repair: bool) -> list[Any]:
        curved = {kind: len(cells) for kind, cells, _ in blocks if kind in _HIGHER_ORDER}
        if curved and not repair:
            raise MeshError(
                f"{_counts(curved)} have nodes on their edges; coarsen takes straight triangles: "
                "read(path, repair=True) or --repair keeps their corners"
            )
        straight = {kind: kind.rstrip("0123456789") for kind in _HIGHER_ORDER}
        return [(straight.get(kind, kind), cells[:, : _HIGHER_ORDER.get(kind)], tags) for kind, cells, tags in blocks]


def _counts(kinds: dict[str, int]) -> str:
    return ", ".join(f"{count} cells of type '{kind}'" for kind, count in sorted(kinds.items()))


def _refusal(odd: list[str], blocks: list[Any]) -> str:
    counts = _counts({kind: sum(len(cells) for k, cells, _ in blocks if k == kind) for kind in odd})
    if any(kind.startswith(("tetra", "hexa", "wedge", "pyramid")) for kind in odd):
        return (
            f"{counts}: a mesh of solids; coarsen builds hierarchies of triangles in the plane (in three dimensions "
            "coarsen.spacing and coarsen.selection work on its points)"
        )
    return f"{counts}: coarsen takes triangles in the plane"


def _flat(points: NDArray[Any], dim: int) -> NDArray[Any]:
    """Drop the coordinates after the first `dim`, which must be constant."""
    if points.ndim != 2 or points.shape[1] <= dim:
        return points
    for axis in range(dim, points.shape[1]):
        low, high = points[:, axis].min(), points[:, axis].max()
        if low != high:
            what = "triangles of a surface" if dim == 2 else "edges without triangles"
            raise MeshError(
                f"{what}: coordinate {'xyz'[axis]} runs from {low:.6g} to {high:.6g}, expected it constant "
                f"(coarsen takes {'triangles in the plane' if dim == 2 else 'a line along x, or triangles'})"
            )
    return np.ascontiguousarray(points[:, :dim])


def _joined(blocks: list[Any], width: int) -> tuple[NDArray[Any], NDArray[Any] | None]:
    cells = np.concatenate([cells for _, cells, _ in blocks]) if blocks else np.zeros((0, width), dtype=np.int64)
    if all(tags is None for _, _, tags in blocks):
        return cells, None
    zeros = [np.zeros(len(cells), dtype=np.int64) if tags is None else np.asarray(tags) for _, cells, tags in blocks]
    return cells, np.concatenate(zeros)


def _triangles(points: NDArray[Any], blocks: list[Any], *, split_quads: bool) -> tuple[NDArray[Any], Any]:
    quads = sum(len(cells) for kind, cells, _ in blocks if kind == "quad")
    if quads and not split_quads:
        every = sum(len(cells) for _, cells, _ in blocks)
        among = f"{quads} quadrilaterals" + (f" among {every} cells" if quads < every else "")
        raise MeshError(
            f"{among} (type 'quad'); coarsen takes triangles: read(path, split_quads=True) or --split-quads cuts each "
            "along its shorter diagonal"
        )
    return _joined(
        [split_quad_block(points, *block[1:]) if block[0] == "quad" else block for block in blocks],
        3,
    )


def split_quad_block(points: NDArray[Any], quads: NDArray[Any], tags: NDArray[Any] | None) -> tuple[str, Any, Any]:
    """Cut every quadrilateral in two along its shorter diagonal, or the one that lies inside where only one does."""
    if len(quads) and (quads.min() < 0 or quads.max() >= len(points)):
        bad = int(np.flatnonzero(((quads < 0) | (quads >= len(points))).any(axis=1))[0])
        raise MeshError(f"'quads' row {bad} is {quads[bad].tolist()}, expected indices from 0 to {len(points) - 1}")
    a, b, c, d = (points[quads[:, k], :2] for k in range(4))

    def turn(p: Any, q: Any, r: Any) -> Any:
        return (q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0]

    along_ac = turn(a, b, c) * turn(a, c, d) > 0
    along_bd = turn(b, c, d) * turn(b, d, a) > 0
    shorter_ac = np.hypot(*(c - a).T) <= np.hypot(*(d - b).T)
    use_ac = np.where(along_ac == along_bd, shorter_ac, along_ac)[:, None]
    first = np.where(use_ac, quads[:, [0, 1, 2]], quads[:, [0, 1, 3]])
    second = np.where(use_ac, quads[:, [0, 2, 3]], quads[:, [1, 2, 3]])
    cells = np.stack([first, second], axis=1).reshape(-1, 3)
    return "triangle", cells, None if tags is None else np.repeat(np.asarray(tags), 2)


def _once(facets: Any, tags: Any) -> tuple[Any, Any]:
    """Facets without repetitions, which files with overlapping groups have; the first tag stays."""
    if facets is None or len(facets) == 0:
        return None, None
    facets = np.asarray(facets)
    _, first = np.unique(np.sort(facets, axis=1), axis=0, return_index=True)
    if len(first) == len(facets):
        return facets, tags
    log.info("%d facets named more than once were taken once", len(facets) - len(first))
    first = np.sort(first)
    return facets[first], None if tags is None else np.asarray(tags)[first]


def drafted(mesh: Mesh) -> Draft:
    """Return the draft of a mesh, for the writers; boundary facets that were not given stay out."""
    kind = "triangle" if mesh.dim == 2 else "line"
    return Draft(
        points=mesh.points,
        blocks=[(kind, mesh.cells, mesh.cell_tags)],
        facets=mesh.facets,
        facet_tags=mesh.facet_tags,
        point_data=dict(mesh.point_data or {}),
        facet_names=mesh.facet_names or {},
        cell_names=mesh.cell_names or {},
    )
