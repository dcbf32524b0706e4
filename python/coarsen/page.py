"""One self-contained HTML page about a hierarchy: table, pictures, histograms of angles, local similarity."""

from __future__ import annotations

import base64
import dataclasses
import html
import io as streams
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .io.aside import aside
from .tables import headings, rows

if TYPE_CHECKING:
    from .multilevel import Hierarchy

_STYLE = """
:root { color-scheme: light; --ink: #1f2933; --soft: #5f6b7a; --line: #d5dbe1; --accent: #1c7ed6; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1100px; padding: 2rem 1.5rem 4rem; background: #fff; color: var(--ink);
       font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; }
h2 { font-size: 1.15rem; margin: 2.4rem 0 .6rem; border-bottom: 1px solid var(--line); padding-bottom: .3rem; }
p.lead { color: var(--soft); margin: 0 0 1.4rem; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); gap: .8rem; }
.figures div { border: 1px solid var(--line); border-radius: .5rem; padding: .7rem .9rem; }
.figures b { display: block; font-size: 1.35rem; font-variant-numeric: tabular-nums; }
.figures span { color: var(--soft); font-size: .85rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .35rem .8rem; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { color: var(--soft); font-weight: 600; }
table.options td, table.options th { text-align: left; }
img { max-width: 100%; height: auto; display: block; margin: .4rem auto; }
footer { margin-top: 3rem; color: var(--soft); font-size: .85rem; }
"""

_MEANS = {"levels": "as many as it takes", "min_angle": "25° (0 with plain)", "threads": "all cores"}
"""What an option that is not given stands for."""

_SIMILARITY = (
    "<p>How many times longer elements become from level to level, counted by cells of the finer one; the largest is "
    "the I of Definition 2.4.</p>"
)


def report(h: Hierarchy, path: str | os.PathLike[str], *, title: str = "Mesh hierarchy", dpi: int = 130) -> Path:
    """Write an HTML page about a hierarchy that needs no other file.

    Parameters
    ----------
    h : Hierarchy
        Of triangles.
    path : path
        Where; written aside and renamed.
    title : str
    dpi : int
        Resolution of the pictures.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    ImportError
        If matplotlib is not installed.
    """
    from .plot import plot_angles, plot_hierarchy, plot_level, plot_quality, plot_similarity

    table = rows(h)
    flat = h[0].mesh.dim > 1
    sections = [("Levels", _table([headings(h), *(row.texts() for row in table)]))]
    sections.append(("The levels side by side", _image(plot_hierarchy(h), dpi, "the meshes of all levels")))
    if flat:
        angles, quality = plot_angles(h), plot_quality(h)
        sections.append(
            ("Angles", _image(quality, dpi, "angles by level") + _image(angles, dpi, "histograms of angles"))
        )
        if len(h) > 1:
            sections.append(("Local similarity", _SIMILARITY + _image(plot_similarity(h), dpi, "local similarity")))
        middle = min(len(h) - 1, max(1, len(h) // 2))
        over = h[middle - 1].mesh if middle else None
        drawn = plot_level(h[middle], over=over).figure
        text = f"Spacing and kept nodes of level {middle} over level {middle - 1}" if middle else "Spacing"
        sections.append((text, _image(drawn, dpi, text)))
    sections.append(("Options", _table([("option", "value"), *_options(h)], "options")))
    finest, coarsest = table[0], table[-1]
    cells = "triangles" if flat else "edges"
    figures = [(f"{finest.nodes:,}", "nodes given"), (f"{coarsest.nodes:,}", "nodes on the coarsest level")]
    figures += [
        (str(len(h)), "levels"),
        (f"{sum(row.cells for row in table) / finest.cells:.2f}", f"{cells} in all / given"),
    ]
    if flat:
        figures.append((f"{min(row.min_angle or 0.0 for row in table):.1f}°", "smallest angle of all levels"))
    worst = max((row.similarity for row in table if row.similarity is not None), default=None)
    if worst is not None:
        figures.append((f"{worst:.2f}", "largest local similarity"))
    with aside(path) as place:
        place.write_text(_page(title, h.stopped, figures, sections), encoding="utf-8")
    return Path(path)


def _page(title: str, stopped: str, figures: list[tuple[str, str]], sections: list[tuple[str, str]]) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        by = f"coarsen-mesh {version('coarsen-mesh')}"
    except PackageNotFoundError:
        by = "coarsen-mesh"
    boxes = "".join(
        f"<div><b>{html.escape(value)}</b><span>{html.escape(what)}</span></div>" for value, what in figures
    )
    body = "".join(f"<section><h2>{html.escape(name)}</h2>{content}</section>\n" for name, content in sections)
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{html.escape(title)}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>{_STYLE}</style>\n</head>\n<body>\n"
        f'<h1>{html.escape(title)}</h1>\n<p class="lead">Ended: {html.escape(stopped)}.</p>\n'
        f'<div class="figures">{boxes}</div>\n{body}<footer>Made by {html.escape(by)}.</footer>\n</body>\n</html>\n'
    )


def _table(lines: list[tuple[str, ...]], kind: str = "levels") -> str:
    head, *body = lines
    top, inside = _line(head, "th"), "".join(_line(line, "td") for line in body)
    return f'<div class="wide"><table class="{kind}"><thead>{top}</thead><tbody>{inside}</tbody></table></div>'


def _line(texts: tuple[str, ...], tag: str) -> str:
    return f"<tr>{''.join(f'<{tag}>{html.escape(text)}</{tag}>' for text in texts)}</tr>"


def _image(figure: Any, dpi: int, text: str) -> str:
    from matplotlib import pyplot

    out = streams.BytesIO()
    figure.savefig(out, dpi=dpi, format="png")
    pyplot.close(figure)
    picture = base64.b64encode(out.getvalue()).decode("ascii")
    return f'<img alt="{html.escape(text)}" src="data:image/png;base64,{picture}">'


def _options(h: Hierarchy) -> list[tuple[str, str]]:
    said = []
    for field in dataclasses.fields(h.options):
        value = getattr(h.options, field.name)
        if isinstance(value, np.ndarray):
            value = f"an array of {len(value)} values"
        elif value is None:
            value = _MEANS.get(field.name, "none")
        said.append((field.name, str(getattr(value, "value", value))))
    return said
