"""Every plane triangle mesh of a folder, coarsened in each way: what every level is like.

    python benches/domains.py FOLDER [--features keep drop auto] [--write docs/domains-table.md]

A level's smallest angle is given twice: of all cells, and without those cells whose smallest angle lies between two
facets of the input, which no coarsening can better. The share of cells under 15 degrees leaves these aside too. Seconds
are the least of three calls, for all levels of a mesh.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import coarsen

FEATURES = ("keep", "drop", "auto")
LEAST = 15.0
CALLS = 3
HEADER = "| mesh | level | nodes | triangles | min angle | but at facets | % < 15° | area % | seconds |"
RULE = "| --- " + "| --: " * 8 + "|"


@dataclass(frozen=True)
class Row:
    """What one level is like."""

    nodes: int
    cells: int
    smallest: float
    free: float
    share: float
    area: float


def pairs(ends: np.ndarray, n: int) -> np.ndarray:
    """Return one number for each undirected edge (..., 2) of `n` nodes."""
    low, high = ends.min(axis=-1), ends.max(axis=-1)
    return low * n + high


def angles_of(level: coarsen.Level, fine: coarsen.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles (m, 3) of a level in degrees, and whether each lies between two facets of the input."""
    mesh = level.mesh
    corners = mesh.points[mesh.cells]
    out = np.roll(corners, -1, axis=1) - corners
    back = np.roll(corners, 1, axis=1) - corners
    cross = out[..., 0] * back[..., 1] - out[..., 1] * back[..., 0]
    angles = np.degrees(np.arctan2(cross, (out * back).sum(-1)))
    cells = np.asarray(level.nodes)[mesh.cells]
    edges = np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1)
    is_facet = np.isin(pairs(edges, fine.n_points), pairs(np.asarray(fine.topology.facets), fine.n_points))
    return angles, is_facet & np.roll(is_facet, 1, axis=1)


def rows_of(mesh: coarsen.Mesh, features: str) -> tuple[list[Row], float]:
    """Coarsen one mesh; describe its levels, the input first, and tell the seconds."""
    seconds = float("inf")
    for _ in range(CALLS):
        start = time.perf_counter()
        h = coarsen.hierarchy(mesh, features=features)
        seconds = min(seconds, time.perf_counter() - start)
    rows = []
    for level in h:
        angles, at_facets = angles_of(level, mesh)
        smallest = angles.min(axis=1)
        is_own = at_facets[np.arange(len(angles)), angles.argmin(axis=1)]
        free = np.where(is_own, 180.0, smallest)
        area = 100 * (level.quality.area / h[0].quality.area - 1)
        share = 100 * float((free < LEAST).mean())
        rows.append(Row(level.mesh.n_points, level.mesh.n_cells, smallest.min(), free.min(), share, area))
    return rows, seconds


def lines_of(name: str, rows: list[Row], seconds: float) -> list[str]:
    """Return the rows of one mesh as lines of the table."""
    lines = []
    for i, row in enumerate(rows):
        area = f"{row.area:+.1f}" if abs(row.area) >= 0.05 else "0"
        free = f"{row.free:.1f}" if row.free < 180 else "–"
        lines.append(
            f"| {name if i == 0 else ''} | {i} | {row.nodes} | {row.cells} | {row.smallest:.1f} | {free} | "
            f"{row.share:.2g} | {area if i else ''} | {f'{seconds:.3f}' if i == 0 else ''} |"
        )
    return lines


def meshes_of(folder: Path) -> dict[str, coarsen.Mesh]:
    """Return the legal plane triangle meshes of a folder, by name."""
    found = {}
    for path in sorted(folder.glob("*.npz")):
        if path.stem.startswith("broken_") or path.stem.endswith("__asis"):
            continue
        try:
            found[path.stem] = coarsen.read(path)
        except coarsen.MeshError:
            continue
    return found


def summary(made: dict[str, tuple[list[Row], float]], features: str) -> str:
    """Return one row that says whether every level is as well shaped as it should be."""
    coarse = [(rows[0], row) for rows, _ in made.values() for row in rows[1:]]
    if features == "drop":
        early = [(rows[0], row) for rows, _ in made.values() for row in rows[1:-2]]
        under = sum(row.free < LEAST for _, row in early)
    else:
        under = sum(row.free < min(LEAST, first.smallest) - 0.05 for first, row in coarse)
    largest = max(rows[-1].cells for rows, _ in made.values())
    area = max(abs(row.area) for _, row in coarse)
    seconds = sum(seconds for _, seconds in made.values())
    return f'| `"{features}"` | {len(coarse)} | {under} | {largest} | {area:.1f} | {seconds:.2f} |'


def report(folder: Path, ways: list[str]) -> str:
    """Return the summary and the tables as Markdown."""
    meshes = meshes_of(folder)
    made = {features: {name: rows_of(mesh, features) for name, mesh in meshes.items()} for features in ways}
    head = [
        f"{len(meshes)} meshes. A level is *under the mark* where its smallest angle, but at facets of the input, is",
        "less than 15 degrees and less than the input's own; with `drop`, where it is less than 15 degrees, the last",
        "two levels of each mesh aside.",
        "",
        "| `features` | levels | under the mark | most cells of a last level | most area change, % | seconds in all |",
        "| --- " + "| --: " * 5 + "|",
        *[summary(made[features], features) for features in ways],
    ]
    parts = ["\n".join(head)]
    for features in ways:
        lines = [line for name, (rows, seconds) in made[features].items() for line in lines_of(name, rows, seconds)]
        parts.append("\n".join([f'## `features="{features}"`, level by level', "", HEADER, RULE, *lines]))
    return "\n\n".join(parts) + "\n"


def main() -> None:
    """Print or write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--features", nargs="+", choices=FEATURES, default=["keep", "drop"])
    parser.add_argument("--write", type=Path, help="file to write instead of printing")
    arguments = parser.parse_args()
    text = report(arguments.folder, arguments.features)
    if arguments.write is None:
        print(text)
    else:
        flags = f"--features {' '.join(arguments.features)} --write docs/{arguments.write.name}"
        arguments.write.write_text(f"Made by `python benches/domains.py FOLDER {flags}`.\n\n{text}", encoding="utf-8")


if __name__ == "__main__":
    main()
