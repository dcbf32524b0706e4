"""NetCDF of unstructured grids: the UGRID conventions 1.0, and FVCOM's older layout.

FVCOM has ``nv`` for the cells, counted from 1, and ``lon``/``lat`` or ``x``/``y``.
The attribute ``start_index`` is often wrong in the wild; what the indices say comes first: a 0 in them means 0-based,
the number of nodes in them 1-based, and only where both or neither appear is the attribute believed.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeshError
from .draft import Draft

_MISSING = -1


def _netcdf() -> Any:
    try:
        return importlib.import_module("netCDF4")
    except ImportError:
        raise ImportError("this format needs netCDF4: pip install 'coarsen-mesh[io]'") from None


def read_ugrid(path: Path) -> Draft:
    """Read the first two-dimensional mesh topology of the file."""
    with _netcdf().Dataset(path) as file:
        variables = file.variables
        mesh = next(
            (v for v in variables.values() if _attribute(v, "cf_role") == "mesh_topology"),
            None,
        )
        if mesh is None:
            return _read_fvcom(file, path)
        if int(_attribute(mesh, "topology_dimension", 2)) != 2:
            raise MeshError(f"'{path.name}': topology_dimension {mesh.topology_dimension}, expected 2")
        x, y = _node_coordinates(file, mesh, path)
        name = _attribute(mesh, "face_node_connectivity")
        if name not in variables:
            raise MeshError(f"'{path.name}': the mesh topology names no face_node_connectivity")
        faces = _connectivity(variables[name], len(x), _attribute(mesh, "face_dimension"))
        draft = Draft(np.column_stack([x, y]), _blocks(faces))
        facets = _attribute(mesh, "boundary_node_connectivity") or _attribute(mesh, "edge_node_connectivity")
        tags = variables.get("facet_tags")
        if facets in variables and (facets == _attribute(mesh, "boundary_node_connectivity") or tags is not None):
            draft.facets = _connectivity(variables[facets], len(x), _attribute(mesh, "edge_dimension"))
            draft.facet_tags = None if tags is None else np.asarray(tags[:])
            draft.facet_names = {} if tags is None else _flags(tags)
        node_dim = variables[_attribute(mesh, "node_coordinates").split()[0]].dimensions[0]
        skipped = {
            *_attribute(mesh, "node_coordinates").split(),
            name,
            facets,
            mesh.name,
        }
        _fields(draft, file, node_dim, skipped)
        if "cell_tags" in variables and np.shape(variables["cell_tags"]) == (len(faces),):
            _share(draft, faces, np.asarray(variables["cell_tags"][:]))
            draft.cell_names = _flags(variables["cell_tags"])
        return draft


def _attribute(variable: Any, name: str, default: Any = "") -> Any:
    return variable.getncattr(name) if name in variable.ncattrs() else default


def _node_coordinates(file: Any, mesh: Any, path: Path) -> tuple[Any, Any]:
    names = str(_attribute(mesh, "node_coordinates")).split()
    if len(names) < 2 or any(name not in file.variables for name in names[:2]):
        raise MeshError(f"'{path.name}': node_coordinates names {' '.join(names) or 'nothing'}, expected two variables")
    first, second = names[:2]
    if _is_latitude(file.variables[first]):
        first, second = second, first
    x, y = (np.ma.filled(file.variables[name][:].astype(np.float64), np.nan) for name in (first, second))
    return x, y


def _is_latitude(variable: Any) -> bool:
    return "latitude" in str(_attribute(variable, "standard_name")) or str(_attribute(variable, "units")).startswith(
        "degrees_n"
    )


def _connectivity(variable: Any, n_points: int, rows: str = "") -> Any:
    """(m, k) indices, 0-based, -1 where a row is shorter."""
    values = np.ma.filled(np.ma.masked_invalid(variable[:].astype(np.float64)), np.nan)
    if (rows and variable.dimensions[1] == rows) or (not rows and values.shape[0] <= 4 < values.shape[1]):
        values = values.T
    values[(values < 0) | (values > n_points)] = np.nan  # other marks of shorter rows, such as 999999
    known = values[np.isfinite(values)]
    zero, last = bool((known == 0).any()), bool((known == n_points).any())
    start = int(_attribute(variable, "start_index", 0) or 0)
    if zero != last:
        start = 0 if zero else 1
    return np.where(np.isfinite(values), values - start, _MISSING).astype(np.int64)


def _blocks(faces: Any) -> list[tuple[str, Any, Any]]:
    counts = (faces != _MISSING).sum(axis=1)
    kinds = {3: "triangle", 4: "quad"}
    return [
        (
            kinds.get(int(count), f"polygon of {count} nodes"),
            faces[counts == count][:, : int(count)],
            None,
        )
        for count in np.unique(counts)
    ]


def _share(draft: Draft, faces: Any, tags: Any) -> None:
    counts = (faces != _MISSING).sum(axis=1)
    draft.blocks = [
        (kind, cells, tags[counts == count])
        for (kind, cells, _), count in zip(draft.blocks, np.unique(counts), strict=True)
    ]


def _fields(draft: Draft, file: Any, node_dim: str, skipped: set[str]) -> None:
    """Numeric variables on the nodes; of those over time the last step."""
    for name, variable in file.variables.items():
        if name in skipped or variable.dtype == str or variable.dtype.kind not in "fiu":
            continue
        if variable.dimensions == (node_dim,):
            values = variable[:]
        elif len(variable.dimensions) == 2 and variable.dimensions[1] == node_dim and variable.shape[0]:
            values = variable[-1]
        else:
            continue
        draft.point_data[name] = (
            np.ma.filled(values.astype(np.float64), np.nan) if np.ma.is_masked(values) else np.asarray(values)
        )


def _read_fvcom(file: Any, path: Path) -> Draft:
    variables = file.variables
    pair = next(
        (p for p in (("x", "y"), ("lon", "lat")) if all(name in variables for name in p)),
        None,
    )
    if "nv" not in variables or pair is None:
        raise MeshError(f"'{path.name}': neither a UGRID mesh topology nor FVCOM's nv with x, y or lon, lat")
    if not np.any(variables[pair[0]][:]) and "lon" in variables:  # FVCOM leaves x and y zero in geographic runs
        pair = ("lon", "lat")
    x, y = (np.asarray(variables[name][:], dtype=np.float64) for name in pair)
    cells = variables["nv"]
    rows = cells.dimensions[1] if cells.shape[0] == 3 else ""  # FVCOM's own order is (three, nele)
    draft = Draft(np.column_stack([x, y]), _blocks(_connectivity(cells, len(x), rows)))
    _fields(draft, file, variables[pair[0]].dimensions[0], {"x", "y", "lon", "lat", "nv"})
    if "h" in draft.point_data:
        draft.point_data["depth"] = draft.point_data.pop("h")
    return draft


def write_ugrid(draft: Draft, path: Path) -> None:
    """Write UGRID 1.0, 0-based, with nodal fields on the nodes."""
    cells, tags = draft.blocks[0][1:]
    if cells.shape[1] != 3:
        raise MeshError("this format holds triangles only")
    with _netcdf().Dataset(path, "w", format="NETCDF4") as file:
        file.Conventions = "CF-1.8 UGRID-1.0"
        for name, size in (
            ("node", len(draft.points)),
            ("face", len(cells)),
            ("three", 3),
            ("two", 2),
        ):
            file.createDimension(name, size)
        mesh = file.createVariable("mesh", "i4", ())
        mesh.setncatts(
            {
                "cf_role": "mesh_topology",
                "topology_dimension": np.int32(2),
                "node_coordinates": "node_x node_y",
                "face_node_connectivity": "face_nodes",
                "face_dimension": "face",
            }
        )
        for name, column in zip(("node_x", "node_y"), draft.points.T, strict=True):
            file.createVariable(name, "f8", ("node",))[:] = column
        _indices(file, "face_nodes", ("face", "three"), cells)
        if tags is not None:
            _write_tags(file, "cell_tags", "face", tags, draft.cell_names)
        if draft.facets is not None and len(draft.facets):
            file.createDimension("facet", len(draft.facets))
            mesh.boundary_node_connectivity = "facet_nodes"
            _indices(file, "facet_nodes", ("facet", "two"), draft.facets)
            if draft.facet_tags is not None:
                _write_tags(file, "facet_tags", "facet", draft.facet_tags, draft.facet_names)
        for name, values in draft.point_data.items():
            columns = np.asarray(values).reshape(len(draft.points), -1).T
            for k, column in enumerate(columns):
                field = file.createVariable(
                    name if len(columns) == 1 else f"{name}_{k}",
                    column.dtype,
                    ("node",),
                )
                field.setncatts({"mesh": "mesh", "location": "node"})
                field[:] = column


def _write_tags(file: Any, name: str, dimension: str, tags: Any, names: dict[int, str]) -> None:
    """Write tags, and their names as the flags of the CF conventions, which are words."""
    variable = file.createVariable(name, "i8", (dimension,))
    variable[:] = tags
    if names:
        variable.flag_values = np.array(list(names), np.int64)
        variable.flag_meanings = " ".join("_".join(text.split()) or "_" for text in names.values())


def _flags(variable: Any) -> dict[int, str]:
    values = np.atleast_1d(_attribute(variable, "flag_values", []))
    return dict(zip(values.tolist(), str(_attribute(variable, "flag_meanings")).split(), strict=False))


def _indices(file: Any, name: str, dimensions: tuple[str, str], values: Any) -> None:
    variable = file.createVariable(name, "i8", dimensions)
    variable.start_index = np.int64(0)
    variable[:] = values
