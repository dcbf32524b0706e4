"""The tables of the texts, measured when the site is built."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from sphinx.application import Sphinx

import coarsen

SETTINGS = (
    {},
    {"factor": 1.5},
    {"factor": 3.0},
    {"beta": 3.0},
    {"gradation": 1.0},
    {"gradation": 0.5},
    {"delta": 1.0},
    {"min_angle": 0},
    {"min_angle": 28},
    {"candidates": "all"},
)
SHOWN = 6  # levels


def row(mesh: coarsen.Mesh, options: dict[str, object]) -> str:
    """Return a line of a table: the options, and nodes and smallest angle of the first coarser levels."""
    h = coarsen.hierarchy(mesh, **options)
    said = ", ".join(f"{name}={value!r}" for name, value in options.items())
    cells = [f"{level.mesh.n_points}, {level.quality.min_angle:.1f}°" for level in h[1 : SHOWN + 1]]
    return " | ".join([f"| `{said}`" if said else "| defaults", *cells, *[""] * (SHOWN - len(cells)), str(len(h) - 1)])


def table(mesh: coarsen.Mesh, settings: tuple[dict[str, object], ...]) -> str:
    """Return a table with a line for each setting."""
    header = " | ".join(["| options", *(f"level {i + 1}" for i in range(SHOWN)), "levels in all"])
    return "\n".join([f"{header} |", "|---" * (SHOWN + 2) + "|", *(f"{row(mesh, one)} |" for one in settings)]) + "\n"


def layer(columns: int = 200, rows: int = 40) -> coarsen.Mesh:
    """Return a boundary layer on a flat wall: cells 1e-5 high at the wall, each row higher by a quarter."""
    height = np.concatenate([[0], np.cumsum(1e-5 * 1.25 ** np.arange(rows - 1))])
    x, y = np.meshgrid(np.linspace(0, 1, columns), height)
    a = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    cells = np.concatenate(
        [np.column_stack([a, a + 1, a + columns + 1]), np.column_stack([a, a + columns + 1, a + columns])]
    )
    return coarsen.Mesh(np.column_stack([x.ravel(), y.ravel()]), cells)


def write_all(app: Sphinx) -> None:
    """Write every table into the folder that the texts include them from."""
    folder = Path(app.srcdir) / "_pictures"
    folder.mkdir(exist_ok=True)
    tables = {
        "options": table(coarsen.gallery.graded_square(40_000), SETTINGS),
        "features": table(
            coarsen.gallery.coast(6000), tuple({"features": f} for f in ("keep", "drop", "auto", "plain"))
        ),
        "layer": table(layer(), ({}, {"min_angle": 0}, {"features": "auto"})),
    }
    for name, text in tables.items():
        (folder / f"{name}.txt").write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Measure before anything is read."""
    app.connect("builder-inited", write_all)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
