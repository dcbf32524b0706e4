"""TELEMAC's Selafin (Serafin) ``.slf``: Fortran records, big-endian, in single or double precision.

Records, each between two int32 of its length in bytes: title (80 characters, the last eight ``SERAFIN`` or
``SERAFIND``); number of variables (2 int32); a name and unit of 32 characters for each; 10 int32, of which the third
and fourth are the origin of the coordinates, the last says whether a date (6 int32) follows; cells, nodes, nodes a
cell, 1; the cells, 1-based; the numbers of boundary nodes; x; y; then for every time step the time and every
variable. The last time step is read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeshError
from .draft import Draft

_NAME_LENGTH = 32


class _Records:
    def __init__(self, content: bytes, name: str) -> None:
        self.content, self.at, self.name = content, 0, name

    def more(self) -> bool:
        return self.at < len(self.content)

    def next(self, what: str, length: int | None = None) -> bytes:
        """Return the next record, which is of that many bytes."""
        content, at = self.content, self.at
        size = int.from_bytes(content[at : at + 4], "big") if at + 4 <= len(content) else -1
        end = at + 4 + size
        if size < 0 or end + 4 > len(content) or content[end : end + 4] != content[at : at + 4]:
            raise MeshError(f"'{self.name}': no Selafin file, or cut short: no whole record of the {what} at byte {at}")
        if length is not None and size != length:
            raise MeshError(f"'{self.name}': the {what} take {size} bytes, expected {length}")
        self.at = end + 4
        return content[at + 4 : end]


def read_selafin(path: Path) -> Draft:
    """Read nodes, cells and the variables of the last time step as nodal fields, named without their units."""
    records = _Records(path.read_bytes(), path.name)
    real = ">f8" if records.next("title", 80).endswith(b"SERAFIND") else ">f4"
    n_names = int(np.frombuffer(records.next("number of variables", 8), ">i4").sum())
    names = [records.next("names", _NAME_LENGTH)[:16].decode("latin-1").strip() for _ in range(n_names)]
    settings = np.frombuffer(records.next("settings", 40), ">i4")
    if settings[9] == 1:
        records.next("date", 24)
    n_cells, n_points, corners, _ = (int(k) for k in np.frombuffer(records.next("sizes", 16), ">i4"))
    cells = np.frombuffer(records.next("cells", 4 * n_cells * corners), ">i4").reshape(n_cells, corners)
    records.next("boundary numbers", 4 * n_points)
    width = np.dtype(real).itemsize * n_points
    x, y = (np.frombuffer(records.next(what, width), real).astype(np.float64) for what in ("x", "y"))
    kind = {3: "triangle", 4: "quad", 6: "wedge"}.get(corners, f"cells of {corners} nodes")
    draft = Draft(
        np.column_stack([x + settings[2], y + settings[3]]),
        [(kind, cells.astype(np.int64) - 1, None)],
    )
    while records.more():
        records.next("time")
        draft.point_data = {name: np.frombuffer(records.next(name, width), real).astype(np.float64) for name in names}
    return draft


def write_selafin(draft: Draft, path: Path) -> None:
    """Write in double precision, one time step at 0 s; ``depth`` becomes BOTTOM, upwards, where there is none."""
    cells = draft.blocks[0][1]
    if cells.shape[1] != 3:
        raise MeshError("this format holds triangles only")
    fields: dict[str, Any] = {}
    for name, values in draft.point_data.items():
        columns = np.asarray(values, dtype=np.float64).reshape(len(draft.points), -1).T
        fields |= {name if len(columns) == 1 else f"{name} {k}": column for k, column in enumerate(columns)}
    if "depth" in fields and "BOTTOM" not in fields:
        fields["BOTTOM"] = -fields.pop("depth")
    if not fields:
        fields["BOTTOM"] = np.zeros(len(draft.points))
    names = [f"{name[:16]:<16}{'M' if name == 'BOTTOM' else '':<16}".encode("latin-1", "replace") for name in fields]
    n = len(draft.points)
    boundary = np.zeros(n, dtype=np.int64)
    rim = _boundary_nodes(cells)
    boundary[rim] = np.arange(1, len(rim) + 1)
    chunks: list[Any] = [
        f"{'written by coarsen':<72}SERAFIND".encode("ascii"),
        np.array([len(names), 0], ">i4"),
        *names,
    ]
    chunks += [
        np.array([1, 0, 0, 0, 0, 0, 0, 0, 0, 0], ">i4"),
        np.array([len(cells), n, 3, 1], ">i4"),
    ]
    chunks += [
        (np.asarray(cells) + 1).astype(">i4"),
        boundary.astype(">i4"),
        *draft.points.T.astype(">f8"),
    ]
    chunks += [
        np.zeros(1, ">f8"),
        *(values.astype(">f8") for values in fields.values()),
    ]
    with path.open("wb") as out:
        for chunk in chunks:
            content = chunk if isinstance(chunk, bytes) else chunk.tobytes()
            size = len(content).to_bytes(4, "big")
            out.write(size + content + size)


def _boundary_nodes(cells: Any) -> Any:
    edges = np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(unique[count == 1])
