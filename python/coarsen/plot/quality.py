"""Quality as pictures: histograms of the angles by level, curves against the level for several hierarchies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..check import local_similarity
from .meshes import FACET, GRID, INK, LINES, pyplot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Mesh
    from ..multilevel import Hierarchy


def angles_of(mesh: Mesh) -> NDArray[np.float64]:
    """Return the three angles of every triangle in degrees, (m, 3)."""
    corners = mesh.points[mesh.cells]
    found = []
    for k in range(3):
        u, v = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        found.append(np.degrees(np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1))))
    return np.column_stack(found)


def plot_angles(h: Hierarchy, *, bins: int = 60) -> Any:
    """Draw a histogram of the angles of every level, one above the other.

    Returns
    -------
    matplotlib figure
    """
    found = {f"{i}": angles_of(level.mesh).ravel() for i, level in enumerate(h)}
    figure, last = _histograms(found, np.linspace(0, 180, bins + 1), "angles by level", "{:.1f}°")
    last.set_xticks(range(0, 181, 30))
    last.set_xlabel("angle, degrees")
    return figure


def plot_similarity(h: Hierarchy, *, bins: int = 60) -> Any:
    """Draw a histogram of the local similarity of every level to the next finer one (Definition 2.4).

    How many times longer elements are, by cell of the finer level: about the factor where the mesh may coarsen, less
    where the domain holds it; the largest is I.

    Returns
    -------
    matplotlib figure

    Raises
    ------
    ValueError
        If there is but one level.
    """
    if len(h) < 2:
        raise ValueError("the hierarchy has one level, expected two or more")
    found = {f"{i - 1} → {i}": local_similarity(h[i - 1], h[i]) for i in range(1, len(h))}
    found = {name: values[np.isfinite(values)] for name, values in found.items()}
    every = np.concatenate(list(found.values()))
    edges = np.geomspace(min(1.0, float(every.min())) / 1.1, max(2.0, float(every.max())) * 1.3, bins + 1)
    figure, last = _histograms(found, edges, "elements grow by", "{:.2f}", smallest=False)
    ticks = [2.0**k for k in range(-6, 12) if edges[0] <= 2.0**k <= edges[-1]]
    last.set_xscale("log")
    last.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    last.minorticks_off()
    last.set_xlabel("longest edge of the overlapping coarse cells / longest edge of the cell")
    return figure


def _histograms(
    found: Mapping[str, NDArray[np.float64]],
    edges: NDArray[np.float64],
    title: str,
    form: str,
    *,
    smallest: bool = True,
) -> tuple[Any, Any]:
    """Draw one histogram above the other, with the extremes marked; return the figure and the lowest axes."""
    figure, axes = pyplot().subplots(
        len(found), 1, figsize=(6.5, 0.4 + 0.72 * len(found)), sharex=True, squeeze=False, layout="constrained"
    )
    for (name, values), ax in zip(found.items(), axes.ravel(), strict=True):
        heights, _ = np.histogram(values, edges)
        ax.stairs(heights, edges, fill=True, color=LINES[0], alpha=0.85)
        for value, side in ((values.min(), "right"), (values.max(), "left"))[0 if smallest else 1 :]:
            ax.axvline(value, color=FACET, lw=1.0)
            ax.annotate(
                form.format(value), (value, 0.92), xytext=(-3 if side == "right" else 3, 0), ha=side, va="top",
                xycoords=ax.get_xaxis_transform(), textcoords="offset points", fontsize=7.5, color=FACET,
            )  # fmt: skip
        ax.set_yticks([])
        ax.tick_params(axis="x", length=0)
        ax.set_ylabel(name, rotation=0, ha="right", va="center", color=INK)
        for where, spine in ax.spines.items():
            spine.set_visible(where == "bottom")
            spine.set_color(GRID)
    axes[0, 0].set_title(title, fontsize=10, color=INK, loc="left")
    return figure, axes[-1, 0]


def plot_quality(hierarchies: Mapping[str, Hierarchy] | Hierarchy, *, against: str = "level") -> Any:
    """Draw smallest and largest angle and the number of nodes against the level, for one hierarchy or several by name.

    Parameters
    ----------
    hierarchies : Hierarchy or dict of them
    against : str
        ``"level"`` or ``"nodes"``.

    Returns
    -------
    matplotlib figure
    """
    if against not in ("level", "nodes"):
        raise ValueError(f"'against' is {against!r}, expected 'level' or 'nodes'")
    given = hierarchies if isinstance(hierarchies, Mapping) else {"": hierarchies}
    figure, axes = pyplot().subplots(1, 3, figsize=(11, 3.4), layout="constrained")
    for k, (name, h) in enumerate(given.items()):
        color = LINES[k % len(LINES)]
        sizes = [level.mesh.n_points for level in h]
        x = range(len(h)) if against == "level" else sizes
        ranges = [(angles.min(), angles.max()) for angles in (angles_of(level.mesh) for level in h)]
        for ax, values in zip(axes, (*zip(*ranges, strict=True), sizes), strict=True):
            ax.plot(x, values, "o-", color=color, ms=4, lw=1.6, label=name or None)
    for ax, title in zip(axes, ("smallest angle, degrees", "largest angle, degrees", "nodes"), strict=True):
        ax.set_title(title, fontsize=10, color=INK, loc="left")
        ax.set_xlabel(against)
        ax.grid(color=GRID, lw=0.6)
        ax.spines[["top", "right"]].set_visible(False)
        if against == "nodes":
            ax.set_xscale("log")
            ax.invert_xaxis()
        else:
            ax.xaxis.get_major_locator().set_params(integer=True)
    axes[0].set_ylim(0, 62)  # 60 degrees are the best there is
    axes[1].set_ylim(58, 182)
    for ax in axes[:2]:
        ax.yaxis.get_major_locator().set_params(steps=[1, 1.5, 3, 10])
    axes[2].set_yscale("log")
    if "" not in given:
        axes[0].legend(frameon=False, fontsize=9)
    return figure
