"""What the check of a mesh finds out about its facets, and what it asks of their tags."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import MeshError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False, repr=False)
class Topology:
    """What the check of a mesh finds out about it.

    Attributes
    ----------
    flip : (k,) int64 array
        Cells that were given clockwise; the mesh stores them with their last two nodes exchanged.
    facets : (s, d) int64 array
        Every facet once. First those of the boundary, directed with their one cell on the left; then those between two
        cells (of different tags, or given), directed with ``facet_cells[:, 0]`` on the left.
    facet_cells : (s, 2) int64 array
        Left and right cell of each facet; -1 where there is none.
    facet_given : (s,) int64 array
        Row of the user's `facets`, or -1.
    n_boundary : int
        How many of them are of the boundary.
    layer : (n,) int64 array or None
        Parts that overlap another one shallowly, as the two sides of a sliding interface do, or that touch another one
        where nodes do not match, have different layers; None where all is one layer (nearly always).
    """

    flip: NDArray[np.int64]
    facets: NDArray[np.int64]
    facet_cells: NDArray[np.int64]
    facet_given: NDArray[np.int64]
    n_boundary: int
    layer: NDArray[np.int64] | None = None

    def __repr__(self) -> str:
        layers = "" if self.layer is None else f", {int(self.layer.max()) + 1} layers"
        return f"Topology({len(self.facets)} facets, {self.n_boundary} of them of the boundary{layers})"


def refuse_two_tags(facets: NDArray[Any], tags: NDArray[Any], topology: Topology) -> None:
    """Refuse a facet that is given twice with different tags.

    Raises
    ------
    MeshError
        Naming both rows.
    """
    kept = topology.facet_given[topology.facet_given >= 0]
    if len(kept) == len(facets):
        return
    first_row = {tuple(sorted(facets[row].tolist())): int(row) for row in kept}
    for row in np.setdiff1d(np.arange(len(facets)), kept).tolist():
        first = first_row[tuple(sorted(facets[row].tolist()))]
        if tags[row] != tags[first]:
            raise MeshError(
                f"two tags: 'facets' row {row} is {facets[row].tolist()} with tag {tags[row]}, the facet of row "
                f"{first} with tag {tags[first]}; give each facet one tag",
                rule="two tags",
                array="facets",
                index=row,
            )
