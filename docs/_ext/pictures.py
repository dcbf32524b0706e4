"""The pictures of the texts, drawn by the package itself when the site is built."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from sphinx.application import Sphinx

import coarsen

BLUE, ORANGE, GREY = "#0b5fa5", "#d9730d", "#8a8f98"
FACTORS = (1.0, 2.0, 4.0)


def draw_mesh(ax: Axes, mesh: coarsen.Mesh, title: str = "", **style: object) -> None:
    """Draw the edges of a mesh, nothing around them."""
    ax.triplot(*mesh.points.T, mesh.cells, **({"color": "k", "lw": 0.4} | style))
    ax.set(aspect="equal", title=title)
    ax.axis("off")


def hero() -> Figure:
    """Return four levels of the crack plate, side by side."""
    h = coarsen.hierarchy(coarsen.gallery.crack_plate())
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.8), layout="constrained")
    for ax, level in zip(axes, h[:4], strict=False):
        draw_mesh(ax, level.mesh, f"{level.mesh.n_points} nodes, {level.quality.min_angle:.0f}° and more", color=BLUE)
    return figure


def cones() -> Figure:
    """Return the coarsened spacing on a line, as an envelope of cones."""
    nodes = np.array([0, 0.3, 0.4, 0.45, 0.5, 0.6, 0.9, 1.5, 2.1, 2.7])
    g = coarsen.spacing.nearest(nodes[:, None])
    x = np.linspace(-0.1, 2.8, 600)
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.2), sharey=True, layout="constrained")
    for ax, factor in zip(axes, FACTORS, strict=True):
        for node, spacing in zip(nodes, g, strict=True):
            ax.plot(x, factor * spacing + abs(x - node), color=GREY, lw=0.6)
        envelope = coarsen.spacing.coarsened(nodes[:, None], g, factor, at=x[:, None]) if factor > 1 else None
        envelope = np.min(factor * g + abs(x[:, None] - nodes), axis=1) if envelope is None else envelope
        ax.plot(x, envelope, color=BLUE, lw=2.5)
        ax.plot(nodes, 0 * nodes, "o", color=ORANGE, ms=5, clip_on=False)
        ax.set(title=f"C = {factor:g}", ylim=(0, 2.2), xlim=(x[0], x[-1]))
    axes[0].set_ylabel("spacing")
    return figure


def discs() -> Figure:
    """Return one level's nodes, each with the disc that no other one's may overlap."""
    mesh = coarsen.gallery.graded_square(700)
    level = coarsen.coarsen(mesh, features="plain", candidates="all")
    beta, nodes = 2.0, mesh.points[level.nodes]
    figure, axes = plt.subplots(1, 2, figsize=(11, 5.5), layout="constrained")
    draw_mesh(axes[0], mesh, color=GREY)
    circles = [Circle(tuple(p), f / beta) for p, f in zip(nodes, level.spacing, strict=True)]
    axes[0].add_collection(PatchCollection(circles, facecolor=BLUE, alpha=0.25, edgecolor=BLUE, lw=0.6))
    axes[0].plot(*nodes.T, "o", color=BLUE, ms=2.5)
    axes[0].set_title("chosen nodes and their discs")
    draw_mesh(axes[1], level.mesh, "their triangulation", color=BLUE, lw=0.8)
    return figure


def nested() -> Figure:
    """Return three levels, each with the nodes of the next coarser one marked."""
    h = coarsen.hierarchy(coarsen.gallery.ring(900), levels=3)
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.6), layout="constrained")
    for ax, fine, coarse in zip(axes, list(h)[:-1], list(h)[1:], strict=True):
        draw_mesh(ax, fine.mesh, f"{fine.mesh.n_points} nodes, {coarse.mesh.n_points} of them stay", color=GREY)
        ax.plot(*coarse.mesh.points.T, "o", color=ORANGE, ms=3)
    return figure


def features() -> Figure:
    """Return a coast, and a coarse level of it that keeps, and one that drops, what is small."""
    mesh = coarsen.gallery.coast(6000)
    kept, dropped = (coarsen.hierarchy(mesh, levels=4, features=rule)[-1] for rule in ("keep", "drop"))
    figure, axes = plt.subplots(1, 3, figsize=(13, 4.6), layout="constrained")
    draw_mesh(axes[0], mesh, f"the coast: {mesh.n_points} nodes", color=GREY, lw=0.25)
    draw_mesh(axes[1], kept.mesh, f'features="keep": {kept.mesh.n_points} nodes', color=BLUE, lw=0.5)
    draw_mesh(axes[2], dropped.mesh, f'features="drop": {dropped.mesh.n_points} nodes', color=BLUE, lw=0.5)
    return figure


def baseline() -> Figure:
    """Return smallest angles by level, for the baseline and for the paper's method."""
    mesh = coarsen.gallery.crack_plate()
    figure, ax = plt.subplots(figsize=(7, 3.4), layout="constrained")
    for method, color, label in (("function", BLUE, "spacing function"), ("mis", ORANGE, "independent sets of edges")):
        h = coarsen.hierarchy(mesh, method=method, features="plain")
        ax.semilogx([level.mesh.n_points for level in h], [level.quality.min_angle for level in h], "o-", color=color)
        ax.plot([], [], "o-", color=color, label=label)
    ax.invert_xaxis()
    ax.set(xlabel="nodes of the level", ylabel="smallest angle, degrees", ylim=(0, 45))
    ax.grid(alpha=0.3)
    ax.legend()
    return figure


PICTURES = (hero, cones, discs, nested, features, baseline)


def draw_all(app: Sphinx) -> None:
    """Draw every picture into the folder that the texts show them from."""
    folder = Path(app.srcdir) / "_pictures"
    folder.mkdir(exist_ok=True)
    with mpl.rc_context({"font.size": 10, "savefig.dpi": 130}):
        for picture in PICTURES:
            figure = picture()
            figure.savefig(folder / f"{picture.__name__}.png")
            plt.close(figure)


def setup(app: Sphinx) -> dict[str, bool]:
    """Draw before anything is read."""
    app.connect("builder-inited", draw_all)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
