"""What others do with the same nodes: one function a rival, each from a mesh to anything.

A rival that is not installed is left out. All of them take (points, cells) and are timed whole.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from inputs import Cells, Points

Contestant = Callable[[Points, Cells], object]
COARSEST = 100  # cells, as in coarsen.hierarchy


def delaunay_by_scipy(points: Points, cells: Cells) -> object:
    """Triangulate by Qhull."""
    from scipy.spatial import Delaunay

    return Delaunay(points)


def delaunay_by_shull(points: Points, cells: Cells) -> object:
    """Triangulate by sweep-hull, sequentially."""
    from shull import Delaunay

    return Delaunay(points)


def neighbours_by_scipy(points: Points, cells: Cells) -> object:
    """Find all nearest neighbours with scipy's k-d tree."""
    from scipy.spatial import KDTree

    return KDTree(points).query(points, k=2)


def neighbours_by_pykdtree(points: Points, cells: Cells) -> object:
    """Find all nearest neighbours with pykdtree (OpenMP: all cores)."""
    from pykdtree.kdtree import KDTree

    return KDTree(points).query(points, k=2)


def stiffness(points: Points, cells: Cells) -> object:
    """Return the Laplacian's P1 stiffness matrix, boundary nodes held, as scipy CSR."""
    from scipy.sparse import coo_array

    corner = points[cells]
    opposite = np.roll(corner, -1, axis=1) - np.roll(corner, -2, axis=1)
    (ax, ay), (bx, by) = opposite[:, 0].T, opposite[:, 1].T
    area_4 = 2 * np.abs(ax * by - ay * bx)
    local = np.einsum("cid,cjd->cij", opposite, opposite) / area_4[:, None, None]
    rows, columns = np.repeat(cells, 3, axis=1).ravel(), np.tile(cells, 3).ravel()
    matrix = coo_array((local.ravel(), (rows, columns)), shape=(len(points), len(points))).tocsr()
    edges = np.sort(cells[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    code, count = np.unique(edges[:, 0] * len(points) + edges[:, 1], return_counts=True)
    inside = np.ones(len(points), dtype=bool)
    inside[np.concatenate(np.divmod(code[count == 1], len(points)))] = False
    return matrix[inside][:, inside]


def amg_by_ruge_stuben(points: Points, cells: Cells, matrix: object) -> object:
    """Set up classical AMG with PyAMG; the matrix is given."""
    from pyamg import ruge_stuben_solver

    return ruge_stuben_solver(matrix)


def amg_by_smoothed_aggregation(points: Points, cells: Cells, matrix: object) -> object:
    """Set up smoothed-aggregation AMG with PyAMG; the matrix is given."""
    from pyamg import smoothed_aggregation_solver

    return smoothed_aggregation_solver(matrix)


def edge_length(points: Points, cells: Cells) -> Points:
    """Return the mean length of the edges at each node."""
    total, count = np.zeros(len(points)), np.zeros(len(points))
    for a, b in ((0, 1), (1, 2), (2, 0)):
        length = np.linalg.norm(points[cells[:, a]] - points[cells[:, b]], axis=1)
        for end in (a, b):
            total += np.bincount(cells[:, end], length, len(points))
            count += np.bincount(cells[:, end], minlength=len(points))
    return total / count


def hierarchy_by_mmg(points: Points, cells: Cells) -> list[int]:
    """Remesh with mmg2d again and again, each time to twice the edge length; not nested."""
    from mmgpy import MmgMesh2D

    sizes = [len(points)]
    while len(cells) > COARSEST:
        mesh = MmgMesh2D(np.ascontiguousarray(points), cells.astype(np.int32))
        mesh.set_field("metric", 2 * edge_length(points, cells)[:, None])
        mesh.remesh(verbose=-1, hgrad=1.5)
        points, cells = np.asarray(mesh.get_vertices()), np.asarray(mesh.get_triangles())
        if len(points) > 0.9 * sizes[-1]:
            break
        sizes.append(len(points))
    return sizes


def hierarchy_by_decimation(points: Points, cells: Cells) -> list[int]:
    """Decimate with fast-simplification again and again, to a quarter of the triangles each time."""
    from fast_simplification import simplify

    space = np.column_stack([points, np.zeros(len(points))])
    sizes = [len(points)]
    while len(cells) > COARSEST:
        space, cells = simplify(space, cells.astype(np.int32), target_reduction=0.75)
        if len(space) > 0.9 * sizes[-1]:
            break
        sizes.append(len(space))
    return sizes


def hierarchy_by_skeleton(points: Points, cells: Cells) -> list[int]:
    """Take independent sets of the edge skeleton (PyAMG's, serial) and triangulate them with shull, repeatedly."""
    from pyamg.graph import maximal_independent_set
    from scipy.sparse import coo_array
    from shull import Delaunay

    sizes = [len(points)]
    while len(cells) > COARSEST:
        a, b = cells[:, [0, 1, 2]].ravel(), cells[:, [1, 2, 0]].ravel()
        ends = np.concatenate([a, b]), np.concatenate([b, a])
        graph = coo_array((np.ones(len(ends[0]), dtype=np.int8), ends), shape=(len(points), len(points))).tocsr()
        points = points[maximal_independent_set(graph) == 1]
        cells = Delaunay(points).simplices
        sizes.append(len(points))
    return sizes
