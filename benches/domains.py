"""Every plane triangle mesh of a folder, coarsened in each way: what every level is like.

    python benches/domains.py FOLDER [--features keep drop auto] [--write docs/domains-table.md]

Columns: nodes, triangles, smallest angle of the level, the same without cells whose smallest angle lies between two
facets, share of triangles under 15 degrees (facet angles left aside too), area against the input,
seconds for all levels.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import coarsen

FEATURES = ("keep", "drop", "auto")
LEAST = 15.0


def angles_of(mesh: coarsen.Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the angles (m, 3) in degrees, and whether each lies between two facets."""
    corners = mesh.points[mesh.cells]
    out = np.roll(corners, -1, axis=1) - corners
    back = np.roll(corners, 1, axis=1) - corners
    cross = out[..., 0] * back[..., 1] - out[..., 1] * back[..., 0]
    angles = np.degrees(np.arctan2(cross, (out * back).sum(-1)))
    facets = np.sort(mesh.topology.facets, axis=1)
    known = np.unique(facets[:, 0] * mesh.n_points + facets[:, 1])
    edges = np.sort(np.stack([mesh.cells, np.roll(mesh.cells, -1, axis=1)], axis=-1), axis=-1)
    is_facet = np.isin(edges[..., 0] * mesh.n_points + edges[..., 1], known)
    return angles, is_facet & np.roll(is_facet, 1, axis=1)


def rows_of(name: str, mesh: coarsen.Mesh, features: str) -> list[str]:
    """Coarsen one mesh and describe its levels."""
    start = time.perf_counter()
    h = coarsen.hierarchy(mesh, features=features)
    seconds = time.perf_counter() - start
    rows = []
    for i, level in enumerate(h):
        angles, at_facets = angles_of(level.mesh)
        free = np.where(at_facets, 180.0, angles).min(axis=1)
        area = level.quality.area / h[0].quality.area - 1
        rows.append(
            f"| {name if i == 0 else ''} | {i} | {level.mesh.n_points} | {level.mesh.n_cells} | {angles.min():.1f} | "
            f"{free.min():.1f} | {100 * (free < LEAST).mean():.2f} | {100 * area:+.2f} | "
            f"{f'{seconds:.3f}' if i == 0 else ''} |"
        )
    return rows


def table(folder: Path, features: str) -> str:
    """Return the table of one way as markdown."""
    lines = [
        "| mesh | level | nodes | triangles | min angle | min but at facets | % < 15° | area % | seconds |",
        "| --- | --: | --: | --: | --: | --: | --: | --: | --: |",
    ]
    for path in sorted(folder.glob("*.npz")):
        if path.stem.startswith("broken_") or path.stem.endswith("__asis"):
            continue
        try:
            mesh = coarsen.read(path)
        except coarsen.MeshError:
            continue
        lines += rows_of(path.stem, mesh, features)
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print or write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--features", nargs="+", choices=FEATURES, default=["keep", "drop"])
    parser.add_argument("--write", type=Path)
    arguments = parser.parse_args()
    text = "".join(f'## `features="{f}"`\n\n{table(arguments.folder, f)}\n' for f in arguments.features)
    if arguments.write is None:
        print(text)
    else:
        command = f"python benches/domains.py FOLDER --features {' '.join(arguments.features)}"
        arguments.write.write_text(f"# Real domains\n\nMade by `{command}`.\n\n{text}", encoding="utf-8")


if __name__ == "__main__":
    main()
