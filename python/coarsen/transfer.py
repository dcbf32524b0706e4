"""Operators between the levels of a hierarchy: nodal fields, cell fields, graphs.

`Hierarchy.prolongation` and its companions are the functions of this module. All work on any two levels of a hierarchy,
nested or not. Fine nodes are located in the coarse mesh by walks over the edges of the fine mesh, so interpolation
never reaches across a slit, a thin wall or into another part.
"""

from __future__ import annotations

import importlib
from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from coarsen.backend import backend

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.sparse import csr_matrix

    from coarsen.mesh import Mesh
    from coarsen.multilevel import Hierarchy

ON = ("nodes", "cells")
"""What a field lives on."""


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
    _check_coarser(hierarchy, i)
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
    _check_coarser(hierarchy, i)
    shared = shared_nodes(hierarchy, i - 1, i)
    if (shared < 0).any():
        raise ValueError(f"level {i} is not nested in level {i - 1}: {np.count_nonzero(shared < 0)} nodes are its own")
    ones = np.ones(len(shared))
    rows = np.arange(len(shared) + 1, dtype=np.int32)
    matrix = _csr((rows, shared.astype(np.int32), ones), hierarchy[i - 1].mesh.n_points)
    mask = free_mask(hierarchy[0].mesh, free, dirichlet)
    return matrix if mask is None else reduced(matrix, mask[hierarchy[i].nodes], mask[hierarchy[i - 1].nodes])


def reduced(matrix: csr_matrix, rows: NDArray[np.bool_], columns: NDArray[np.bool_]) -> csr_matrix:
    """Return the rows and columns of a matrix that two masks pick."""
    if not rows.all():
        matrix = matrix[rows]
    if columns.all():
        return matrix
    place = np.cumsum(columns, dtype=matrix.indices.dtype) - 1
    keep = columns[matrix.indices]
    before = np.zeros(len(keep) + 1, dtype=matrix.indptr.dtype)
    np.cumsum(keep, out=before[1:])
    return _csr((before[matrix.indptr], place[matrix.indices[keep]], matrix.data[keep]), int(np.count_nonzero(columns)))


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
    if not isinstance(tag, str):
        return int(tag)
    names = mesh.facet_names or {}
    for number, name in names.items():
        if name == tag:
            return number
    known = f", one of {', '.join(map(repr, names.values()))}" if names else " (no facet has a name)"
    raise ValueError(f"'dirichlet' is {tag!r}, expected 'boundary' or facet tags{known}")


def shared_nodes(hierarchy: Hierarchy, fine: int, coarse: int) -> NDArray[np.int64]:
    """Return, for each node of level `coarse`, its place among the nodes of level `fine`, or -1."""
    among, nodes = hierarchy[fine].nodes, hierarchy[coarse].nodes
    place = np.minimum(np.searchsorted(among, nodes), len(among) - 1)
    return np.where(among[place] == nodes, place, -1)


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
            *_pair(hierarchy, fine, coarse), hierarchy.options.threads
        )
        found = Located(_csr(rows, other.n_points), outside, distance, lost)
    if coarse == fine + 1:
        kept[fine, coarse] = found
    return found


def _pair(hierarchy: Hierarchy, fine: int, coarse: int) -> tuple[Any, ...]:
    mesh, other = hierarchy[fine].mesh, hierarchy[coarse].mesh
    return mesh.points, mesh.cells, other.points, other.cells, shared_nodes(hierarchy, fine, coarse)


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
    matrix = _csr((starts, columns[keep], weights[keep]), coarse.n_points)
    return Located(matrix, outside, distance[outside], np.empty(0, np.int64))


def sparse() -> Any:
    """Return ``scipy.sparse``, or say how to get it.

    Raises
    ------
    ImportError
        If SciPy is not installed.
    """
    try:
        return importlib.import_module("scipy.sparse")
    except ImportError:
        raise ImportError("operators are SciPy matrices: pip install 'coarsen-mesh[multigrid]'") from None


def _csr(rows: tuple[Any, Any, Any], columns: int) -> csr_matrix:
    """Wrap sorted rows, without a copy."""
    csr_matrix = sparse().csr_matrix

    indptr, indices, values = rows
    matrix = csr_matrix((values, indices, indptr), shape=(len(indptr) - 1, columns), copy=False)
    matrix.has_sorted_indices = True
    matrix.has_canonical_format = True
    return matrix


def _check_coarser(hierarchy: Hierarchy, i: int) -> None:
    if not 1 <= i < len(hierarchy):
        raise ValueError(f"'i' is {i}, expected a coarser level: 1 <= i <= {len(hierarchy) - 1}")


def _check_level(hierarchy: Hierarchy, name: str, level: int) -> int:
    if not -len(hierarchy) <= level < len(hierarchy):
        raise ValueError(f"'{name}' is {level}, expected a level: 0 <= {name} <= {len(hierarchy) - 1}")
    return level % len(hierarchy)


# --- fields ----------------------------------------------------------------------------------------------------------


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
    start = _check_level(hierarchy, "from_level", from_level)
    end = _check_level(hierarchy, "to_level", to_level)
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
        return _applied(_coarse_nodes_in_fine(hierarchy, start, end), field)
    for level in range(start, end, -1):
        field = _applied(prolongation(hierarchy, level), field)
    return field


def _applied(matrix: csr_matrix, field: NDArray[Any]) -> NDArray[Any]:
    out: NDArray[Any] = np.asarray(matrix @ field.reshape(len(field), -1))
    return np.reshape(out, (matrix.shape[0], *field.shape[1:]))


def _coarse_nodes_in_fine(hierarchy: Hierarchy, fine: int, coarse: int) -> csr_matrix:
    """Interpolate the finer mesh at the nodes of a coarser one that has nodes of its own."""
    mesh, other = hierarchy[fine].mesh, hierarchy[coarse].mesh
    back = shared_nodes(hierarchy, coarse, fine)
    if mesh.dim == 1:
        return _locate_on_line(other, mesh, back).matrix
    core = backend(hierarchy.options.backend)
    rows, *_ = core.prolongation(other.points, other.cells, mesh.points, mesh.cells, back, hierarchy.options.threads)
    return _csr(rows, mesh.n_points)


def cell_transfer(hierarchy: Hierarchy, from_level: int, to_level: int) -> csr_matrix:
    """Return the matrix that carries cell averages from one level to another by overlap.

    What a cell holds (its value times its area) goes to the cells of the other level in proportion to the areas that it
    shares with them, cut as exact polygons; the part of a cell that the other mesh does not cover goes with the rest,
    and a cell that is not covered at all goes to the nearest one. Integrals are kept; constants are, too, in all cells
    but those where one of the meshes ends and the other does not.

    Returns
    -------
    (m_to, m_from) csr_matrix
    """
    diags = sparse().diags
    fine, coarse = sorted((from_level, to_level))
    mesh, other = hierarchy[fine].mesh, hierarchy[coarse].mesh
    if mesh.dim == 1:
        shared = _overlap_on_line(mesh, other)
    else:
        rows = backend(hierarchy.options.backend).overlap(*_pair(hierarchy, fine, coarse), hierarchy.options.threads)
        shared = _csr(rows, other.n_cells)
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
    return _csr((rows, at.astype(np.int32), cell_sizes(mesh)), coarse.n_cells)


# --- graphs ----------------------------------------------------------------------------------------------------------


class Graph(NamedTuple):
    """Edges of a level: ``edge_index`` (2, E) of source and target, ``relative`` (E, d) from source to target."""

    edge_index: NDArray[np.int64]
    relative: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"Graph({self.edge_index.shape[1]} edges, both directions)"


class Assignment(NamedTuple):
    """Fine nodes and their coarse nodes: ``edge_index`` (2, E) of fine and coarse node, ``weights`` (E,)."""

    edge_index: NDArray[np.int64]
    weights: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"Assignment({len(np.unique(self.edge_index[0]))} fine nodes, {len(self.weights)} weights)"


def graph(hierarchy: Hierarchy, i: int) -> Graph:
    """Return the edges of level `i`, each in both directions, as graph networks take them.

    Returns
    -------
    Graph
        ``edge_index`` (2, E) int64, sorted by source, then target, and ``relative`` (E, d) float64:
        position of the target minus position of the source.
    """
    mesh = hierarchy[_check_level(hierarchy, "i", i)].mesh
    cells = mesh.cells.astype(np.int64, copy=False)
    # cells turn left, so an inner edge is there in both directions already
    ways = [cells, cells[:, ::-1]] if mesh.dim == 1 else [cells[:, [k, (k + 1) % 3]] for k in range(3)]
    if mesh.dim == 2:
        ways.append(mesh.boundary_facets[:, ::-1])
    edges = np.concatenate(ways)
    edges = edges[np.argsort(edges[:, 0] * mesh.n_points + edges[:, 1])]
    relative = mesh.points[edges[:, 1]] - mesh.points[edges[:, 0]]
    return Graph(np.ascontiguousarray(edges.T), relative)


def assignment(hierarchy: Hierarchy, i: int) -> Assignment:
    """Assign each node of level `i` - 1 to one to three nodes of level `i`, with the weights of `prolongation`.

    Returns
    -------
    Assignment
        ``edge_index`` (2, E) int64 of fine and coarse node, ``weights`` (E,) float64 that sum to 1 for each fine node.
    """
    matrix = prolongation(hierarchy, i)
    fine = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    return Assignment(np.stack([fine, matrix.indices.astype(np.int64)]), matrix.data.copy())


# --- the report ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class LevelTransfer:
    """How the nodes of level `level` - 1 lie in level `level`.

    Attributes
    ----------
    level, nodes : int
        The coarser level, and the number of nodes of the finer one.
    shared, on_edge, in_cell : int
        Finer nodes with one, two and three weights.
    outside : int
        Finer nodes outside of the coarse mesh.
    farthest, farthest_spacings : float
        The largest distance of such a node, and in units of the coarse spacing there.
    lost : int
        Finer nodes of parts that the coarse mesh has not.
    without_image : int
        Coarse nodes that no finer node takes a value from; 0 in nested hierarchies.
    """

    level: int
    nodes: int
    shared: int
    on_edge: int
    in_cell: int
    outside: int
    farthest: float
    farthest_spacings: float
    lost: int
    without_image: int


@dataclass(frozen=True, repr=False)
class TransferReport:
    """What `Hierarchy.transfer_report` found, one row a coarser level; prints as a table."""

    rows: tuple[LevelTransfer, ...]

    @property
    def outside(self) -> int:
        """Number of nodes that lie outside of the next coarser mesh, over all levels."""
        return sum(row.outside for row in self.rows)

    @property
    def without_image(self) -> int:
        """Number of coarse nodes without a finer node that takes a value from them, over all levels."""
        return sum(row.without_image for row in self.rows)

    def __repr__(self) -> str:
        return f"TransferReport({len(self.rows)} coarser levels, {self.outside} nodes outside of the next)"

    def __str__(self) -> str:
        head = "level   nodes  1 weight 2 weights 3 weights  outside   farthest (spacings)   lost  without image"
        lines = [
            f"{r.level:5d} {r.nodes:7d} {r.shared:9d} {r.on_edge:9d} {r.in_cell:9d} {r.outside:8d} "
            f"{r.farthest:10.4g} {r.farthest_spacings:10.3f} {r.lost:6d} {r.without_image:14d}"
            for r in self.rows
        ]
        return "\n".join([head, *lines])


def transfer_report(hierarchy: Hierarchy) -> TransferReport:
    """Say, for each coarser level, how many finer nodes lie outside of it, how far, and how the others lie.

    Returns
    -------
    TransferReport

    Raises
    ------
    RuntimeError
        If a node of a nested level has no finer node that takes a value from it: a defect of this package.
    """
    rows = []
    for i in range(1, len(hierarchy)):
        found = locate(hierarchy, i - 1, i)
        weights = np.diff(found.matrix.indptr)
        inside = np.ones(len(weights), dtype=bool)
        inside[found.outside] = False
        spacings = found.distance / (found.matrix[found.outside] @ hierarchy[i].spacing)
        bare = hierarchy[i].mesh.n_points - int(np.count_nonzero(np.bincount(found.matrix.indices)))
        if bare and hierarchy.options.nested:
            raise RuntimeError(f"internal error, please report it: {bare} nodes of level {i} have no fine image")
        rows.append(
            LevelTransfer(
                level=i,
                nodes=len(weights),
                shared=int(np.count_nonzero(weights[inside] == 1)),
                on_edge=int(np.count_nonzero(weights[inside] == 2)),
                in_cell=int(np.count_nonzero(weights[inside] == 3)),
                outside=len(found.outside),
                farthest=float(found.distance.max(initial=0.0)),
                farthest_spacings=float(spacings.max(initial=0.0)),
                lost=len(found.lost),
                without_image=bare,
            )
        )
    return TransferReport(tuple(rows))
