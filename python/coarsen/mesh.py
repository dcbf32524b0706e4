"""The mesh: points and cells, checked once by the core, then never changed."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .arguments import thread_count
from .arrays import FloatArray, IndexArray, fields_of, index_rows, names_of, points_array, read_only, tags_array
from .backend import backend
from .errors import MeshError
from .quality import Quality, quality_of
from .topology import Topology, refuse_two_tags

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .repaired import Repairs

__all__ = ["Mesh", "MeshError", "Quality", "Topology"]


class Mesh:
    """Triangles in the plane, or intervals on a line (d = 1); checked, immutable.

    Parameters
    ----------
    points : (n, d) array_like of real numbers
        Coordinates; float64 in C order is taken without a copy, as a view that can't be written to.
    cells : (m, d + 1) array_like of integers
        Nodes of each cell, counted from 0, in either orientation; they are stored counter-clockwise.
    facets : (s, d) array_like of integers, optional
        Edges that every coarser mesh must keep as unions of its own edges: material interfaces, cracks, coast lines.
        The boundary and every edge between cells of different `cell_tags` are facets whether given or not. An edge
        given twice counts once; two different tags for it are an error.
    facet_tags : (s,) array_like of integers, optional
        Tags of the given `facets`.
    cell_tags : (m,) array_like of integers, optional
        Tags of the cells.
    point_data : mapping of str to (n, ...) array_like, optional
        Nodal fields (depth, for instance), carried to every level.
    facet_names, cell_names : mapping of int to str, optional
        What tags are called (``{1: "inflow", 2: "wall"}``): physical groups of gmsh, markers of SU2, kinds of boundary
        of ADCIRC. Carried to every level and into files that have names.
    threads : int, optional
        How many threads check the mesh; all cores if not given.

    Attributes
    ----------
    points, cells, facets, facet_tags, cell_tags, point_data, facet_names, cell_names
        As given, read-only; None where not given.
    dim, n_points, n_cells : int
    boundary_facets : (b, d) int64 array
        Edges of one cell, which lies on their left.
    topology : Topology

    Raises
    ------
    MeshError
        If the mesh breaks a rule: a coordinate that isn't finite, an index out of range, a repeated node within a cell,
        a cell of zero area, a duplicate cell, an edge with three cells, a node in no cell, coincident nodes that are no
        slit, overlapping or inverted cells, a hanging node, wrong shape or dtype. The message names the rule, the
        array, the first index and its value, and how many more. `Mesh.repaired` mends some of it.

    Notes
    -----
    A *slit* is a line along which two or more nodes share coordinates, each with cells on its own side only::

            o-----o-----o          upper cells
            |     |     |
            1-----3     |          nodes 1, 2 and 3, 4 share coordinates: a slit
            2-----4-----5          that ends at node 5
            |     |     |
            o-----o-----o          lower cells

    Parts may touch each other. Those that are nowhere joined may even overlap by up to a twentieth of their edges, as
    the two polygons of a sliding interface do.

    The check costs O(n + m) for the cells and O(b log b) for b boundary edges.

    Examples
    --------
    >>> import coarsen
    >>> coarsen.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], [[0, 1, 2], [0, 2, 3]])
    Mesh(4 points, 2 triangles, 4 boundary edges)
    """

    __slots__ = (
        "_cell_names",
        "_cell_tags",
        "_cells",
        "_facet_names",
        "_facet_tags",
        "_facets",
        "_point_data",
        "_points",
        "_quality",
        "_topology",
    )

    _points: FloatArray
    _cells: IndexArray
    _facets: NDArray[Any] | None
    _facet_tags: NDArray[Any] | None
    _cell_tags: NDArray[Any] | None
    _point_data: dict[str, NDArray[Any]] | None
    _facet_names: dict[int, str] | None
    _cell_names: dict[int, str] | None
    _topology: Topology
    _quality: Quality | None

    def __init__(
        self,
        points: Any,
        cells: Any,
        *,
        facets: Any = None,
        facet_tags: Any = None,
        cell_tags: Any = None,
        point_data: Mapping[str, Any] | None = None,
        facet_names: Mapping[int, str] | None = None,
        cell_names: Mapping[int, str] | None = None,
        threads: int | None = None,
    ) -> None:
        points = points_array(points)
        dim = points.shape[1]
        cells = index_rows("cells", cells, dim + 1, f"(m, {dim + 1})")
        if facets is not None:
            facets = index_rows("facets", facets, dim, f"(s, {dim})")
        elif facet_tags is not None:
            raise MeshError("'facet_tags' without 'facets'", rule="wrong shape", array="facet_tags")
        if facet_tags is not None:
            facet_tags = tags_array("facet_tags", facet_tags, len(facets), "'facets'")
        if cell_tags is not None:
            cell_tags = tags_array("cell_tags", cell_tags, len(cells), "'cells'")
        fields = fields_of(point_data, len(points))
        names = names_of("facet_names", facet_names), names_of("cell_names", cell_names)
        threads = thread_count(threads)
        found = backend("rust").check_mesh(
            points,
            cells,
            None if facets is None else facets.astype(np.int64, copy=False),
            None if cell_tags is None else cell_tags.astype(np.int64, copy=False),
            threads,
        )
        topology = Topology(**found)
        if facet_tags is not None:
            refuse_two_tags(facets, facet_tags, topology)
        if len(topology.flip):
            cells = cells.copy()
            cells[topology.flip, -2:] = cells[topology.flip, :-3:-1]
        self._set(points, cells, topology, facets, facet_tags, cell_tags, fields, *names)

    @classmethod
    def _trusted(
        cls,
        points: FloatArray,
        cells: IndexArray,
        topology: Topology,
        *,
        facets: NDArray[Any] | None = None,
        facet_tags: NDArray[Any] | None = None,
        cell_tags: NDArray[Any] | None = None,
        point_data: dict[str, NDArray[Any]] | None = None,
        facet_names: dict[int, str] | None = None,
        cell_names: dict[int, str] | None = None,
    ) -> Mesh:
        """Make a mesh that is known to be legal, with cells positive, without checking it."""
        mesh = cls.__new__(cls)
        mesh._set(points, cells, topology, facets, facet_tags, cell_tags, point_data, facet_names, cell_names)
        return mesh

    def _set(
        self,
        points: FloatArray,
        cells: IndexArray,
        topology: Topology,
        facets: NDArray[Any] | None,
        facet_tags: NDArray[Any] | None,
        cell_tags: NDArray[Any] | None,
        point_data: dict[str, NDArray[Any]] | None,
        facet_names: dict[int, str] | None,
        cell_names: dict[int, str] | None,
    ) -> None:
        values = {
            "_points": read_only(points),
            "_cells": read_only(cells),
            "_topology": topology,
            "_facets": None if facets is None else read_only(facets),
            "_facet_tags": None if facet_tags is None else read_only(facet_tags),
            "_cell_tags": None if cell_tags is None else read_only(cell_tags),
            "_point_data": None if point_data is None else {k: read_only(v) for k, v in point_data.items()},
            "_facet_names": dict(facet_names) if facet_names else None,
            "_cell_names": dict(cell_names) if cell_names else None,
            "_quality": None,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"a Mesh can't be changed: cannot set {name!r}")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"a Mesh can't be changed: cannot delete {name!r}")

    @property
    def points(self) -> FloatArray:
        """Coordinates, (n, d) float64, read-only."""
        return self._points

    @property
    def cells(self) -> IndexArray:
        """Nodes of each cell, (m, d + 1) int32 or int64, counter-clockwise, read-only."""
        return self._cells

    @property
    def facets(self) -> NDArray[Any] | None:
        """Given facets, (s, d), or None."""
        return self._facets

    @property
    def facet_tags(self) -> NDArray[Any] | None:
        """Tags of the given facets, (s,), or None."""
        return self._facet_tags

    @property
    def cell_tags(self) -> NDArray[Any] | None:
        """Tags of the cells, (m,), or None."""
        return self._cell_tags

    @property
    def point_data(self) -> dict[str, NDArray[Any]] | None:
        """Nodal fields by name, each (n, ...), or None."""
        return None if self._point_data is None else dict(self._point_data)

    @property
    def facet_names(self) -> dict[int, str] | None:
        """What facet tags are called, by tag, or None."""
        return None if self._facet_names is None else dict(self._facet_names)

    @property
    def cell_names(self) -> dict[int, str] | None:
        """What cell tags are called, by tag, or None."""
        return None if self._cell_names is None else dict(self._cell_names)

    @property
    def topology(self) -> Topology:
        """Facets and their cells."""
        return self._topology

    @property
    def dim(self) -> int:
        """Dimension d: 2, or 1 on a line."""
        return int(self._points.shape[1])

    @property
    def n_points(self) -> int:
        """Number of points n."""
        return len(self._points)

    @property
    def n_cells(self) -> int:
        """Number of cells m."""
        return len(self._cells)

    @property
    def boundary_facets(self) -> NDArray[np.int64]:
        """Facets of one cell, (b, d) int64, with that cell on their left."""
        return read_only(self._topology.facets[: self._topology.n_boundary])

    def quality(self) -> Quality:
        """Return counts, angles, edge lengths and area; O(m), kept for the next call."""
        if self._quality is None:
            object.__setattr__(self, "_quality", quality_of(self._points, self._cells))
        assert self._quality is not None
        return self._quality

    def scaled(self, s: float) -> Mesh:
        """Return the mesh with all coordinates multiplied by `s` > 0.

        Raises
        ------
        ValueError
            If `s` is not a positive finite number.
        MeshError
            If rounding or overflow breaks the mesh.
        """
        scale = float(s)
        if not 0.0 < scale < np.inf:
            raise ValueError(f"'s' is {s!r}, expected a positive finite number")
        with np.errstate(over="ignore", under="ignore"):
            points = self._points * scale
        return Mesh(points, self._cells, **self._beside())

    def _beside(self) -> dict[str, Any]:
        """Return all that is given beside points and cells."""
        names = ("facets", "facet_tags", "cell_tags", "point_data", "facet_names", "cell_names")
        return {name: getattr(self, f"_{name}") for name in names}

    @classmethod
    def repaired(cls, points: Any, cells: Any, **given: Any) -> tuple[Mesh, Repairs]:
        """Mend what can be mended, and say what was done; see `coarsen.repaired.repaired`.

        Raises
        ------
        MeshError
            If the mesh breaks a rule that can't be mended.
        """
        from .repaired import repaired

        return repaired(points, cells, **given)

    @classmethod
    def read(cls, path: str | Path, **options: Any) -> Mesh:
        """Read a mesh from a file; see `coarsen.read`."""
        from .io import read

        mesh: Mesh = read(path, **options)
        return mesh

    def write(self, path: str | Path, **options: Any) -> None:
        """Write the mesh to a file, its format told by the ending; see `coarsen.io.write`."""
        from .io import write

        write(self, path, **options)

    @classmethod
    def from_meshio(cls, m: Any, **options: Any) -> Mesh:
        """Make a mesh of a ``meshio.Mesh``; see `coarsen.io.from_meshio`."""
        from .io import from_meshio

        mesh: Mesh = from_meshio(m, **options)
        return mesh

    def to_meshio(self) -> Any:
        """Return a ``meshio.Mesh`` with tags and nodal fields."""
        from .io import to_meshio

        return to_meshio(self)

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Draw the mesh; see `coarsen.plot.plot_mesh`."""
        from .plot import plot_mesh

        return plot_mesh(self, ax=ax, **options)

    def to_pyvista(self) -> Any:
        """Return a ``pyvista.UnstructuredGrid`` with tags and nodal fields; see `coarsen.plot.grid_of`."""
        from .plot import grid_of

        return grid_of(self)

    def view(self, scalars: str | None = None, **options: Any) -> Any:
        """Show the mesh in a window of PyVista; see `coarsen.plot.view_mesh`."""
        from .plot import view_mesh

        return view_mesh(self, scalars, **options)

    def __repr__(self) -> str:
        plane = self.dim == 2
        parts = [
            f"{self.n_points} points",
            f"{self.n_cells} {'triangles' if plane else 'intervals'}",
            f"{self._topology.n_boundary} boundary {'edges' if plane else 'nodes'}",
        ]
        if self._facets is not None:
            parts.append(f"{len(self._facets)} given facets")
        if self._cell_tags is not None:
            parts.append(f"{len(np.unique(self._cell_tags))} cell tags")
        if self._point_data:
            parts.append(f"fields {', '.join(self._point_data)}")
        return f"Mesh({', '.join(parts)})"

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        if not isinstance(other, Mesh):
            return NotImplemented
        arrays = ("_points", "_cells", "_facets", "_facet_tags", "_cell_tags")
        if not all(_equal(getattr(self, name), getattr(other, name)) for name in arrays):
            return False
        if self._facet_names != other._facet_names or self._cell_names != other._cell_names:
            return False
        mine, theirs = self._point_data or {}, other._point_data or {}
        return mine.keys() == theirs.keys() and all(
            np.array_equal(mine[name], theirs[name], equal_nan=True) for name in mine
        )

    __hash__ = None  # type: ignore[assignment]

    def __getstate__(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}

    def __setstate__(self, state: dict[str, Any]) -> None:
        given = ("_facets", "_facet_tags", "_cell_tags", "_point_data", "_facet_names", "_cell_names")
        self._set(state["_points"], state["_cells"], state["_topology"], *(state.get(name) for name in given))

    def __copy__(self) -> Mesh:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Mesh:
        # nothing of a mesh can change but the user's own arrays under its views: a deep copy has arrays of its own
        mesh = Mesh.__new__(Mesh)
        mesh.__setstate__({name: copy.deepcopy(value, memo) for name, value in self.__getstate__().items()})
        return mesh


def _equal(mine: NDArray[Any] | None, theirs: NDArray[Any] | None) -> bool:
    if mine is None or theirs is None:
        return mine is theirs
    return np.array_equal(mine, theirs)
