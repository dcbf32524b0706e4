"""The bridge to meshio: every format it knows, with tags, names and nodal fields.

meshio prints, exits and raises all sorts of errors on files it cannot take; here each becomes one
:class:`coarsen.MeshError` of one line.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import logging
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeshError
from ..mesh import Mesh
from .draft import Draft, drafted

log = logging.getLogger("coarsen")

_TAG_NAMES = (
    "cell_tags",
    "gmsh:physical",
    "medit:ref",
    "su2:tag",
    "netgen:index",
    "avsucd:material",
    "flac3d:group",
    "nastran:ref",
    "ugrid:ref",
    "tetgen:ref",
    "cell_markers",
    "MaterialIDs",
    "MaterialIds",
    "CellEntityIds",
    "markers",
    "gmsh:geometrical",
)
"""Names under which formats keep the tags of cells, in the order they are looked for."""

_OWN_TAG = {
    "gmsh": "gmsh:physical",
    "gmsh22": "gmsh:physical",
    "medit": "medit:ref",
    "netgen": "netgen:index",
}
_OWN_TAG |= {
    "avsucd": "avsucd:material",
    "su2": "su2:tag",
    "tetgen": "tetgen:ref",
    "flac3d": "flac3d:group",
}
_TRIANGLES_ONLY = {"obj", "off", "stl", "svg", "wkt", "tecplot", "hmf"}
"""Formats without edges, or whose edges meshio cannot read back."""
_FLAT_FORMATS = {"su2", "xdmf", "dolfin-xml", "medit", "svg"}


def meshio() -> Any:
    """Return the module, or say how to get it.

    Raises
    ------
    ImportError
        If meshio is not installed.
    """
    try:
        return importlib.import_module("meshio")
    except ImportError:
        raise ImportError("this format needs meshio: pip install 'coarsen-mesh[io]'") from None


def extensions(*, write: bool = False) -> dict[str, list[str]]:
    """File name endings meshio reads or writes, and its formats of each; empty without meshio."""
    try:
        helpers = importlib.import_module(meshio().__name__ + "._helpers")
    except ImportError:
        return {}
    able = helpers._writer_map if write else helpers.reader_map
    kept = {end: [f for f in formats if f in able] for end, formats in helpers.extension_to_filetypes.items()}
    return {ending: formats for ending, formats in kept.items() if formats}


def from_meshio(other: Any, *, split_quads: bool = False, repair: bool = False, tags: str | None = None) -> Mesh:
    """Make a mesh of a ``meshio.Mesh``.

    Triangles become cells, lines facets; ``gmsh:physical`` and its kin become tags; point data is carried along. A
    constant height is dropped.

    Parameters
    ----------
    other : meshio.Mesh
    split_quads : bool
        Cut quadrilaterals along their shorter diagonals; without it they raise.
    repair : bool
        Mend what :meth:`coarsen.Mesh.repaired` can.
    tags : str, optional
        Name of the cell data that are the tags, where it is none of the usual ones.

    Raises
    ------
    MeshError
        If it is no legal mesh of triangles, or has no such cell data of whole numbers.
    """
    return draft_from_meshio(other, tags).mesh(split_quads=split_quads, repair=repair)[0]


def draft_from_meshio(other: Any, name: str | None = None) -> Draft:
    """Sort what a ``meshio.Mesh`` holds into a draft, with the cell data `name` as tags."""
    tags = _tags(other, name)
    solid = {"triangle", "quad", "triangle6", "triangle7", "quad8", "quad9"} & {block.type for block in other.cells}
    draft = Draft(np.asarray(other.points), [], point_data={})
    facets, facet_tags = [], []
    for block, tag in zip(other.cells, tags, strict=True):
        kind, cells = block.type, np.asarray(block.data)
        if kind == "vertex" or len(cells) == 0:
            continue
        if kind.startswith("line") and solid:
            facets.append(cells[:, :2])
            facet_tags.append(np.zeros(len(cells), dtype=np.int64) if tag is None else tag)
        elif kind == "polygon":
            kind = {3: "triangle", 4: "quad"}.get(cells.shape[1], f"polygon{cells.shape[1]}")
            draft.blocks.append((kind, cells, tag))
        else:
            draft.blocks.append((kind, cells, tag))
    if facets:
        draft.facets, draft.facet_tags = (
            np.concatenate(facets),
            np.concatenate(facet_tags),
        )
        if not draft.facet_tags.any():
            draft.facet_tags = None
    if not any(np.any(tag) for _, _, tag in draft.blocks if tag is not None):  # zero stands for none
        draft.blocks = [(kind, cells, None) for kind, cells, _ in draft.blocks]
    draft.point_data = {
        name: np.asarray(values)
        for name, values in other.point_data.items()
        if not name.startswith(("gmsh:", "medit:"))
    }
    _name(draft, other, name)
    return draft


def _name(draft: Draft, other: Any, tags: str | None) -> None:
    """Give the draft the names of its tags: gmsh's physical names, MED's families, sets that became tags."""
    for name, (tag, dim) in _names(other).items():
        {1: draft.facet_names, 2: draft.cell_names}.get(dim, {})[tag] = name
    families = {int(tag): ", ".join(names) for tag, names in getattr(other, "cell_tags", {}).items() if names}
    families |= {} if _numbered(other, tags) else dict(enumerate(_sets(other), 1))
    of_cells = [tags for _, _, tags in draft.blocks if tags is not None]
    for names, found in (
        (draft.cell_names, np.concatenate(of_cells) if of_cells else np.zeros(0)),
        (draft.facet_names, np.zeros(0) if draft.facet_tags is None else draft.facet_tags),
    ):
        names.update({tag: name for tag, name in families.items() if np.any(found == tag)})


def _names(other: Any) -> dict[str, tuple[int, int]]:
    """Names of tags and the dimension they belong to, from gmsh's physical names."""
    names = {}
    for name, value in (other.field_data or {}).items():
        pair = np.asarray(value).ravel()
        if pair.size == 2 and np.issubdtype(pair.dtype, np.integer):
            names[str(name)] = (int(pair[0]), int(pair[1]))
    return names


def _tags(other: Any, chosen: str | None) -> list[Any]:
    """Return the tags of every block: of the first name that has whole numbers, or of sets that do not overlap."""
    if numbered := _numbered(other, chosen):
        return numbered
    sets = _sets(other)
    if not sets:
        return [None] * len(other.cells)
    tags = [np.zeros(len(block.data), dtype=np.int64) for block in other.cells]
    for number, blocks in enumerate(sets.values(), 1):
        for tag, members in zip(tags, blocks, strict=False):
            if members is not None and len(members):
                tag[np.asarray(members, dtype=np.int64)] = number
    return tags


def _numbered(other: Any, chosen: str | None) -> list[Any]:
    """Return the tags of every block that stand in the file as numbers, or nothing."""
    found: list[Any] = []
    for name in _TAG_NAMES if chosen is None else (chosen,):
        values = [np.asarray(value) for value in other.cell_data.get(name, [])]
        whole = bool(values) and all(value.ndim == 1 and _whole(value) for value in values)
        if whole and (chosen is not None or any(np.any(value) for value in values)):
            chosen, found = name, [value.astype(np.int64) for value in values]
            break
    others = sorted(name for name in other.cell_data if name != chosen and not name.startswith("gmsh:"))
    if chosen is not None and not found:
        there = f"only {', '.join(map(repr, others))}" if others else "none at all"
        what = "is not of whole numbers" if chosen in other.cell_data else f"is not among the cell data, {there}"
        raise MeshError(f"'tags' is {chosen!r}, which {what}")
    if others:
        log.info("cell data left out: %s (read(path, tags=...) takes one for the tags)", ", ".join(others))
    return found


def _sets(other: Any) -> dict[str, Any]:
    return {name: blocks for name, blocks in (other.cell_sets or {}).items() if not name.startswith("gmsh:")}


def _whole(values: Any) -> bool:
    if np.issubdtype(values.dtype, np.integer):
        return True
    return bool(np.issubdtype(values.dtype, np.floating) and np.all(values == np.round(values)))


def to_meshio(mesh: Mesh) -> Any:
    """Return a ``meshio.Mesh``: cells, given facets, ``cell_tags`` as cell data of both, nodal fields as point data."""
    return meshio_from_draft(drafted(mesh))


def meshio_from_draft(draft: Draft, tag_name: str = "cell_tags") -> Any:
    """Turn a draft into a ``meshio.Mesh`` with its tags under `tag_name`."""
    blocks = list(draft.blocks)
    if draft.facets is not None and len(draft.facets):
        blocks.append(("line", draft.facets, draft.facet_tags))
    cell_data = {}
    if any(tags is not None for _, _, tags in blocks):
        cell_data[tag_name] = [np.zeros(len(cells), np.int64) if tags is None else tags for _, cells, tags in blocks]
        if tag_name == "gmsh:physical":  # the format wants both
            cell_data["gmsh:geometrical"] = cell_data[tag_name]
    dim = 2 if any(np.shape(cells)[1] > 2 for _, cells, _ in draft.blocks) else 1
    names = {name: np.array([tag, dim]) for tag, name in draft.cell_names.items()}
    for tag, name in draft.facet_names.items():  # meshio has one name for one group, gmsh one for each dimension
        names[f"{name} (facets)" if name in names else name] = np.array([tag, dim - 1])
    return meshio().Mesh(
        np.array(draft.points),
        [(kind, np.asarray(cells)) for kind, cells, _ in blocks],
        point_data={name: np.asarray(values) for name, values in draft.point_data.items()},
        cell_data=cell_data,
        field_data=names,
    )


def read_through_meshio(path: Path, tags: str | None = None) -> Draft:
    """Read any format meshio knows, with the cell data `tags` as tags."""
    return draft_from_meshio(_quietly(path, "read", lambda: meshio().read(path)), tags)


def write_through_meshio(draft: Draft, path: Path) -> None:
    """Write the format that meshio keeps for the ending of `path`."""
    name = path.name.lower()
    formats = next(formats for ending, formats in extensions(write=True).items() if name.endswith(ending))
    # version 2.2 holds edges and triangles with their tags as they are; 4.1 wants a geometry that we do not have
    chosen = "gmsh22" if "gmsh" in formats else formats[0]
    if chosen in _TRIANGLES_ONLY:
        draft = replace(draft, facets=None)
    other = meshio_from_draft(draft, _OWN_TAG.get(chosen, "cell_tags"))
    missing = 3 - other.points.shape[1]
    if missing > 0 and not (chosen in _FLAT_FORMATS and missing == 1):
        other.points = np.pad(other.points, ((0, 0), (0, missing)))
    options: dict[str, Any] = {"data_format": "XML"} if chosen == "xdmf" else {}  # one file, not two
    _quietly(
        path,
        "write",
        lambda: meshio().write(path, other, file_format=chosen, **options),
    )


def _quietly(path: Path, what: str, act: Callable[[], Any]) -> Any:
    said = io.StringIO()
    try:
        with (
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore")
            return act()
    except (ImportError, MemoryError, MeshError, OSError):
        raise
    except (
        Exception,
        SystemExit,
    ) as error:  # whatever a parser of a broken file may raise
        reason = str(error) if str(error) and not isinstance(error, SystemExit) else said.getvalue()
        reason = " ".join(reason.split()) or type(error).__name__
        raise MeshError(f"'{path.name}': meshio cannot {what} it: {reason[:200]}") from None
