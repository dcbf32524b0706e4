"""Hierarchies of meshes whose parts overlap.

The two sides of a sliding interface need not match node by node; their polygons then overlap by slivers, and no one
triangulation can hold both. Such parts lie in different *layers*; each layer is coarsened as a mesh of its own, and
every level joins the layers' levels.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .domain import FacetArrays
from .hierarchy import STALL, Made
from .point import Bools, Floats, Ints

if TYPE_CHECKING:
    from coarsen.options import Options

Build = Callable[[Floats, Ints, FacetArrays, "Floats | None", "Options"], Made]


@dataclass(frozen=True)
class FacetRows:
    """The facets of one layer."""

    facets: Ints
    cell_tags: Ints
    tags: Ints
    given: Bools
    n_boundary: int
    layer: None = None


def hierarchy_in_layers(
    build: Build, points: Floats, cells: Ints, facets: FacetArrays, spacing: Floats | None, options: Options
) -> Made:
    """Build the coarser levels of a mesh in layers."""
    layer = np.asarray(facets.layer)
    parts = []
    for name in np.unique(layer[cells[:, 0]]):
        nodes = np.flatnonzero(layer == name)
        own, rows = layer[cells[:, 0]] == name, layer[facets.facets[:, 0]] == name
        part = FacetRows(
            np.searchsorted(nodes, facets.facets[rows]),
            facets.cell_tags[rows],
            facets.tags[rows],
            facets.given[rows],
            int(rows[: facets.n_boundary].sum()),
        )
        given = None if spacing is None else spacing[nodes]
        parts.append((nodes, (points[nodes], np.searchsorted(nodes, cells[own]), part, given)))
    depth = options.levels
    if depth is None:
        # together the layers' last levels should be small enough; where some are left out, their factors still tell
        coarsest, depth = max(options.coarsest // len(parts), 1), 0
        for _, mesh in parts:
            own = build(*mesh, replace(options, coarsest=coarsest))[0]
            last = own[-1]["factor"] if own else 1.0
            depth = max(depth, round(math.log(last) / math.log(options.factor)))
    made = [(nodes, build(*mesh, replace(options, levels=depth))) for nodes, mesh in parts]
    g = np.zeros(len(points))
    for nodes, (_, _, own_g) in made:
        g[nodes] = own_g
    levels: list[dict[str, Any]] = []
    before = len(cells)
    for i in range(depth):
        level = _joined([(nodes, own[i]) for nodes, (own, _, _) in made if i < len(own)])
        now = len(level["cells"])
        if options.levels is None and now > STALL * before:
            if options.features in {"keep", "plain"}:
                return levels, "stalled", g
            continue
        levels.append(level)
        before = now
        if options.levels is None and now <= options.coarsest:
            return levels, "coarsest", g
    return levels, "stalled" if options.levels is None else "levels", g


def _joined(parts: list[tuple[Ints, dict[str, Any]]]) -> dict[str, Any]:
    """Return one level from the layers' levels, boundary facets of all of them first."""
    whole = [nodes[level["nodes"]] for nodes, level in parts]
    nodes = np.sort(np.concatenate(whole))
    order = np.argsort(np.concatenate(whole))
    offsets = np.cumsum([0] + [len(level["cells"]) for _, level in parts[:-1]])

    def stacked(name: str, part: Callable[[int, Any], Any]) -> Any:
        return np.concatenate([part(k, level[name]) for k, (_, level) in enumerate(parts)])

    inner = stacked("facets", lambda k, rows: np.arange(len(rows)) >= parts[k][1]["n_boundary"])
    rows = np.argsort(inner, kind="stable")
    spacing = np.concatenate([level["spacing"] for _, level in parts])
    dropped = [level["dropped"] for _, level in parts if "dropped" in level]
    joined: dict[str, Any] = {
        "nodes": nodes,
        "cells": stacked("cells", lambda k, ends: np.searchsorted(nodes, whole[k][ends])),
        "cell_tags": stacked("cell_tags", lambda _, tags: tags),
        "facets": stacked("facets", lambda k, ends: np.searchsorted(nodes, whole[k][ends]))[rows],
        "facet_cells": stacked("facet_cells", lambda k, sides: np.where(sides < 0, sides, sides + offsets[k]))[rows],
        "given": stacked("given", lambda _, given: given)[rows],
        "facet_tags": stacked("facet_tags", lambda _, tags: tags)[rows],
        "n_boundary": int((~inner).sum()),
        "factor": parts[0][1]["factor"],
        "spacing": spacing[order] if len(spacing) == len(nodes) else spacing,
        "visits": sum(level["visits"] for _, level in parts),
    }
    if dropped:
        joined["dropped"] = {name: sum(own[name] for own in dropped) for name in dropped[0]}
    return joined
