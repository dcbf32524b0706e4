"""Hierarchies on meshes of the line (d = 1): paths of intervals.

Figures 2 and 3 as in the plane, with the triangulation replaced by joining kept nodes that follow each other along a
path. P0 are the ends of the paths and the nodes where cell tags change; there is no P1.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from .hierarchy import MAX_LEVELS, STALL, Made, Report, enough, power
from .point import Bools, Floats, Ints, distance
from .selection import greedy, rank
from .spacing import coarsened, nearest, threshold

if TYPE_CHECKING:
    from coarsen.options import Options

Path = tuple[list[int], list[int]]
"""Nodes along a path from its lower end, and the tags of the cells between them."""


def line_hierarchy(
    points: Floats,
    cells: Ints,
    cell_tags: Ints | None,
    spacing: Floats | None,
    options: Options,
    report: Report = None,
    threads: int | None = None,
) -> Made:
    """Build the coarser levels of a mesh of intervals; `report` and `threads` are passed over."""
    g = nearest(points) if spacing is None else spacing
    line = Line(points, g, paths(cells, cell_tags), options)
    levels, stopped = line.skeleton() if options.method == "mis" else line.build(len(cells))
    return levels, stopped, g


def paths(cells: Ints, cell_tags: Ints | None) -> list[Path]:
    """Return the paths of intervals, each from its lower end."""
    tags = np.zeros(len(cells), np.int64) if cell_tags is None else cell_tags
    after = {a: (b, tag) for (a, b), tag in zip(cells.tolist(), tags.tolist(), strict=True)}
    found = []
    for start in sorted(set(after) - set(cells[:, 1].tolist())):
        nodes, own = [start], []
        while nodes[-1] in after:
            node, tag = after[nodes[-1]]
            nodes.append(node)
            own.append(tag)
        found.append((nodes, own))
    return found


class Line:
    """A line and its spacing."""

    def __init__(self, points: Floats, g: Floats, along: list[Path], options: Options) -> None:
        self.points, self.g, self.paths, self.options = points, g, along, options
        self.corner = np.zeros(len(points), np.bool_)
        for nodes, tags in along:
            self.corner[[nodes[0], nodes[-1]]] = True
            for k in range(1, len(tags)):
                self.corner[nodes[k]] |= tags[k - 1] != tags[k]

    def spacing(self, i: int) -> Floats:
        """Return f_i."""
        factor = power(self.options.factor, i)
        if self.options.method == "threshold":
            return threshold(self.g, factor)
        return coarsened(self.points, self.g, factor, self.options.gradation)

    def choose(self, f: Floats, seeds: Bools) -> Bools:
        """Select a level's nodes: corners and seeds, then those that are delta * f away from the ends of their path."""
        kept = self.corner | seeds
        free = np.zeros(len(self.points), np.bool_)
        for nodes, _ in self.paths:
            ends = [distance(self.points[nodes], self.points[end]) for end in (nodes[0], nodes[-1])]
            free[nodes] = np.minimum(*ends) >= self.options.delta * f[nodes]
        order = rank(np.flatnonzero(free & ~kept), f)
        kept[greedy(self.points, f, self.options.beta, order, np.flatnonzero(kept))] = True
        return kept

    def level(self, i: int, kept: Bools) -> dict[str, Any]:
        """Join the kept nodes along each path."""
        nodes = np.flatnonzero(kept)
        cells, tags = [], []
        for path, own in self.paths:
            held = [k for k, node in enumerate(path) if kept[node]]
            cells += [[path[a], path[b]] for a, b in itertools.pairwise(held)]
            tags += [own[a] for a in held[:-1]]
        return {
            "nodes": nodes,
            "cells": np.searchsorted(nodes, np.array(cells, np.int64).reshape(-1, 2)),
            "cell_tags": np.array(tags, np.int64),
            "factor": power(self.options.factor, i),
            "spacing": self.spacing(i)[nodes],
        }

    def n_cells(self, kept: Bools) -> int:
        """Return the number of cells that a choice makes."""
        return int(kept.sum()) - len(self.paths)

    def build(self, n_cells: int) -> tuple[list[dict[str, Any]], str]:
        """Build the levels, coarsest first."""
        options = self.options
        none = np.zeros(len(self.points), np.bool_)
        depth, stopped = options.levels, "levels"
        if depth is None:
            depth, before = 0, n_cells
            while True:
                now = self.n_cells(self.choose(self.spacing(depth + 1), none))
                if now > STALL * before or depth == MAX_LEVELS:
                    stopped = "stalled"
                    break
                depth, before = depth + 1, now
                if now <= options.coarsest:
                    stopped = "coarsest"
                    break
        levels: list[dict[str, Any]] = []
        kept = none
        for i in range(depth, 0, -1):
            kept = self.choose(self.spacing(i), kept if options.nested else none)
            levels.insert(0, self.level(i, kept))
        for k, level in enumerate(levels if options.levels is None else []):
            if len(level["cells"]) <= options.coarsest:
                return levels[: k + 1], "coarsest"
        return levels, stopped

    def skeleton(self) -> tuple[list[dict[str, Any]], str]:
        """Build the baseline: every other node along each path, again and again."""
        kept = np.ones(len(self.points), np.bool_)
        levels: list[dict[str, Any]] = []
        while True:
            stopped = enough(self.options, len(levels), self.n_cells(kept))
            if stopped is not None:
                return levels, stopped
            fewer = self.corner.copy()
            for path, _ in self.paths:
                held = [node for node in path if kept[node]]
                for k in range(1, len(held) - 1):
                    fewer[held[k]] |= not (fewer[held[k - 1]] or fewer[held[k + 1]])
            if self.options.levels is None and self.n_cells(fewer) > STALL * self.n_cells(kept):
                return levels, "stalled"
            kept = fewer
            levels.append(self.level(len(levels) + 1, kept))
