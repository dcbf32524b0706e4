"""Pictures: what is drawn is counted in the artists; how it looks was looked at by eye."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coarsen
from coarsen import gallery
from coarsen.mesh import Mesh
from coarsen.multilevel import Hierarchy
from coarsen.plot import angles_of, plot_angles, plot_hierarchy, plot_level, plot_mesh, plot_quality, plot_similarity
from coarsen.plot.meshes import BOUNDARY, FACET, INK, unique_edges

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402
from matplotlib.collections import LineCollection, PolyCollection  # noqa: E402
from matplotlib.colors import to_rgba  # noqa: E402


@pytest.fixture(autouse=True)
def _close() -> Any:
    yield
    pyplot.close("all")


@pytest.fixture(scope="module")
def h() -> Hierarchy:
    """The paper's example, small."""
    return coarsen.hierarchy(gallery.crack_plate(1200))


def lines_of(ax: Any, color: str) -> int:
    """Count the segments of a colour."""
    found = [artist for artist in ax.collections if isinstance(artist, LineCollection)]
    return sum(len(a.get_segments()) for a in found if np.allclose(a.get_colors()[0], to_rgba(color)))


def test_every_edge_is_drawn_once_and_the_boundary_apart() -> None:
    mesh = gallery.ring(300)
    ax = plot_mesh(mesh)
    assert lines_of(ax, INK) == len(unique_edges(mesh.cells)) == mesh.n_points + mesh.n_cells
    assert lines_of(ax, BOUNDARY) == len(mesh.boundary_facets)
    assert lines_of(ax, FACET) == 0


def test_slits_and_interfaces_stand_out() -> None:
    plate, disc = gallery.crack_plate(300), gallery.interface(300)
    banks = plate.boundary_facets[(plate.points[plate.boundary_facets, 1] == 0.5).all(axis=1)]
    assert lines_of(plot_mesh(plate), FACET) == len(banks)
    assert lines_of(plot_mesh(disc), FACET) == len(disc.topology.facets) - disc.topology.n_boundary


def test_cells_are_filled_by_tag() -> None:
    disc = gallery.interface(300)
    area = next(a for a in plot_mesh(disc).collections if isinstance(a, PolyCollection))
    shades = {tuple(shade) for shade in area.get_facecolors()}
    assert len(area.get_paths()) == disc.n_cells
    assert len(shades) == 2


@pytest.mark.parametrize("name", ["ring", "crack_plate", "plate_with_holes", "coast"])
def test_without_tags_the_domain_is_filled_and_its_holes_are_not(name: str) -> None:
    mesh = getattr(gallery, name)(600)
    figure, ax = pyplot.subplots(figsize=(5, 5), dpi=100)
    plot_mesh(mesh, ax, color="none", facets=False)
    figure.canvas.draw()
    image = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    filled = (image < 250).any(axis=2).sum() / (np.diff(ax.transData.transform([[0, 0], [1, 1]]), axis=0).prod())
    assert filled == pytest.approx(mesh.quality().area, rel=0.02)


def test_a_window_draws_only_what_reaches_into_it() -> None:
    mesh = gallery.square(2500)
    ax = plot_mesh(mesh, window=(0.5, 0.5, 0.1))
    assert 0 < lines_of(ax, INK) < 0.1 * len(unique_edges(mesh.cells))
    assert ax.get_xlim() == pytest.approx((0.4, 0.6))


def test_a_fine_mesh_is_rastered_and_its_lines_are_thin() -> None:
    ax = plot_mesh(gallery.crack_plate(30_000))
    edges = max((a for a in ax.collections if isinstance(a, LineCollection)), key=lambda a: len(a.get_segments()))
    assert edges.get_rasterized()
    assert np.max(edges.get_linewidths()) <= 0.71
    assert np.min(edges.get_linewidths()) < 0.05


def test_a_vector_file_of_a_fine_mesh_stays_small(tmp_path: Path) -> None:
    plot_mesh(gallery.square(20_000)).figure.savefig(tmp_path / "a.pdf")
    assert (tmp_path / "a.pdf").stat().st_size < 1_500_000


def test_a_level_shows_kept_nodes_over_the_finer_mesh(h: Hierarchy) -> None:
    ax = plot_level(h[2], over=h[1].mesh, nodes=True)
    dots = ax.collections[-1].get_offsets()
    assert {tuple(dot) for dot in np.asarray(dots).tolist()} == {tuple(p) for p in h[2].mesh.points.tolist()}
    assert len(ax.figure.axes) == 2  # and the scale of the spacing
    assert len(plot_level(h[2], spacing=False).figure.axes) == 1


@pytest.mark.parametrize("zoom", [None, (0.5, 0.5, 0.1)])
def test_a_hierarchy_has_a_picture_for_every_level(h: Hierarchy, zoom: Any) -> None:
    figure = plot_hierarchy(h, zoom=zoom)
    titles = [ax.get_title() for ax in figure.axes if ax.get_title()]
    assert len(titles) == len(h)
    assert f"{h[-1].mesh.n_points} nodes" in titles[-1]
    drawn = [ax for ax in figure.axes if ax.collections]
    assert len(drawn) == len(h) * (2 if zoom else 1)
    assert len(plot_hierarchy(h, levels=[0, 2], columns=1).axes) == 2


def test_a_line_is_drawn_as_rows_of_strokes() -> None:
    h = coarsen.hierarchy(gallery.line(60, growth=1.1), coarsest=5)
    figure = plot_hierarchy(h)
    assert [text.get_text().partition(":")[0] for text in figure.axes[0].get_yticklabels()] == [
        f"level {i}" for i in range(len(h))
    ]


def test_histograms_and_curves_hold_every_level(h: Hierarchy) -> None:
    assert len(plot_angles(h).axes) == len(h)
    other = coarsen.hierarchy(gallery.crack_plate(1200), method="mis", levels=2)
    for against in ("level", "nodes"):
        figure = plot_quality({"function": h, "mis": other}, against=against)
        smallest = figure.axes[0].get_lines()
        assert [len(line.get_xdata()) for line in smallest] == [len(h), 3]
        assert smallest[0].get_ydata()[1] == pytest.approx(h[1].quality.min_angle)
        assert {text.get_text() for text in figure.axes[0].get_legend().get_texts()} == {"function", "mis"}
    with pytest.raises(ValueError, match="'against' is 'time'"):
        plot_quality(h, against="time")


def test_the_histogram_of_similarity_marks_the_largest_of_every_level(h: Hierarchy) -> None:
    figure = plot_similarity(h)
    assert len(figure.axes) == len(h) - 1
    for ax, one in zip(figure.axes, h.check().levels[1:], strict=True):
        assert ax.lines[0].get_xdata()[0] == one.similarity
        heights = ax.patches[0].get_data().values
        assert heights.sum() == h[one.level - 1].mesh.n_cells
    with pytest.raises(ValueError, match="one level"):
        plot_similarity(coarsen.hierarchy(gallery.square(100), levels=0))


def test_angles_sum_to_half_a_turn() -> None:
    angles = angles_of(gallery.coast(500))
    assert np.allclose(angles.sum(axis=1), 180)
    assert angles.min() > 0


def test_methods_of_mesh_level_and_hierarchy_draw(h: Hierarchy) -> None:
    _, ax = pyplot.subplots()
    assert h[0].mesh.plot(ax) is ax
    assert h[1].plot(ax=ax) is ax
    assert len(h.plot(levels=[1]).axes) == 1


def test_shapes_far_from_square_and_origin_are_framed() -> None:
    points = gallery.square(100).points * [1000, 1] + [1e6, -1e6]
    mesh = Mesh(points, gallery.square(100).cells)
    ax = plot_mesh(mesh)
    assert ax.get_xlim()[0] < 1e6 < 1e6 + 1000 < ax.get_xlim()[1]
    plot_hierarchy(coarsen.hierarchy(mesh)).canvas.draw()


def test_without_matplotlib_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match=r"coarsen-mesh\[plot\]"):
        plot_mesh(gallery.square(9))
