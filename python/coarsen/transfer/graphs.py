"""Levels and the steps between them as graph networks take them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from coarsen.transfer.nodes import prolongation
from coarsen.transfer.rows import check_level

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from coarsen.multilevel import Hierarchy


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
    mesh = hierarchy[check_level(hierarchy, "i", i)].mesh
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
