"""Thin parts at one place or beside each other: kinds of domains that once cost quadratic time, in small."""

from __future__ import annotations

import numpy as np
import pytest

import coarsen
from coarsen import options


def turned(points, angle=0.3):
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[c, s], [-s, c]])


def star(rays, centres):
    """Return triangles that touch at the origin, with one node there or one each."""
    t, k = 2 * np.pi * np.arange(rays) / rays, np.arange(rays)
    rim = [np.stack([np.cos(turn), np.sin(turn)], axis=1) for turn in (t, t + 0.6 * t[1])]
    points = np.concatenate([np.zeros((centres, 2)), *rim])
    return coarsen.Mesh(points, np.stack([k % centres, centres + k, centres + rays + k], axis=1))


def needles(count):
    """Return disjoint slanted needles, their ends here and there."""
    k, shift = np.arange(count), np.random.default_rng(0).uniform(0, 0.2, count)
    y = k / count
    ends = [(shift, y), (1 + shift, y + 0.15 / count), (shift, y + 0.3 / count)]
    points = turned(np.concatenate([np.stack(end, axis=1) for end in ends]))
    return coarsen.Mesh(points, np.stack([k, count + k, 2 * count + k], axis=1))


def strips(count, length):
    """Return disjoint slanted strips of squares cut in two."""
    x, y = np.meshgrid(np.linspace(0, 1, length), (np.arange(count)[:, None] + [0, 0.4]).ravel() / count)
    points = turned(np.stack([x.ravel(), y.ravel()], axis=1))
    first = (2 * length * np.arange(count)[:, None] + np.arange(length - 1)).ravel()
    a, b, c, d = first, first + 1, first + length + 1, first + length
    return coarsen.Mesh(points, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))


def rings(count, sides):
    """Return islands in islands, each a fifth smaller than the one around it."""
    r, t = 0.8 ** np.arange(2 * count), 2 * np.pi * np.arange(sides) / sides
    points = (r[:, None, None] * np.stack([np.cos(t), np.sin(t)], axis=1)).reshape(-1, 2)
    ring, k = np.meshgrid(2 * np.arange(count), np.arange(sides), indexing="ij")
    a, b = (ring * sides + k).ravel(), (ring * sides + (k + 1) % sides).ravel()
    inner = np.stack([a + sides, b + sides], axis=1)
    return coarsen.Mesh(points, np.concatenate([np.c_[a, inner[:, 1], b], np.c_[a, inner]]))


MESHES = {
    "star of one node": star(30, 1),
    "star of parts": star(30, 30),
    "needles": needles(40),
    "strips": strips(5, 7),
    "rings": rings(5, 10),
}


@pytest.mark.parametrize("features", options.FEATURES)
@pytest.mark.parametrize("name", MESHES)
def test_levels_are_legal_and_the_twins_agree(name, features):
    mesh = MESHES[name]
    levels, reference = (
        coarsen.hierarchy(mesh, features=features, coarsest=4, backend=backend) for backend in options.BACKENDS
    )
    assert [level.nodes.tolist() for level in levels] == [level.nodes.tolist() for level in reference]
    for level in levels[1:]:
        coarsen.Mesh(level.mesh.points, level.mesh.cells)
    if features in ("keep", "plain"):
        outer = [level.mesh.n_points - len(edges(level.mesh)) + level.mesh.n_cells for level in levels]
        assert len(set(outer)) == 1  # Euler's characteristic


def edges(mesh):
    sides = np.sort(np.concatenate([mesh.cells[:, [0, 1]], mesh.cells[:, [1, 2]], mesh.cells[:, [2, 0]]]), axis=1)
    return np.unique(sides, axis=0)


def test_parts_on_parts_are_refused():
    inner, outer = needles(40), star(3, 1)
    outer = coarsen.Mesh(10 * outer.points - [0, 0.01], outer.cells)
    inside = inner.points + np.array([2, 0.5])
    with pytest.raises(coarsen.MeshError, match=r"(?i)overlap|inside"):
        coarsen.Mesh(
            np.concatenate([inside, outer.points]), np.concatenate([inner.cells, outer.cells + inner.n_points])
        )
