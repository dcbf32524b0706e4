"""How the nodes of each level lie in the next coarser one, counted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from coarsen.transfer.location import locate

if TYPE_CHECKING:
    from coarsen.multilevel import Hierarchy


@dataclass(frozen=True)
class LevelTransfer:
    """How the nodes of level `level` - 1 lie in level `level`.

    Attributes
    ----------
    level, nodes : int
        The coarser level, and the number of nodes of the finer one.
    shared, on_edge, in_cell : int
        Finer nodes with one, two and three weights.
    outside : int
        Finer nodes outside of the coarse mesh.
    farthest, farthest_spacings : float
        The largest distance of such a node, and in units of the coarse spacing there.
    lost : int
        Finer nodes of parts that the coarse mesh has not.
    without_image : int
        Coarse nodes that no finer node takes a value from; 0 in nested hierarchies.
    """

    level: int
    nodes: int
    shared: int
    on_edge: int
    in_cell: int
    outside: int
    farthest: float
    farthest_spacings: float
    lost: int
    without_image: int


@dataclass(frozen=True, repr=False)
class TransferReport:
    """What `Hierarchy.transfer_report` found, one row a coarser level; prints as a table."""

    rows: tuple[LevelTransfer, ...]

    @property
    def outside(self) -> int:
        """Number of nodes that lie outside of the next coarser mesh, over all levels."""
        return sum(row.outside for row in self.rows)

    @property
    def without_image(self) -> int:
        """Number of coarse nodes without a finer node that takes a value from them, over all levels."""
        return sum(row.without_image for row in self.rows)

    def __repr__(self) -> str:
        return f"TransferReport({len(self.rows)} coarser levels, {self.outside} nodes outside of the next)"

    def __str__(self) -> str:
        head = "level   nodes  1 weight 2 weights 3 weights  outside   farthest (spacings)   lost  without image"
        lines = [
            f"{r.level:5d} {r.nodes:7d} {r.shared:9d} {r.on_edge:9d} {r.in_cell:9d} {r.outside:8d} "
            f"{r.farthest:10.4g} {r.farthest_spacings:10.3f} {r.lost:6d} {r.without_image:14d}"
            for r in self.rows
        ]
        return "\n".join([head, *lines])


def transfer_report(hierarchy: Hierarchy) -> TransferReport:
    """Say, for each coarser level, how many finer nodes lie outside of it, how far, and how the others lie.

    Returns
    -------
    TransferReport

    Raises
    ------
    RuntimeError
        If a node of a nested level has no finer node that takes a value from it: a defect of this package.
    """
    rows = []
    for i in range(1, len(hierarchy)):
        found = locate(hierarchy, i - 1, i)
        weights = np.diff(found.matrix.indptr)
        inside = np.ones(len(weights), dtype=bool)
        inside[found.outside] = False
        spacings = found.distance / (found.matrix[found.outside] @ hierarchy[i].spacing)
        bare = hierarchy[i].mesh.n_points - int(np.count_nonzero(np.bincount(found.matrix.indices)))
        if bare and hierarchy.options.nested:
            raise RuntimeError(f"internal error, please report it: {bare} nodes of level {i} have no fine image")
        rows.append(
            LevelTransfer(
                level=i,
                nodes=len(weights),
                shared=int(np.count_nonzero(weights[inside] == 1)),
                on_edge=int(np.count_nonzero(weights[inside] == 2)),
                in_cell=int(np.count_nonzero(weights[inside] == 3)),
                outside=len(found.outside),
                farthest=float(found.distance.max(initial=0.0)),
                farthest_spacings=float(spacings.max(initial=0.0)),
                lost=len(found.lost),
                without_image=bare,
            )
        )
    return TransferReport(tuple(rows))
