"""Exact signs, and (constrained) Delaunay triangulations of both twins, by property."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import coarsen
from clouds import clouds
from coarsen import reference
from coarsen.backend import backend
from coarsen.reference.point import in_circle, orient, signs
from coarsen.reference.triangulation import is_one_line
from oracles import assert_is_conforming, assert_is_delaunay, directed_edges

SEED = 63

each_backend = pytest.mark.parametrize("name", ["rust", "numpy"])


def exact_orient(a, b, c):
    (ax, ay), (bx, by), (cx, cy) = (map(Fraction, p) for p in (a, b, c))
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return (area > 0) - (area < 0)


def exact_in_circle(a, b, c, d):
    """Sign of the 4 × 4 determinant with rows (x, y, x² + y², 1), by Laplace expansion."""
    rows = [
        [Fraction(p[0]), Fraction(p[1]), Fraction(p[0]) ** 2 + Fraction(p[1]) ** 2, Fraction(1)] for p in (a, b, c, d)
    ]

    def determinant(m):
        if len(m) == 1:
            return m[0][0]
        return sum((-1) ** k * m[0][k] * determinant([row[:k] + row[k + 1 :] for row in m[1:]]) for k in range(len(m)))

    value = determinant(rows)
    return (value > 0) - (value < 0)


def test_signs_are_exact_however_near_to_zero():
    for points in clouds(SEED, 800, 2, most=12):
        p = [tuple(map(float, x)) for x in points[np.arange(6) % len(points)]]
        assert orient(*p[:3]) == exact_orient(*p[:3])
        assert in_circle(*p[:4]) == exact_in_circle(*p[:4])
        index = np.array([(0, 1, 2), (1, 2, 3), (2, 3, 4), (3, 4, 5)])
        found = signs(*(np.array(p)[index[:, k]] for k in range(3)))
        assert found.tolist() == [exact_orient(*(p[i] for i in row)) for row in index]


def test_signs_survive_products_that_underflow_or_overflow():
    for scale in (1e-170, 1e-200, 1e160, 1e300):
        a, b, c, d = (0.0, 0.0), (scale, 0.0), (scale, scale), (0.0, scale)
        assert orient(a, b, c) == 1
        assert in_circle(a, b, c, d) == 0
        assert in_circle(a, b, c, (scale / 2, scale / 2)) == 1


def assert_is_delaunay_of(points, cells, facets=()):
    """Cells tile the convex hull of all points, every point is a corner, unconstrained edges are Delaunay."""
    assert_is_conforming(points, cells)
    assert_is_delaunay(points, cells, facets)
    edges, _, _ = directed_edges(cells)
    both = {tuple(edge) for edge in edges.tolist()}
    hull = np.array([edge for edge in both if edge[::-1] not in both])
    for a, b in hull:
        assert (signs(points[a], points[b], points) >= 0).all(), "a point beyond the rim"
    # a rim that turns left or straight on and closes once is the hull's
    assert len(np.unique(hull[:, 0])) == len(hull)
    assert len(points) - len(both | {e[::-1] for e in both}) // 2 + len(cells) == 1


@each_backend
def test_random_point_sets_are_delaunay(name):
    for points in clouds(SEED, 1200, 2, distinct=True):
        cells = backend(name).delaunay(points, None)
        if is_one_line(points):
            assert len(cells) == 0
        else:
            assert_is_delaunay_of(points, cells)


@each_backend
def test_facets_that_do_not_cross_are_kept(name):
    rng = np.random.default_rng(SEED)
    for points in clouds(SEED + 1, 600, 2, distinct=True):
        if is_one_line(points):
            continue
        # edges of another triangulation, sheared, never cross; so edges of them are constraints far from Delaunay
        sheared = points @ np.array([[1.0, 0.0], [rng.uniform(1, 3), 1.0]])
        edges = directed_edges(reference.delaunay(sheared, None))[0]
        facets = rng.permutation(edges)[: int(rng.integers(1, 9))]
        if not straight(points, facets):
            continue
        assert_is_delaunay_of(points, backend(name).delaunay(points, facets), facets)


def straight(points, facets):
    """Whether the edges, free of crossings up to the rounding of a shear, are free of them exactly."""
    from oracles import crossing

    on = signs(points[facets[:, 0]][:, None], points[facets[:, 1]][:, None], points[None]) == 0
    return crossing(points, facets) is None and (on.sum(axis=1) == 2).all()


@each_backend
def test_a_facet_through_a_point_or_another_facet_is_refused(name):
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.0]])
    delaunay = backend(name).delaunay
    with pytest.raises(ValueError, match=r"'facets' row 0 \(points 0 and 2\)"):
        delaunay(square, np.array([[0, 2]]))
    with pytest.raises(ValueError, match=r"'facets' row 1 \(points 1 and 3\)"):
        delaunay(np.delete(square, 4, axis=0), np.array([[0, 2], [1, 3]]))
    with pytest.raises(ValueError, match="'facets' row 0 names point 9"):
        delaunay(square, np.array([[0, 9]]))
    with pytest.raises(ValueError, match=r"point 3 repeats point 1 at"):
        delaunay(square[[4, 0, 2, 0]], None)


@each_backend
def test_a_facet_across_a_lattice_is_kept_whatever_it_crosses(name):
    lattice = np.stack(np.meshgrid(np.arange(12.0), np.arange(12.0)), axis=-1).reshape(-1, 2)
    for facet in ([0, 142], [11, 120], [5, 138]):
        assert_is_delaunay_of(lattice, backend(name).delaunay(lattice, np.array([facet])), [facet])


@each_backend
def test_the_public_function_takes_what_looks_like_arrays(name):
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    cells = coarsen.delaunay(square, facets=[(1, 3)], backend=name)
    assert_is_delaunay_of(np.array(square, dtype=float), cells, [(1, 3)])
    assert len(coarsen.delaunay([[0, 0], [1, 1], [2, 2]], facets=[], backend=name)) == 0


@pytest.mark.parametrize(
    ("facets", "said"),
    [
        ([[0, 9]], r"'facets\[1\]' is 9"),
        ([0, 1], r"'facets' has shape \(2,\), expected \(s, 2\)"),
        ([[0.5, 1]], "'facets' has dtype float64"),
        ([[0, 1], [2]], "'facets' is no array"),
    ],
)
def test_facets_that_are_none_are_refused_with_words(facets, said):
    with pytest.raises(ValueError, match=said):
        coarsen.delaunay([[0, 0], [1, 0], [0, 1]], facets=facets)
