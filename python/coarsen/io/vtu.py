"""VTK's XML format for unstructured grids, ``.vtu``, written without any library; meshio reads it.

After "VTK XML Formats" of the VTK documentation: arrays stand in the text in base64, cut into blocks and compressed
by zlib, under a head of its own that holds the number of blocks, their size, the size of the last one where it is
shorter (else 0), and the compressed sizes. Facets are lines after the cells; tags are the cell data ``cell_tags`` of
both, 0 where there are none.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from .draft import Draft

_BLOCK = 1 << 20  # bytes
_FAST = 1  # higher levels of zlib take three times as long for a tenth less
_VTK_TYPES = {2: 3, 3: 5, 4: 9}
_NAMES = {"f": "Float", "i": "Int", "u": "UInt"}


def write_vtu(draft: Draft, path: Path) -> None:
    """Write points, cells, facets as lines, tags and nodal fields."""
    blocks = [(cells, tags) for _, cells, tags in draft.blocks]
    if draft.facets is not None and len(draft.facets):
        blocks.append((np.asarray(draft.facets), draft.facet_tags))
    widths = np.repeat([cells.shape[1] for cells, _ in blocks], [len(cells) for cells, _ in blocks])
    points = np.zeros((len(draft.points), 3))
    points[:, : draft.points.shape[1]] = draft.points
    with path.open("w", encoding="utf-8") as out:
        out.write(
            '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian"'
            ' header_type="UInt64" compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n'
            f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(widths)}">\n'
        )
        out.write(f"<Points>\n{_array('Points', points)}</Points>\n<Cells>\n")
        out.write(_array("connectivity", np.concatenate([cells.ravel() for cells, _ in blocks]).astype(np.int64)))
        out.write(_array("offsets", np.cumsum(widths, dtype=np.int64)))
        out.write(_array("types", np.vectorize(_VTK_TYPES.get, otypes=[np.uint8])(widths)))
        out.write("</Cells>\n<PointData>\n")
        for name, values in draft.point_data.items():
            out.writelines(_array(*part) for part in _real(name, np.asarray(values)))
        out.write("</PointData>\n<CellData>\n")
        if any(tags is not None for _, tags in blocks):
            tags = [np.zeros(len(cells), np.int64) if tags is None else tags for cells, tags in blocks]
            out.write(_array("cell_tags", np.concatenate(tags).astype(np.int64)))
        out.write("</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")


def _real(name: str, values: np.ndarray[Any, Any]) -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
    """Give arrays that VTK has: complex numbers in two parts, truth values as bytes, odd floats as doubles."""
    if values.dtype.kind == "c":
        yield f"{name}:real", values.real.astype(np.float64)
        yield f"{name}:imag", values.imag.astype(np.float64)
    elif values.dtype.kind == "b":
        yield name, values.astype(np.uint8)
    elif values.dtype.kind == "f" and values.dtype.itemsize not in (4, 8):
        yield name, values.astype(np.float64)
    else:
        yield name, values


def _array(name: str, values: np.ndarray[Any, Any]) -> str:
    kind = f"{_NAMES[values.dtype.kind]}{8 * values.dtype.itemsize}"
    parts = int(np.prod(values.shape[1:]))
    content = np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes()
    blocks = [zlib.compress(content[k : k + _BLOCK], _FAST) for k in range(0, len(content), _BLOCK)]
    head = np.array([len(blocks), _BLOCK, len(content) % _BLOCK, *map(len, blocks)], "<u8")
    text = (base64.b64encode(part).decode("ascii") for part in (head.tobytes(), b"".join(blocks)))
    several = f' NumberOfComponents="{parts}"' if values.ndim > 1 else ""
    return f'<DataArray type="{kind}" Name={quoteattr(name)}{several} format="binary">{"".join(text)}</DataArray>\n'
