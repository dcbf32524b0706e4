"""Hierarchies and meshes as tables: `Hierarchy.summary()`, the rows behind it as in Table 1 of the paper, facts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .check import similarities

if TYPE_CHECKING:
    from .mesh import Mesh
    from .multilevel import Hierarchy

HEADINGS = ("level", "factor", "nodes", "triangles", "min angle", "max angle", "similarity")


@dataclass(frozen=True)
class Row:
    """One level in numbers.

    Attributes
    ----------
    level : int
    factor : float
        C^i.
    nodes, cells : int
    min_angle, max_angle : float or None
        Degrees; None on a line.
    similarity : float or None
        Largest ratio of edge lengths to the next finer level, where both have a point in common (Definition 2.4); None
        on level 0.
    """

    level: int
    factor: float
    nodes: int
    cells: int
    min_angle: float | None
    max_angle: float | None
    similarity: float | None

    def texts(self) -> tuple[str, ...]:
        """Return the columns of a table, ready to print."""
        angles = ("–" if angle is None else f"{angle:.2f}°" for angle in (self.min_angle, self.max_angle))
        similarity = "–" if self.similarity is None else f"{self.similarity:.2f}"
        return (str(self.level), f"{self.factor:g}", str(self.nodes), str(self.cells), *angles, similarity)


def rows(h: Hierarchy) -> list[Row]:
    """Return one row a level, finest first."""
    found = []
    for i, (level, ratio) in enumerate(zip(h, similarities(h), strict=True)):
        quality = level.quality
        smallest, largest = (float(quality.min_angle), float(quality.max_angle)) if level.mesh.dim > 1 else (None, None)
        size = level.mesh.n_points, level.mesh.n_cells
        found.append(Row(i, float(level.factor), *size, smallest, largest, ratio if i else None))
    return found


def summary(h: Hierarchy) -> str:
    """Return a table of the levels as text, and why the hierarchy ends where it does."""
    lines = [headings(h), *(row.texts() for row in rows(h))]
    widths = [max(len(line[k]) for line in lines) for k in range(len(HEADINGS))]
    table = ["  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in lines]
    table.insert(1, "  ".join("-" * width for width in widths))
    return "\n".join([*table, f"ended: {h.stopped}"])


def headings(h: Hierarchy) -> tuple[str, ...]:
    """Return the names of the columns; on a line, cells are edges."""
    return tuple("edges" if name == "triangles" and h[0].mesh.dim == 1 else name for name in HEADINGS)


def facts_of(mesh: Mesh) -> dict[str, Any]:
    """Return what is to be said of a mesh, by name, as JSON has it."""
    quality = mesh.quality()
    facts: dict[str, Any] = {"dimension": mesh.dim, "nodes": mesh.n_points, "cells": mesh.n_cells}
    if mesh.dim > 1:
        facts |= {"min_angle": float(quality.min_angle), "max_angle": float(quality.max_angle)}
    facts |= {"min_edge": float(quality.min_edge), "max_edge": float(quality.max_edge), "area": float(quality.area)}
    facts["box"] = [mesh.points.min(axis=0).tolist(), mesh.points.max(axis=0).tolist()]
    facts["boundary_facets"] = len(mesh.boundary_facets)
    facts["doubled_nodes"] = mesh.n_points - len(np.unique(mesh.points, axis=0))
    facts["facets"] = 0 if mesh.facets is None else len(mesh.facets)
    for name, tags in (("facet_tags", mesh.facet_tags), ("cell_tags", mesh.cell_tags)):
        if tags is not None:
            values, counts = np.unique(tags, return_counts=True)
            facts[name] = {int(value): int(count) for value, count in zip(values, counts, strict=True)}
    for name, names in (("facet_names", mesh.facet_names), ("cell_names", mesh.cell_names)):
        if names:
            facts[name] = names
    facts["fields"] = sorted(mesh.point_data or {})
    return facts


def short(value: Any) -> str:
    """Return such a value as a line of text."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, dict):
        first = [f"{tag} ({count})" for tag, count in list(value.items())[:12]]
        return ", ".join(first) + (f", … {len(value)} in all" if len(value) > len(first) else "")
    if isinstance(value, list):
        parts = [f"({short(part)})" if isinstance(part, list) else short(part) for part in value]
        return ", ".join(parts) or "none"
    return str(value)
