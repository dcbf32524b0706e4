"""NumPy archives: our own layout, and the looser ones people keep their meshes in.

Own keys: ``points``, ``cells``, ``facets``, ``facet_tags``, ``cell_tags``, ``point_data:NAME``,
``facet_names``/``cell_names`` (a (k,) array of tags and one of names). Also read: ``triangles``, ``quads``, ``tetra``
for cells, ``segments``, ``segment_markers`` and ``segment_names`` for facets; any other array with one row a node is
a nodal field.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeshError
from .draft import Draft

HIERARCHY_KEY = "coarsen_hierarchy"
_FIELD = "point_data:"
_CELLS = {
    "triangles": "triangle",
    "quads": "quad",
    "tetra": "tetra",
    "tetrahedra": "tetra",
    "lines": "line",
}
_KNOWN = {
    "points",
    "cells",
    "facets",
    "facet_tags",
    "cell_tags",
    "segments",
    "segment_markers",
    "segment_names",
}
_NOT_NODAL = {"weir_pairs"}


def arrays_of(path: Path) -> dict[str, np.ndarray[Any, Any]]:
    """All arrays of an archive, without pickled objects."""
    with path.open("rb") as file:
        try:
            with np.load(file, allow_pickle=False) as archive:
                if not isinstance(archive, np.lib.npyio.NpzFile):
                    raise MeshError(f"'{path.name}': not an archive of named arrays")
                return {name: archive[name] for name in archive.files}
        except (MeshError, MemoryError):
            raise
        except Exception as error:  # zip, zlib and NumPy's own parser raise all sorts of them on damaged bytes
            reason = " ".join(str(error).split())[:200] or type(error).__name__
            raise MeshError(f"'{path.name}': not a readable NumPy archive: {reason}") from None


def read_npz(path: Path) -> Draft:
    """Read any of the layouts above."""
    arrays = arrays_of(path)
    if HIERARCHY_KEY in arrays:
        raise MeshError(f"'{path.name}' holds a whole hierarchy: coarsen.load(path) reads it")
    if "points" not in arrays:
        raise MeshError(f"'{path.name}': no array 'points' in it, only {', '.join(sorted(arrays)) or 'nothing'}")
    draft = Draft(arrays["points"], [])
    tags = arrays.get("cell_tags")
    kinds = {2: "line", 3: "triangle", 4: "tetra"}
    for name, cells in arrays.items():
        if name == "cells" and cells.ndim == 2:
            draft.blocks.append(
                (
                    kinds.get(cells.shape[1], f"cells of {cells.shape[1]} nodes"),
                    cells,
                    None,
                )
            )
        elif name in _CELLS:
            draft.blocks.append((_CELLS[name], cells, None))
    if not draft.blocks:
        raise MeshError(f"'{path.name}': no array 'cells' or 'triangles' in it, only {', '.join(sorted(arrays))}")
    if tags is not None:
        _share_tags(draft, tags, path)
    draft.facets = arrays.get("facets", arrays.get("segments"))
    draft.facet_tags = arrays.get("facet_tags", arrays.get("segment_markers"))
    if "segment_names" in arrays:
        draft.facet_names = {number: str(name) for number, name in enumerate(arrays["segment_names"])}
    for which, names in (
        ("facet_names", draft.facet_names),
        ("cell_names", draft.cell_names),
    ):
        if which in arrays:
            numbers = arrays[which + ":tags"].tolist()
            names.update(zip(numbers, (str(name) for name in arrays[which]), strict=True))
    for name, values in arrays.items():
        if name.startswith(_FIELD):
            draft.point_data[name.removeprefix(_FIELD)] = values
        elif (
            name not in _KNOWN | _NOT_NODAL | _CELLS.keys()
            and values.ndim >= 1
            and len(values) == len(draft.points)
            and values.dtype.kind in "fiub"
        ):
            draft.point_data[name] = values
    return draft


def _share_tags(draft: Draft, tags: np.ndarray[Any, Any], path: Path) -> None:
    total = sum(len(cells) for _, cells, _ in draft.blocks)
    if len(tags) != total:
        raise MeshError(f"'{path.name}': 'cell_tags' has {len(tags)} entries, expected {total}, one a cell")
    starts = np.cumsum([0] + [len(cells) for _, cells, _ in draft.blocks])
    draft.blocks = [
        (kind, cells, tags[start : start + len(cells)])
        for (kind, cells, _), start in zip(draft.blocks, starts, strict=False)
    ]


def write_npz(draft: Draft, path: Path) -> None:
    """Write our own layout, compressed."""
    (_, cells, tags) = draft.blocks[0]
    arrays = {"points": draft.points, "cells": cells, "cell_tags": tags}
    arrays |= {"facets": draft.facets, "facet_tags": draft.facet_tags}
    arrays |= {_FIELD + name: values for name, values in draft.point_data.items()}
    for which, names in (
        ("facet_names", draft.facet_names),
        ("cell_names", draft.cell_names),
    ):
        if names:
            arrays |= {
                which: np.array(list(names.values())),
                which + ":tags": np.array(list(names)),
            }
    np.savez_compressed(path, allow_pickle=False, **{k: v for k, v in arrays.items() if v is not None})
