"""Slits that bend strongly, drawn by many short edges: on every level that keeps features both sides stay apart."""

from __future__ import annotations

import numpy as np
import pytest

import coarsen
from coarsen import options


def spiral(nodes, turns):
    t = np.linspace(0.15, 1, nodes)
    return 0.5 + 0.35 * t[:, None] * np.stack([np.cos(2 * np.pi * turns * t), np.sin(2 * np.pi * turns * t)], axis=1)


def zigzag(nodes, height):
    return np.stack([np.linspace(0.2, 0.8, nodes), 0.5 + height * (np.arange(nodes) % 2)], axis=1)


def ring(nodes, share):
    turn = np.linspace(0, 2 * np.pi * share, nodes)
    return 0.5 + 0.2 * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def koch(times):
    line = np.array([0.2 + 0.5j, 0.8 + 0.5j])
    for _ in range(times):
        a, third = line[:-1], np.diff(line) / 3
        top = a + third * (1 + np.exp(1j * np.pi / 3))
        line = np.append(np.stack([a, a + third, top, a + 2 * third], axis=1).ravel(), line[-1])
    return np.stack([line.real, line.imag], axis=1)


SLITS = {
    "spiral": spiral(90, 3),
    "tight spiral": spiral(120, 5),
    "zigzag": zigzag(40, 0.02),
    "steep zigzag": zigzag(30, 0.2),
    "nearly a ring": ring(40, 0.97),
    "small hook": 0.5 + (ring(12, 0.8) - 0.5) * 0.005,
    "snowflake": koch(3),
}


def with_slit(line):
    """Return a mesh of the unit square with a slit along a polyline, its inner nodes doubled."""
    k, rng = 20, np.random.default_rng(0)
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, k)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    inner = ((grid > 0) & (grid < 1)).all(axis=1)
    grid[inner] += rng.uniform(-0.3, 0.3, (int(inner.sum()), 2)) / k
    apart = np.linalg.norm(grid[:, None] - line, axis=2).min(axis=1) > 0.7 * np.linalg.norm(line[1] - line[0])
    points, m = np.concatenate([line, grid[~inner | apart]]), len(line)
    cells = coarsen.delaunay(points, np.stack([np.arange(m - 1), np.arange(1, m)], axis=1))
    across = {
        (a, b): t for t, cell in enumerate(cells.tolist()) for a, b in zip(cell, cell[1:] + cell[:1], strict=True)
    }
    open_cells = cells.copy()
    for v in range(1, m - 1):
        # the cells on one side: around v from the edge before it to the edge after it
        edge = (v, v - 1)
        while True:
            t = across[edge]
            corner = cells[t].tolist().index(v)
            open_cells[t, corner] = len(points) + v - 1
            last = int(cells[t, (corner + 2) % 3])
            if last == v + 1:
                break
            edge = (v, last)
    return coarsen.Mesh(np.concatenate([points, line[1:-1]]), open_cells)


def assert_slit_is_open(mesh):
    ends = {tuple(map(tuple, mesh.points[edge])): tuple(edge) for edge in mesh.boundary_facets.tolist()}
    slit = [(edge, ends[q, p]) for (p, q), edge in ends.items() if (q, p) in ends]
    assert len(slit) >= 4  # both sides of two edges at least: there is a doubled node
    assert all(set(one) != set(other) for one, other in slit)
    edges = {tuple(sorted((cell[k], cell[k - 1]))) for cell in mesh.cells.tolist() for k in range(3)}
    assert mesh.n_points - len(edges) + mesh.n_cells == 0  # a square with one hole, which has no area


@pytest.mark.parametrize("features", ["keep", "plain"])
@pytest.mark.parametrize("name", SLITS)
def test_bent_slits_stay_open(name, features):
    mesh = with_slit(SLITS[name])
    assert_slit_is_open(mesh)
    for more in ({}, {"method": "mis"}, {"factor": 8.0, "nested": False, "gradation": 1.0}, {"feature_angle": 179.0}):
        for level in coarsen.hierarchy(mesh, features=features, coarsest=4, **more):
            assert_slit_is_open(level.mesh)


@pytest.mark.parametrize("name", ["zigzag", "nearly a ring"])
def test_the_twins_agree_on_bent_slits(name):
    mesh = with_slit(SLITS[name])
    one, other = (coarsen.hierarchy(mesh, coarsest=4, backend=backend) for backend in options.BACKENDS)
    assert [level.nodes.tolist() for level in one] == [level.nodes.tolist() for level in other]
