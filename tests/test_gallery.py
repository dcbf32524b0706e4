"""The built-in meshes are what their names say; that they are legal `coarsen.Mesh` itself checks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coarsen import gallery
from coarsen.bisection import bisected
from coarsen.coast import ISLAND, MAINLAND, OPEN
from coarsen.mesh import Mesh
from coarsen.plot import angles_of
from coarsen.plot.meshes import unique_edges

PLANE = {
    "crack_plate": gallery.crack_plate,
    "lshape": gallery.lshape,
    "graded_square": lambda n: gallery.graded_square(n, 10.0),
    "square": gallery.square,
    "irregular square": lambda n: gallery.square(n, seed=3),
    "ring": gallery.ring,
    "plate_with_holes": gallery.plate_with_holes,
    "interface": gallery.interface,
    "coast": gallery.coast,
}


def euler(mesh: Mesh) -> int:
    return mesh.n_points - len(unique_edges(mesh.cells)) + mesh.n_cells


def loops(mesh: Mesh) -> int:
    """Boundary loops, counted by walking; every boundary node is on one loop here."""
    after = dict(mesh.boundary_facets.tolist())
    count = 0
    while after:
        count += 1
        node = next(iter(after))
        while node in after:
            node = after.pop(node)
    return count


@pytest.mark.parametrize("n", [500, 3000, 20_000])
@pytest.mark.parametrize("name", PLANE)
def test_about_as_many_nodes_as_asked(name: str, n: int) -> None:
    mesh = PLANE[name](n)
    assert abs(mesh.n_points - n) <= (0.2 if n < 1000 else 0.1) * n
    assert mesh.quality().min_angle > 4


@pytest.mark.parametrize("name", PLANE)
def test_made_twice_is_the_same_twice(name: str) -> None:
    one, two = PLANE[name](700), PLANE[name](700)
    assert np.array_equal(one.points, two.points)
    assert np.array_equal(one.cells, two.cells)


def test_every_triangle_of_the_crack_plate_is_45_45_90_exactly() -> None:
    mesh = gallery.crack_plate(5120)
    corners = mesh.points[mesh.cells]
    sides_2 = np.sort(((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=2), axis=1)
    assert np.array_equal(sides_2[:, 0], sides_2[:, 1])
    assert np.array_equal(sides_2[:, 2], 2 * sides_2[:, 0])


def test_the_slit_is_doubled_up_to_its_tip_and_the_plate_is_whole() -> None:
    mesh = gallery.crack_plate(5120)
    places, count = np.unique(mesh.points, axis=0, return_counts=True)
    doubled = places[count > 1]
    on_slit = places[(places[:, 1] == 0.5) & (places[:, 0] < 0.5)]
    assert np.array_equal(doubled, on_slit)
    assert len(doubled) > 30
    assert count[(places == 0.5).all(axis=1)] == 1
    assert euler(mesh) == 1
    assert loops(mesh) == 1
    assert mesh.quality().area == 1.0


def test_edges_of_the_crack_plate_grow_as_the_papers_do() -> None:
    mesh = gallery.crack_plate(20_000)
    corners = mesh.points[mesh.cells]
    distance = np.hypot(*(corners.mean(axis=1) - 0.5).T)
    size = np.sqrt(np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])))
    inside = (distance > 1e-3) & (distance < 0.4)
    slope = np.polyfit(np.log(distance[inside]), np.log(size[inside]), 1)[0]
    assert slope == pytest.approx(0.75, abs=0.08)


def test_lshape_is_an_l_finest_at_its_corner() -> None:
    mesh = gallery.lshape(3000)
    assert mesh.quality().area == pytest.approx(3.0, rel=1e-12)
    assert euler(mesh) == 1
    edges = unique_edges(mesh.cells)
    length = np.hypot(*(mesh.points[edges[:, 1]] - mesh.points[edges[:, 0]]).T)
    shortest = edges[length == length.min()]
    assert np.hypot(*mesh.points[shortest].reshape(-1, 2).T).min() == 0
    assert length.max() / length.min() > 100


@pytest.mark.parametrize("ratio", [1e4, 1e6, 1e9])
def test_graded_square_reaches_its_edge_ratio(ratio: float) -> None:
    mesh = gallery.graded_square(4000, ratio)
    quality = mesh.quality()
    assert ratio <= quality.max_edge / quality.min_edge <= 20 * ratio
    assert quality.area == pytest.approx(1.0, rel=1e-12)


def test_ring_has_nearly_equilateral_cells_and_one_hole() -> None:
    mesh = gallery.ring(3000, inner=0.2)
    assert angles_of(mesh).min() > 50
    assert euler(mesh) == 0
    assert loops(mesh) == 2
    radius = np.hypot(*mesh.points.T)
    assert radius.min() == pytest.approx(0.2)
    assert radius.max() == pytest.approx(1.0)


def test_plate_has_as_many_holes_as_asked() -> None:
    mesh = gallery.plate_with_holes(6000, (4, 3), seed=7)
    assert loops(mesh) == 1 + 12
    assert euler(mesh) == 1 - 12
    assert mesh.points.min(axis=0).tolist() == [0, 0]
    assert mesh.points.max(axis=0).tolist() == [4, 3]


def test_interface_runs_along_the_circle_between_two_tags() -> None:
    mesh = gallery.interface(2000, radius=0.3)
    assert np.unique(mesh.cell_tags).tolist() == [1, 2]
    between = mesh.topology.facets[mesh.topology.n_boundary :]
    assert len(between) > 20
    radius = np.hypot(*(mesh.points[np.unique(between)] - 0.5).T)
    assert np.allclose(radius, 0.3, rtol=1e-12)
    middles = np.hypot(*(mesh.points[mesh.cells].mean(axis=1) - 0.5).T)
    assert middles[mesh.cell_tags == 2].max() < 0.3 < middles[mesh.cell_tags == 1].min() + 0.01


@pytest.mark.parametrize("seed", range(6))
def test_coast_is_one_sea_with_tagged_shores(seed: int) -> None:
    mesh = gallery.coast(4000, seed=seed)
    assert len(mesh.facets) == len(mesh.boundary_facets)
    assert set(np.unique(mesh.facet_tags)) <= {OPEN, MAINLAND, ISLAND}
    assert (mesh.facet_tags == OPEN).any()
    assert mesh.point_data["depth"].min() >= 2
    assert mesh.quality().min_angle > 5
    # islands are loops of their own: no node of theirs is on another shore
    island = np.unique(mesh.facets[mesh.facet_tags == ISLAND])
    other = np.unique(mesh.facets[mesh.facet_tags != ISLAND])
    assert len(np.intersect1d(island, other)) == 0


def test_another_seed_is_another_coast_and_some_have_islands() -> None:
    meshes = [gallery.coast(4000, seed=seed) for seed in range(6)]
    assert len({mesh.n_points for mesh in meshes}) > 3
    assert sum(ISLAND in mesh.facet_tags for mesh in meshes) >= 2


def test_line_is_the_papers_example_exactly() -> None:
    mesh = gallery.line(50, growth=2.0)
    assert mesh.dim == 1
    assert mesh.points[:, 0].tolist() == [2**i - 1 for i in range(50)]
    assert mesh.cells.tolist() == [[i, i + 1] for i in range(49)]


def test_line_without_growth_is_even() -> None:
    assert np.allclose(np.diff(gallery.line(11).points[:, 0]), 0.1)


@given(n=st.integers(12, 1500), exponent=st.floats(0, 0.9))
def test_bisection_keeps_edge_to_edge_and_stops_just_under_the_wish(n: int, exponent: float) -> None:
    mesh = gallery.crack_plate(n, exponent=exponent)
    assert n - 6 <= mesh.n_points <= n
    assert euler(mesh) == 1
    assert angles_of(mesh).min() == pytest.approx(45)


def test_bisection_returns_the_initial_mesh_where_it_has_as_many_nodes() -> None:
    points, cells = np.array([[0.0, 0], [1, 0], [0, 1]]), np.array([[0, 1, 2]])
    same = bisected(points, cells, lambda x: np.ones(len(x)), 3)
    assert np.array_equal(same[0], points)
    assert np.array_equal(same[1], cells)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: gallery.crack_plate(3), "n"),
        (lambda: gallery.crack_plate(100, exponent=2), "exponent"),
        (lambda: gallery.graded_square(100, 1e6), "n"),
        (lambda: gallery.graded_square(1000, 0.5), "ratio"),
        (lambda: gallery.ring(100, inner=1.0), "inner"),
        (lambda: gallery.plate_with_holes(1000, (0, 1)), "holes"),
        (lambda: gallery.interface(1000, radius=0.5), "radius"),
        (lambda: gallery.coast(10), "n"),
        (lambda: gallery.coast(1000, extent=-1), "extent"),
        (lambda: gallery.line(1), "n"),
        (lambda: gallery.line(5000, growth=2.0), "growth"),
        (lambda: gallery.square(1), "n"),
    ],
)
def test_wishes_out_of_range_name_the_argument_and_its_value(call, name) -> None:
    with pytest.raises(ValueError, match=f"^'{name}' is .*expected"):
        call()
