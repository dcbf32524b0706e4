"""Loose unknowns: those that a coarse mesh does not serve.

Where a level has dropped parts of the domain, piecewise-linear interpolation from its mesh would do harm

- at nodes well outside of it, deep in an inlet that was cut off, which would all take one value;
- in its cells that the finer mesh does not cover: a spit or an island that was closed may part waters that are far from
  each other for the matrix;
- at unknowns that an earlier stage has added for such nodes, and that are nodes of no mesh;
- at nodes whose weights, though linear, tie a coarse unknown that the matrix hardly holds (the far end of an inlet, the
  tip of a needle) to what is held firmly. They are known by the energy that they cost.

These are loose: they are interpolated by the entries of the matrix (``rust/transfer/loose.rs``), some of them becoming
coarse unknowns themselves. The other nodes near by take values only from coarse nodes that they hang together with.

Where materials meet, coarse chords cut through both of them: a node of the one may lie in a coarse cell of the other.
It takes values from nodes of its own material only, and a node of the interface from the interface only. If the
coefficients of a matrix jump there, anything else costs iterations, the more the higher the jump.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from coarsen.backend import backend
from coarsen.transfer.rows import csr

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_matrix

    from coarsen.mesh import Mesh
    from coarsen.multilevel import Hierarchy
    from coarsen.transfer import Located

COSTLY = 0.1
"""A row that raises the energy of a column by more than this share is made anew. 0.05 would only add entries."""


def unserved(
    hierarchy: Hierarchy,
    levels: tuple[int, int],
    found: Located,
    deep: float,
    matrix: csr_matrix,
    unknown: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Say which nodes of the finer of two levels its coarser one does not serve.

    They lie over `deep` spacings outside of it, or in one of its cells that covers what is parted for the matrix.
    `unknown` is the row of each finer node in the matrix, or -1.
    """
    fine, coarse = (hierarchy[i] for i in levels)
    out = np.zeros(fine.mesh.n_points, dtype=bool)
    out[found.outside[found.distance > deep * fine.spacing[found.outside]]] = True
    if coarse.dropped is not None:
        walls = np.zeros(fine.mesh.n_points, dtype=bool)
        walls[fine.mesh.boundary_facets] = True
        if fine.dropped is not None:
            walls |= with_uncoupled_edge(fine.mesh, matrix, unknown)
        out |= in_cut_cells(walls, found.matrix)
    return out


def with_uncoupled_edge(mesh: Mesh, matrix: csr_matrix, unknown: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Say which nodes have an edge to one that they are not coupled to: over land that an earlier level closed."""
    ends = np.concatenate([mesh.cells[:, [k, (k + 1) % 3]] for k in range(3)])
    ends = ends[(unknown[ends] >= 0).all(axis=1)]
    apart = np.asarray(matrix[unknown[ends[:, 0]], unknown[ends[:, 1]]]).ravel() == 0
    out = np.zeros(mesh.n_points, dtype=bool)
    out[ends[apart]] = True
    return out


def in_cut_cells(walls: NDArray[np.bool_], prolongation: csr_matrix) -> NDArray[np.bool_]:
    """Say which nodes lie in coarse cells that also hold a node of `walls`."""
    inside = np.flatnonzero(np.diff(prolongation.indptr) == 3)
    corners = prolongation.indices[prolongation.indptr[inside][:, None] + np.arange(3)].astype(np.int64)
    _, cell = np.unique(corners, axis=0, return_inverse=True)
    cut = np.zeros(len(walls), dtype=bool)
    cut[inside] = np.isin(cell, cell[walls[inside]])
    return cut


def within_materials(mesh: Mesh, coarse: Mesh, prolongation: csr_matrix) -> csr_matrix:
    """Leave out weights of coarse nodes that are not nodes of all cell tags which the finer node is a node of.

    Rows sum to 1 as before; a row of which nothing would be left stays.
    """
    if mesh.cell_tags is None or coarse.cell_tags is None or (mesh.cell_tags == mesh.cell_tags[0]).all():
        return prolongation
    tags = np.unique(mesh.cell_tags)
    # more tags than bits share some: less is left out then
    own, other = (
        _tag_bits(m, np.searchsorted(tags, cell_tags) % 62)
        for m, cell_tags in ((mesh, mesh.cell_tags), (coarse, coarse.cell_tags))
    )
    row = np.repeat(np.arange(mesh.n_points), np.diff(prolongation.indptr))
    data = np.where(own[row] & ~other[prolongation.indices], 0.0, prolongation.data)
    sums = np.bincount(row, data, minlength=mesh.n_points)
    kept = prolongation.copy()
    kept.data = np.where(sums[row] > 0, data / np.where(sums > 0, sums, 1.0)[row], prolongation.data)
    kept.eliminate_zeros()
    return kept


def _tag_bits(mesh: Mesh, bit_of_cell: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return, for each node, the bits of its cells."""
    bits = np.zeros(mesh.n_points, dtype=np.int64)
    for bit in np.unique(bit_of_cell):
        bits[mesh.cells[bit_of_cell == bit]] |= np.int64(1) << bit
    return bits


def extended(
    matrix: csr_matrix,
    prolongation: csr_matrix,
    own: NDArray[np.int64],
    loose: NDArray[np.bool_],
    component: NDArray[np.int64],
    dropped: bool,
) -> tuple[csr_matrix, NDArray[np.int64], NDArray[np.int64]]:
    """Return a prolongation that serves all unknowns.

    Parameters
    ----------
    matrix : (n, n) csr_matrix
    prolongation : (k, m) csr_matrix
        For the unknowns at nodes, which come first.
    own : (m,) int64 array
        The unknown that each coarse one is, or -1 where it is none.
    loose : (k,) bool array
        Those of them that the coarse mesh does not serve; all after the first k are loose.
    component : (n,) int64 array
        Loose unknowns are interpolated from those of the same component only.
    dropped : bool
        Whether the coarse mesh has dropped parts of the domain.

    Returns
    -------
    (n, m + l) csr_matrix
    (l,) int64 array
        The loose unknowns that are additional coarse ones.
    (s,) int64 array
        All loose unknowns.
    """
    from scipy.sparse import csr_matrix, vstack

    more = matrix.shape[0] - len(loose)
    if more:
        prolongation = vstack([prolongation, csr_matrix((more, prolongation.shape[1]))], format="csr")
        loose = np.concatenate([loose, np.ones(more, dtype=bool)])
    coarse = np.zeros(len(loose), dtype=bool)
    coarse[own[own >= 0]] = True
    # what a coarse unknown is itself is never loose
    loose = loose & ~coarse
    if dropped:
        before = np.diff(prolongation.indptr)
        prolongation = hanging_together(matrix, prolongation, own)
        loose |= np.diff(prolongation.indptr) < before
    made, added = _by_matrix(matrix, prolongation, coarse, loose, component)
    if dropped:
        more_loose = costly(matrix, made, component) & ~coarse & ~loose
        if more_loose.any():
            loose |= more_loose
            made, added = _by_matrix(matrix, prolongation, coarse, loose, component)
    return made, added, np.flatnonzero(loose)


def _by_matrix(
    matrix: csr_matrix,
    prolongation: csr_matrix,
    coarse: NDArray[np.bool_],
    loose: NDArray[np.bool_],
    component: NDArray[np.int64],
) -> tuple[csr_matrix, NDArray[np.int64]]:
    """Interpolate loose unknowns by the entries of the matrix; return those of them that become coarse ones, too."""
    if not loose.any():
        return prolongation, np.empty(0, np.int64)
    rows, added = backend("rust").extended(matrix, prolongation, coarse, loose, component)
    return csr(rows, prolongation.shape[1] + len(added)), added


def costly(matrix: csr_matrix, prolongation: csr_matrix, component: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Say which unknowns make a column of the prolongation cost much energy.

    Relaxing the one of them in the one column would lower its energy by more than `COSTLY` of it. Runtime: O(entries of
    the product).
    """
    product = matrix @ prolongation
    of_column = np.zeros(prolongation.shape[1], dtype=component.dtype)
    of_column[prolongation.indices] = np.repeat(component, np.diff(prolongation.indptr))
    row, column = np.repeat(np.arange(matrix.shape[0]), np.diff(product.indptr)), product.indices
    energy = np.asarray(prolongation.multiply(product).sum(axis=0)).ravel()
    # lowered by product² / diagonal
    bound = COSTLY * energy[column] * matrix.diagonal()[row]
    over = (bound > 0) & (product.data**2 > bound) & (component[row] == of_column[column])
    out = np.zeros(matrix.shape[0], dtype=bool)
    out[row[over]] = True
    return out


def hanging_together(matrix: csr_matrix, prolongation: csr_matrix, own: NDArray[np.int64]) -> csr_matrix:
    """Return a prolongation without the weights of unknowns that hang not together with the one that is the coarse one.

    They hang together if couplings lead from one to the other, over unknowns that take values from the same coarse one.
    Columns of coarse unknowns that are no fine ones (`own` is -1) stay.
    """
    from scipy.sparse import csr_matrix, diags

    shape = prolongation.shape
    known = np.flatnonzero(own >= 0)
    pattern = csr_matrix((np.ones(prolongation.nnz), prolongation.indices, prolongation.indptr), shape=shape)
    near = csr_matrix((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    reached = csr_matrix((np.ones(len(known)), (own[known], known)), shape=shape)
    reached = (reached + pattern @ diags((own < 0).astype(float))).multiply(pattern).tocsr()
    reached.eliminate_zeros()
    count = -1
    while reached.nnz > count:
        count = reached.nnz
        reached = (near @ reached).multiply(pattern).tocsr()
        reached.data[:] = 1.0
    kept = prolongation.multiply(reached).tocsr()
    kept.sort_indices()
    return kept
