"""Operators and prolongations of a multigrid method on the levels of a hierarchy.

On top of the hierarchy's own prolongations, some things that solvers need:

- Coarse operators are Galerkin's, P^T A P, without their weak entries (`WEAK`, `WEAK_BLOCKS`).
- Where a level has dropped parts of the domain, unknowns that its mesh does not serve are interpolated by the entries
  of the matrix instead, some of them becoming coarse unknowns themselves; see `coarsen.loose`.
- Where materials meet, interpolation stays within them.
- Where nothing but one unknown is held, and the matrix has the constants in its null space (all boundaries natural),
  the one held unknown is only a choice of the constant. The coarse levels then work on the whole, singular problem,
  and the constant is chosen on the finest level: holding a single node on every level would slow all of them down, by
  the logarithm of their size.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from coarsen import loose, transfer
from coarsen.backend import backend
from coarsen.transfer.rows import csr

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_matrix

    from coarsen.mesh import Mesh
    from coarsen.multilevel import Hierarchy

WEAK = 0.01
"""Galerkin's entries under this, relative to the roots of both diagonals, are weak. 0.02 would cost iterations."""

WEAK_BLOCKS = 0.025
"""The same for the couplings between nodes of several unknowns, by norms of blocks. 0.05 would cost iterations."""

SHRINK = 0.6
"""A level with more than this share of the unknowns of the one before is passed over."""

DEEP = 0.1
"""Nodes further than this many fine spacings outside of the coarse mesh are loose."""

SLOW = 0.2
"""Where relaxation between the coarse unknowns leaves more than this of an error of 1, a cycle needs more of it."""

MOST_GAUGED = 256
"""A node with more neighbours than this is no node of a mesh."""

Operators = Callable[[int, "Mesh"], Any]


@dataclass(frozen=True, eq=False, repr=False)
class Stage:
    """A level of a multigrid method.

    Attributes
    ----------
    level : int
        The level of the hierarchy.
    A : csr_matrix
        The operator on its unknowns.
    P, R : csr_matrix or None
        Prolongation from the next coarser stage and its transpose; None on the coarsest one.
    slow : (s,) int64 array or None
        Unknowns that are too far from coarse ones for one sweep, and loose ones: they are worth a second one.
    gauge : (k,) float64 array or None
        On the finest stage, if its single held unknown only chooses the constant: the row sums of A.
    """

    level: int
    A: csr_matrix
    P: csr_matrix | None = None
    R: csr_matrix | None = None
    slow: NDArray[np.int64] | None = None
    gauge: NDArray[np.float64] | None = None

    def __repr__(self) -> str:
        below = "the coarsest" if self.P is None else f"{self.P.shape[1]} on the next"
        return f"Stage(level {self.level}, {self.A.shape[0]} unknowns, {below})"


def stages(
    A: Any,
    hierarchy: Hierarchy,
    free: Any = None,
    *,
    dirichlet: Any = None,
    block_size: int = 1,
    operators: Operators | None = None,
    max_coarse: int = 200,
    singular: bool = False,
) -> list[Stage]:
    """Return operators and prolongations, finest first; the parameters are those of `multigrid.pyamg_solver`.

    With `singular`, where the one unknown that is held only chooses the constant, the finest stage is that of the
    whole, singular matrix, and it is left to the caller to choose the constant.
    """
    finest, mask = finest_matrix(A, hierarchy, free, dirichlet, block_size)
    whole = whole_matrix(finest, mask) if block_size == 1 else None
    matrix = finest if whole is None else whole
    held = mask if whole is None else np.ones_like(mask)
    made: list[tuple[Any, ...]] = []
    core, threads = backend(hierarchy.options.backend), hierarchy.options.threads
    columns, component = held, np.tile(np.arange(block_size), len(held) // block_size)[held]
    i = 0
    while matrix.shape[0] > max_coarse:
        j = _next_level(hierarchy, i, matrix.shape[0] - (len(component) - int(columns.sum())), held, block_size)
        if j is None:
            break
        rows, columns = columns, held.reshape(-1, block_size)[hierarchy[j].nodes].ravel()
        found = transfer.locate(hierarchy, i, j)
        whole_p = blocks(loose.within_materials(hierarchy[i].mesh, hierarchy[j].mesh, found.matrix), block_size)
        place = transfer.shared_nodes(hierarchy, i, j)
        if (place < 0).any():
            # a level that is not nested may have nodes that no free finer one takes a value from: they are no unknowns
            columns &= np.bincount(whole_p[rows].indices, minlength=len(columns)) > 0
        prolongation = transfer.reduced(whole_p, rows, columns)
        component_coarse = np.tile(np.arange(block_size), len(columns) // block_size)[columns]
        own = _own_unknowns(place, rows, columns)
        if operators is None:
            unknown = np.where(rows, np.cumsum(rows) - 1, -1)[::block_size]
            nodes = loose.unserved(hierarchy, (i, j), found, DEEP, matrix, unknown)
            prolongation, more, by_matrix = loose.extended(
                matrix,
                prolongation,
                own,
                np.repeat(nodes, block_size)[rows],
                component,
                hierarchy[j].dropped is not None,
            )
            own = np.concatenate([own, more])
            component = np.concatenate([component_coarse, component[more]])
            least = WEAK if block_size == 1 else 0.0
            restriction, coarse, slow = core.stage(
                matrix, prolongation, _marked(matrix.shape[0], own[own >= 0]), least, SLOW, threads
            )
            if len(by_matrix):
                slow = np.flatnonzero(_marked(matrix.shape[0], slow, by_matrix))
            restriction = csr(restriction, matrix.shape[0])
            coarse = csr(coarse, prolongation.shape[1])
            if block_size > 1 and hierarchy[0].mesh.dim == 2:
                coarse = without_weak_blocks(coarse, hierarchy[j].mesh, columns, block_size, threads)
        else:
            component = component_coarse
            restriction = prolongation.T.tocsr()
            coarse = transfer.reduced(as_csr(operators(j, hierarchy[j].mesh)), columns, columns)
            slow = core.slow(matrix, _marked(matrix.shape[0], own[own >= 0]), SLOW)
        made.append((i, matrix, prolongation, restriction, slow))
        matrix, i = coarse, j
    made.append((i, matrix, None, None, None))
    gauge = None
    if whole is not None and len(made) == 1:
        made = [(0, finest, None, None, None)]
    elif whole is not None:
        made = _grounded(made)
        gauge = np.asarray(finest.sum(axis=1)).ravel()
        made = made if singular else _gauged(made, finest, mask)
    gauges = [gauge] + [None] * (len(made) - 1)
    whole_stages = ((*stage, own) for stage, own in zip(made, gauges, strict=True))
    return [Stage(*stage) for stage in whole_stages]


def without_weak_blocks(
    matrix: csr_matrix, mesh: Mesh, free: NDArray[np.bool_], block_size: int, threads: int | None
) -> csr_matrix:
    """Leave out weak couplings between nodes, those that are wholly free; nothing changes for linear functions."""
    nodes = np.flatnonzero(free.reshape(-1, block_size).all(axis=1))
    first = (np.cumsum(free) - 1)[nodes * block_size]
    rows = backend("rust").filtered_blocks(matrix, first, mesh.points[nodes], block_size, WEAK_BLOCKS, threads)
    return csr(rows, matrix.shape[1])


def _marked(size: int, *places: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return a mask that is set at some places."""
    out = np.zeros(size, dtype=bool)
    for some in places:
        out[some] = True
    return out


def _own_unknowns(place: NDArray[np.int64], rows: NDArray[np.bool_], columns: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return, for each coarse unknown, the fine one that it is, or -1; from the places of coarse nodes."""
    block_size = len(columns) // len(place)
    fine = np.where(place < 0, -1, place * block_size)[:, None] + np.arange(block_size)
    fine = np.where((place < 0)[:, None], -1, fine).ravel()[columns]
    number = np.where(rows, np.cumsum(rows) - 1, -1)
    return np.where(fine < 0, -1, number[fine])


def _next_level(hierarchy: Hierarchy, i: int, unknowns: int, held: NDArray[np.bool_], block_size: int) -> int | None:
    """Return the next level after `i` that is smaller by a good share, or None."""
    counts = held.reshape(-1, block_size)
    for j in range(i + 1, len(hierarchy)):
        count = int(np.count_nonzero(counts[hierarchy[j].nodes]))
        if 0 < count <= SHRINK * unknowns:
            return j
    return None


def finest_matrix(
    A: Any, hierarchy: Hierarchy, free: Any, dirichlet: Any, block_size: int
) -> tuple[csr_matrix, NDArray[np.bool_]]:
    """Return the matrix of the free unknowns, and which of all are free.

    Raises
    ------
    ValueError
        If the matrix has another size or dtype, or `free` and `dirichlet` do not fit the mesh.
    """
    mesh = hierarchy[0].mesh
    if block_size < 1:
        raise ValueError(f"'block_size' is {block_size}, expected at least 1")
    unknowns = mesh.n_points * block_size
    if free is not None and np.shape(free) == (unknowns,) and dirichlet is None:
        mask = np.asarray(free)
        if mask.dtype != np.bool_:
            raise ValueError(f"'free' has dtype {mask.dtype}, expected bool")
    else:
        nodes = transfer.free_mask(mesh, free, dirichlet)
        mask = np.ones(unknowns, dtype=bool) if nodes is None else np.repeat(nodes, block_size)
    matrix = as_csr(A)
    count = int(np.count_nonzero(mask))
    if matrix.shape not in ((unknowns, unknowns), (count, count)):
        wanted = f"({unknowns}, {unknowns})" + (f" or ({count}, {count})" if count < unknowns else "")
        raise ValueError(f"'A' has shape {matrix.shape}, expected {wanted}")
    if matrix.shape[0] == unknowns and count < unknowns:
        matrix = transfer.reduced(matrix, mask, mask)
    return matrix, mask


def whole_matrix(matrix: csr_matrix, mask: NDArray[np.bool_]) -> csr_matrix | None:
    """Return the singular matrix of all unknowns, of which one was held, or None where that is not what was done.

    Its row and column of the held unknown are what makes all rows and columns sum to 0.
    """
    if len(mask) - np.count_nonzero(mask) != 1:
        return None
    rows, columns = (np.asarray(matrix.sum(axis=axis)).ravel() for axis in (1, 0))
    rounding = 1e-10 * np.abs(matrix.diagonal())
    near = np.flatnonzero((np.abs(rows) > rounding) | (np.abs(columns) > rounding))
    if not 0 < len(near) <= MOST_GAUGED or not rows[near].sum() > 0:
        return None
    return _bordered(matrix, int(np.argmin(mask)), near, (-columns[near], -rows[near], rows[near].sum()))


def _bordered(
    matrix: csr_matrix, held: int, near: NDArray[np.int64], values: tuple[Any, NDArray[np.float64], float]
) -> csr_matrix:
    """Return a matrix with one more row and column, entries of which are given for unknowns `near`, and diagonal."""
    known = matrix if matrix.has_sorted_indices else matrix.sorted_indices()
    indices = known.indices + (known.indices >= held)
    number = near + (near >= held)
    before = int(np.searchsorted(number, held))
    row, column, own = values
    # by row: where its new entries come, and what they are
    more = [(held, int(known.indptr[held]), np.insert(number, before, held), np.insert(row, before, own))]
    for k, i in enumerate(near.tolist()):
        start, end = known.indptr[i : i + 2].tolist()
        place = start + int(np.searchsorted(indices[start:end], held))
        more.append((int(number[k]), place, np.array([held]), column[k : k + 1]))
    more.sort(key=lambda entries: entries[0])
    _, places, new_indices, new_values = zip(*more, strict=True)
    counts = np.insert(np.diff(known.indptr), held, len(near) + 1)
    counts[number] += 1
    indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    return csr(
        (indptr, _inserted(indices, places, new_indices), _inserted(known.data, places, new_values)), len(counts)
    )


def _inserted(values: NDArray[Any], places: Sequence[int], pieces: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Return an array with pieces put in before ascending places."""
    kept = np.split(values, places)
    both = [part for pair in zip(kept[:-1], pieces, strict=True) for part in pair]
    return np.concatenate([*both, kept[-1]], dtype=values.dtype, casting="same_kind")


def _grounded(made: list[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
    """Leave out an unknown of the coarsest stage: up to constants, which no stage feels, nothing is lost."""
    level, matrix, prolongation, restriction, slow = made[-2]
    keep = np.arange(prolongation.shape[1]) > 0
    prolongation = transfer.reduced(prolongation, np.ones(prolongation.shape[0], dtype=bool), keep)
    last = (made[-1][0], transfer.reduced(made[-1][1], keep, keep), None, None, None)
    return [*made[:-2], (level, matrix, prolongation, restriction[1:], slow), last]


def _gauged(made: list[tuple[Any, ...]], finest: csr_matrix, mask: NDArray[np.bool_]) -> list[tuple[Any, ...]]:
    """Choose the constant: what comes from the coarse stages is 0 at the held unknown."""
    from scipy.sparse import csr_matrix, vstack

    level, _, prolongation, _, slow = made[0]
    row = prolongation[int(np.argmin(mask))]
    ones = csr_matrix(np.ones((finest.shape[0], 1)))
    prolongation = as_csr(prolongation[mask] - ones @ row)
    prolongation.sort_indices()
    held = int(np.argmin(mask))
    slow = slow[slow != held]
    slow = slow - (slow > held)
    return [(level, finest, prolongation, vstack([prolongation.T], format="csr"), slow), *made[1:]]


def as_csr(A: Any) -> csr_matrix:
    """Return a real matrix by rows with the indices that the core takes.

    Raises
    ------
    ValueError
        If it is complex, or has 2³¹ or more entries.
    """
    from scipy.sparse import csr_matrix

    matrix = csr_matrix(A)
    if matrix.dtype != np.float64:
        if matrix.dtype.kind not in "iuf":
            raise ValueError(f"'A' has dtype {matrix.dtype}, expected real numbers")
        matrix = matrix.astype(np.float64)
    if matrix.indices.dtype != np.int32 or matrix.indptr.dtype != np.int32:
        if matrix.nnz >= np.iinfo(np.int32).max:
            raise ValueError(f"'A' has {matrix.nnz} entries, expected fewer than 2**31 - 1")
        parts = (matrix.data, matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32))
        matrix = csr_matrix(parts, shape=matrix.shape)
    return matrix


def blocks(matrix: csr_matrix, block_size: int) -> csr_matrix:
    """Interpolate each of a node's unknowns alike."""
    if block_size == 1:
        return matrix
    from scipy.sparse import identity, kron

    return as_csr(kron(matrix, identity(block_size), format="csr"))
