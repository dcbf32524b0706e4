"""Operators between levels: where fine nodes lie, whose values they take, what stays of integrals."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("scipy")
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay

import coarsen
from coarsen import _core, reference, transfer
from domains import domains

SEED = 20_24


# --- pairs of meshes, without a hierarchy ----------------------------------------------------------------------------


def doubled_areas(points, cells):
    a, b, c = np.moveaxis(points[cells], 1, 0)
    return (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]


def cells_of(points):
    """Delaunay cells, counter-clockwise, without the slivers of a straight hull."""
    cells = Delaunay(points).simplices.astype(np.int64)
    twice = doubled_areas(points, cells)
    return np.where((twice < 0)[:, None], cells[:, ::-1], cells)[np.abs(twice) > 1e-12]


def square_pair(n=400, *, seed=SEED):
    """Random points in a square and a quarter of them, the corners in both."""
    rng = np.random.default_rng(seed)
    points = np.concatenate([[[0, 0], [1, 0], [1, 1], [0, 1]], rng.random((n, 2))])
    shared = np.concatenate([np.arange(4), 4 + np.sort(rng.permutation(n)[: n // 4])])
    return points, cells_of(points), points[shared], cells_of(points[shared]), shared


def boundary_of(cells):
    """Edges of one cell, which is on their left."""
    edges = np.concatenate([cells[:, [k, (k + 1) % 3]] for k in range(3)]).tolist()
    there = set(map(tuple, edges))
    return np.array([[a, b] for a, b in edges if (b, a) not in there], dtype=np.int64).reshape(-1, 2)


def with_boundary(points, cells, *coarse):
    """Insert the boundary of the finer mesh, as the core is given it."""
    return points, cells, boundary_of(cells), *coarse


def located(points, cells, coarse_points, coarse_cells, shared, threads=None):
    pair = with_boundary(points, cells, coarse_points, coarse_cells, shared)
    rows, outside, distance, lost = _core.prolongation(*pair, threads)
    matrix = csr_matrix((rows[2], rows[1], rows[0]), shape=(len(points), len(coarse_points)))
    return matrix, outside, distance, lost


def barycentric(points, coarse_points, coarse_cells):
    """Weights in the first cell that holds a point, by brute force: (n, k), and whether there is one."""
    a, b, c = np.moveaxis(coarse_points[coarse_cells], 1, 0)
    whole = doubled_areas(coarse_points, coarse_cells)

    def twice(p, q, x):
        u, v = q - p, x[:, None] - p
        return u[:, 0] * v[..., 1] - u[:, 1] * v[..., 0]

    weights = np.stack([twice(b, c, points), twice(c, a, points), twice(a, b, points)], axis=-1) / whole[:, None]
    best = weights.min(axis=-1).argmax(axis=1)
    mine = weights[np.arange(len(points)), best]
    dense = np.zeros((len(points), len(coarse_points)))
    np.put_along_axis(dense, coarse_cells[best], mine, axis=1)
    return dense, mine.min(axis=1) > -1e-12


def parts_of(mesh):
    """The number of its part for each node; parts that touch in one node only count as one."""
    pairs = np.concatenate([mesh.cells[:, [0, 1]], mesh.cells[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(mesh.n_points, mesh.n_points))
    return connected_components(graph, directed=False)[1]


def distance_to_edges(points, coarse_points, edges):
    a, b = coarse_points[edges[:, 0]], coarse_points[edges[:, 1]]
    d = b - a
    t = ((points[:, None] - a) * d).sum(axis=-1) / (d * d).sum(axis=-1)
    foot = a + np.clip(t, 0, 1)[..., None] * d
    return np.hypot(*np.moveaxis(points[:, None] - foot, -1, 0)).min(axis=1)


def assert_is_interpolation(matrix, fine, coarse):
    """What holds for every prolongation, whatever the meshes."""
    assert matrix.data.min() > 0
    assert np.diff(matrix.indptr).max() <= 3
    assert np.diff(matrix.indptr).min() >= 1
    np.testing.assert_allclose(matrix.sum(axis=1), 1, rtol=0, atol=4e-16)
    assert matrix.has_sorted_indices
    assert matrix.shape == (fine.n_points, coarse.n_points)


@pytest.mark.parametrize("seed", range(6))
def test_weights_are_the_barycentric_ones_of_the_cell_that_holds_the_node(seed):
    pair = square_pair(300, seed=seed)
    matrix, outside, _, lost = located(*pair)
    dense, inside = barycentric(pair[0], pair[2], pair[3])
    assert inside.all()
    assert len(outside) == len(lost) == 0
    np.testing.assert_allclose(matrix.toarray(), dense, atol=1e-9)


def test_a_shared_node_takes_its_own_value_and_nothing_else():
    pair = square_pair()
    matrix = located(*pair)[0]
    own = matrix[pair[4]]
    assert (own.indptr == np.arange(len(pair[4]) + 1)).all()
    assert (own.indices == np.arange(len(pair[4]))).all()
    assert (own.data == 1).all()


def test_nodes_on_coarse_edges_take_two_values_also_where_rounding_puts_them_off_the_line():
    # uniform refinement of a rotated triangle: the middles of its edges are rounded
    turn = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    corners = np.array([[0.0, 0.0], [3.0, 0.1], [1.0, 2.0]]) @ turn + 100.0
    points = np.concatenate([corners, (corners + np.roll(corners, -1, axis=0)) / 2])
    cells = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
    matrix, outside, _, _ = located(points, cells, corners, np.array([[0, 1, 2]]), np.arange(3))
    assert (np.diff(matrix.indptr) == [1, 1, 1, 2, 2, 2]).all()
    assert len(outside) == 0
    np.testing.assert_allclose(matrix[3:].data, 0.5, rtol=1e-13)


@pytest.mark.parametrize("height", [1, 3, 6, 12])
@pytest.mark.parametrize("core", [_core, reference])
def test_a_node_in_a_needle_takes_the_values_next_to_it(core, height):
    # flat up to rounding: the node is on the lines of two or three edges, and still far from all corners
    corners = np.array([[0.0, 1.0], [1.0, 1.0], [0.5, 1.0 + height * np.spacing(1.0)]])
    points = np.concatenate([corners, [[0.25, 1.0], [0.75, 1.0]]])
    cells = np.array([[0, 3, 2], [3, 4, 2], [4, 1, 2]])
    pair = with_boundary(points, cells, corners, np.array([[0, 1, 2]]), np.arange(3))
    rows, outside, *_ = core.prolongation(*pair, None)
    matrix = csr_matrix((rows[2], rows[1], rows[0]), shape=(5, 3))
    assert len(outside) == 0
    np.testing.assert_allclose(matrix @ corners, points, rtol=0, atol=1e-14)


def test_the_result_never_depends_on_threads_nor_on_the_kind_of_indices():
    pair = with_boundary(*square_pair(20_000))
    one = _core.prolongation(*pair, 1)
    for threads in (2, 3, 8, None):
        for a, b in zip(one[0], _core.prolongation(*pair, threads)[0], strict=True):
            assert (a == b).all()
    short = (pair[0], pair[1].astype(np.int32), *pair[2:4], pair[4].astype(np.int32), pair[5])
    assert (_core.prolongation(*short, None)[0][2] == one[0][2]).all()


def test_a_part_without_shared_nodes_takes_the_nearest_coarse_point_and_is_said_to_be_lost():
    points, cells, coarse_points, coarse_cells, shared = square_pair(100)
    far = points[:50] * 0.1 + [1.5, 0.5]
    far_cells = cells_of(far)
    both = np.concatenate([points, far]), np.concatenate([cells, far_cells + len(points)])
    matrix, outside, distance, lost = located(*both, coarse_points, coarse_cells, shared)
    used = np.unique(far_cells) + len(points)
    assert set(used) <= set(lost.tolist())
    assert set(lost.tolist()) <= set(outside.tolist())
    np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=4e-16)
    np.testing.assert_allclose(distance, both[0][outside, 0] - 1, rtol=1e-12)


def test_a_part_that_shares_no_node_but_lies_in_the_coarse_mesh_is_found_all_the_same():
    points, cells, coarse_points, coarse_cells, shared = square_pair(300)
    matrix, outside, _, lost = located(points, cells, coarse_points, coarse_cells, np.full(len(shared), -1))
    assert len(outside) == len(lost) == 0
    np.testing.assert_allclose(matrix @ coarse_points, points, atol=1e-13)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p: (*p[:4], p[4][:0], p[5]), "no cells"),
        (lambda p: (p[0], p[1] + 9999, *p[2:]), "expected an index"),
        (lambda p: (*p[:2], p[2] + 9999, *p[3:]), r"'boundary\[0\]' names node \d+, expected an index"),
        (lambda p: (*p[:2], -1 - p[2], *p[3:]), r"'boundary\[0\]' names node -\d+, expected an index"),
        (lambda p: (*p[:5], p[5][1:]), "injection"),
        (lambda p: (*p[:5], p[5] + 9999), "injection"),
        (lambda p: (*p[:3], p[3].T, *p[4:]), "coarse_points"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_by_name(change, words):
    with pytest.raises(ValueError, match=words):
        _core.prolongation(*change(with_boundary(*square_pair(50))), None)


# --- hierarchies -----------------------------------------------------------------------------------------------------


def bent(mesh, amount=0.08):
    """Bend a mesh, so that straight slits and edges become curves that coarse chords cut."""
    x, y = mesh.points.T
    return coarsen.Mesh(np.column_stack([x, y + amount * np.sin(5 * x)]), mesh.cells)


GALLERY = {
    "square": lambda: coarsen.gallery.square(2000, seed=1),
    "crack": lambda: coarsen.gallery.crack_plate(2000),
    "bent crack": lambda: bent(coarsen.gallery.crack_plate(2000)),
    "lshape": lambda: coarsen.gallery.lshape(1500),
    "ring": lambda: coarsen.gallery.ring(2000),
    "holes": lambda: coarsen.gallery.plate_with_holes(4000),
    "interface": lambda: coarsen.gallery.interface(2000),
    "coast": lambda: coarsen.gallery.coast(3000),
}
FEATURES = ("keep", "drop")


@pytest.fixture(scope="module", params=[(name, features) for name in GALLERY for features in FEATURES], ids=str)
def made(request):
    name, features = request.param
    return coarsen.hierarchy(GALLERY[name](), features=features)


def test_prolongations_interpolate(made):
    for i in range(1, len(made)):
        matrix = made.prolongation(i)
        fine, coarse = made[i - 1], made[i]
        assert_is_interpolation(matrix, fine.mesh, coarse.mesh)
        found = transfer.locate(made, i - 1, i)
        inside = np.setdiff1d(np.arange(fine.mesh.n_points), found.outside)
        scale = np.abs(fine.mesh.points).max()
        np.testing.assert_allclose(
            (matrix @ coarse.mesh.points)[inside], fine.mesh.points[inside], rtol=0, atol=1e-11 * scale
        )
        away = np.linalg.norm((matrix @ coarse.mesh.points - fine.mesh.points)[found.outside], axis=1)
        np.testing.assert_allclose(away, found.distance, rtol=1e-9, atol=1e-13 * scale)


def test_a_node_is_outside_only_if_no_coarse_cell_holds_it(made):
    for i in range(1, len(made)):
        fine, coarse = made[i - 1].mesh, made[i].mesh
        found = transfer.locate(made, i - 1, i)
        if coarse.n_cells * len(found.outside) > 4_000_000:
            continue
        held = barycentric(fine.points[found.outside], coarse.points, coarse.cells)[1]
        # at a slit that is bent, a node may lie beyond its own bank, in a cell of the other side
        doubled = len(np.unique(fine.points, axis=0)) < fine.n_points
        assert doubled or not held.any()


def test_a_node_outside_takes_the_nearest_point_of_the_coarse_mesh():
    h = coarsen.hierarchy(coarsen.gallery.ring(4000))
    for i in range(1, len(h)):
        coarse = h[i].mesh
        found = transfer.locate(h, i - 1, i)
        assert len(found.outside)
        nearest = distance_to_edges(h[i - 1].mesh.points[found.outside], coarse.points, coarse.boundary_facets)
        np.testing.assert_allclose(found.distance, nearest, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("features", FEATURES)
@pytest.mark.parametrize("amount", [0.0, 0.08, -0.2])
def test_no_value_crosses_a_slit(amount, features):
    mesh = coarsen.gallery.crack_plate(4000)
    x, y = mesh.points.T
    # which side of the slit, told by the cells: 1 above, 0 below, copies of the slit's nodes apart
    above = np.zeros(mesh.n_points)
    middle = mesh.points[mesh.cells].mean(axis=1)[:, 1] > 0.5
    above[mesh.cells[middle]] = 1.0
    h = coarsen.hierarchy(bent(mesh, amount), features=features)
    mouth = np.flatnonzero((x == 0) & (y == 0.5))
    checked = 0
    for i in range(1, len(h)):
        if features == "drop" and not np.isin(mouth, h[i].nodes).all():
            break  # a slit whose mouth was dropped is closed there
        matrix = h.prolongation(i)
        coarse_x = x[h[i].nodes]
        behind = np.array([coarse_x[row.indices].max() < 0.5 for row in matrix])
        fine = h[i - 1].nodes
        got = matrix @ above[h[i].nodes]
        # a row left of the tip, none of whose nodes lies right of the tip, mixes no sides
        near = behind & (np.abs(y[fine] - 0.5) < 0.1)
        np.testing.assert_allclose(got[near], above[fine[near]], atol=1e-15)
        checked += np.count_nonzero(near)
    assert checked > 200


def test_no_value_crosses_a_thin_wall():
    # a U, bent, whose two arms are a thousandth apart
    square = coarsen.gallery.square(3000, seed=3)
    x, y = square.points.T
    cut = coarsen.Mesh(*two_arms(square))
    arm = np.sign(cut.points[:, 0] - 0.5)
    assert np.ptp(x) == np.ptp(y) == 1
    # "drop" closes a gap that is under the spacing: then there is no wall
    h = coarsen.hierarchy(cut, features="keep", levels=3)
    for i in range(1, len(h)):
        matrix = h.prolongation(i)
        high = h[i].mesh.points[:, 1]
        rows = np.flatnonzero([high[row.indices].min() > 0.3 for row in matrix])
        got = (matrix @ arm[h[i].nodes])[rows]
        np.testing.assert_allclose(got, arm[h[i - 1].nodes][rows], atol=1e-15)
        assert len(rows) > 20


def two_arms(mesh, gap=1e-3):
    """Cut a square from above to a quarter of its height, and move the halves apart by `gap` there."""
    points = mesh.points.copy()
    middle = points[mesh.cells].mean(axis=1)
    wall = np.abs(points[:, 0] - 0.5) < 0.5 / np.sqrt(mesh.n_points)
    points[wall & (points[:, 1] > 0.25), 0] = 0.5
    right = middle[:, 0] > 0.5
    above = (points[:, 0] == 0.5) & (points[:, 1] > 0.25)
    twin = np.full(mesh.n_points, -1)
    twin[above] = mesh.n_points + np.arange(above.sum())
    cells = mesh.cells.copy()
    cells[right] = np.where(above[cells[right]], twin[cells[right]], cells[right])
    points = np.concatenate([points, points[above]])
    shift = np.zeros(len(points))
    shift[np.flatnonzero(above)], shift[mesh.n_points :] = -gap / 2, gap / 2
    points[:, 0] += shift
    used, index = np.unique(cells, return_inverse=True)
    return points[used], index.reshape(cells.shape)


@pytest.mark.parametrize("core", [_core, reference])
def test_no_value_crosses_a_notch_at_a_shared_node(core):
    #   w
    #   |  \
    #   |   v       s, d and e are coarse, and v is nearest to the edge from s to e, over the gap between v and e
    #   s ---- e
    coarse = np.array([[0.0, 0.0], [0.0, -4.0], [4.0, 0.0]])
    points = np.concatenate([coarse, [[3.0, 1.0], [0.0, 3.0], [-3.0, 0.0]]])
    cells = np.array([[0, 1, 2], [0, 3, 4], [0, 4, 5], [0, 5, 1]])
    pair = with_boundary(points, cells, coarse, np.array([[0, 1, 2]]), np.array([0, 1, 2]))
    rows, outside, distance, lost = core.prolongation(*pair, None)
    matrix = csr_matrix((rows[2], rows[1], rows[0]), shape=(6, 3)).toarray()
    assert (matrix[3:] == [1, 0, 0]).all()
    assert (outside == [3, 4, 5]).all()
    np.testing.assert_allclose(distance, [np.sqrt(10), 3, 3])
    assert len(lost) == 0


def test_no_value_goes_from_one_part_into_another():
    one = coarsen.gallery.ring(800)
    two = coarsen.gallery.square(800, seed=2)
    points = np.concatenate([one.points, two.points + np.array([1.001, -0.5])])
    mesh = coarsen.Mesh(points, np.concatenate([one.cells, two.cells + one.n_points]))
    h = coarsen.hierarchy(mesh)
    for i in range(1, len(h)):
        part = (h[i - 1].nodes >= one.n_points).astype(float)
        assert (h.prolongation(i) @ (h[i].nodes >= one.n_points) == part).all()


def test_restriction_is_the_transpose_and_injection_picks_the_shared_nodes(made):
    for i in range(1, len(made)):
        assert (made.restriction(i) != made.prolongation(i).T).nnz == 0
        picked = made.injection(i) @ made[i - 1].nodes
        assert (picked == made[i].nodes).all()
        identity = made.injection(i) @ made.prolongation(i)
        assert abs(identity - np.eye(made[i].mesh.n_points)).max() == 0


def test_the_report_counts_every_node_and_no_coarse_node_is_without_image(made):
    report = made.transfer_report()
    for row, level in zip(report.rows, made[:-1], strict=True):
        assert row.shared + row.on_edge + row.in_cell + row.outside == level.mesh.n_points
        assert row.without_image == row.lost == 0
        assert (row.farthest > 0) == (row.outside > 0)
    assert len(str(report).splitlines()) == len(made)
    assert report.outside == sum(row.outside for row in report.rows)
    assert report.without_image == 0


def test_levels_that_are_not_nested_have_operators_too():
    h = coarsen.hierarchy(coarsen.gallery.square(3000, seed=5), nested=False)
    linear = lambda points: 2.0 + points @ [3.0, -1.0]  # noqa: E731 - a formula
    assert any((transfer.shared_nodes(h, i - 1, i) < 0).any() for i in range(1, len(h)))
    for i in range(1, len(h)):
        coarse, fine = h[i].mesh, h[i - 1].mesh
        assert_is_interpolation(h.prolongation(i), fine, coarse)
        np.testing.assert_allclose(h.prolongation(i) @ linear(coarse.points), linear(fine.points), atol=1e-12)
    down = h.interpolate(linear(h[0].mesh.points), 0, -1)
    np.testing.assert_allclose(down, linear(h[-1].mesh.points), atol=1e-12)


# --- fields ----------------------------------------------------------------------------------------------------------


def test_linear_fields_survive_the_way_down_and_up():
    h = coarsen.hierarchy(coarsen.gallery.square(2000, seed=1))
    field = 1.0 + h[0].mesh.points @ np.array([[2.0, 0.5], [-3.0, 0.25]])
    for level in range(len(h)):
        down = h.interpolate(field, 0, level)
        assert (down == field[h[level].nodes]).all()
        np.testing.assert_allclose(h.interpolate(down, level, 0), field, atol=1e-12)


def test_cell_fields_keep_their_integral_and_stay_in_their_range(made):
    rng = np.random.default_rng(SEED)
    last = len(made) - 1
    for start, end in {(0, 1), (1, 0), (0, last), (last, 0), (last, last // 2)}:
        source, target = made[start].mesh, made[end].mesh
        field = rng.random((source.n_cells, 2)) + 1
        moved = made.interpolate(field, start, end, on="cells")
        before, after = (transfer.cell_sizes(mesh) @ values for mesh, values in ((source, field), (target, moved)))
        np.testing.assert_allclose(after, before, rtol=1e-12)
        assert moved.min() >= 0


def test_cell_fields_are_means_over_the_cells_where_the_meshes_cover_each_other():
    h = coarsen.hierarchy(coarsen.gallery.square(2000, seed=4))
    for start, end in ((0, 1), (1, 0), (0, 3), (3, 0)):
        source, target = h[start].mesh, h[end].mesh
        assert h.interpolate(np.ones(source.n_cells), start, end, on="cells") == pytest.approx(1, abs=1e-12)
        matrix = transfer.cell_transfer(h, start, end)
        # the mean place of what a cell receives is its own middle: areas and shapes of the overlaps are right
        if start < end:
            middles = [mesh.points[mesh.cells].mean(axis=1) for mesh in (source, target)]
            assert np.abs(matrix @ middles[0] - middles[1]).max() < source.quality().max_edge
        assert matrix.shape == (target.n_cells, source.n_cells)


def test_fields_of_the_wrong_length_and_levels_that_are_not_there_are_refused():
    h = coarsen.hierarchy(coarsen.gallery.square(500))
    with pytest.raises(ValueError, match=r"'values' has shape \(3,\)"):
        h.interpolate(np.zeros(3), 0, 1)
    with pytest.raises(ValueError, match="'from_level' is 99"):
        h.interpolate(np.zeros(3), 99, 0)
    with pytest.raises(ValueError, match="'on' is 'edges'"):
        h.interpolate(np.zeros(h[0].mesh.n_points), 0, 1, on="edges")
    for i in (0, len(h), -1):
        with pytest.raises(ValueError, match="expected a coarser level"):
            h.prolongation(i)


@pytest.mark.parametrize("level", [1.5, "1", None])
def test_a_level_that_is_no_whole_number_is_refused_by_name(level):
    h = coarsen.hierarchy(coarsen.gallery.square(500))
    field = np.zeros(h[0].mesh.n_points)
    for name, call in {
        "i": lambda: h.prolongation(level),
        "to_level": lambda: h.interpolate(field, 0, level),
        "from_level": lambda: transfer.cell_transfer(h, level, 0),
    }.items():
        with pytest.raises(TypeError, match=f"'{name}' is {level!r}, expected a whole number"):
            call()


def test_levels_of_cell_fields_count_from_the_coarsest_too():
    h = coarsen.hierarchy(coarsen.gallery.square(500))
    for start, end in ((0, -1), (-1, 0), (1, -1)):
        counted = transfer.cell_transfer(h, start % len(h), end % len(h))
        assert (transfer.cell_transfer(h, start, end) != counted).nnz == 0


# --- what is held ----------------------------------------------------------------------------------------------------


def test_reduced_operators_are_the_free_rows_and_columns():
    h = coarsen.hierarchy(coarsen.gallery.square(900))
    free = transfer.free_mask(h[0].mesh, dirichlet="boundary")
    for i in range(1, len(h)):
        rows, columns = free[h[i - 1].nodes], free[h[i].nodes]
        expected = h.prolongation(i).toarray()[np.ix_(rows, columns)]
        assert (h.prolongation(i, free=free).toarray() == expected).all()
        assert (h.prolongation(i, dirichlet="boundary").toarray() == expected).all()
        assert (h.restriction(i, free=free).toarray() == expected.T).all()
        assert (h.injection(i, free=free) @ h.prolongation(i, free=free) != np.eye(columns.sum())).sum() == 0


def test_facet_tags_say_what_is_held():
    square = coarsen.gallery.square(400)
    facets = square.boundary_facets
    tags = np.where((square.points[facets][:, :, 0] == 0).all(axis=1), 7, 8)
    mesh = coarsen.Mesh(square.points, square.cells, facets=facets, facet_tags=tags)
    assert (transfer.free_mask(mesh, dirichlet=7) == (mesh.points[:, 0] != 0)).all()
    assert (transfer.free_mask(mesh, dirichlet=[7, 8]) == transfer.free_mask(mesh, dirichlet="boundary")).all()
    assert transfer.free_mask(mesh) is None
    with pytest.raises(ValueError, match="names facet tag 9"):
        transfer.free_mask(mesh, dirichlet=9)
    with pytest.raises(ValueError, match="'boundary' or facet tags"):
        transfer.free_mask(mesh, dirichlet="left")
    with pytest.raises(ValueError, match="expected bool"):
        transfer.free_mask(mesh, free=[1, 0])
    for tag in (7.5, [None]):
        with pytest.raises(ValueError, match="'boundary' or facet tags"):
            transfer.free_mask(mesh, dirichlet=tag)
    with pytest.raises(ValueError, match="given both"):
        transfer.free_mask(mesh, free=np.ones(mesh.n_points, bool), dirichlet=7)


# --- graphs ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["crack", "holes"])
def test_the_graph_has_every_edge_in_both_directions_once(name):
    h = coarsen.hierarchy(GALLERY[name]())
    for i, level in enumerate(h):
        (source, target), relative = h.graph(i)
        cells = level.mesh.cells
        pairs = np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]), axis=1)
        expected = {tuple(pair) for pair in pairs.tolist()}
        got = list(zip(source.tolist(), target.tolist(), strict=True))
        assert len(set(got)) == len(got) == 2 * len(expected)
        assert {(min(e), max(e)) for e in got} == expected
        assert (relative == level.mesh.points[target] - level.mesh.points[source]).all()
        assert len(parts_of(level.mesh)) == level.mesh.n_points
        assert parts_of(level.mesh).max() == 0


def test_the_assignment_is_the_prolongation():
    h = coarsen.hierarchy(coarsen.gallery.square(900))
    (fine, coarse), weights = h.assignment(1)
    assert fine.dtype == coarse.dtype == np.int64
    again = csr_matrix((weights, (fine, coarse)), shape=h.prolongation(1).shape)
    assert (again != h.prolongation(1)).nnz == 0


# --- the line --------------------------------------------------------------------------------------------------------


def test_on_a_line_the_weights_are_linear():
    h = coarsen.hierarchy(coarsen.gallery.line(200), coarsest=4)
    for i in range(1, len(h)):
        matrix = h.prolongation(i)
        assert_is_interpolation(matrix, h[i - 1].mesh, h[i].mesh)
        np.testing.assert_allclose(matrix @ h[i].mesh.points, h[i - 1].mesh.points, atol=1e-15)
        assert (h.injection(i) @ matrix != np.eye(h[i].mesh.n_points)).sum() == 0
    field = np.arange(h[0].mesh.n_cells, dtype=float)
    for start, end in ((0, len(h) - 1), (len(h) - 1, 0)):
        sizes = transfer.cell_sizes(h[start].mesh), transfer.cell_sizes(h[end].mesh)
        values = field[: len(sizes[0])]
        assert sizes[1] @ h.interpolate(values, start, end, on="cells") == pytest.approx(sizes[0] @ values)
    (source, target), relative = h.graph(0)
    assert len(source) == 2 * h[0].mesh.n_cells
    assert (relative == h[0].mesh.points[target] - h[0].mesh.points[source]).all()


# --- real meshes -----------------------------------------------------------------------------------------------------

REAL = [
    "airfoil1_4253",
    "crack_10240",
    "pinched_two_squares",
    "plate_12_cracks",
    "thetis_north_sea",
    "thetis_lagoon",
    "xugrid_xoxo",
    "su2_naca0012_inv",
]


@pytest.mark.parametrize("name", REAL)
@pytest.mark.parametrize("features", FEATURES)
def test_real_domains_are_interpolated_part_by_part(meshes, name, features):
    arrays = np.load(meshes / f"{name}.npz")
    mesh = coarsen.Mesh(arrays["points"], arrays["triangles"])
    h = coarsen.hierarchy(mesh, features=features)
    for i in range(1, len(h)):
        matrix = h.prolongation(i)
        assert_is_interpolation(matrix, h[i - 1].mesh, h[i].mesh)
        # every node takes values of a coarse part (gaps between parts may be closed) that has nodes of its own part
        fine, coarse = parts_of(h[i - 1].mesh), parts_of(h[i].mesh)
        joined = set(zip(fine[transfer.shared_nodes(h, i - 1, i)].tolist(), coarse.tolist(), strict=True))
        rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
        strange = [
            row
            for row, a, b in zip(rows.tolist(), fine[rows].tolist(), coarse[matrix.indices].tolist(), strict=True)
            if (a, b) not in joined
        ]
        assert set(strange) <= set(transfer.locate(h, i - 1, i).lost.tolist())
    assert h.transfer_report().without_image == 0


# --- the twins -------------------------------------------------------------------------------------------------------

SMALL = {
    "square": lambda: coarsen.gallery.square(300, seed=1),
    "crack": lambda: coarsen.gallery.crack_plate(300),
    "bent crack": lambda: bent(coarsen.gallery.crack_plate(400)),
    "ring": lambda: coarsen.gallery.ring(400),
    "holes": lambda: coarsen.gallery.plate_with_holes(500, (2, 2)),
    "coast": lambda: coarsen.gallery.coast(600),
}


def arguments(h, i):
    """Return what the core and its twin are given of level i and the one before."""
    return (*transfer.location.pair_of(h, i - 1, i), None)


@pytest.mark.parametrize("features", FEATURES)
@pytest.mark.parametrize("name", SMALL)
def test_the_twins_agree(name, features):
    h = coarsen.hierarchy(SMALL[name](), features=features)
    for i in range(1, len(h)):
        fine, coarse = h[i - 1].mesh, h[i].mesh
        pair = arguments(h, i)
        (rust, outside, distance, lost), (numpy, *others) = _core.prolongation(*pair), reference.prolongation(*pair)
        shape = (fine.n_points, coarse.n_points)
        matrices = [csr_matrix((rows[2], rows[1], rows[0]), shape=shape) for rows in (rust, numpy)]
        np.testing.assert_allclose(matrices[0].toarray(), matrices[1].toarray(), atol=1e-11)
        assert (outside == others[0]).all()
        np.testing.assert_allclose(distance, others[1], rtol=1e-9)
        assert (lost == others[2]).all()
        areas = [
            csr_matrix((rows[2], rows[1], rows[0]), shape=(fine.n_cells, coarse.n_cells)).toarray()
            for rows in (_core.overlap(*pair), reference.overlap(*pair))
        ]
        np.testing.assert_allclose(areas[0], areas[1], atol=1e-12 * areas[0].max())
        products, slow = [], []
        coarse_ones = np.zeros(fine.n_points, dtype=bool)
        coarse_ones[pair[-1]] = True
        A = diags([0.3, -1.0, 3.0, -1.0, 0.3], range(-2, 3), shape=(fine.n_points,) * 2).tocsr()
        A.indices, A.indptr = A.indices.astype(np.int32), A.indptr.astype(np.int32)
        for core in (_core, reference):
            _, rows, found = core.stage(A, matrices[0], coarse_ones, 0.05, 0.25, None)
            slow.append(found)
            products.append(csr_matrix((rows[2], rows[1], rows[0]), shape=(coarse.n_points,) * 2).toarray())
        np.testing.assert_allclose(*products, atol=1e-12)
        np.testing.assert_array_equal(*slow)


@pytest.mark.parametrize("features", ["keep", "drop"])
def test_the_twins_agree_on_random_domains(features):
    for mesh in domains(1, 30, most=80):
        h = coarsen.hierarchy(mesh, features=features, coarsest=6)
        for i in range(1, len(h)):
            fine, coarse = h[i - 1].mesh, h[i].mesh
            pair = arguments(h, i)
            (rust, outside, _, lost), (numpy, *others) = _core.prolongation(*pair), reference.prolongation(*pair)
            shape = (fine.n_points, coarse.n_points)
            matrices = [csr_matrix((rows[2], rows[1], rows[0]), shape=shape).toarray() for rows in (rust, numpy)]
            np.testing.assert_allclose(*matrices, atol=1e-7)
            assert (outside == others[0]).all()
            assert (lost == others[2]).all()


def test_hierarchies_of_the_reference_have_operators_too():
    h = coarsen.hierarchy(coarsen.gallery.square(200), backend="numpy", coarsest=50)
    for i in range(1, len(h)):
        assert_is_interpolation(h.prolongation(i), h[i - 1].mesh, h[i].mesh)
    assert h.transfer_report().without_image == 0
