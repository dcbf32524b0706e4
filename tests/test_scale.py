"""A mesh scaled by a power of two, which rounds nothing, has the same levels, at sizes no triangulator takes too."""

from __future__ import annotations

import numpy as np
import pytest

import coarsen
from coarsen import options
from domains import domains


def scaled(mesh: coarsen.Mesh, exponent: int) -> coarsen.Mesh:
    points = np.ldexp(mesh.points, exponent)
    return coarsen.Mesh(points, mesh.cells, facets=mesh.facets, facet_tags=mesh.facet_tags, cell_tags=mesh.cell_tags)


@pytest.mark.parametrize("exponent", [-330, -145, 205, 330])
@pytest.mark.parametrize("features", options.FEATURES)
def test_levels_do_not_depend_on_the_scale(features, exponent):
    for mesh in [coarsen.gallery.plate_with_holes(600), *domains(5, 10)]:
        one, other = (coarsen.hierarchy(m, features=features, coarsest=10) for m in (mesh, scaled(mesh, exponent)))
        assert len(one) == len(other)
        for a, b in zip(one[1:], other[1:], strict=True):
            np.testing.assert_array_equal(a.nodes, b.nodes)
            np.testing.assert_array_equal(a.mesh.cells, b.mesh.cells)
            np.testing.assert_array_equal(np.ldexp(a.spacing, exponent), b.spacing)


@pytest.mark.parametrize("exponent", [-450, 450])
@pytest.mark.parametrize("features", ["keep", "drop"])
def test_the_twins_agree_at_the_ends_of_the_range(features, exponent):
    for mesh in [scaled(mesh, exponent) for mesh in domains(6, 5, most=60)]:
        one, other = (
            coarsen.hierarchy(mesh, features=features, coarsest=10, backend=backend) for backend in options.BACKENDS
        )
        assert [level.nodes.tolist() for level in one] == [level.nodes.tolist() for level in other]


def test_what_vanishes_beside_the_largest_coordinate_counts_as_zero():
    mesh = coarsen.gallery.square(400)
    points = np.where(mesh.points == 0, 5e-324, mesh.points)
    one, other = coarsen.hierarchy(mesh), coarsen.hierarchy(coarsen.Mesh(points, mesh.cells))
    assert [level.nodes.tolist() for level in one] == [level.nodes.tolist() for level in other]


def test_nodes_may_be_as_near_as_1e_100():
    ring = np.array([[1.0, 0.1], [0.0, 1.2], [-1.3, 0.0], [0.0, -1.4]])
    points = np.concatenate([[[0.0, 0.0]], 1e-100 * ring, ring])
    cells = coarsen.delaunay(points)
    assert len(cells) == 12
    assert coarsen.hierarchy(coarsen.Mesh(points, cells), levels=1, features="drop")[1].mesh.n_cells > 0
