"""Shewchuk's Triangle: ``NAME.node``, ``NAME.ele``, and ``NAME.poly`` or ``NAME.edge`` for facets, side by side.

Attributes of nodes become the nodal fields ``attribute``, ``attribute:1``, …; the first attribute of a cell, where it
is whole, its tag; markers of segments (edges) their facet tags.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeshError
from .draft import Draft
from .numbers import reals, whole


def _table(path: Path) -> tuple[list[int], list[list[str]]]:
    """Return the head of whole numbers and the rows after it, without comments."""
    lines = (line.split("#")[0].split() for line in path.read_text(encoding="utf-8", errors="replace").splitlines())
    rows = [line for line in lines if line]
    if not rows:
        raise MeshError(f"'{path.name}': empty")
    return [int(word) for word in rows[0]], rows[1:]


def _numbers(path: Path, rows: list[list[str]], count: int, width: int) -> np.ndarray[Any, Any]:
    if not 0 <= count <= len(rows):
        raise MeshError(f"'{path.name}': {count} rows were announced, {len(rows)} follow")
    return reals(rows[:count], width, f"'{path.name}': row")


def read_triangle(path: Path) -> Draft:
    """Read the files that share the name of `path` up to its ending."""
    stem = path.with_suffix("")
    node, ele, poly, edge = (Path(f"{stem}{ending}") for ending in (".node", ".ele", ".poly", ".edge"))
    for needed in (node, ele):
        if not needed.exists():
            raise MeshError(f"'{path.name}': '{needed.name}' is missing beside it; a mesh needs .node and .ele")
    (count, dim, n_attributes, *markers), rows = _table(node)
    if dim != 2:
        raise MeshError(
            f"'{node.name}': dimension {dim}: a mesh of solids (TetGen); coarsen takes triangles in the plane"
        )
    table = _numbers(node, rows, count, 3 + n_attributes + bool(markers and markers[0]))
    first = int(whole(table[:1, 0], f"'{node.name}': the first number")[0]) if count else 0
    head, rows = _table(ele)
    n_cells, corners, n_tags = (*head, 0, 0)[:3]
    cells = _numbers(ele, rows, n_cells, 1 + corners + n_tags)
    kind = {3: "triangle", 6: "triangle6", 4: "tetra"}.get(corners, f"cells of {corners} nodes")
    tags = cells[:, 1 + corners] if n_tags else None
    if tags is not None and not np.array_equal(tags, np.round(tags)):
        tags = None
    draft = Draft(
        table[:, 1:3].copy(),
        [
            (
                kind,
                whole(cells[:, 1 : 1 + corners], f"'{ele.name}': the cells") - first,
                None if tags is None else tags.astype(np.int64),
            )
        ],
    )
    for k in range(n_attributes):
        draft.point_data[f"attribute:{k}" if k else "attribute"] = table[:, 3 + k].copy()
    if poly.exists():
        head, rows = _table(poly)
        skipped = head[0]
        count, has_marker = (int(word) for word in (*rows[skipped], "0")[:2])
        rows = rows[skipped + 1 :]
        _facets(draft, _numbers(poly, rows, count, 3 + bool(has_marker)), first, poly)
    elif edge.exists():
        head, rows = _table(edge)
        found = _numbers(edge, rows, head[0], 3 + bool(len(head) > 1 and head[1]))
        _facets(draft, found[found[:, 3] != 0] if found.shape[1] > 3 else found[:0], first, edge)
    return draft


def _facets(draft: Draft, table: np.ndarray[Any, Any], first: int, path: Path) -> None:
    if len(table):
        rows = whole(table[:, 1:], f"'{path.name}': the facets")
        draft.facets = rows[:, :2] - first
        draft.facet_tags = rows[:, 2] if rows.shape[1] > 2 else None


def write_triangle(draft: Draft, path: Path) -> None:
    """Write ``.node`` and ``.ele``, and ``.poly`` with the facets, counted from 0."""
    stem = path.with_suffix("")
    (_, cells, tags) = draft.blocks[0]
    if cells.shape[1] != 3:
        raise MeshError("this format holds triangles only")
    fields = [np.asarray(values, dtype=np.float64) for values in draft.point_data.values()]
    columns = [column for values in fields for column in values.reshape(len(draft.points), -1).T.tolist()]
    with Path(f"{stem}.node").open("w", encoding="utf-8") as out:
        out.write(f"{len(draft.points)} 2 {len(columns)} 0\n")
        for k, row in enumerate(zip(*draft.points.T.tolist(), *columns, strict=True)):
            out.write(f"{k} {' '.join(map(repr, row))}\n")
    with Path(f"{stem}.ele").open("w", encoding="utf-8") as out:
        out.write(f"{len(cells)} 3 {int(tags is not None)}\n")
        for k, row in enumerate(cells.tolist()):
            out.write(f"{k} {' '.join(map(str, row))}{'' if tags is None else f' {tags[k]}'}\n")
    facets = [] if draft.facets is None else draft.facets.tolist()
    marks = draft.facet_tags if facets else None
    with Path(f"{stem}.poly").open("w", encoding="utf-8") as out:
        out.write(f"0 2 0 0\n{len(facets)} {int(marks is not None)}\n")
        for k, (a, b) in enumerate(facets):
            out.write(f"{k} {a} {b}{'' if marks is None else f' {marks[k]}'}\n")
        out.write("0\n")
