"""Spacing functions: definitions by brute force, the paper's statements, arguments."""

from __future__ import annotations

import doctest

import numpy as np
import pytest

import coarsen.spacing
from coarsen.spacing import coarsened, nearest, quadtree, threshold

SEED = 1997


def distances(a, b):
    squares = [(a[:, None, k] - b[None, :, k]) ** 2 for k in range(a.shape[1])]
    total = squares[0]
    for square in squares[1:]:
        total = total + square
    return np.sqrt(total)


def clouds():
    rng = np.random.default_rng(SEED)
    for d in (1, 2, 3):
        uniform = rng.random((200, d))
        yield f"uniform{d}", uniform
        yield f"graded{d}", 10.0 ** (6 * uniform - 6)
        yield f"far{d}", uniform + 1e6
        yield f"tiny{d}", uniform * 1e-6
        yield f"lattice{d}", rng.integers(0, 5, (150, d)).astype(float)


CLOUDS = dict(clouds())
each_cloud = pytest.mark.parametrize("points", CLOUDS.values(), ids=CLOUDS.keys())


@each_cloud
def test_nearest_is_the_least_distance_over_0(points):
    between = distances(points, points)
    brute = np.where(between > 0, between, np.inf).min(axis=1)
    np.testing.assert_array_equal(nearest(points), brute)
    np.testing.assert_array_equal(nearest(points, at=points), brute)


@each_cloud
def test_nearest_is_1_lipschitz_and_2_spacing(points):
    g, between = nearest(points), distances(points, points)
    assert (np.abs(g[:, None] - g[None, :]) <= between * (1 + 1e-12)).all()
    apart = between > 0
    assert (((g[:, None] + g[None, :]) / 2)[apart] <= between[apart]).all()


@each_cloud
@pytest.mark.parametrize("gradation", [1.0, 0.5])
def test_coarsened_is_the_least_of_its_cones(points, gradation):
    g = nearest(points)
    at = points + 0.3 * np.ptp(points)
    for factor in (2.0, 64.0):
        for x, f in (
            (points, coarsened(points, g, factor, gradation=gradation)),
            (at, coarsened(points, g, factor, gradation=gradation, at=at)),
        ):
            brute = (factor * g[None, :] + gradation * distances(x, points)).min(axis=1)
            np.testing.assert_array_equal(f, brute)


@each_cloud
def test_quadtree_never_exceeds_nearest_and_is_comparable(points):
    g, h = nearest(points), quadtree(points)
    assert (h <= g).all()
    assert (h > 0).all()


def test_quadtree_of_a_uniform_cloud_is_within_a_constant_of_nearest_at_crowded_points():
    points = CLOUDS["uniform2"]
    lattice = np.stack(np.meshgrid(np.arange(16.0), np.arange(16.0)), axis=-1).reshape(-1, 2)
    assert (quadtree(lattice) >= 0.25 * nearest(lattice)).all()
    assert np.median(quadtree(points) / nearest(points)) > 0.15


@each_cloud
def test_quadtree_leaves_that_touch_differ_by_at_most_one_level(points):
    side = quadtree(points) * 16 / 15
    steps = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * points.shape[1])).reshape(points.shape[1], -1).T
    for step in steps:
        # just across the leaf's border lies a leaf that touches it or the leaf itself
        across = quadtree(points, at=points + step * side[:, None]) * 16 / 15
        assert (across <= 2 * side * (1 + 1e-9)).all()


def test_threshold_lifts_what_is_under_the_least_grown():
    g = np.random.default_rng(SEED).random(100)
    np.testing.assert_array_equal(threshold(g, 3.0), np.maximum(g, 3.0 * g.min()))


def test_one_location_has_no_nearest_other():
    assert np.isinf(nearest([[1.0, 2.0]] * 3)).all()
    assert np.isinf(quadtree([[1.0, 2.0]] * 3)).all()
    assert nearest(np.empty((0, 2))).shape == (0,)
    assert quadtree(np.empty((0, 2))).shape == (0,)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_values_do_not_depend_on_the_number_of_threads(threads):
    points = np.random.default_rng(SEED).random((30_000, 2))
    g = nearest(points)
    np.testing.assert_array_equal(nearest(points, threads=threads), g)
    np.testing.assert_array_equal(coarsened(points, g, 8.0, threads=threads), coarsened(points, g, 8.0))
    np.testing.assert_array_equal(quadtree(points, threads=threads), quadtree(points))


def test_any_real_array_is_taken_as_it_is_meant():
    points = np.random.default_rng(SEED).integers(0, 50, (60, 2))
    expected = nearest(points.astype(np.float64))
    for given in (
        points,
        points.tolist(),
        points.astype(np.float32),
        points.astype(np.int8),
        np.asfortranarray(points.astype(float)),
        np.repeat(points.astype(float), 2, axis=0)[::2],
    ):
        np.testing.assert_array_equal(nearest(given), expected)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: nearest([0.0, 1.0]), r"'points' has shape \(2,\), expected \(n, d\)"),
    (lambda: nearest(np.zeros((3, 4))), r"'points' has shape \(3, 4\)"),
    (lambda: nearest([[0.0, np.nan], [np.inf, 0.0]]), r"'points\[0, 1\]' is nan.*1 more"),
    (lambda: nearest([[0.0, 1j]]), "dtype complex128"),
    (lambda: nearest([["a", "b"]]), "expected real numbers"),
    (lambda: nearest([[0.0, 1.0], [2.0]]), "'points' is no array"),
    (lambda: nearest([[0.0]], at=[[0.0, 1.0]]), r"'at' has shape \(1, 2\), expected \(k, 1\)"),
    (lambda: nearest([[0.0]], threads=0), "'threads' is 0, expected"),
    (lambda: nearest([[0.0]], backend="julia"), "'backend' is 'julia'"),
    (lambda: coarsened([[0.0]], [1.0, 2.0], 2.0), r"'g' has shape \(2,\), expected \(1,\)"),
    (lambda: coarsened([[0.0]], [-1.0], 2.0), r"'g\[0\]' is -1.0, expected at least 0"),
    (lambda: coarsened([[0.0]], [1.0], 1.0), "'factor' is 1.0, expected a finite number over 1"),
    (lambda: coarsened([[0.0]], [1.0], "2"), "'factor' is '2'"),
    (lambda: coarsened([[0.0]], [1.0], 2.0, gradation=0.0), r"'gradation' is 0.0, expected a number in \(0, 1\]"),
    (lambda: threshold([np.nan], 2.0), r"'g\[0\]' is nan"),
])  # fmt: skip
def test_what_is_wrong_with_an_argument_is_said(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_every_example_in_the_docstrings_holds():
    assert doctest.testmod(coarsen.spacing).failed == 0
