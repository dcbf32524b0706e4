"""SU2: keywords and lists; markers by name; several zones in one file.

After the SU2 documentation, "Mesh File". Cells are ``type nodes… [number]`` with VTK types (3 line, 5 triangle, 9
quadrilateral, …). Markers become facet tags 0, 1, … in the order they first come, with their names; of several zones
each gets a cell tag 1, 2, …. Files that we write say in comments at their head which tag a marker has and what it is
called, where SU2 would not take the name (it wants one word).
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeshError
from .draft import Draft
from .numbers import reals

_KINDS = {
    3: ("line", 2),
    5: ("triangle", 3),
    9: ("quad", 4),
    10: ("tetra", 4),
    12: ("hexahedron", 8),
}
_KINDS |= {13: ("wedge", 6), 14: ("pyramid", 5)}


_TOLD = re.compile(r"%\s*marker (-?\d+) (.+)$")


def _word(name: str) -> str:
    """Return a name as SU2 takes it."""
    return re.sub(r"[\s%=]+", "_", name)


def read_su2(path: Path) -> Draft:
    """Read all zones; nodes are numbered on from zone to zone."""
    raw = path.read_text(encoding="utf-8", errors="replace").splitlines()
    told = {_word(found[2]): (int(found[1]), found[2]) for line in raw if (found := _TOLD.match(line))}
    lines = [line.split("%")[0].strip() for line in raw]
    points: list[Any] = []
    cells: dict[str, list[list[int]]] = {}
    zones: dict[str, list[int]] = {}
    facets: list[list[int]] = []
    tags: list[int] = []
    names: dict[str, int] = {}
    start, dim, zone, n_zones = 0, 2, 1, 1
    tag = -1
    at = 0
    while at < len(lines):
        key, equals, value = (part.strip() for part in lines[at].partition("="))
        at += 1
        if not equals:
            continue
        key = key.upper()
        if key == "NDIME":
            dim = int(value)
        elif key == "NZONE":
            n_zones = int(value)
        elif key == "IZONE":
            zone, start = int(value), sum(map(len, points))
        elif key == "NPOIN":
            rows, at = _rows(lines, at, int(value.split()[0]), key, path)
            points.append(reals(rows, dim, f"'{path.name}': node"))
        elif key == "NELEM":
            rows, at = _rows(lines, at, int(value), key, path)
            for row in rows:
                kind, corners = _kind(row, path)
                cells.setdefault(kind, []).append([int(node) + start for node in row[1 : 1 + corners]])
                zones.setdefault(kind, []).append(zone)
        elif key == "MARKER_TAG":
            number, name = told.get(value, (None, value))
            tag = names.setdefault(name, _tag_of(name, names) if number is None else number)
        elif key == "MARKER_ELEMS":
            rows, at = _rows(lines, at, int(value), key, path)
            for row in rows:
                kind, corners = _kind(row, path)
                if kind == "line":
                    facets.append([int(node) + start for node in row[1:3]])
                    tags.append(tag)
    if not points or not cells:
        raise MeshError(f"'{path.name}': no {'NPOIN' if not points else 'NELEM'} in it")
    draft = Draft(
        np.concatenate(points),
        [],
        facet_names={tag: name for name, tag in names.items()},
    )
    for kind, block in cells.items():
        draft.blocks.append(
            (
                kind,
                np.array(block, dtype=np.int64),
                np.array(zones[kind]) if n_zones > 1 else None,
            )
        )
    if facets:
        draft.facets, draft.facet_tags = (
            np.array(facets, dtype=np.int64),
            np.array(tags, dtype=np.int64),
        )
    return draft


def _tag_of(name: str, names: dict[str, int]) -> int:
    """Return the number of ``marker_7``, our own name for a tag without one, or the next free one."""
    if (own := re.fullmatch(r"marker_(-?\d+)", name)) and int(own[1]) not in names.values():
        return int(own[1])
    return next(tag for tag in range(len(names) + 1) if tag not in names.values())


def _rows(lines: list[str], at: int, count: int, key: str, path: Path) -> tuple[list[list[str]], int]:
    rows: list[list[str]] = []
    while len(rows) < count:
        if at >= len(lines) or "=" in lines[at]:
            raise MeshError(f"'{path.name}': {key} announces {count} rows, {len(rows)} follow")
        if lines[at]:
            rows.append(lines[at].split())
        at += 1
    return rows, at


def _kind(row: list[str], path: Path) -> tuple[str, int]:
    kind = _KINDS.get(int(row[0]))
    if kind is None:
        raise MeshError(f"'{path.name}': a cell of VTK type {row[0]}, which SU2 does not have")
    return kind


def write_su2(draft: Draft, path: Path) -> None:
    """Write nodes, cells and the facets of every tag as a marker (SU2 wants every boundary edge in one).

    Cell tags are not kept: the format has none.
    """
    cells = draft.blocks[0][1]
    if cells.shape[1] != 3:
        raise MeshError("this format holds triangles only")
    with path.open("w", encoding="utf-8") as out:
        out.writelines(f"% marker {tag} {name}\n" for tag, name in draft.facet_names.items())
        out.write(f"NDIME= 2\nNELEM= {len(cells)}\n")
        out.writelines(f"5 {a} {b} {c} {k}\n" for k, (a, b, c) in enumerate(cells.tolist()))
        out.write(f"NPOIN= {len(draft.points)}\n")
        out.writelines(f"{x!r} {y!r} {k}\n" for k, (x, y) in enumerate(draft.points.tolist()))
        facets = np.zeros((0, 2), np.int64) if draft.facets is None else np.asarray(draft.facets)
        tags = np.zeros(len(facets), np.int64) if draft.facet_tags is None else np.asarray(draft.facet_tags)
        order = np.unique(tags)
        out.write(f"NMARK= {len(order)}\n")
        for tag in order.tolist():
            chosen = facets[tags == tag].tolist()
            out.write(
                f"MARKER_TAG= {_word(draft.facet_names.get(tag, f'marker_{tag}'))}\nMARKER_ELEMS= {len(chosen)}\n"
            )
            out.writelines(f"3 {a} {b}\n" for a, b in chosen)
