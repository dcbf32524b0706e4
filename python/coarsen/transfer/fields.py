"""Fields carried from one level to any other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coarsen.transfer.location import coarse_nodes_in_fine, shared_nodes
from coarsen.transfer.nodes import prolongation
from coarsen.transfer.overlap import cell_transfer
from coarsen.transfer.rows import check_level

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.sparse import csr_matrix

    from coarsen.multilevel import Hierarchy

ON = ("nodes", "cells")
"""What a field lives on."""


def interpolate(
    hierarchy: Hierarchy, values: ArrayLike, from_level: int, to_level: int, *, on: str = "nodes"
) -> NDArray[Any]:
    """Carry a field from one level to any other.

    Nodal fields go to finer levels by `prolongation` and to coarser ones by their values at the nodes (by interpolation
    where the levels are not nested). Cell fields go both ways by overlap, and conservatively: the integral over the
    mesh stays, up to rounding; see `cell_transfer`.

    Parameters
    ----------
    hierarchy : Hierarchy
    values : (n, ...) array
        One value (or row of values) for each node or cell of level `from_level`.
    from_level, to_level : int
        0 is the finest; negative ones count from the coarsest.
    on : {"nodes", "cells"}
        What `values` belong to.

    Returns
    -------
    (k, ...) array

    Raises
    ------
    ValueError
        If there is no such level, or `values` have another length.
    """
    start = check_level(hierarchy, "from_level", from_level)
    end = check_level(hierarchy, "to_level", to_level)
    if on not in ON:
        raise ValueError(f"'on' is {on!r}, expected one of {', '.join(map(repr, ON))}")
    field: NDArray[Any] = np.asarray(values)
    mesh = hierarchy[start].mesh
    rows = mesh.n_points if on == "nodes" else mesh.n_cells
    if field.ndim == 0 or len(field) != rows:
        raise ValueError(f"'values' has shape {field.shape}, expected ({rows}, ...): one for each of the {on}")
    if start == end:
        return np.array(field)
    if on == "cells":
        return _applied(cell_transfer(hierarchy, start, end), field)
    if end > start:
        shared = shared_nodes(hierarchy, start, end)
        if (shared >= 0).all():
            return np.asarray(field[shared])
        return _applied(coarse_nodes_in_fine(hierarchy, start, end), field)
    for level in range(start, end, -1):
        field = _applied(prolongation(hierarchy, level), field)
    return field


def _applied(matrix: csr_matrix, field: NDArray[Any]) -> NDArray[Any]:
    out: NDArray[Any] = np.asarray(matrix @ field.reshape(len(field), -1))
    return np.reshape(out, (matrix.shape[0], *field.shape[1:]))
