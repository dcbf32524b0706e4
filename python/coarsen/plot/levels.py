"""Levels and hierarchies as pictures: kept nodes over the finer mesh, levels side by side as in Figure 5."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .meshes import (
    FACET,
    INK,
    NODE,
    UNDER,
    axes_or_new,
    draw_edges,
    draw_facets,
    fill_cells,
    frame,
    matplotlib,
    near,
    plot_line,
    plot_mesh,
    points_per_unit,
    pyplot,
    unique_edges,
)

if TYPE_CHECKING:
    from ..mesh import Mesh
    from ..multilevel import Hierarchy, Level


def plot_level(
    level: Level,
    ax: Any = None,
    *,
    over: Mesh | None = None,
    spacing: bool = True,
    nodes: bool | None = None,
    window: tuple[float, float, float] | None = None,
) -> Any:
    """Draw a level: its cells, the nodes that were kept, facets, the spacing as colour.

    Parameters
    ----------
    level : Level
    ax : matplotlib axes, optional
    over : Mesh, optional
        The finer mesh, drawn thin below: ``plot_level(h[1], over=h[0].mesh)``.
    spacing : bool
        Fill the cells by the logarithm of the spacing, with a scale beside.
    nodes : bool, optional
        Mark the nodes; by default where they are not too many to be told apart.
    window : (x, y, half), optional
        Show the square of that half width about (x, y) only.

    Returns
    -------
    matplotlib axes
    """
    ax = axes_or_new(ax)
    mesh = level.mesh
    if mesh.dim == 1:
        return plot_line(mesh, ax, INK)
    frame(ax, mesh.points, window)
    if spacing:
        _shade(ax, level)
    if over is not None:
        edges = unique_edges(np.asarray(over.cells) if window is None else near(over.points, over.cells, window))
        draw_edges(ax, over.points, edges, UNDER, weight=0.6)
    cells = np.asarray(mesh.cells) if window is None else near(mesh.points, np.asarray(mesh.cells), window)
    draw_edges(ax, mesh.points, unique_edges(cells), INK, weight=1.2)
    draw_facets(ax, mesh)
    seen = np.unique(cells)
    if nodes if nodes is not None else len(seen) <= 6000:
        gap = np.minimum(level.spacing[seen] * points_per_unit(ax), 12.0)
        shown = seen[gap > 1.0] if nodes is None else seen
        size = np.clip(0.28 * level.spacing[shown] * points_per_unit(ax), 0.8, 3.6)
        ax.scatter(*mesh.points[shown].T, s=size**2, color=NODE, linewidths=0, zorder=3)
    return ax


def _shade(ax: Any, level: Level) -> None:
    colors = matplotlib("colors")
    values = np.asarray(level.spacing, dtype=np.float64)
    low, high = float(values.min()), float(values.max())
    if not (0 < low < high < math.inf):
        fill_cells(ax, level.mesh, None, np.asarray(level.mesh.cells))
        return
    area = ax.tripcolor(
        *level.mesh.points.T,
        level.mesh.cells,
        values,
        shading="gouraud",
        cmap=_soft_map(),
        norm=colors.LogNorm(low, high),
        rasterized=True,
        zorder=0,
    )
    bar = ax.figure.colorbar(area, ax=ax, shrink=0.6, pad=0.015, aspect=30)
    bar.set_label("spacing", color=INK)
    bar.outline.set_visible(False)


def _soft_map() -> Any:
    """Return a light part of a perceptually even map, so that lines stay legible on it."""
    colors = matplotlib("colors")
    source = pyplot().get_cmap("YlGnBu")
    return colors.ListedColormap(source(np.linspace(0.65, 0.02, 256)))


def plot_hierarchy(
    h: Hierarchy,
    *,
    levels: Sequence[int] | None = None,
    columns: int | None = None,
    zoom: tuple[float, float, float] | None = None,
    size: float = 3.2,
) -> Any:
    """Draw the levels side by side, as in Figure 5 of the paper.

    Parameters
    ----------
    h : Hierarchy
    levels : sequence of int, optional
        Which; all by default.
    columns : int, optional
        Pictures in a row; by default at most four.
    zoom : (x, y, half), optional
        Draw below each level the square of that half width about (x, y).
    size : float
        Width of one picture, inches.

    Returns
    -------
    matplotlib figure
    """
    chosen = [(i, h[i]) for i in (range(len(h)) if levels is None else levels)]
    if h[0].mesh.dim == 1:
        return _plot_lines(chosen)
    columns = max(1, min(columns or columns_for(len(chosen)), len(chosen)))
    rows = math.ceil(len(chosen) / columns)
    low, high = h[0].mesh.points.min(axis=0), h[0].mesh.points.max(axis=0)
    tall = float(np.clip((high[1] - low[1]) / max(high[0] - low[0], np.finfo(float).tiny), 0.2, 3.0))
    heights = ([tall + 0.1, 1.0] if zoom else [tall + 0.1]) * rows  # a tenth for the title
    figure, axes = pyplot().subplots(
        len(heights),
        columns,
        figsize=(size * columns, size * sum(heights)),
        gridspec_kw={"height_ratios": heights},
        squeeze=False,
        layout="constrained",
    )
    for ax in axes.ravel():
        ax.set_axis_off()
    for k, (i, level) in enumerate(chosen):
        row, column = divmod(k, columns)
        ax = axes[row * (2 if zoom else 1), column]
        ax.set_axis_on()
        plot_mesh(level.mesh, ax)
        ax.set_title(_caption(i, level), fontsize=9, color=INK)
        if zoom:
            close = axes[2 * row + 1, column]
            close.set_axis_on()
            plot_mesh(level.mesh, close, window=zoom)
            _mark(ax, zoom)
    return figure


def columns_for(count: int) -> int:
    """Four in a row, three where that fills the rows better."""
    if count <= 4:
        return count
    return min((4, 3), key=lambda c: (-count) % c)


def _caption(i: int, level: Level) -> str:
    points, cells = (f"{count:,}".replace(",", "\u2009") for count in (level.mesh.n_points, level.mesh.n_cells))
    return f"level {i}: {points} nodes, {cells} triangles"


def _mark(ax: Any, zoom: tuple[float, float, float]) -> None:
    x, y, half = zoom
    patch = matplotlib("patches").Rectangle((x - half, y - half), 2 * half, 2 * half, fill=False, ec=FACET, lw=0.9)
    patch.set_zorder(4)
    ax.add_patch(patch)


def _plot_lines(chosen: Sequence[tuple[int, Level]]) -> Any:
    figure, ax = pyplot().subplots(figsize=(9, 0.6 + 0.45 * len(chosen)), layout="constrained")
    for row, (_, level) in enumerate(chosen):
        plot_line(level.mesh, ax, INK, height=-row)
    ax.set_yticks([-row for row in range(len(chosen))], [f"level {i}: {lv.mesh.n_points}" for i, lv in chosen])
    ax.tick_params(axis="y", length=0)
    return figure
