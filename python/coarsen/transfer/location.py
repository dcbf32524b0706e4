"""Where the nodes of a level lie in another one.

Fine nodes are located in the coarse mesh by walks over the edges of the fine mesh, so interpolation never reaches
across a slit, a thin wall or into another part. On the line they are looked up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from coarsen.backend import backend
from coarsen.transfer.rows import csr

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_matrix

    from coarsen.mesh import Mesh
    from coarsen.multilevel import Hierarchy, Level


@dataclass(frozen=True, eq=False)
class Located:
    """Where the nodes of a mesh lie in a coarser one.

    Attributes
    ----------
    matrix : (n_fine, n_coarse) csr_matrix
        Barycentric weights.
    outside : (k,) int64 array
        Fine nodes outside of the coarse mesh, which take its nearest point on their own side.
    distance : (k,) float64 array
        How far that is.
    lost : (l,) int64 array
        Those of them whose part of the mesh shares no node with the coarse mesh (it was dropped): they take the nearest
        coarse point overall.
    """

    matrix: csr_matrix
    outside: NDArray[np.int64]
    distance: NDArray[np.float64]
    lost: NDArray[np.int64]


def shared_nodes(hierarchy: Hierarchy, fine: int, coarse: int) -> NDArray[np.int64]:
    """Return, for each node of level `coarse`, its place among the nodes of level `fine`, or -1."""
    return hierarchy[coarse].nodes if fine == 0 else places_among(hierarchy[fine], hierarchy[coarse])


def places_among(among: Level, level: Level) -> NDArray[np.int64]:
    """Return the place of each node of a level among those of another, or -1."""
    place = np.minimum(np.searchsorted(among.nodes, level.nodes), len(among.nodes) - 1)
    return np.where(among.nodes[place] == level.nodes, place, -1)


def locate(hierarchy: Hierarchy, fine: int, coarse: int) -> Located:
    """Locate the nodes of level `fine` in the mesh of level `coarse`; made once for two neighbouring levels."""
    kept: dict[tuple[int, int], Located] = vars(hierarchy).setdefault("_located", {})
    if (fine, coarse) in kept:
        return kept[fine, coarse]
    mesh, other = hierarchy[fine].mesh, hierarchy[coarse].mesh
    if mesh.dim == 1:
        found = _locate_on_line(mesh, other, shared_nodes(hierarchy, fine, coarse))
    else:
        rows, outside, distance, lost = backend(hierarchy.options.backend).prolongation(
            *pair_of(hierarchy, fine, coarse), hierarchy.options.threads
        )
        found = Located(csr(rows, other.n_points), outside, distance, lost)
    if coarse == fine + 1:
        kept[fine, coarse] = found
    return found


def pair_of(hierarchy: Hierarchy, fine: int, coarse: int) -> tuple[Any, ...]:
    """Return the arrays of two levels as the core takes them."""
    mesh, other = hierarchy[fine].mesh, hierarchy[coarse].mesh
    shared = shared_nodes(hierarchy, fine, coarse)
    return mesh.points, mesh.cells, mesh.boundary_facets, other.points, other.cells, shared


def _locate_on_line(mesh: Mesh, coarse: Mesh, shared: NDArray[np.int64]) -> Located:
    """Locate the nodes of intervals in coarser intervals.

    A node is looked up from the middle of a cell of its own, so that it stays on its side where nodes are doubled.
    """
    x, ends = mesh.points[:, 0], coarse.points[coarse.cells, 0]
    own_cell = np.zeros(mesh.n_points, dtype=np.int64)
    own_cell[mesh.cells.ravel()] = np.repeat(np.arange(mesh.n_cells), 2)
    middle = x[mesh.cells[own_cell]].mean(axis=1)
    order = np.argsort(ends[:, 0], kind="stable")
    at = order[np.maximum(np.searchsorted(ends[order, 0], middle, side="right") - 1, 0)]
    # right of the interval that starts last before it may come a gap, and then an interval that is nearer
    after = order[np.minimum(np.searchsorted(ends[order, 0], middle, side="right"), len(order) - 1)]
    beyond = np.maximum(middle - ends[at, 1], 0)
    at = np.where((beyond > 0) & (np.abs(ends[after, 0] - middle) < beyond), after, at)
    a, b = ends[at].T
    t = np.clip((x - a) / (b - a), 0.0, 1.0)
    distance = np.abs(x - np.clip(x, a, b))
    columns = coarse.cells[at].astype(np.int32)
    weights = np.column_stack([1.0 - t, 1.0 - (1.0 - t)])
    own = np.flatnonzero(shared >= 0)
    columns[shared[own]], weights[shared[own]], distance[shared[own]] = own[:, None], [1.0, 0.0], 0.0
    swap = columns[:, 0] > columns[:, 1]
    columns[swap], weights[swap] = columns[swap, ::-1], weights[swap, ::-1]
    keep = weights > 0
    starts = np.concatenate([[0], np.cumsum(keep.sum(axis=1))]).astype(np.int32)
    outside = np.flatnonzero(distance > 0)
    matrix = csr((starts, columns[keep], weights[keep]), coarse.n_points)
    return Located(matrix, outside, distance[outside], np.empty(0, np.int64))


def coarse_nodes_in_fine(hierarchy: Hierarchy, fine: int, coarse: int) -> csr_matrix:
    """Interpolate the finer mesh at the nodes of a coarser one that has nodes of its own."""
    mesh, other = hierarchy[fine].mesh, hierarchy[coarse].mesh
    if mesh.dim == 1:
        return _locate_on_line(other, mesh, shared_nodes(hierarchy, coarse, fine)).matrix
    core = backend(hierarchy.options.backend)
    rows, *_ = core.prolongation(*pair_of(hierarchy, coarse, fine), hierarchy.options.threads)
    return csr(rows, mesh.n_points)
