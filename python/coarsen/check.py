"""Definition 2.4 measured: how well-conditioned a hierarchy is.

A hierarchy is (θ, I, b)-well-conditioned where every angle of every coarser level lies between θ and 180° - θ, where
el of a level is nowhere over I times el of the next finer one, and where the last level has at most b cells. `el`
(Definition 2.1) is the longest edge of the cell that holds a point.

The size of a level is told against a lower bound in the manner of Lemma 4.6. A triangle of longest edge e has at most
the area √3/4 e², so a mesh whose elements are nowhere larger than E has at least 4/√3 ∫ E⁻² cells. E is the largest
1-Lipschitz function under C^i el of the input (Lemma 5.8): what any well-shaped coarsening by C^i has to obey.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from . import spacing
from .backend import backend
from .quality import longest_edges
from .transfer.location import places_among

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .mesh import Mesh
    from .multilevel import Hierarchy, Level


@dataclass(frozen=True, eq=False, repr=False)
class LevelCheck:
    """What Definition 2.4 says of one level.

    Attributes
    ----------
    level : int
    n_points, n_cells : int
    min_angle, max_angle : float
        Degrees; NaN on a line.
    similarity : float
        The largest el of this level over el of the next finer one, over all points; NaN on level 0.
    nested : bool
        Whether the nodes are nodes of the next finer level.
    size_ratio : float
        Cells over the least number that a mesh with elements as large as allowed can have; NaN on a line.
    """

    level: int
    n_points: int
    n_cells: int
    min_angle: float
    max_angle: float
    similarity: float
    nested: bool
    size_ratio: float

    def __repr__(self) -> str:
        similarity = "" if np.isnan(self.similarity) else f", similarity {self.similarity:.2f}"
        return f"LevelCheck(level {self.level}, angles {self.min_angle:.2f} to {self.max_angle:.2f}{similarity})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, LevelCheck):
            return NotImplemented
        # what is not known equals itself
        pairs = zip(astuple(self), astuple(other), strict=True)
        return all(mine == theirs or (mine != mine and theirs != theirs) for mine, theirs in pairs)  # noqa: PLR0124

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True, repr=False)
class Conditioning:
    """A hierarchy measured by Definition 2.4; true where the bounds asked for hold on every coarser level.

    Attributes
    ----------
    levels : tuple of LevelCheck
    failed : tuple of str
        What did not hold.
    """

    levels: tuple[LevelCheck, ...]
    failed: tuple[str, ...]

    def __bool__(self) -> bool:
        return not self.failed

    def __repr__(self) -> str:
        holds = f", {len(self.failed)} bounds not held" if self.failed else ""
        return f"Conditioning({self.depth} levels, θ = {self.theta:.2f}, I = {self.similarity:.2f}{holds})"

    @property
    def depth(self) -> int:
        """Number of meshes (Definition 2.3)."""
        return len(self.levels)

    @property
    def theta(self) -> float:
        """The smallest angle of all coarser levels in degrees, or 180° less the largest (Definition 2.4)."""
        coarser = self.levels[1:] or self.levels
        return min(min(one.min_angle, 180.0 - one.max_angle) for one in coarser)

    @property
    def similarity(self) -> float:
        """The largest I of all pairs of levels."""
        return max((one.similarity for one in self.levels[1:]), default=1.0)

    def __str__(self) -> str:
        lines = ["level    nodes    cells  min angle  max angle  similarity  nested  size ratio"]
        for one in self.levels:
            similarity = "-" if np.isnan(one.similarity) else f"{one.similarity:.2f}"
            lines.append(
                f"{one.level:5d} {one.n_points:8d} {one.n_cells:8d} {one.min_angle:10.2f} {one.max_angle:10.2f} "
                f"{similarity:>11} {'yes' if one.nested else 'no':>7} {one.size_ratio:11.2f}"
            )
        return "\n".join([*lines, *(f"not held: {text}" for text in self.failed)])


def similarity(finer: Level, coarser: Level, name: str = "rust") -> float:
    """Return the largest el of `coarser` over el of `finer`, over all points that both meshes hold."""
    return float(np.nanmax(local_similarity(finer, coarser, name)))


def local_similarity(finer: Level, coarser: Level, name: str = "rust") -> NDArray[np.float64]:
    """Return how much longer elements become, by cell of `finer`: (m,).

    The largest el of the cells of `coarser` that overlap a cell, over the cell's own el; NaN for a cell that lies
    outside `coarser`.
    """
    one, two = finer.mesh, coarser.mesh
    if one.dim == 1:
        return _line_similarity(one, two)
    pair = one.points, one.cells, one.boundary_facets, two.points, two.cells, places_among(finer, coarser)
    indptr, indices, areas = backend(name).overlap(*pair, None)
    lengths = np.where(areas > 0, longest_edges(two)[indices], 0.0)
    longest = np.zeros(one.n_cells)
    some = indptr[:-1] < indptr[1:]
    longest[some] = np.maximum.reduceat(lengths, indptr[:-1][some])
    ratio: NDArray[np.float64] = np.where(longest > 0, longest, np.nan) / longest_edges(one)
    return ratio


def _line_similarity(one: Mesh, two: Mesh) -> NDArray[np.float64]:
    middle = one.points[one.cells, 0].mean(axis=1)
    starts = two.points[two.cells[:, 0], 0]
    order = np.argsort(starts)
    holder = order[np.maximum(np.searchsorted(starts[order], middle, side="right") - 1, 0)]
    ratio: NDArray[np.float64] = longest_edges(two)[holder] / longest_edges(one)
    return ratio


def similarities(h: Hierarchy) -> list[float]:
    """Return the local similarity of every level to the next finer one, NaN first; measured once for a hierarchy."""
    known: list[float] | None = h.__dict__.get("_similarities")
    if known is None:
        known = [float("nan"), *(similarity(finer, coarser) for finer, coarser in pairwise(h))]
        h.__dict__["_similarities"] = known
    return list(known)


def least_cells(mesh: Mesh, factors: Sequence[float]) -> list[float]:
    """Return, for each factor, the least number of cells of a mesh with elements as large as it may have."""
    el = longest_edges(mesh)
    a, b, c = (mesh.points[corner] for corner in mesh.cells.T)
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    middles = (a + b + c) / 3
    allowed = (el if factor == 1.0 else spacing.coarsened(middles, el, factor) for factor in factors)
    return [float(4 / np.sqrt(3) * (area / longest**2).sum()) for longest in allowed]


def check(
    h: Hierarchy, *, min_angle: float | None = None, similarity: float | None = None, size: float | None = None
) -> Conditioning:
    """Measure a hierarchy by Definition 2.4.

    Parameters
    ----------
    h : Hierarchy
    min_angle : float, optional
        θ in degrees, asked of every coarser level: θ < angles < 180° - θ.
    similarity : float, optional
        I, asked of every two adjacent levels.
    size : float, optional
        b, asked of the last level: at most this many cells.

    Returns
    -------
    Conditioning
        True where what was asked for holds; printable.
    """
    levels, failed = [], []
    ratios = similarities(h)
    flat = h[0].mesh.dim > 1
    least = least_cells(h[0].mesh, [level.factor for level in h]) if flat else [float("nan")] * len(h)
    for i, (level, ratio, fewest) in enumerate(zip(h, ratios, least, strict=True)):
        quality = level.quality
        nested = i == 0 or bool(np.isin(level.nodes, h[i - 1].nodes).all())
        one = LevelCheck(
            i,
            level.mesh.n_points,
            level.mesh.n_cells,
            quality.min_angle,
            quality.max_angle,
            ratio,
            nested,
            level.mesh.n_cells / fewest,
        )
        levels.append(one)
        if i and min_angle is not None and not min_angle < min(one.min_angle, 180 - one.max_angle):
            failed.append(f"level {i} has angles from {one.min_angle:.2f} to {one.max_angle:.2f}, θ = {min_angle:g}")
        if i and similarity is not None and not ratio <= similarity:
            failed.append(f"level {i} has elements {ratio:.2f} times as large as level {i - 1}, I = {similarity:g}")
    if size is not None and levels[-1].n_cells > size:
        failed.append(f"the last level has {levels[-1].n_cells} cells, b = {size:g}")
    return Conditioning(tuple(levels), tuple(failed))
