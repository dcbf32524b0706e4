"""Whole hierarchies: a folder with one file a level that ParaView opens as a series, or one archive, bit for bit.

The archive keeps the points once and of each level what cannot be taken from the finest: nodes, cells, spacing and
the topology of its facets. Loading checks shapes and index ranges, not the geometry again.
"""

from __future__ import annotations

import dataclasses
import json
import os
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import MeshError
from ..mesh import Mesh, Topology
from .aside import aside, folder_aside
from .draft import drafted
from .files import Family, family_of, read, readable
from .npz import HIERARCHY_KEY, arrays_of

if TYPE_CHECKING:
    from ..multilevel import Hierarchy, Level

VERSION = 1
_MESH_ARRAYS = ("cells", "facets", "facet_tags", "cell_tags")


def write_hierarchy(h: Hierarchy, folder: str | os.PathLike[str], format: str = "vtu") -> list[Path]:
    """Write one file a level, with ``node``, ``spacing``, tags and nodal fields as data, and a series for ParaView.

    Parameters
    ----------
    h : Hierarchy
    folder : path
        Made where it is missing; files of the same names are replaced, all at once at the end.
    format : str
        A file name ending :func:`coarsen.read` knows: ``"vtu"``, ``"vtk"``, ``"msh"``, ``"npz"``, ``"xdmf"``, ….

    Returns
    -------
    list of Path
        The files: the levels', finest first, then ``levels.pvd`` (vtu) and ``levels.vtu.series`` or
        ``levels.vtk.series``.

    Raises
    ------
    ValueError
        If the format is unknown.
    """
    ending = "." + format.lstrip(".").lower()
    family = family_of_format(format)
    folder = Path(folder)
    width = len(str(len(h) - 1))
    names = [f"level_{i:0{width}d}{ending}" for i in range(len(h))]
    with folder_aside(folder, (f"level_*{ending}",)) as place:
        for level, name in zip(h, names, strict=True):
            draft = drafted(level.mesh)
            draft.point_data = {
                **draft.point_data,
                "node": level.nodes,
                "spacing": level.spacing,
            }
            family.write(draft, place / name)
        names += _write_series(h, place, names, ending)
    return [folder / name for name in names]


def family_of_format(format: str) -> Family:
    """Return the family that writes files with this ending.

    Raises
    ------
    ValueError
        If there is none.
    """
    try:
        return family_of(Path(f"level.{format.lstrip('.').lower()}"), write=True)
    except MeshError as error:
        expected = str(error).partition("expected ")[2]
        raise ValueError(f"'format' is {format!r}, expected {expected}") from None


def _write_series(h: Hierarchy, folder: Path, names: list[str], ending: str) -> list[str]:
    written = []
    if ending == ".vtu":
        rows = "".join(f'    <DataSet timestep="{i}" part="0" file="{name}"/>\n' for i, name in enumerate(names))
        kind = 'type="Collection" version="0.1" byte_order="LittleEndian"'
        text = f'<?xml version="1.0"?>\n<VTKFile {kind}>\n  <Collection>\n{rows}  </Collection>\n</VTKFile>\n'
        (folder / "levels.pvd").write_text(text, encoding="utf-8")
        written.append("levels.pvd")
    if ending in (".vtu", ".vtk"):
        files = [{"name": name, "time": i} for i, name in enumerate(names)]
        series = json.dumps({"file-series-version": "1.0", "files": files}, indent=1)
        (folder / f"levels{ending}.series").write_text(series, encoding="utf-8")
        written.append(f"levels{ending}.series")
    return written


def read_levels(folder: str | os.PathLike[str]) -> list[Level]:
    """Read the levels of a folder that :func:`write_hierarchy` made: meshes, nodes and spacing, to look at.

    Raises
    ------
    MeshError
        If there are none.
    """
    from ..multilevel import Level

    folder = Path(folder)
    files = sorted(file for file in folder.glob("level_*") if file.suffix.lower() in readable())
    if not files:
        raise MeshError(f"'{folder}' holds no levels: coarsen build or Hierarchy.write make such a folder")
    levels = []
    for file in files:
        mesh = read(file)
        fields = dict(mesh.point_data or {})
        nodes = np.asarray(fields.get("node", np.arange(mesh.n_points)), dtype=np.int64)
        levels.append(Level(mesh, nodes, float("nan"), np.asarray(fields.get("spacing", np.ones(mesh.n_points)))))
    return levels


def save_hierarchy(h: Hierarchy, path: str | os.PathLike[str], *, operators: bool = False) -> None:
    """Write the whole hierarchy to one ``.npz``; :func:`load_hierarchy` reads it back bit for bit.

    Parameters
    ----------
    h : Hierarchy
    path : path
        Written aside and renamed: there whole or not at all.
    operators : bool
        Keep the prolongations too (``prolongation:I:data``, ``:indices``, ``:indptr``).
    """
    options = dataclasses.asdict(h.options)
    arrays: dict[str, Any] = {"points": h[0].mesh.points}
    for name, values in (h[0].mesh.point_data or {}).items():
        arrays[f"point_data:{name}"] = values
    levels = []
    for i, level in enumerate(h):
        mesh, topology = level.mesh, level.mesh.topology
        arrays |= {f"{i}:nodes": level.nodes, f"{i}:spacing": level.spacing}
        arrays |= {f"{i}:{name}": getattr(mesh, name) for name in _MESH_ARRAYS}
        for field in dataclasses.fields(topology):
            if field.name != "n_boundary":
                arrays[f"{i}:topology:{field.name}"] = getattr(topology, field.name)
        levels.append(
            {
                "factor": level.factor,
                "visits": level.visits,
                "dropped": level.dropped,
                "n_boundary": topology.n_boundary,
            }
        )
        if operators and i:
            matrix = h.prolongation(i)
            arrays |= {f"prolongation:{i}:{part}": getattr(matrix, part) for part in ("data", "indices", "indptr")}
    for name, value in options.items():
        if isinstance(value, np.ndarray):
            arrays[f"option:{name}"] = value
            options[name] = None
        elif callable(value):
            options[name] = None  # a function cannot be kept; what it gave is in the levels' spacing
    head = {
        "version": VERSION,
        "stopped": h.stopped,
        "options": options,
        "levels": levels,
        "facet_names": h[0].mesh.facet_names,
        "cell_names": h[0].mesh.cell_names,
    }
    arrays[HIERARCHY_KEY] = np.array(json.dumps(head))
    with aside(path) as place:
        _save({name: np.asanyarray(array) for name, array in arrays.items() if array is not None}, place)


def _save(arrays: dict[str, Any], path: Path) -> None:
    """Write an archive as NumPy does, with the quickest compression: its own takes four times as long."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as out:
                np.lib.format.write_array(out, array, allow_pickle=False)


def holds_hierarchy(path: str | os.PathLike[str]) -> bool:
    """Whether the archive was made by :func:`save_hierarchy`."""
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as archive:
            return HIERARCHY_KEY in getattr(archive, "files", ())
    except (OSError, ValueError, zipfile.BadZipFile):
        return False


def load_hierarchy(path: str | os.PathLike[str]) -> Hierarchy:
    """Read what :func:`save_hierarchy` wrote.

    Raises
    ------
    MeshError
        If the file holds no hierarchy or is damaged.
    FileNotFoundError
        If there is none.
    """
    path = Path(path)
    arrays = arrays_of(path)
    if HIERARCHY_KEY not in arrays:
        raise MeshError(f"'{path.name}' holds no hierarchy (coarsen.read reads single meshes)")
    try:
        return _assembled(arrays)
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise MeshError(f"'{path.name}': a damaged hierarchy: {' '.join(str(error).split())}") from None


def _assembled(arrays: dict[str, Any]) -> Hierarchy:
    from ..multilevel import Hierarchy, Level
    from ..options import Options

    head = json.loads(str(arrays[HIERARCHY_KEY]))
    if head["version"] != VERSION:
        raise ValueError(f"layout {head['version']}, this version reads {VERSION}")
    points = arrays["points"]
    fields = {name.partition(":")[2]: array for name, array in arrays.items() if name.startswith("point_data:")}
    names = {
        which: {int(tag): str(name) for tag, name in (head.get(which) or {}).items()}
        for which in ("facet_names", "cell_names")
    }
    levels = []
    for i, told in enumerate(head["levels"]):
        nodes = arrays[f"{i}:nodes"]
        _check_range(f"{i}:nodes", nodes, len(points))
        cells = arrays[f"{i}:cells"]
        _check_range(f"{i}:cells", cells, len(nodes))
        parts: dict[str, Any] = {
            field.name: arrays.get(f"{i}:topology:{field.name}")
            for field in dataclasses.fields(Topology)
            if field.name != "n_boundary"
        }
        _check_range(f"{i}:topology:facets", parts["facets"], len(nodes))
        mesh = Mesh._trusted(
            points if i == 0 else points[nodes],
            cells,
            Topology(**parts, n_boundary=int(told["n_boundary"])),
            facets=arrays.get(f"{i}:facets"),
            facet_tags=arrays.get(f"{i}:facet_tags"),
            cell_tags=arrays.get(f"{i}:cell_tags"),
            point_data={name: values if i == 0 else values[nodes] for name, values in fields.items()} or None,
            **names,
        )
        levels.append(
            Level(
                mesh,
                nodes,
                told["factor"],
                arrays[f"{i}:spacing"],
                told["visits"],
                told["dropped"],
            )
        )
    options = head["options"]
    options |= {name.partition(":")[2]: array for name, array in arrays.items() if name.startswith("option:")}
    if options.get("spacing", "nearest") is None:
        options["spacing"] = "nearest"
    return Hierarchy(levels, head["stopped"], Options(**options))


def _check_range(name: str, values: Any, end: int) -> None:
    if len(values) and (values.min() < 0 or values.max() >= end):
        raise ValueError(f"'{name}' runs from {values.min()} to {values.max()}, expected 0 to {end - 1}")
