"""Conflict graph and independent sets: the definition by brute force, greedy order, arguments."""

from __future__ import annotations

import doctest
from types import SimpleNamespace

import numpy as np
import pytest

import coarsen.selection
from coarsen.selection import conflict_graph, independent_set, skeleton_independent_set
from test_spacing import CLOUDS, distances

SEED = 35

each_cloud = pytest.mark.parametrize("points", CLOUDS.values(), ids=CLOUDS.keys())


def conflicts(points, f, beta):
    between = distances(points, points)
    return (between > 0) & (between < (f[:, None] + f[None, :]) / beta)


def any_spacing(points):
    return np.random.default_rng(SEED).random(len(points)) ** 4 * 0.5 * np.ptp(points)


@each_cloud
@pytest.mark.parametrize("beta", [1.1, 2.0, 3.0])
def test_edges_are_the_pairs_in_conflict(points, beta):
    f = any_spacing(points)
    brute = np.argwhere(np.triu(conflicts(points, f, beta)))
    edges = conflict_graph(points, f, beta)
    np.testing.assert_array_equal(edges, brute)
    assert edges.dtype == np.int64


@each_cloud
def test_the_set_is_greedy_by_rank_then_index_after_keep(points):
    rng = np.random.default_rng(SEED)
    f, beta, n = any_spacing(points), 2.0, len(points)
    edges = conflicts(points, f, beta)
    for rank, keep in ((None, None), (rng.integers(0, 3, n), None), (rng.random(n), [3, 5, 3])):
        inside = np.zeros(n, dtype=bool)
        inside[keep or []] = True
        for i in np.lexsort((np.arange(n), np.zeros(n) if rank is None else rank)):
            if not (edges[i] & inside).any():
                inside[i] = True
        np.testing.assert_array_equal(independent_set(points, f, beta, rank=rank, keep=keep), np.flatnonzero(inside))


def test_unsigned_and_wide_ranks_sort_as_numbers():
    points, f = np.arange(4.0)[:, None], np.full(4, 1.5)
    for rank in (
        np.array([1, 0, 2, 2], dtype=np.uint64) + np.uint64(2**63),
        [True, False, False, False],
        [0.3, -1.0, 0, 0],
    ):
        assert independent_set(points, f, 2.0, rank=rank).tolist() == [1, 3]


@pytest.mark.parametrize("threads", [1, 2])
def test_the_graph_does_not_depend_on_the_number_of_threads(threads):
    points = np.random.default_rng(SEED).random((20_000, 2))
    f = np.full(len(points), 0.01)
    np.testing.assert_array_equal(conflict_graph(points, f, 2.0, threads=threads), conflict_graph(points, f, 2.0))


@pytest.mark.parametrize("dtype", [np.int32, np.int64, np.uint16])
def test_the_skeleton_set_is_greedy_on_the_edges_of_the_cells(dtype):
    cells = np.random.default_rng(SEED).integers(0, 60, (40, 3)).astype(dtype)
    adjacent = np.zeros((60, 60), dtype=bool)
    for cell in cells.astype(int):
        adjacent[np.ix_(cell, cell)] = True
    inside = np.zeros(60, dtype=bool)
    for i in range(60):
        inside[i] = not (adjacent[i] & inside).any()
    mesh = SimpleNamespace(n_points=60, cells=cells)
    np.testing.assert_array_equal(skeleton_independent_set(mesh), np.flatnonzero(inside))


@pytest.mark.parametrize(("call", "words"), [
    (lambda: conflict_graph([[0.0]], [1.0], 1.0), "'beta' is 1.0, expected a finite number over 1"),
    (lambda: conflict_graph([[0.0]], [np.nan], 2.0), r"'f\[0\]' is nan"),
    (lambda: independent_set([[0.0]], [1.0], 2.0, keep=[1]), r"'keep\[0\]' is 1, expected an index from 0 to 0"),
    (lambda: independent_set([[0.0]], [1.0], 2.0, keep=[-1]), r"'keep\[0\]' is -1"),
    (lambda: independent_set([[0.0]], [1.0], 2.0, keep=[0.5]), "'keep' has dtype float64, expected indices"),
    (lambda: independent_set([[0.0]], [1.0], 2.0, rank=[np.nan]), r"'rank\[0\]' is NaN"),
    (lambda: independent_set([[0.0]], [1.0], 2.0, rank=[1, 2]), r"'rank' has shape \(2,\)"),
    (lambda: skeleton_independent_set(SimpleNamespace(n_points=2, cells=np.array([[0, 1, 2]]))), "names node 2"),
    (lambda: skeleton_independent_set(SimpleNamespace(n_points=2, cells=np.array([0, 1]))), r"shape \(2,\)"),
])  # fmt: skip
def test_what_is_wrong_with_an_argument_is_said(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_every_example_in_the_docstrings_holds():
    assert doctest.testmod(coarsen.selection).failed == 0
