"""Views to turn, zoom and pick in: meshes as PyVista's grids, hierarchies as linked windows (where it is installed)."""

from __future__ import annotations

import importlib
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .levels import columns_for
from .meshes import BOUNDARY, FACET, INK

if TYPE_CHECKING:
    from ..mesh import Mesh
    from ..multilevel import Hierarchy, Level

_VTK_LINE, _VTK_TRIANGLE = 3, 5
_SIZE = 520  # pixels of one level's window
_BAR = {"n_labels": 3, "fmt": "%.2g", "position_x": 0.25, "position_y": 0.01, "width": 0.5, "height": 0.05}
_BAR |= {"title_font_size": 12, "label_font_size": 12}


def pyvista() -> Any:
    """Return the module, or say how to get it.

    Raises
    ------
    ImportError
        If PyVista is not installed.
    """
    try:
        return importlib.import_module("pyvista")
    except ImportError:
        raise ImportError("views need PyVista: pip install pyvista") from None


def grid_of(mesh: Mesh, fields: Mapping[str, Any] | None = None) -> Any:
    """Return a mesh as ``pyvista.UnstructuredGrid``, flat at z = 0.

    Parameters
    ----------
    mesh : Mesh
    fields : mapping of str to (n, ...) array, optional
        More nodal fields.

    Returns
    -------
    pyvista.UnstructuredGrid
        Of triangles (of lines where d = 1), with nodal fields as point data and ``cell_tags`` as cell data.
    """
    points = np.zeros((mesh.n_points, 3))
    points[:, : mesh.dim] = mesh.points
    kind = _VTK_TRIANGLE if mesh.dim == 2 else _VTK_LINE
    grid = pyvista().UnstructuredGrid({kind: np.asarray(mesh.cells, dtype=np.int64)}, points)
    for name, values in {**(mesh.point_data or {}), **(fields or {})}.items():
        grid.point_data[name] = np.array(values)
    if mesh.cell_tags is not None:
        grid.cell_data["cell_tags"] = np.array(mesh.cell_tags)
    return grid


def level_grid(level: Level) -> Any:
    """Return a level as ``pyvista.UnstructuredGrid``, with ``node`` and ``spacing`` as point data."""
    return grid_of(level.mesh, {"node": level.nodes, "spacing": level.spacing})


def view_mesh(mesh: Mesh, scalars: str | None = None, *, path: str | os.PathLike[str] | None = None) -> Any:
    """Show a mesh in a window, or in a notebook.

    Parameters
    ----------
    mesh : Mesh
    scalars : str, optional
        The field that colours it: a name of `point_data`, or ``"cell_tags"``, which is the default where there are any.
    path : path, optional
        Draw into this picture, off screen, and show nothing.

    Returns
    -------
    pyvista.Plotter

    Raises
    ------
    ValueError
        If there is no such field.
    """
    shown = scalars or ("cell_tags" if mesh.cell_tags is not None else None)
    return _view([(mesh, grid_of(mesh), "")], shown, 1, path)


def view_hierarchy(
    h: Hierarchy,
    scalars: str | None = "spacing",
    *,
    levels: Sequence[int] | None = None,
    columns: int | None = None,
    path: str | os.PathLike[str] | None = None,
) -> Any:
    """Show the levels side by side, one camera for all.

    Parameters
    ----------
    h : Hierarchy
    scalars : str, optional
        The field that colours them: ``"spacing"``, ``"node"``, ``"cell_tags"`` or a name of `point_data`; or None.
    levels : sequence of int, optional
        Which; all by default.
    columns : int, optional
        Windows in a row.
    path : path, optional
        Draw into this picture, off screen, and show nothing.

    Returns
    -------
    pyvista.Plotter

    Raises
    ------
    ValueError
        If there is no such field.
    """
    chosen = range(len(h)) if levels is None else levels
    grids = [(h[i].mesh, level_grid(h[i]), f"level {i}: {h[i].mesh.n_points} nodes") for i in chosen]
    return _view(grids, scalars, columns or columns_for(len(grids)), path)


def _view(grids: list[tuple[Mesh, Any, str]], scalars: str | None, columns: int, path: Any) -> Any:
    names = [*grids[0][1].point_data.keys(), *grids[0][1].cell_data.keys()]
    if scalars is not None and scalars not in names:
        known = f"one of {', '.join(map(repr, names))}, or None" if names else "None: the mesh has no fields"
        raise ValueError(f"'scalars' is {scalars!r}, expected {known}")
    rows = -(-len(grids) // columns)
    size = [_SIZE * columns, _SIZE * rows]
    plotter = pyvista().Plotter(
        shape=(rows, columns), window_size=size, off_screen=path is not None or None, border=False
    )
    values = [] if scalars is None else [np.asarray(grid[scalars], dtype=np.float64) for _, grid, _ in grids]
    low = min((float(np.nanmin(value)) for value in values), default=0.0)
    high = max((float(np.nanmax(value)) for value in values), default=0.0)
    for k, (mesh, grid, title) in enumerate(grids):
        plotter.subplot(*divmod(k, columns))
        style: dict[str, Any] = {"color": "white"}
        if scalars is not None:
            log = low > 0 and high > 100 * low
            style = {"scalars": scalars, "clim": [low, high], "cmap": "YlGnBu_r", "log_scale": log}
            style |= {"show_scalar_bar": k == len(grids) - 1, "scalar_bar_args": _BAR}
        plotter.add_mesh(grid, show_edges=True, edge_color=INK, line_width=0.5, lighting=False, **style)
        if mesh.dim == 2:
            _add_facets(plotter, mesh, grid.points)
        if title:
            plotter.add_text(title, font_size=8, color=INK)
        plotter.view_xy()
    plotter.link_views()
    plotter.subplot(0, 0)
    plotter.enable_parallel_projection()
    plotter.camera.zoom(1.1)
    if path is None:
        plotter.show()
    else:
        plotter.screenshot(os.fspath(path))
    return plotter


def _add_facets(plotter: Any, mesh: Mesh, points: Any) -> None:
    """Draw the boundary dark, facets inside in red."""
    topology = mesh.topology
    rim, inside = topology.facets[: topology.n_boundary], topology.facets[topology.n_boundary :]
    for facets, color in ((rim, BOUNDARY), (inside, FACET)):
        if len(facets):
            lines = np.column_stack([np.full(len(facets), 2), facets]).ravel()
            plotter.add_mesh(pyvista().PolyData(points, lines=lines), color=color, line_width=2, lighting=False)
