"""What `Mesh.repaired` mends, what it says about it, and what it leaves alone."""

from __future__ import annotations

import numpy as np
import pytest

import coarsen
from coarsen import Mesh, MeshError
from test_mesh import SEED, arrays_of, lattice, slit


def test_a_legal_mesh_is_left_as_it_is():
    points, cells = slit(*lattice(), [2, 7])
    mesh, report = Mesh.repaired(points, cells)
    assert mesh == Mesh(points, cells)
    assert str(report) == "nothing to mend"
    assert np.array_equal(report.nodes, np.arange(len(points)))
    assert np.array_equal(report.cells, np.arange(len(cells)))


def test_a_soup_becomes_the_mesh_it_was():
    points, cells = lattice(rng=np.random.default_rng(SEED))
    mesh, report = Mesh.repaired(points[cells.ravel()], np.arange(cells.size).reshape(-1, 3))
    assert mesh.n_points == len(points)
    assert report.merged == cells.size - len(points)
    assert np.array_equal(mesh.points[mesh.cells], points[cells])
    assert np.array_equal(mesh.points[report.nodes], points[cells.ravel()])


def test_all_that_is_said_was_done():
    points, cells = lattice()
    points = np.vstack([points, [[9.0, 9.0], [8.0, 9.0]]])
    bad = np.vstack([cells, cells[3][[1, 2, 0]], [[0, 1, 2]], [[4, 4, 9]]])
    bad[5] = bad[5][::-1]
    mesh, report = Mesh.repaired(points, bad)
    assert (report.orphans, report.duplicates, report.zero_area, report.repeated, report.turned) == (2, 1, 1, 1, 1)
    assert report.merged == report.facets == 0
    assert mesh == Mesh(points[:25], cells) or np.array_equal(np.sort(mesh.cells), np.sort(cells))
    assert report.nodes[25:].tolist() == [-1, -1]
    assert report.cells[-3:].tolist() == [-1, -1, -1]
    for words in ("2 nodes in no cell dropped", "1 duplicate cell dropped", "1 clockwise cell turned"):
        assert words in str(report)


def test_tags_facets_and_fields_come_along():
    points, cells = lattice()
    soup = points[cells.ravel()]
    own = np.arange(cells.size).reshape(-1, 3)
    mesh, report = Mesh.repaired(
        soup,
        own,
        cell_tags=np.arange(len(own)),
        facets=[[0, 1], [1, 0], [0, 40]],
        facet_tags=[5, 5, 6],
        point_data={"x": soup[:, 0]},
    )
    assert mesh.cell_tags.tolist() == list(range(len(own)))
    assert np.array_equal(mesh.point_data["x"], mesh.points[:, 0])
    assert mesh.points[mesh.facets[0]].tolist() == soup[[0, 1]].tolist()
    assert mesh.facet_tags.tolist() == [5]
    assert report.facets == 2


def test_slits_stay_where_one_place_is_doubled_wrongly():
    points, cells = slit(*lattice(6, 6), [3, 10, 17])
    doubled = len(points)
    corner = np.argwhere(cells == 8)[0]
    points = np.vstack([points, points[8] + 0.0])
    cells[corner[0], corner[1]] = doubled
    # one cell at an inner node has a node of its own there: legal, a slit along two of its edges
    mesh, report = Mesh.repaired(points, cells)
    assert report.merged == 0
    assert mesh.n_points == len(points)


def test_two_copies_of_a_mesh_become_one():
    points, cells = lattice()
    mesh, report = Mesh.repaired(np.vstack([points, points]), np.vstack([cells, cells + 25]))
    assert np.array_equal(mesh.points, points)
    assert (report.merged, report.duplicates) == (25, len(cells))


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (lambda p, c: (np.where(p == p[7], np.nan, p), c), "non-finite coordinate"),
        (lambda p, c: (p, c + 1), "index out of range"),
        (lambda p, c: (np.where(np.arange(25)[:, None] == 12, [0.4, 2.2], p), c), "overlapping or inverted cells"),
        (lambda p, c: (p[:0], c[:0]), "no cells"),
    ],
)
def test_what_cannot_be_mended_is_refused(change, rule):
    with pytest.raises(MeshError) as caught:
        Mesh.repaired(*change(*lattice()))
    assert caught.value.rule == rule


def test_a_mended_line_is_a_line():
    mesh, report = Mesh.repaired([[0.0], [1.0], [1.0], [2.0], [2.0], [3.0], [9.0]], [[0, 1], [3, 2], [4, 5], [0, 0]])
    assert mesh.n_points == 4
    assert (report.merged, report.orphans, report.repeated, report.turned) == (2, 1, 1, 1)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("soup_duplicate_nodes", "19849 coincident nodes merged"),
        ("orphans", "40 nodes in no cell dropped"),
        ("duplicate_cells", "12 duplicate cells dropped"),
        ("zero_area", "1 cell of zero area dropped"),
        ("repeated_index_cell", "1 cell with a repeated node dropped"),
        ("mixed_orientation", "510 clockwise cells turned"),
    ],
)
def test_real_broken_meshes_are_mended(meshes, name, words):
    arrays = arrays_of(meshes / f"broken_{name}.npz")
    mesh, report = Mesh.repaired(arrays["points"], arrays["triangles"])
    assert words in str(report)
    assert coarsen.Mesh(mesh.points, mesh.cells) == mesh


@pytest.mark.parametrize("name", ["folded", "hanging_nodes", "nonmanifold_edge", "one_based", "nan_coordinate"])
def test_real_meshes_that_cannot_be_mended_are_refused(meshes, name):
    arrays = arrays_of(meshes / f"broken_{name}.npz")
    with pytest.raises(MeshError):
        Mesh.repaired(arrays["points"], arrays["triangles"])
