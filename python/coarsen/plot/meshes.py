"""One mesh as a picture.

Every edge is as thick as it is long allows: lines thin out where a mesh is fine, so that a graded mesh of a hundred
thousand nodes stays a drawing and does not become a blot. Edges shorter than half a pixel are drawn as a grey of
their place.
"""

from __future__ import annotations

import importlib
import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Mesh

INK = "#1f2933"
FACE = "#f3f6f9"
BOUNDARY = "#111827"
FACET = "#c2255c"
NODE = "#d9480f"
UNDER = "#9aa5b1"
GRID = "#d5dbe1"
TAGS = ("#dbe9f6", "#fde7c9", "#dff0d8", "#f3dcef", "#e8e4f8", "#fbdcd6", "#d9f0ee", "#efe9d2")
"""Colours of cell tags, in turn."""
LINES = ("#1c7ed6", "#d9480f", "#2b8a3e", "#862e9c", "#c2255c", "#5f6b7a", "#e8a200", "#0b7285")
"""Colours of curves, in turn."""

_INKED, _POWER = 0.08, 0.85
"""Width of a line as a share of its length (to a power just under 1, so that finer parts are a little darker)."""

_SHORTEST = 0.5
"""Points (1/72 inch); shorter edges are drawn as a grey of their ink."""

_RASTER_FROM = 20_000  # edges from which on a vector file keeps the mesh as an image


def pyplot() -> Any:
    """Return matplotlib.pyplot, or say how to get it."""
    try:
        return importlib.import_module("matplotlib.pyplot")
    except ImportError:
        raise ImportError("pictures need matplotlib: pip install 'coarsen-mesh[plot]'") from None


def matplotlib(module: str) -> Any:
    """Return a module of matplotlib."""
    pyplot()
    return importlib.import_module(f"matplotlib.{module}")


def plot_mesh(
    mesh: Mesh,
    ax: Any = None,
    *,
    color: str = INK,
    fill: bool = True,
    facets: bool = True,
    window: tuple[float, float, float] | None = None,
) -> Any:
    """Draw a mesh: cells by tag, edges, and facets.

    Parameters
    ----------
    mesh : Mesh
        Of one or two dimensions.
    ax : matplotlib axes, optional
        Where to draw; new ones by default.
    color : str
        Colour of the edges.
    fill : bool
        Fill the cells, in a colour for each tag.
    facets : bool
        Draw the boundary dark, the facets inside in red.
    window : (x, y, half), optional
        Show the square of that half width about (x, y) only.

    Returns
    -------
    matplotlib axes
    """
    ax = axes_or_new(ax)
    if mesh.dim == 1:
        return plot_line(mesh, ax, color)
    points, cells = mesh.points, np.asarray(mesh.cells)
    frame(ax, points, window)
    if window is not None:
        cells = near(points, cells, window)
    if fill and len(cells):
        tags = mesh.cell_tags
        if tags is not None and window is not None:
            tags = tags[_near_mask(points, np.asarray(mesh.cells), window)]
        fill_cells(ax, mesh, tags, cells)
    draw_edges(ax, points, unique_edges(cells), color)
    if facets:
        draw_facets(ax, mesh)
    return ax


def axes_or_new(ax: Any) -> Any:
    """Return the axes, new ones for None."""
    if ax is not None:
        return ax
    return pyplot().subplots(figsize=(7, 7), layout="constrained")[1]


def frame(ax: Any, points: NDArray[Any], window: tuple[float, float, float] | None) -> None:
    """Set limits and aspect before drawing, so that lengths in pixels are known."""
    if window is None:
        low, high = points.min(axis=0), points.max(axis=0)
        margin = 0.02 * max(float((high - low).max()), np.finfo(float).tiny)
        low, high = low - margin, high + margin
    else:
        x, y, half = window
        low, high = np.array([x - half, y - half]), np.array([x + half, y + half])
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    for side in ax.spines.values():
        side.set_visible(window is not None)
        side.set_color(UNDER)


def _near_mask(points: NDArray[Any], cells: NDArray[Any], window: tuple[float, float, float]) -> Any:
    corners = points[cells]
    x, y, half = window
    low, high = corners.min(axis=1), corners.max(axis=1)
    return ((low <= [x + half, y + half]) & (high >= [x - half, y - half])).all(axis=1)


def near(points: NDArray[Any], cells: NDArray[Any], window: tuple[float, float, float]) -> NDArray[Any]:
    """Return the cells whose boxes reach into the window."""
    return np.asarray(cells[_near_mask(points, cells, window)])


def unique_edges(cells: NDArray[Any]) -> NDArray[Any]:
    """Return every edge of triangles once, (e, 2)."""
    edges = np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]).astype(np.int64), axis=1)
    if len(edges) == 0:
        return edges
    keys = np.unique(edges[:, 0] * (edges.max() + 1) + edges[:, 1])
    return np.asarray(np.column_stack(np.divmod(keys, edges.max() + 1)))


def points_per_unit(ax: Any) -> float:
    """Typographic points (1/72 inch) that one unit of the plot takes on paper."""
    figure = ax.figure.get_figure(root=True) if hasattr(ax.figure, "get_figure") else ax.figure
    box = ax.get_position()
    width, height = figure.get_size_inches()
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    return float(72 * min(width * box.width / abs(x1 - x0), height * box.height / abs(y1 - y0)))


def fill_cells(ax: Any, mesh: Mesh, tags: NDArray[Any] | None, cells: NDArray[Any]) -> None:
    """Fill the cells, each tag in its colour; without tags the domain as one path, whatever the number of cells."""
    if tags is None:
        shape = matplotlib("patches").PathPatch(_outline(mesh), facecolor=FACE, linewidth=0, zorder=0)
        ax.add_artist(shape)
        return
    collections, colors = matplotlib("collections"), matplotlib("colors")
    values = np.unique(tags, return_inverse=True)[1]
    shades = colors.to_rgba_array([TAGS[k % len(TAGS)] for k in range(int(values.max()) + 1)])
    area = collections.PolyCollection(
        mesh.points[cells], facecolors=shades[values], edgecolors="face", linewidths=0.2, antialiased=False, zorder=0
    )
    area.set_rasterized(len(cells) > _RASTER_FROM)
    ax.add_collection(area, autolim=False)


def _outline(mesh: Mesh) -> Any:
    """Return the boundary as closed loops; its edges have the cells on their left, so that holes stay empty."""
    after: dict[int, list[int]] = {}
    for tail, head in mesh.boundary_facets.tolist():
        after.setdefault(tail, []).append(head)
    path = matplotlib("path").Path
    nodes: list[int] = []
    codes: list[int] = []
    for start in list(after):
        while after[start]:
            loop = [start]
            while after.get(loop[-1]):  # at a node of several loops any way round fills the same
                loop.append(after[loop[-1]].pop())
            nodes += loop
            codes += [path.MOVETO] + [path.LINETO] * (len(loop) - 2) + [path.CLOSEPOLY]
    return path(mesh.points[nodes], codes)


def draw_edges(ax: Any, points: NDArray[Any], edges: NDArray[Any], color: str, weight: float = 1.0) -> None:
    """Draw edges, each as thick as it is long allows."""
    if len(edges) == 0:
        return
    ends = points[edges]
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T) * points_per_unit(ax)
    width = weight * np.minimum(_INKED * length**_POWER, 0.7)
    visible = length > _SHORTEST
    if not visible.all():
        _smear(ax, ends[~visible].mean(axis=1), (width * length)[~visible], color)
    lines = matplotlib("collections").LineCollection(
        ends[visible],
        colors=color,
        linewidths=width[visible],
        zorder=1,
    )
    lines.set_rasterized(len(edges) > _RASTER_FROM)
    ax.add_collection(lines, autolim=False)


def _smear(ax: Any, middles: NDArray[Any], ink: NDArray[Any], color: str) -> None:
    """Lay the ink of edges too short to be seen on the places where they are, so that the tone goes on evenly."""
    (x0, x1), (y0, y1) = ax.get_xlim(), ax.get_ylim()
    cell = 1.4 / points_per_unit(ax)
    shape = (max(1, math.ceil((x1 - x0) / cell)), max(1, math.ceil((y1 - y0) / cell)))
    laid, _, _ = np.histogram2d(
        middles[:, 0], middles[:, 1], bins=shape, range=np.array([[x0, x1], [y0, y1]]), weights=ink
    )
    image = np.zeros((*laid.T.shape, 4))
    image[...] = matplotlib("colors").to_rgba(color)
    image[..., 3] = np.minimum(laid.T / 1.4**2, 0.7)
    ax.imshow(image, extent=(x0, x1, y0, y1), origin="lower", interpolation="bilinear", aspect="equal", zorder=1)


def draw_facets(ax: Any, mesh: Mesh, weight: float = 1.0) -> None:
    """Draw the boundary dark, facets inside and slits in red."""
    rim = np.asarray(mesh.boundary_facets)
    edges = np.asarray(mesh.topology.facets)
    inside = edges[mesh.topology.n_boundary :]
    slit = _doubled(mesh.points, rim)
    for some, color, width in ((rim[~slit], BOUNDARY, 0.9), (inside, FACET, 1.1), (rim[slit], FACET, 1.1)):
        lines = matplotlib("collections").LineCollection(
            mesh.points[some], colors=color, linewidths=width * weight, zorder=2, capstyle="round"
        )
        lines.set_rasterized(len(some) > _RASTER_FROM)
        ax.add_collection(lines, autolim=False)


def _doubled(points: NDArray[Any], rim: NDArray[Any]) -> Any:
    """Which boundary edges lie on another one: the two banks of a slit."""
    if len(rim) == 0:
        return np.zeros(0, dtype=bool)
    place = np.unique(points, axis=0, return_inverse=True)[1].ravel()
    pairs = np.sort(place[rim], axis=1)
    _, inverse, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    return (count > 1)[inverse.ravel()]


def plot_line(mesh: Mesh, ax: Any, color: str, height: float = 0.0) -> Any:
    """Draw a mesh of one dimension as a line with a stroke for every node."""
    x = np.sort(mesh.points[:, 0])
    ax.plot(x, np.full(len(x), height), "-", color=UNDER, lw=0.8, zorder=1)
    ax.plot(x, np.full(len(x), height), "|", color=color, ms=10, mew=1.0, zorder=2)
    ax.set_yticks([])
    for side in ("left", "right", "top"):
        ax.spines[side].set_visible(False)
    return ax
