"""The study behind the defaults: one option at a time, over every plane triangle mesh of a folder.

    python benches/study.py FOLDER [--write docs]

For each setting: the share of levels whose smallest angle (angles between two facets left aside) reaches 15, 20 and 25
degrees, the 1 % quantile of all cells' smallest angles over all levels, nodes of all coarser levels against the default
setting's, and time against the default's. Levels are those of `features="keep"`, as many as the default makes.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

import coarsen
from domains import angles_of

VARIED: dict[str, list[Any]] = {
    "gradation": [0.35, 0.5, 0.6, 0.7, 0.85, 1.0],
    "beta": [1.7, 2.0, 2.5, 3.0],
    "delta": [0.25, 0.5, 0.75, 1.0],
    "feature_angle": [30.0, 45.0, 60.0, 90.0],
    "min_angle": [0.0, 15.0, 20.0, 25.0, 28.0, 30.0],
    "candidates": ["pool", "all"],
}
MOST_NODES = 30_000


def meshes(folder: Path) -> dict[str, coarsen.Mesh]:
    """Return the legal plane meshes of a folder, the largest ones left out to keep the study short."""
    found = {}
    for path in sorted(folder.glob("*.npz")):
        if path.stem.startswith("broken_") or path.stem.endswith("__asis"):
            continue
        try:
            mesh = coarsen.read(path)
        except coarsen.MeshError:
            continue
        if mesh.n_points <= MOST_NODES:
            found[path.stem] = mesh
    return found


def measure(found: dict[str, coarsen.Mesh], depths: dict[str, int], options: dict[str, Any]) -> dict[str, Any]:
    """Coarsen every mesh with one setting."""
    least, all_angles, nodes, seconds = [], [], 0, 0.0
    for name, mesh in found.items():
        start = time.perf_counter()
        h = coarsen.hierarchy(mesh, levels=depths[name], **options)
        seconds += time.perf_counter() - start
        for level in h[1:]:
            angles, at_facets = angles_of(level, mesh)
            free = np.where(at_facets, 180.0, angles).min(axis=1)
            least.append(free.min())
            all_angles.append(free)
            nodes += level.mesh.n_points
    return {
        "least": np.array(least),
        "quantile": float(np.quantile(np.concatenate(all_angles), 0.01)),
        "nodes": nodes,
        "seconds": seconds,
    }


def study(found: dict[str, coarsen.Mesh]) -> tuple[list[str], dict[str, list[tuple[Any, dict[str, Any]]]]]:
    """Vary each option; return the table's rows and the figures behind them."""
    depths = {name: len(coarsen.hierarchy(mesh)) - 1 for name, mesh in found.items()}
    base = measure(found, depths, {})
    rows, figures = [], {}
    for option, values in VARIED.items():
        figures[option] = []
        default = getattr(coarsen.Options(), option)
        default = 25.0 if option == "min_angle" else default
        for value in values:
            got = base if value == default else measure(found, depths, {option: value})
            figures[option].append((value, got))
            shares = " | ".join(f"{100 * (got['least'] >= bound).mean():.0f}" for bound in (15, 20, 25))
            mark = " (default)" if value == default else ""
            rows.append(
                f"| `{option}={value!r}`{mark} | {shares} | {got['quantile']:.1f} | "
                f"{got['nodes'] / base['nodes']:.3f} | {got['seconds'] / base['seconds']:.2f} |"
            )
    return rows, figures


def picture(figures: dict[str, list[tuple[Any, dict[str, Any]]]], path: Path) -> None:
    """Plot angle and size against each option."""
    from matplotlib.figure import Figure

    varied = {option: runs for option, runs in figures.items() if option != "candidates"}
    figure = Figure(figsize=(3 * len(varied), 3.2), layout="constrained")
    for ax, (option, runs) in zip(figure.subplots(1, len(varied), sharey=True), varied.items(), strict=True):
        values = [value for value, _ in runs]
        ax.plot(values, [np.quantile(got["least"], 0.1) for _, got in runs], "o-", label="smallest angle, worst tenth")
        ax.plot(values, [got["quantile"] for _, got in runs], "s-", label="1 % of all cells")
        sizes = [got["nodes"] for _, got in runs]
        ax.twinx().plot(values, np.array(sizes) / 1000, "k:", label="nodes / 1000")
        ax.set_xlabel(option)
    figure.axes[0].set_ylabel("degrees (dotted: nodes / 1000)")
    figure.axes[0].legend(fontsize=7)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Print or write the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--write", type=Path, help="folder for study-table.md and study.png")
    arguments = parser.parse_args()
    found = meshes(arguments.folder)
    rows, figures = study(found)
    text = "\n".join(
        [
            "| setting | levels ≥ 15° (%) | ≥ 20° | ≥ 25° | 1 % quantile | nodes / default | time / default |",
            "| --- | --: | --: | --: | --: | --: | --: |",
            *rows,
        ]
    )
    if arguments.write is None:
        print(text)
    else:
        made = f"Made by `python benches/study.py FOLDER --write docs` over {len(found)} meshes.\n\n{text}\n"
        (arguments.write / "study-table.md").write_text(made, encoding="utf-8")
        picture(figures, arguments.write / "_static" / "study.png")


if __name__ == "__main__":
    main()
