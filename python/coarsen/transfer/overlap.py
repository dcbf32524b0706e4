"""Areas and lengths that the cells of two levels share, and cell fields carried by them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from coarsen.backend import backend
from coarsen.transfer.location import pair_of, shared_nodes
from coarsen.transfer.rows import check_level, csr, sparse

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_matrix

    from coarsen.mesh import Mesh
    from coarsen.multilevel import Hierarchy


def cell_transfer(hierarchy: Hierarchy, from_level: int, to_level: int) -> csr_matrix:
    """Return the matrix that carries cell averages from one level to another by overlap.

    What a cell holds (its value times its area) goes to the cells of the other level in proportion to the areas that it
    shares with them, cut as exact polygons; the part of a cell that the other mesh does not cover goes with the rest,
    and a cell that is not covered at all goes to the nearest one. Integrals are kept; constants are, too, in all cells
    but those where one of the meshes ends and the other does not.

    Returns
    -------
    (m_to, m_from) csr_matrix

    Raises
    ------
    ValueError
        If there is no such level.
    """
    diags = sparse().diags
    from_level = check_level(hierarchy, "from_level", from_level)
    to_level = check_level(hierarchy, "to_level", to_level)
    fine, coarse = sorted((from_level, to_level))
    mesh, other = hierarchy[fine].mesh, hierarchy[coarse].mesh
    if mesh.dim == 1:
        shared = _overlap_on_line(mesh, other)
    else:
        rows = backend(hierarchy.options.backend).overlap(*pair_of(hierarchy, fine, coarse), hierarchy.options.threads)
        shared = csr(rows, other.n_cells)
    areas = shared.copy()
    # a finer cell next to the coarse mesh, but not in it, has one entry: 0
    alone = np.flatnonzero(np.asarray(shared.sum(axis=1)).ravel() == 0)
    shared.data[shared.indptr[alone]] = cell_sizes(mesh)[alone]
    if from_level > to_level:
        shared = _with_uncovered(hierarchy, areas, fine, coarse).T.tocsr()
    target = other if from_level < to_level else mesh
    source = mesh if from_level < to_level else other
    share = diags(cell_sizes(source) / np.asarray(shared.sum(axis=1)).ravel()) @ shared
    return (diags(1.0 / cell_sizes(target)) @ share.T).tocsr()


def _with_uncovered(hierarchy: Hierarchy, shared: csr_matrix, fine: int, coarse: int) -> csr_matrix:
    """Give each coarse cell that no finer cell meets (in a hole that was closed) a finer cell at one of its nodes."""
    from scipy.sparse import coo_matrix

    mesh, other = hierarchy[fine].mesh, hierarchy[coarse].mesh
    alone = np.flatnonzero(np.asarray(shared.sum(axis=0)).ravel() == 0)
    if not len(alone):
        return shared
    at = shared_nodes(hierarchy, fine, coarse)[other.cells[alone]]
    # not nested, and none of its nodes in the finer mesh: the finer node nearest to the first one
    for row in np.flatnonzero((at < 0).all(axis=1)):
        at[row, 0] = np.argmin(((mesh.points - other.points[other.cells[alone[row], 0]]) ** 2).sum(axis=1))
    node = at.max(axis=1)
    cell_at = np.empty(mesh.n_points, dtype=np.int64)
    cell_at[mesh.cells.ravel()] = np.repeat(np.arange(mesh.n_cells), mesh.cells.shape[1])
    more = coo_matrix((cell_sizes(other)[alone], (cell_at[node], alone)), shape=shared.shape)
    return (shared + more).tocsr()


def cell_sizes(mesh: Mesh) -> NDArray[np.float64]:
    """Return the areas (d = 2) or lengths (d = 1) of the cells."""
    corners = mesh.points[mesh.cells]
    if mesh.dim == 1:
        return np.asarray(np.abs(corners[:, 1, 0] - corners[:, 0, 0]))
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.asarray(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2)


def _overlap_on_line(mesh: Mesh, coarse: Mesh) -> csr_matrix:
    """Lengths that intervals share with coarser ones: the coarser interval of the middle holds the whole."""
    middle = mesh.points[mesh.cells, 0].mean(axis=1)
    ends = np.sort(coarse.points[coarse.cells, 0], axis=1)
    order = np.argsort(ends[:, 0], kind="stable")
    at = order[np.clip(np.searchsorted(ends[order, 0], middle, side="right") - 1, 0, len(order) - 1)]
    rows = np.arange(mesh.n_cells + 1, dtype=np.int32)
    return csr((rows, at.astype(np.int32), cell_sizes(mesh)), coarse.n_cells)
