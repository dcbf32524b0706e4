"""PyVista: grids that hold the mesh, views drawn off screen and looked at."""

from __future__ import annotations

import numpy as np
import pytest

import coarsen
from coarsen import gallery


@pytest.fixture(scope="module")
def h():
    return coarsen.hierarchy(gallery.interface(800))


@pytest.fixture
def pyvista(monkeypatch):
    found = pytest.importorskip("pyvista")
    monkeypatch.setattr(found, "OFF_SCREEN", True)
    return found


def test_a_grid_holds_points_cells_tags_and_fields(pyvista):
    coast = gallery.coast(500)
    grid = coast.to_pyvista()
    assert np.array_equal(grid.points[:, :2], coast.points)
    assert np.array_equal(grid.cells_dict[5], coast.cells)
    assert np.array_equal(grid.point_data["depth"], coast.point_data["depth"])
    assert grid.compute_cell_sizes().cell_data["Area"].sum() == pytest.approx(coast.quality().area)
    assert np.array_equal(gallery.interface(300).to_pyvista().cell_data["cell_tags"], gallery.interface(300).cell_tags)


def test_a_level_s_grid_knows_its_nodes_and_spacing(pyvista, h):
    grid = h[1].to_pyvista()
    assert np.array_equal(grid.points[:, :2], h[0].mesh.points[grid.point_data["node"]])
    assert np.array_equal(grid.point_data["spacing"], h[1].spacing)


def test_the_grid_is_no_window_into_the_mesh(pyvista):
    mesh = gallery.coast(300)
    before = mesh.point_data["depth"].copy()
    mesh.to_pyvista().point_data["depth"][:] = -1
    assert np.array_equal(mesh.point_data["depth"], before)


def test_a_line_is_a_grid_too(pyvista):
    grid = gallery.line(30).to_pyvista()
    assert np.array_equal(grid.cells_dict[3], gallery.line(30).cells)


def test_views_draw_every_level_in_its_window(pyvista, h, tmp_path):
    from matplotlib.image import imread

    path = tmp_path / "levels.png"
    h.view(levels=[0, 1, 2], path=path).close()
    image = imread(path)[..., :3]
    assert image.shape[1] == 3 * image.shape[0]
    for window in np.split(image, 3, axis=1):
        colourful = window.max(axis=2) - window.min(axis=2) > 0.2
        assert colourful.mean() > 0.2  # the spacing
        assert ((window[..., 0] > 0.6) & (window[..., 1] < 0.35)).sum() > 50  # the circle, a facet, in red


def test_a_view_of_a_mesh_shows_its_tags(pyvista, tmp_path):
    from matplotlib.image import imread

    gallery.interface(400).view(path=tmp_path / "mesh.png").close()
    image = np.round(imread(tmp_path / "mesh.png")[..., :3], 2)
    assert len(np.unique(image.reshape(-1, 3), axis=0)) > 4
    gallery.square(200).view(path=tmp_path / "plain.png").close()
    assert (tmp_path / "plain.png").stat().st_size > 5000


def test_a_field_that_is_not_there_is_refused_by_name(pyvista, h):
    with pytest.raises(
        ValueError, match="'scalars' is 'depth', expected one of 'node', 'spacing', 'cell_tags', or None"
    ):
        h.view("depth")


def test_without_pyvista_the_error_says_what_to_install(h, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyvista", None)
    for call in (h.view, h[0].to_pyvista, h[0].mesh.view):
        with pytest.raises(ImportError, match="pip install pyvista"):
            call()
