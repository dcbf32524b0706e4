"""Operators between the nodes of two neighbouring levels: prolongation, restriction, injection."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coarsen.transfer.held import free_mask, reduced
from coarsen.transfer.location import locate, shared_nodes
from coarsen.transfer.rows import check_coarser, csr

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from coarsen.multilevel import Hierarchy


def prolongation(hierarchy: Hierarchy, i: int, *, free: Any = None, dirichlet: Any = None) -> csr_matrix:
    """Return piecewise-linear interpolation from level `i` to the next finer level.

    Rows sum to 1, weights are at least 0, no zero is stored. A node that both levels have takes its own value, a node
    on an edge two values, a node in a cell three; linear functions are exact wherever the fine node lies in the coarse
    mesh. A fine node outside (at a curved boundary, in a dropped inlet) takes the nearest point of the coarse mesh on
    its own side of slits and thin walls. A node of a part that the coarse mesh has not at all takes the nearest coarse
    point.

    Parameters
    ----------
    hierarchy : Hierarchy
    i : int
        The coarser level, 1 <= i < len(hierarchy).
    free, dirichlet
        Leave out the rows and columns of nodes that are not free; see `free_mask`.

    Returns
    -------
    (n_{i-1}, n_i) csr_matrix
        Of int32 indices, sorted; made once and kept, so do not change it.

    Raises
    ------
    ValueError
        If there is no such level.

    Notes
    -----
    O(n_{i-1}), parallel; the result doesn't depend on the number of threads.
    """
    check_coarser(hierarchy, i)
    matrix = locate(hierarchy, i - 1, i).matrix
    mask = free_mask(hierarchy[0].mesh, free, dirichlet)
    return matrix if mask is None else reduced(matrix, mask[hierarchy[i - 1].nodes], mask[hierarchy[i].nodes])


def restriction(hierarchy: Hierarchy, i: int, *, free: Any = None, dirichlet: Any = None) -> csr_matrix:
    """Return the transpose of `prolongation`, by rows."""
    return prolongation(hierarchy, i, free=free, dirichlet=dirichlet).T.tocsr()


def injection(hierarchy: Hierarchy, i: int, *, free: Any = None, dirichlet: Any = None) -> csr_matrix:
    """Return the (n_i, n_{i-1}) matrix that picks the nodes of level `i` from the next finer level.

    Raises
    ------
    ValueError
        If there is no such level, or it is not nested in the finer one.
    """
    check_coarser(hierarchy, i)
    shared = shared_nodes(hierarchy, i - 1, i)
    if (shared < 0).any():
        raise ValueError(f"level {i} is not nested in level {i - 1}: {np.count_nonzero(shared < 0)} nodes are its own")
    ones = np.ones(len(shared))
    rows = np.arange(len(shared) + 1, dtype=np.int32)
    matrix = csr((rows, shared.astype(np.int32), ones), hierarchy[i - 1].mesh.n_points)
    mask = free_mask(hierarchy[0].mesh, free, dirichlet)
    return matrix if mask is None else reduced(matrix, mask[hierarchy[i].nodes], mask[hierarchy[i - 1].nodes])
