"""`features="drop"` and `"auto"`: what a simplified domain must still be, and how its levels follow each other."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import coarsen
from coarsen import gallery
from domains import domains, river
from oracles import assert_is_conforming, assert_is_delaunay, assert_is_valid_level, assert_node_nested


def strip(width, length, interface=False, n=4000):
    """A channel bent into a half circle; its middle line may be an interface."""
    rows = max(2, 2 * round(np.sqrt(n * width / length) / 2)) + 1
    columns = round(rows * length / width)
    across, along = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    radius = length / np.pi + width * (across - 0.5)
    points = np.stack([radius * np.cos(np.pi * along), radius * np.sin(np.pi * along)], axis=-1).reshape(-1, 2)
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    a, b, c, d = corner, corner + 1, corner + columns, corner + columns + 1
    cells = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
    tags = (cells.min(axis=1) // columns >= rows // 2).astype(np.int64) if interface else None
    return coarsen.Mesh(points, cells, cell_tags=tags)


def graded_rectangle(width=10.0, height=3.0, seed=5):
    """A rectangle, fine in the middle only."""
    rng = np.random.default_rng(seed)
    inner = np.array([width, height]) / 2 + np.array([1.0, 0.6]) * rng.standard_normal((6000, 2)) * 0.2
    outer = rng.random((60, 2)) * [width, height]
    sides = [np.stack([np.linspace(0, width, 26), np.full(26, y)], 1) for y in (0.0, height)]
    ends = [np.stack([np.full(7, x), np.linspace(0, height, 9)[1:-1]], 1) for x in (0.0, width)]
    points = np.concatenate([inner, outer, *sides, *ends])
    points = points[((points >= 0) & (points <= [width, height])).all(axis=1)]
    return coarsen.Mesh(points, coarsen.delaunay(points))


def far_field(around, rings, radius=12.0):
    """A thin plate in a circle of a radius, with rings of cells between them that grow outwards."""
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    plate = np.stack([np.cos(angle), 0.05 * np.sin(angle)], axis=1)
    circle = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    share = np.expm1(np.linspace(0, 5, rings)) / np.expm1(5)
    points = (plate + share[:, None, None] * (circle - plate)).reshape(-1, 2)
    a = np.arange(around * (rings - 1))
    b = a - a % around + (a + 1) % around
    cells = np.concatenate([np.stack([a, a + around, b + around], 1), np.stack([a, b + around, b], 1)])
    return coarsen.Mesh(points, cells)


def area_of(mesh):
    return mesh.quality().area


@pytest.mark.parametrize(("nodes", "holes"), [(4000, (4, 4)), (9000, (6, 6))])
def test_auto_keeps_what_keep_keeps_and_then_drops(nodes, holes):
    mesh = gallery.plate_with_holes(nodes, holes)
    auto = coarsen.hierarchy(mesh, features="auto")
    kept = [level for level in auto if level.dropped is None]
    assert 2 <= len(kept) < len(auto)
    for level in kept[1:]:
        assert_is_valid_level(level, mesh, delaunay=False)
    assert_node_nested(auto)
    assert auto[-1].mesh.n_cells <= 100


@pytest.mark.parametrize("features", ["auto", "drop"])
@pytest.mark.parametrize(("around", "rings"), [(60, 40), (150, 12)])
def test_a_round_far_field_loses_little(around, rings, features):
    mesh = far_field(around, rings)
    h = coarsen.hierarchy(mesh, features=features)
    assert h[-1].mesh.n_cells <= 100
    for level in h:
        assert area_of(level.mesh) == pytest.approx(area_of(mesh), rel=0.06)


@pytest.mark.parametrize("interface", [False, True])
def test_a_thin_channel_stays_one_channel_until_few_cells_are_left(interface):
    mesh = strip(1.0, 30.0, interface)
    h = coarsen.hierarchy(mesh, features="drop", coarsest=90)
    assert h[-1].mesh.n_cells <= 90
    for level in h:
        assert abs(area_of(level.mesh) / area_of(mesh) - 1) < 0.05
        assert level.quality.min_angle >= 15


@pytest.mark.parametrize(("along", "across"), [(500, 2), (1000, 3), (2000, 4)])
def test_thin_bridges_that_hold_a_winding_river_together_are_cut(along, across):
    for seed in range(6):
        h = coarsen.hierarchy(river(seed, along, across), features="drop")
        for level in list(h)[1:-2]:
            assert level.quality.min_angle >= 15
            assert_is_conforming(level.mesh.points, np.asarray(level.mesh.cells))
            assert_is_delaunay(level.mesh.points, np.asarray(level.mesh.cells), level.mesh.topology.facets)


def test_corners_of_a_rectangle_stay_while_it_is_wider_than_half_the_spacing():
    mesh = graded_rectangle()
    h = coarsen.hierarchy(mesh, features="drop")
    corners = [[x, y] for x in (0.0, 10.0) for y in (0.0, 3.0)]
    for level in h:
        points = level.mesh.points.tolist()
        assert all(corner in points for corner in corners)
        assert area_of(level.mesh) == pytest.approx(area_of(mesh), rel=0.02)


@pytest.mark.parametrize("features", ["drop", "auto"])
def test_levels_of_edge_ratios_of_1e10_are_few(features):
    # rings of nodes around a point, each by a fifth larger than the one before
    radii = 1.2 ** np.arange(127) * 1e-10
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    turned = angles + np.pi / 12 * (np.arange(127) % 2)[:, None]
    rings = radii[:, None, None] * np.stack([np.cos(turned), np.sin(turned)], axis=-1)
    points = np.concatenate([[[0.0, 0.0]], rings.reshape(-1, 2)])
    h = coarsen.hierarchy(coarsen.Mesh(points, coarsen.delaunay(points)), features=features)
    cells = np.array([level.mesh.n_cells for level in h])
    drops = np.array([level.dropped is not None for level in h])[1:-1]  # levels that keep are thinned by the guard, too
    assert (cells[1:-1] <= 0.95 * cells[:-2])[drops].all()
    assert cells[-1] <= 100
    assert len(coarsen.hierarchy(h[0].mesh, features=features, levels=40)) == 41


@pytest.mark.parametrize("features", ["drop", "auto"])
@pytest.mark.parametrize("method", ["function", "threshold"])
def test_levels_of_random_domains_are_meshes(features, method):
    for mesh in domains(11, 30):
        h = coarsen.hierarchy(mesh, features=features, method=method, coarsest=4)
        assert_node_nested(h)
        for level in h:
            np.testing.assert_array_equal(level.mesh.points, mesh.points[level.nodes])
            assert_is_conforming(level.mesh.points, np.asarray(level.mesh.cells))
            if level.dropped is not None:
                assert_is_delaunay(level.mesh.points, np.asarray(level.mesh.cells), level.mesh.topology.facets)
                area = area_of(mesh) + level.dropped["area_gained"] - level.dropped["area_lost"]
                assert area_of(level.mesh) == pytest.approx(area, rel=1e-9)


def parts_of(mesh):
    """The part of each cell: cells that share an edge are of one."""
    cells = np.asarray(mesh.cells)
    ends = np.sort(np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, edge = np.unique(ends, axis=0, return_inverse=True)
    graph = coo_matrix((np.ones(edge.size), (np.repeat(np.arange(len(cells)), 3), edge.reshape(-1))))
    return connected_components(graph @ graph.T, directed=False)[1]


def assert_parts_stay_apart(h):
    """The nodes of a part of a level all belong to one part of the input."""
    fine = parts_of(h[0].mesh)
    of_node = np.zeros((h[0].mesh.n_points, fine.max() + 1), dtype=bool)
    of_node[np.asarray(h[0].mesh.cells), fine[:, None]] = True
    for level in h:
        of_cell = parts_of(level.mesh)
        nodes = np.asarray(level.nodes)[np.asarray(level.mesh.cells)]
        for part in range(of_cell.max() + 1):
            assert of_node[nodes[of_cell == part].reshape(-1)].all(axis=0).any()


def beside(mesh, shift):
    """A mesh and a copy of it moved, as two parts."""
    points, cells = np.asarray(mesh.points), np.asarray(mesh.cells)
    return coarsen.Mesh(np.concatenate([points, points + shift]), np.concatenate([cells, cells + len(points)]))


@pytest.mark.parametrize("features", ["drop", "auto"])
@pytest.mark.parametrize("gap", [0.0, 1e-9, 0.003, 0.1])
def test_parts_beside_each_other_are_never_joined(gap, features):
    square = gallery.square(800)
    h = coarsen.hierarchy(beside(square, [1.0 + gap, 0.0]), features=features, coarsest=20)
    assert h[-1].mesh.n_cells <= 20
    assert_parts_stay_apart(h)
    for level in h:
        assert len(np.unique(parts_of(level.mesh))) == 2
        assert area_of(level.mesh) == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize("features", ["drop", "auto"])
@pytest.mark.parametrize("seed", [0, 3, 8, 11, 376, 388])
def test_parts_of_random_domains_are_never_joined(seed, features):
    meshes = [mesh for mesh in domains(seed, 6, most=400) if parts_of(mesh).max() > 0]
    for mesh in meshes:
        assert_parts_stay_apart(coarsen.hierarchy(mesh, features=features, coarsest=4))


@pytest.mark.parametrize("name", ["su2_rotating_cylinders_multizone", "thetis_lagoon", "gridded_fvcom"])
def test_zones_of_real_meshes_are_never_joined(meshes, name):
    arrays = np.load(meshes / f"{name}.npz")
    assert_parts_stay_apart(coarsen.hierarchy(coarsen.Mesh(arrays["points"], arrays["triangles"]), features="drop"))


def test_a_round_boundary_loses_little_area():
    mesh = gallery.ring(4000)
    h = coarsen.hierarchy(mesh, features="drop")
    assert h[-1].mesh.n_cells <= 100
    for level in h:
        assert area_of(level.mesh) == pytest.approx(area_of(mesh), rel=0.04)


@pytest.mark.parametrize(
    "name", ["gridded_fvcom", "xugrid_sandiego", "su2_naca0012_inv", "su2_rotating_cylinders_multizone"]
)
def test_real_domains_change_their_area_by_a_twelfth_at_most(meshes, name):
    arrays = np.load(meshes / f"{name}.npz")
    mesh = coarsen.Mesh(arrays["points"], arrays["triangles"])
    h = coarsen.hierarchy(mesh, features="drop")
    assert h[-1].mesh.n_cells <= 100
    for level in h:
        assert area_of(level.mesh) == pytest.approx(area_of(mesh), rel=1 / 12)
