"""Hierarchies as tables: the text of ``Hierarchy.summary()`` and the rows behind it, as in Table 1 of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .check import similarities

if TYPE_CHECKING:
    from .multilevel import Hierarchy

HEADINGS = ("level", "factor", "nodes", "triangles", "min angle", "max angle", "similarity")


@dataclass(frozen=True)
class Row:
    """One level in numbers.

    Attributes
    ----------
    level : int
    factor : float
        C^i.
    nodes, cells : int
    min_angle, max_angle : float or None
        Degrees; None on a line.
    similarity : float or None
        Largest ratio of edge lengths to the next finer level, where both have a point in common (Definition 2.4); None
        on level 0.
    """

    level: int
    factor: float
    nodes: int
    cells: int
    min_angle: float | None
    max_angle: float | None
    similarity: float | None

    def texts(self) -> tuple[str, ...]:
        """Return the columns of a table, ready to print."""
        angles = ("–" if angle is None else f"{angle:.2f}°" for angle in (self.min_angle, self.max_angle))
        similarity = "–" if self.similarity is None else f"{self.similarity:.2f}"
        return (str(self.level), f"{self.factor:g}", str(self.nodes), str(self.cells), *angles, similarity)


def rows(h: Hierarchy) -> list[Row]:
    """Return one row a level, finest first."""
    found = []
    for i, (level, ratio) in enumerate(zip(h, similarities(h), strict=True)):
        quality = level.quality
        smallest, largest = (float(quality.min_angle), float(quality.max_angle)) if level.mesh.dim > 1 else (None, None)
        size = level.mesh.n_points, level.mesh.n_cells
        found.append(Row(i, float(level.factor), *size, smallest, largest, ratio if i else None))
    return found


def summary(h: Hierarchy) -> str:
    """Return a table of the levels as text, and why the hierarchy ends where it does."""
    lines = [headings(h), *(row.texts() for row in rows(h))]
    widths = [max(len(line[k]) for line in lines) for k in range(len(HEADINGS))]
    table = ["  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in lines]
    table.insert(1, "  ".join("-" * width for width in widths))
    return "\n".join([*table, f"ended: {h.stopped}"])


def headings(h: Hierarchy) -> tuple[str, ...]:
    """Return the names of the columns; on a line, cells are edges."""
    return tuple("edges" if name == "triangles" and h[0].mesh.dim == 1 else name for name in HEADINGS)
