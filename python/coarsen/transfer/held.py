"""Nodes that are free and nodes that are held, and operators between the free ones."""

from __future__ import annotations

import contextlib
import operator
from collections.abc import Collection
from typing import TYPE_CHECKING, Any

import numpy as np

from coarsen.transfer.rows import csr

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_matrix

    from coarsen.mesh import Mesh


def free_mask(mesh: Mesh, free: Any = None, dirichlet: Any = None) -> NDArray[np.bool_] | None:
    """Say which nodes of a mesh are free, from a mask or from what is held.

    Parameters
    ----------
    mesh : Mesh
    free : (n,) bool array, optional
        True for nodes that are free; None: all, unless `dirichlet` is given.
    dirichlet : "boundary", int, str or collection of them, optional
        The nodes on the whole boundary, or on the facets with these `facet_tags` or `facet_names`, are held.

    Returns
    -------
    (n,) bool array or None
        None where nothing is held.

    Raises
    ------
    ValueError
        If both are given, the mask has another shape or dtype, or no facet has one of the tags.
    """
    if free is not None and dirichlet is not None:
        raise ValueError("'free' and 'dirichlet' are given both, expected one of them")
    if free is not None:
        mask = np.asarray(free)
        if mask.dtype != np.bool_ or mask.shape != (mesh.n_points,):
            wanted = f"expected bool and ({mesh.n_points},): one for each node of the finest mesh"
            raise ValueError(f"'free' has dtype {mask.dtype} and shape {mask.shape}, {wanted}")
        return np.asarray(mask)
    if dirichlet is None:
        return None
    mask = np.ones(mesh.n_points, dtype=bool)
    if isinstance(dirichlet, str) and dirichlet == "boundary":
        mask[mesh.boundary_facets] = False
        return mask
    several = isinstance(dirichlet, Collection | np.ndarray) and not isinstance(dirichlet, str)
    tags = [_facet_tag(mesh, tag) for tag in (dirichlet if several else [dirichlet])]
    known = np.empty(0, np.int64) if mesh.facet_tags is None else mesh.facet_tags
    missing = np.setdiff1d(tags, known)
    if len(missing):
        raise ValueError(f"'dirichlet' names facet tag {missing[0]}, which no facet of the mesh has")
    if mesh.facets is not None:
        mask[mesh.facets[np.isin(known, tags)]] = False
    return mask


def _facet_tag(mesh: Mesh, tag: Any) -> int:
    names = mesh.facet_names or {}
    if not isinstance(tag, str):
        with contextlib.suppress(TypeError):
            return operator.index(tag)
    for number, name in names.items():
        if name == tag:
            return number
    known = f", one of {', '.join(map(repr, names.values()))}" if names else " (no facet has a name)"
    raise ValueError(f"'dirichlet' is {tag!r}, expected 'boundary' or facet tags{known}")


def reduced(matrix: csr_matrix, rows: NDArray[np.bool_], columns: NDArray[np.bool_]) -> csr_matrix:
    """Return the rows and columns of a matrix that two masks pick."""
    if rows.all() and columns.all():
        return matrix
    keep = columns[matrix.indices]
    if not rows.all():
        keep &= np.repeat(rows, np.diff(matrix.indptr))
    before = np.zeros(len(keep) + 1, dtype=matrix.indptr.dtype)
    np.cumsum(keep, out=before[1:])
    # rows that go have nothing left: each that stays starts where it did, and ends where the next one starts
    starts = before[matrix.indptr[np.append(rows, True)]]
    place = np.cumsum(columns, dtype=matrix.indices.dtype) - 1
    return csr((starts, place[matrix.indices[keep]], matrix.data[keep]), int(np.count_nonzero(columns)))
