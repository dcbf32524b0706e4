"""The twins: spacing equal bit for bit, selected nodes exactly, both by definition."""

from __future__ import annotations

import numpy as np
import pytest

import coarsen
from clouds import clouds
from coarsen import _core, reference
from domains import domains, river
from oracles import (
    assert_is_lipschitz,
    assert_is_mis,
    assert_is_valid_level,
    assert_node_nested,
    brute_coarsened,
    brute_conflicts,
    brute_greedy,
    brute_nearest,
)

SEED = 1997
COUNT = 400

each_dimension = pytest.mark.parametrize("d", [1, 2, 3])


def both(name, *arguments):
    """The answer of both twins to the same question, after they were found equal."""
    rust, numpy = (getattr(twin, name)(*arguments) for twin in (_core, reference))
    assert rust.dtype == numpy.dtype
    np.testing.assert_array_equal(rust, numpy)
    return rust


@each_dimension
def test_spacing_agrees_bit_for_bit_and_is_what_the_definitions_say(d):
    rng = np.random.default_rng(SEED)
    for points in clouds(SEED, COUNT, d):
        at = points[rng.integers(0, len(points), 20)] + rng.normal(size=(20, d)) * np.ptp(points) / 9
        g = both("nearest", points, None)
        np.testing.assert_array_equal(g, brute_nearest(points))
        np.testing.assert_array_equal(both("nearest_at", points, points, None), g)
        both("nearest_at", points, at, None)
        both("threshold", g, 3.0)
        g = np.minimum(g, 1e9)
        for factor, gradation in ((2.0, 1.0), (7.3, 0.37)):
            f = both("coarsened", points, g, factor, gradation, None, None)
            np.testing.assert_array_equal(f, brute_coarsened(points, g, factor, gradation))
            assert_is_lipschitz(points, f, gradation)
            f_at = both("coarsened", points, g, factor, gradation, at, None)
            np.testing.assert_array_equal(f_at, brute_coarsened(points, g, factor, gradation, at))


@each_dimension
def test_quadtree_agrees_bit_for_bit_and_stays_under_nearest(d):
    rng = np.random.default_rng(SEED)
    for points in clouds(SEED + 2, COUNT // 2, d, most=40):
        h = both("quadtree", points, None, None)
        assert (h <= brute_nearest(points)).all()
        low, high = points.min(axis=0), points.max(axis=0)
        both("quadtree", points, low + (rng.random((30, d)) * 1.4 - 0.2) * (high - low), None)


@each_dimension
def test_selection_agrees_exactly_and_is_a_maximal_independent_set(d):
    rng = np.random.default_rng(SEED)
    for k, points in enumerate(clouds(SEED + 3, COUNT, d)):
        n = len(points)
        g = np.minimum(brute_nearest(points), 1e9)
        f = brute_coarsened(points, g, 3.0) if k % 4 else rng.random(n) ** 3 * np.ptp(points)
        beta = float(rng.choice([1.2, 2.0, 3.0]))
        rank = rng.integers(0, 4, n) if k % 2 else None
        keep = rng.integers(0, n, int(rng.integers(0, 4))) if k % 3 else None
        conflicts = brute_conflicts(points, f, beta)
        edges = both("conflict_graph", points, f, beta, None)
        np.testing.assert_array_equal(edges, np.argwhere(np.triu(conflicts)).reshape(-1, 2))
        selected = both("independent_set", points, f, beta, rank, keep, None)
        kept = () if keep is None else keep
        order = np.lexsort((np.arange(n), np.zeros(n) if rank is None else rank))
        np.testing.assert_array_equal(selected, brute_greedy(conflicts, order, kept))
        assert_is_mis(points, f, beta, selected, exempt=kept)


def test_skeleton_sets_agree_exactly():
    for points in clouds(SEED + 4, 100, 2, distinct=True):
        cells = reference.delaunay(points, None)
        both("skeleton_independent_set", len(points), cells)
    both("skeleton_independent_set", 5, np.array([[0, 1], [1, 2], [2, 3]]))


def test_large_sets_agree_too():
    """Trees and blocks of many levels; a uniform and a graded set."""
    rng = np.random.default_rng(SEED)
    uniform = rng.random((20_000, 2))
    for points in (uniform, 10.0 ** (6 * uniform - 6)):
        g = both("nearest", points, None)
        both("quadtree", points, None, None)
        for factor in (2.0, 32.0):
            f = both("coarsened", points, g, factor, 0.5, None, None)
            both("independent_set", points, f, 2.0, None, None, None)


# --- hierarchies -----------------------------------------------------------------------------------------------------

OPTIONS = {
    "default": {},
    "as in the paper": {"features": "plain", "gradation": 1.0, "candidates": "all", "beta": 3.0},
    "threshold, not nested": {"method": "threshold", "nested": False, "levels": 3, "min_angle": 0.0},
    "slow factor, guarded": {"features": "plain", "factor": 1.37, "min_angle": 28.0},
    "far from facets": {"delta": 1.1, "beta": 1.6, "feature_angle": 20.0, "levels": 2},
}
REAL = ["gridded_fvcom", "libmesh_drum2", "ngs_2_doms", "triangle_box_4", "triangle_la_1", "xugrid_xoxo"]

each_options = pytest.mark.parametrize("options", OPTIONS.values(), ids=OPTIONS.keys())


def agreeing(mesh, options):
    """Return the hierarchies of both twins: the same nodes on every level, and the same spacing bit for bit."""
    rust, numpy = (coarsen.hierarchy(mesh, **options, backend=twin) for twin in ("rust", "numpy"))
    assert [level.mesh.n_points for level in rust] == [level.mesh.n_points for level in numpy]
    assert rust.stopped == numpy.stopped
    for one, two in zip(rust, numpy, strict=True):
        np.testing.assert_array_equal(one.nodes, two.nodes)
        np.testing.assert_array_equal(one.spacing, two.spacing)
        assert (one.factor, one.visits) == (two.factor, two.visits)
    return rust, numpy


def assert_twins_agree(mesh, options):
    """Both build the same levels: nodes exactly, spacing bit for bit, and both validly."""
    rust, numpy = agreeing(mesh, options)
    for hierarchy in (rust, numpy):
        for level in hierarchy[1:]:
            assert_is_valid_level(level, mesh)
        if options.get("nested", True):
            assert_node_nested(hierarchy)


@each_options
def test_twins_keep_the_same_nodes_of_random_domains(options):
    for mesh in domains(SEED, 30):
        assert_twins_agree(mesh, options)


@each_options
@pytest.mark.parametrize("name", ["crack_plate", "plate_with_holes", "interface", "lshape", "coast"])
def test_twins_keep_the_same_nodes_of_the_gallery(name, options):
    assert_twins_agree(getattr(coarsen.gallery, name)(600), options)


@each_options
@pytest.mark.parametrize("name", REAL)
def test_twins_keep_the_same_nodes_of_real_meshes(meshes, name, options):
    with np.load(meshes / f"{name}.npz") as file:
        mesh = coarsen.Mesh(file["points"], file["triangles"], cell_tags=file.get("cell_tags"))
    assert_twins_agree(mesh, options)


def test_twins_keep_the_same_nodes_where_candidates_lie_in_several_tiles():
    """Up to 16,384 candidates are one tile."""
    rust, numpy = (
        coarsen.hierarchy(coarsen.gallery.square(20_000, seed=SEED), features="plain", levels=2, backend=backend)
        for backend in ("rust", "numpy")
    )
    for one, two in zip(rust[1:], numpy[1:], strict=True):
        np.testing.assert_array_equal(one.nodes, two.nodes)


def test_twins_keep_the_same_nodes_of_the_papers_mesh(meshes):
    with np.load(meshes / "crack_5120_f32.npz") as file:
        mesh = coarsen.Mesh(file["points"], file["triangles"])
    for name in ("as in the paper", "default"):
        assert_twins_agree(mesh, OPTIONS[name])


def test_twins_keep_the_same_nodes_of_lines():
    rng = np.random.default_rng(SEED)
    for k, points in enumerate(clouds(SEED + 5, 100, 1, distinct=True)):
        x = np.sort(points, axis=0)
        cells = np.column_stack([np.arange(len(x) - 1), np.arange(1, len(x))])
        if k % 3 == 0 and len(x) > 6:
            cells = np.delete(cells, len(x) // 2, axis=0)
        if len(cells) == 0:
            continue
        mesh = coarsen.Mesh(x, cells, cell_tags=rng.integers(0, 2, len(cells)) if k % 4 == 0 else None)
        for options in ({"coarsest": 3}, {"method": "mis", "coarsest": 3}, {"levels": 3, "factor": 1.3, "delta": 1.0}):
            rust, numpy = (coarsen.hierarchy(mesh, **options, backend=twin) for twin in ("rust", "numpy"))
            assert rust == numpy


def test_twins_take_the_same_baseline_from_the_same_mesh():
    """On later levels cells, and so their edges, may differ where points are cocircular."""
    for mesh in domains(SEED + 6, 40):
        rust, numpy = (coarsen.coarsen(mesh, method="mis", backend=twin) for twin in ("rust", "numpy"))
        np.testing.assert_array_equal(rust.nodes, numpy.nodes)
        assert_is_valid_level(numpy, mesh)


def test_twins_keep_the_same_nodes_of_parts_that_overlap(meshes):
    with np.load(meshes / "su2_rotating_cylinders_multizone.npz") as file:
        mesh = coarsen.Mesh(file["points"], file["triangles"])
    assert mesh.topology.layer is not None
    rust, numpy = (coarsen.coarsen(mesh, 8.0, backend=twin) for twin in ("rust", "numpy"))
    np.testing.assert_array_equal(rust.nodes, numpy.nodes)
    np.testing.assert_array_equal(rust.spacing, numpy.spacing)
    assert_is_valid_level(numpy, mesh)


# --- features dropped -------------------------------------------------------------------------------------------------

DROPPING = {
    "drop": {"features": "drop", "coarsest": 8},
    "auto": {"features": "auto", "coarsest": 8},
    "drop, not nested, slow": {"features": "drop", "nested": False, "levels": 3, "factor": 1.5, "candidates": "all"},
    "auto, threshold": {"features": "auto", "method": "threshold", "levels": 4, "delta": 0.8},
}
SMALLER = ["skfem_interface", "skfem_cylinder_stokes", "omegah_greenland_gis", "airfoil1_4253", "square_structured_65"]

each_dropping = pytest.mark.parametrize("options", DROPPING.values(), ids=DROPPING.keys())


def assert_twins_drop_the_same(mesh, options):
    """Both build the same levels to the last cell and facet, and say that the same was dropped."""
    rust, numpy = agreeing(mesh, options)
    for one, two in zip(rust, numpy, strict=True):
        assert one.mesh.n_cells == two.mesh.n_cells
        assert (one.dropped is None) == (two.dropped is None)
        if one.dropped is None:
            continue
        for name in ("cells", "cell_tags", "facets", "facet_tags"):
            np.testing.assert_array_equal(getattr(one.mesh, name), getattr(two.mesh, name))
        np.testing.assert_array_equal(one.mesh.topology.facets, two.mesh.topology.facets)
        assert one.dropped["loops_closed"] == two.dropped["loops_closed"]
        for name in ("area_gained", "area_lost"):
            assert one.dropped[name] == pytest.approx(two.dropped[name], abs=1e-9 * mesh.quality().area)


@each_dropping
def test_twins_drop_the_same_of_random_domains(options):
    for mesh in domains(SEED + 7, 100):
        assert_twins_drop_the_same(mesh, options)


@each_dropping
@pytest.mark.parametrize("seed", range(3))
def test_twins_cut_a_winding_river_at_the_same_bridges(seed, options):
    assert_twins_drop_the_same(river(seed, 300, 2), options)


@each_dropping
@pytest.mark.parametrize("name", ["square", "crack_plate", "plate_with_holes", "interface", "lshape", "coast"])
def test_twins_drop_the_same_of_the_gallery(name, options):
    assert_twins_drop_the_same(getattr(coarsen.gallery, name)(600), options)


@each_dropping
@pytest.mark.parametrize("name", REAL + SMALLER)
def test_twins_drop_the_same_of_real_meshes(meshes, name, options):
    with np.load(meshes / f"{name}.npz") as file:
        mesh = coarsen.Mesh(file["points"], file["triangles"], cell_tags=file.get("cell_tags"))
    assert_twins_drop_the_same(mesh, options)


def test_the_reference_guards_slivers_whose_area_is_rounded_to_nothing():
    """Such a sliver has no circumcentre: the core's is infinite or no number, and the twin's must be so too."""
    mesh = next(mesh for k, mesh in enumerate(domains(1, 28)) if k == 27)
    assert_twins_agree(mesh, {"coarsest": 4})
