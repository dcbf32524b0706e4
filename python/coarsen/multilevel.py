"""One level (Figure 2) and the hierarchy (Figure 3) of Miller, Talmor and Teng (1997).

`coarsen` and `hierarchy` check the options, hand the mesh to a backend, and wrap what comes back; `Level` and
`Hierarchy` hold the results. Transfer, files, pictures and tables live in their own modules, imported when asked for.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from coarsen import spacing as spacings
from coarsen.backend import backend
from coarsen.mesh import Mesh, Quality, Topology
from coarsen.options import Options

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_matrix

    from coarsen.check import Conditioning

log = logging.getLogger("coarsen")

STOPPED = {
    "levels": "the {depth} levels asked for are there",
    "coarsest": "level {depth} has at most {coarsest} cells",
    "stalled": "one more level would keep over 95 % of the cells of level {depth}",
}
"""Why a hierarchy ends, by what the core says."""

_GO_ON = " (the domain's features hold it; features='auto' or 'drop' goes on)"


@dataclass(frozen=True, eq=False, repr=False)
class Level:
    """A mesh of a hierarchy, in terms of the nodes of the input mesh.

    Attributes
    ----------
    mesh : Mesh
        The level's mesh; ``mesh.points`` are ``h[0].mesh.points[nodes]``, bit for bit.
    nodes : (k,) int64 array
        The level's nodes as indices into the input mesh, ascending.
    factor : float
        C^i, by which the spacing of the input was coarsened.
    spacing : (k,) float64 array
        The coarsened spacing f_i at the level's nodes, in the units of the points.
    visits : int
        Candidates that were looked at to make the level.
    """

    mesh: Mesh
    nodes: NDArray[np.int64]
    factor: float
    spacing: NDArray[np.float64]
    visits: int = 0
    dropped: dict[str, Any] | None = None

    @cached_property
    def quality(self) -> Quality:
        """Counts, angles, edges and area of the level's mesh, and what ``features="drop"`` took off it."""
        quality = self.mesh.quality()
        return quality if self.dropped is None else replace(quality, **self.dropped)

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Draw the level; see `coarsen.plot.plot_level`."""
        from coarsen.plot import plot_level

        return plot_level(self, ax=ax, **options)

    def to_pyvista(self) -> Any:
        """Return a ``pyvista.UnstructuredGrid`` with ``node`` and ``spacing``; see `coarsen.plot.level_grid`."""
        from coarsen.plot import level_grid

        return level_grid(self)

    def __repr__(self) -> str:
        return f"Level({self.mesh.n_points} nodes, {self.mesh.n_cells} cells, factor {self.factor:g})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Level):
            return NotImplemented
        same = self.factor == other.factor and self.mesh == other.mesh
        return same and np.array_equal(self.nodes, other.nodes) and np.array_equal(self.spacing, other.spacing)

    __hash__ = None  # type: ignore[assignment]


class Hierarchy(Sequence[Level]):
    """A mesh and its coarser meshes, finest first; ``h[0].mesh`` is the given mesh.

    Attributes
    ----------
    levels : tuple of Level
    stopped : str
        Why the hierarchy ends where it does.
    options : Options
        The options it was built with.
    """

    def __init__(self, levels: Sequence[Level], stopped: str, options: Options) -> None:
        self.levels = tuple(levels)
        self.stopped = stopped
        self.options = options

    @overload
    def __getitem__(self, index: int) -> Level: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Level, ...]: ...
    def __getitem__(self, index: int | slice) -> Level | tuple[Level, ...]:
        return self.levels[index]

    def __len__(self) -> int:
        return len(self.levels)

    def __iter__(self) -> Iterator[Level]:
        return iter(self.levels)

    def __repr__(self) -> str:
        sizes = " > ".join(str(level.mesh.n_points) for level in self.levels)
        return f"Hierarchy({len(self)} levels, nodes {sizes})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Hierarchy):
            return NotImplemented
        return self.levels == other.levels and self.stopped == other.stopped

    __hash__ = None  # type: ignore[assignment]

    def prolongation(self, i: int, *, free: Any = None, dirichlet: Any = None) -> csr_matrix:
        """Return piecewise-linear interpolation from level `i` to level `i` - 1; see `coarsen.transfer`."""
        from coarsen import transfer

        return transfer.prolongation(self, i, free=free, dirichlet=dirichlet)

    def restriction(self, i: int, *, free: Any = None, dirichlet: Any = None) -> csr_matrix:
        """Return the transpose of the prolongation from level `i`."""
        from coarsen import transfer

        return transfer.restriction(self, i, free=free, dirichlet=dirichlet)

    def injection(self, i: int, *, free: Any = None, dirichlet: Any = None) -> csr_matrix:
        """Return the matrix that picks the nodes that level `i` shares with level `i` - 1 (nested hierarchies)."""
        from coarsen import transfer

        return transfer.injection(self, i, free=free, dirichlet=dirichlet)

    def transfer_report(self) -> Any:
        """Say how many nodes lie outside the next coarser mesh, and how far; see `coarsen.transfer`."""
        from coarsen import transfer

        return transfer.transfer_report(self)

    def interpolate(self, values: Any, from_level: int, to_level: int, *, on: str = "nodes") -> NDArray[Any]:
        """Carry values at nodes or cells from one level to another; see `coarsen.transfer`."""
        from coarsen import transfer

        return transfer.interpolate(self, values, from_level, to_level, on=on)

    def graph(self, i: int) -> Any:
        """Return edges of level `i`, both directions, with relative positions; see `coarsen.transfer`."""
        from coarsen import transfer

        return transfer.graph(self, i)

    def assignment(self, i: int) -> Any:
        """Assign each node of level `i` - 1 to nodes of level `i`, with weights; see `coarsen.transfer`."""
        from coarsen import transfer

        return transfer.assignment(self, i)

    def check(
        self, *, min_angle: float | None = None, similarity: float | None = None, size: float | None = None
    ) -> Conditioning:
        """Measure Definition 2.4 level by level; see `coarsen.check`."""
        from coarsen.check import check

        return check(self, min_angle=min_angle, similarity=similarity, size=size)

    def summary(self) -> str:
        """Return a table of the levels as text."""
        from coarsen.tables import summary

        return summary(self)

    def plot(self, **options: Any) -> Any:
        """Draw the levels side by side; see `coarsen.plot.plot_hierarchy`."""
        from coarsen.plot import plot_hierarchy

        return plot_hierarchy(self, **options)

    def view(self, scalars: str | None = "spacing", **options: Any) -> Any:
        """Show the levels in linked windows of PyVista; see `coarsen.plot.view_hierarchy`."""
        from coarsen.plot import view_hierarchy

        return view_hierarchy(self, scalars, **options)

    def write(self, folder: str | Path, format: str = "vtu") -> list[Path]:
        """Write one file a level, and a series that ParaView opens; see `coarsen.io.write_hierarchy`."""
        from coarsen.io import write_hierarchy

        return write_hierarchy(self, folder, format)

    def save(self, path: str | Path, *, operators: bool = False) -> None:
        """Write the whole hierarchy to one ``.npz`` file, to be read by `coarsen.load` bit for bit."""
        from coarsen.io import save_hierarchy

        save_hierarchy(self, path, operators=operators)


def coarsen(mesh: Mesh, factor: float = 2.0, **options: Any) -> Level:
    """Coarsen a mesh once (ONE_LEVEL_COARSEN, Figure 2).

    Parameters
    ----------
    mesh : Mesh
    factor : float
        C > 1: the level is spaced by the C-coarsening of the spacing of `mesh`.
    **options
        Those of `hierarchy` but `levels`, `coarsest` and `nested`.

    Returns
    -------
    Level

    Raises
    ------
    ValueError
        If an option is unknown or out of its range.
    """
    return hierarchy(mesh, factor=factor, **options, levels=1)[1]


def hierarchy(
    mesh: Mesh,
    *,
    factor: float = 2.0,
    levels: int | None = None,
    coarsest: int = 100,
    nested: bool = True,
    progress: bool | Callable[[str, int, int], None] = False,
    **options: Any,
) -> Hierarchy:
    """Build coarser and coarser well-shaped meshes (MULTI_LEVEL_COARSEN, Figure 3).

    Parameters
    ----------
    mesh : Mesh
    factor : float
        C > 1: level i is spaced by the C^i-coarsening of the spacing of `mesh`.
    levels : int, optional
        How many coarser meshes, exactly; by default until `coarsest` is met or a level no longer shrinks.
    coarsest : int
        The paper's b: stop at the first level with at most this many cells.
    nested : bool
        Node-nested levels (coarsest first), or each level on its own.
    progress : bool or callable
        Show a bar, or call ``progress(stage, done, total)`` about every 25 ms.
    **options
        `method`, `spacing`, `beta`, `delta`, `gradation`, `features`, `candidates`, `min_angle`, `feature_angle`,
        `backend`, `threads`: see `coarsen.options.Options`.

    Returns
    -------
    Hierarchy

    Raises
    ------
    ValueError
        If an option is unknown or out of its range.

    Notes
    -----
    O(n log n) for the spacing of the input, O(n) for all levels (``candidates="pool"``).

    References
    ----------
    G. L. Miller, D. Talmor, S.-H. Teng, "Optimal Good-Aspect-Ratio Coarsening for Unstructured Meshes", 1997.
    """
    checked = Options.from_kwargs(factor=factor, levels=levels, coarsest=coarsest, nested=nested, **options)
    core = backend(checked.backend)
    began = perf_counter()
    given = given_spacing(mesh, checked)
    cells = mesh.cells.astype(np.int64, copy=False)
    with watched(progress) as report:
        if mesh.dim == 1:
            tags = None if mesh.cell_tags is None else mesh.cell_tags.astype(np.int64)
            made, stopped, finest = core.line_hierarchy(
                mesh.points, cells, tags, given, checked, report, checked.threads
            )
        else:
            made, stopped, finest = core.hierarchy(
                mesh.points, cells, facets_of(mesh), given, checked, report, checked.threads
            )
    whole = Level(mesh, np.arange(mesh.n_points), 1.0, finest)
    coarser = [level_from(mesh, level) for level in made]
    text = STOPPED[stopped].format(depth=len(made), coarsest=checked.coarsest)
    if stopped == "stalled" and checked.features == "keep" and mesh.dim > 1 and checked.method != "mis":
        text += _GO_ON
    made_of = Hierarchy([whole, *coarser], text, checked)
    log.info("%r of %r with %r in %.2f s; ended: %s", made_of, mesh, checked, perf_counter() - began, text)
    return made_of


@dataclass(frozen=True)
class FacetArrays:
    """Facets of a mesh as the core takes them: one row a facet edge, boundary first, first cell on the left."""

    facets: NDArray[np.int64]
    cell_tags: NDArray[np.int64]
    tags: NDArray[np.int64]
    given: NDArray[np.bool_]
    n_boundary: int
    layer: NDArray[np.uint8] | None


def facets_of(mesh: Mesh) -> FacetArrays:
    """Gather what the core needs to know of a mesh's facets."""
    topology = mesh.topology
    cells = topology.facet_cells
    tags = np.zeros(mesh.n_cells, np.int64) if mesh.cell_tags is None else mesh.cell_tags.astype(np.int64)
    beside = np.where(cells >= 0, tags[cells], 0)
    given = topology.facet_given >= 0
    facet_tags = np.zeros(len(given), np.int64)
    if mesh.facet_tags is not None:
        facet_tags[given] = mesh.facet_tags[topology.facet_given[given]]
    layer = None if topology.layer is None else topology.layer.astype(np.uint8)
    return FacetArrays(np.ascontiguousarray(topology.facets), beside, facet_tags, given, topology.n_boundary, layer)


def level_from(mesh: Mesh, made: dict[str, Any]) -> Level:
    """Wrap what the core made of one level."""
    nodes = made["nodes"]
    points = mesh.points.take(nodes, axis=0)
    cell_tags = None if mesh.cell_tags is None else made["cell_tags"].astype(mesh.cell_tags.dtype)
    fields = None if mesh.point_data is None else {name: values[nodes] for name, values in mesh.point_data.items()}
    carried: dict[str, Any] = {"cell_tags": cell_tags, "point_data": fields}
    carried |= {"facet_names": mesh.facet_names, "cell_names": mesh.cell_names}
    if mesh.dim == 1:
        coarse = Mesh(points, made["cells"], **carried)
        return Level(coarse, nodes, made["factor"], made["spacing"])
    given = made["given"]
    facets = facet_tags = None
    if mesh.facets is not None:
        facets = made["facets"][given]
        facet_tags = None if mesh.facet_tags is None else made["facet_tags"][given].astype(mesh.facet_tags.dtype)
    topology = Topology(
        flip=np.empty(0, np.int64),
        facets=made["facets"],
        facet_cells=made["facet_cells"],
        facet_given=np.where(given, np.cumsum(given) - 1, -1),
        n_boundary=made["n_boundary"],
        layer=None if mesh.topology.layer is None else mesh.topology.layer[nodes],
    )
    coarse = Mesh._trusted(points, made["cells"], topology, facets=facets, facet_tags=facet_tags, **carried)
    return Level(coarse, nodes, made["factor"], made["spacing"], made["visits"], made.get("dropped"))


def given_spacing(mesh: Mesh, options: Options) -> NDArray[np.float64] | None:
    """Evaluate the option `spacing`; None stands for the nearest-neighbour spacing, which the core computes itself.

    Raises
    ------
    ValueError
        If an array or a callable gives other than one positive finite value a node.
    """
    spacing = options.spacing
    if isinstance(spacing, str):
        return None if spacing == "nearest" else spacings.quadtree(mesh.points, backend=options.backend)
    values = np.ascontiguousarray(spacing(mesh.points) if callable(spacing) else spacing, dtype=np.float64)
    if values.shape != (mesh.n_points,):
        raise ValueError(f"'spacing' has shape {values.shape}, expected ({mesh.n_points},): one value a node")
    wrong = np.flatnonzero(~(np.isfinite(values) & (values > 0)))
    if len(wrong):
        raise ValueError(
            f"'spacing' of node {wrong[0]} is {values[wrong[0]]}, expected a positive finite number"
            + (f" ({len(wrong) - 1} more)" if len(wrong) > 1 else "")
        )
    return values


@contextmanager
def watched(progress: bool | Callable[[str, int, int], None]) -> Iterator[Callable[[str, int, int], None] | None]:
    """Turn the option `progress` into what the core calls: nothing, a bar on the terminal, or the user's function."""
    if callable(progress):
        yield progress
    elif not progress:
        yield None
    else:
        from coarsen.progress import progress_bar

        with progress_bar() as bar:
            yield bar
