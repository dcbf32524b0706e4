"""Quality as pictures: histograms of the angles by level, curves against the level for several hierarchies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

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
    figure, axes = pyplot().subplots(
        len(h), 1, figsize=(6.5, 0.4 + 0.72 * len(h)), sharex=True, squeeze=False, layout="constrained"
    )
    for i, (level, ax) in enumerate(zip(h, axes.ravel(), strict=True)):
        angles = angles_of(level.mesh).ravel()
        ax.hist(angles, bins=np.linspace(0, 180, bins + 1), color=LINES[0], alpha=0.85, density=True)
        for value, side in ((angles.min(), "right"), (angles.max(), "left")):
            ax.axvline(value, color=FACET, lw=1.0)
            gap = -1.2 if side == "right" else 1.2
            ax.text(
                value + gap, 0.92, f"{value:.1f}°", ha=side, va="top", fontsize=7.5, color=FACET,
                transform=ax.get_xaxis_transform(),
            )  # fmt: skip
        ax.set_yticks([])
        ax.tick_params(axis="x", length=0)
        ax.set_ylabel(f"{i}", rotation=0, ha="right", va="center", color=INK)
        for name, spine in ax.spines.items():
            spine.set_visible(name == "bottom")
            spine.set_color(GRID)
    axes[-1, 0].set_xticks(range(0, 181, 30))
    axes[-1, 0].set_xlabel("angle, degrees")
    axes[0, 0].set_title("angles by level", fontsize=10, color=INK, loc="left")
    return figure


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
    axes[0].set_ylim(bottom=0)
    axes[1].set_ylim(top=180)
    axes[2].set_yscale("log")
    if "" not in given:
        axes[0].legend(frameon=False, fontsize=9)
    return figure
