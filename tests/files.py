"""Oracles for files: facets as sets, same cells, what was refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from coarsen import MeshError
from coarsen.mesh import Mesh

SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def facet_set(mesh: Mesh) -> set[tuple[int, int, int]]:
    if mesh.facets is None:
        return set()
    tags = np.zeros(len(mesh.facets), int) if mesh.facet_tags is None else mesh.facet_tags
    return {(*sorted(edge), tag) for edge, tag in zip(mesh.facets.tolist(), tags.tolist(), strict=True)}


def assert_same_cells(one: Mesh, two: Mesh) -> None:
    assert np.array_equal(one.points, two.points)
    assert np.array_equal(one.cells, two.cells)


def refusal(act: Callable[[], Any]) -> str:
    """The message of the MeshError raised, or nothing."""
    try:
        act()
    except MeshError as error:
        return str(error)
    return ""
