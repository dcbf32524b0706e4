"""Definition 2.4 measured: against points thrown at both meshes, and against meshes whose answer is known."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import coarsen
from coarsen import check, gallery
from coarsen.multilevel import Hierarchy

SEED = 7


@pytest.fixture(scope="module")
def h() -> Hierarchy:
    """The paper's plate, small."""
    return coarsen.hierarchy(gallery.crack_plate(1200))


def holders(mesh, at):
    """Return the cell that holds each point, -1 where none does, by trying every cell."""
    a, b, c = (mesh.points[corner] for corner in mesh.cells.T)

    def left(p, q):
        return (q - p)[:, 0] * (at[:, None] - p)[..., 1] - (q - p)[:, 1] * (at[:, None] - p)[..., 0] > 0

    inside = left(a, b) & left(b, c) & left(c, a)
    return np.where(inside.any(axis=1), inside.argmax(axis=1), -1)


def sides(mesh):
    corners = mesh.points[mesh.cells]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)


def test_no_thrown_point_sees_a_larger_ratio_and_some_come_near(h):
    rng = np.random.default_rng(SEED)
    found = check.similarities(h)
    assert np.isnan(found[0])
    for finer, coarser, most in zip(h[:-1], h[1:], found[1:], strict=True):
        cell = np.repeat(np.arange(finer.mesh.n_cells), 12)
        shares = rng.dirichlet([0.4, 0.4, 0.4], len(cell))  # more of them near edges and corners
        at = np.einsum("kc,kcd->kd", shares, finer.mesh.points[finer.mesh.cells[cell]])
        holder = holders(coarser.mesh, at)
        seen = holder >= 0
        ratio = sides(coarser.mesh).max(axis=1)[holder[seen]] / sides(finer.mesh).max(axis=1)[cell[seen]]
        assert 0.8 * most < ratio.max() <= most * (1 + 1e-12)


def test_similarity_is_known_cell_by_cell_but_outside_of_the_coarser_mesh(h):
    sea = coarsen.hierarchy(gallery.coast(800), features="drop", coarsest=10)
    outside = 0
    for one in (h, sea):
        for finer, coarser, most in zip(one[:-1], one[1:], check.similarities(one)[1:], strict=True):
            found = check.local_similarity(finer, coarser)
            assert found.shape == (finer.mesh.n_cells,)
            assert np.nanmax(found) == most
            outside += np.isnan(found).sum()
            middles = finer.mesh.points[finer.mesh.cells].mean(axis=1)
            assert np.all(holders(coarser.mesh, middles[np.isnan(found)]) == -1)
    assert outside > 0


def test_both_backends_measure_the_same_similarity(h):
    assert check.similarity(h[1], h[2], "numpy") == pytest.approx(check.similarity(h[1], h[2]), rel=1e-12)


def test_similarity_is_measured_once_and_kept_in_copies(h, monkeypatch):
    known = check.similarities(h)
    copied = pickle.loads(pickle.dumps(h))
    monkeypatch.setattr(check, "similarity", lambda *_: pytest.fail("measured again"))
    assert check.similarities(h)[1:] == check.similarities(copied)[1:] == known[1:]
    assert copied == h
    assert h.check().similarity == max(known[1:])
    assert h.summary()


def test_equilateral_cells_are_the_fewest_that_their_size_allows():
    points = [[0, 0], [1, 0], [0.5, 0.75**0.5], [1.5, 0.75**0.5]]
    mesh = coarsen.Mesh(points, [[0, 1, 2], [1, 3, 2]])
    assert check.least_cells(mesh, [1.0]) == pytest.approx([2.0])
    assert check.least_cells(mesh, [2.0]) == pytest.approx([0.5])


def test_longest_edges_are_the_longest_in_any_dimension():
    flat, line = gallery.crack_plate(300), gallery.line(40, growth=1.3)
    assert check.longest_edges(flat) == pytest.approx(sides(flat).max(axis=1), rel=1e-15)
    assert check.longest_edges(line).tolist() == np.abs(np.diff(line.points[line.cells, 0])).ravel().tolist()


def test_bounds_asked_for_are_judged_one_by_one(h):
    found = h.check(min_angle=1, similarity=1e3, size=10**6)
    assert found
    for bound, word in (({"min_angle": 59}, "angles"), ({"similarity": 1.0}, "times"), ({"size": 1}, "cells")):
        failing = h.check(**bound)
        assert not failing
        assert word in str(failing)
        assert "not held" in str(failing)
    assert len(str(h.check(min_angle=59)).splitlines()) == 1 + len(h) + len(h) - 1
