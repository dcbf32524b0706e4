"""Values stay on their side: prolongations of random domains against an oracle that follows what is connected."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("scipy")

import coarsen
from coarsen import transfer
from coarsen.transfer.location import coarse_nodes_in_fine
from domains import domains
from transfer_oracle import oracle

SEED = 7


def pairs(way, features, count):
    """Two levels of random domains, the values that the one's nodes take from the other, and what the oracle says."""
    for mesh in domains(SEED, count):
        h = coarsen.hierarchy(mesh, features=features, coarsest=6, nested="nested" not in way)
        step = 2 if way == "over a level" else 1
        for i in range(step, len(h)):
            ends = (i, i - step) if way == "up, not nested" else (i - step, i)
            one, other = (h[end].mesh for end in ends)
            shared = transfer.shared_nodes(h, *ends)
            said = oracle(one.points, one.cells, other.points, other.cells, shared)
            if said.unsure:
                continue
            matrix = coarse_nodes_in_fine(h, *ends[::-1]) if ends[0] > ends[1] else transfer.locate(h, *ends).matrix
            yield one, other, matrix, said


def are_right(nodes, walls, cells):
    """Nodes of the boundary that the piece meets, or of a cell there: where a line that left may come in again."""
    at_wall = [set(cell) for cell in cells.tolist() if any((cell[k], cell[(k + 1) % 3]) in walls for k in range(3))]
    return nodes <= set(np.ravel(walls).tolist()) or any(nodes <= cell for cell in at_wall)


@pytest.mark.parametrize("features", ["keep", "drop", "auto"])
@pytest.mark.parametrize(
    ("way", "count"), [("next level", 60), ("over a level", 30), ("not nested", 30), ("up, not nested", 20)]
)
def test_values_stay_on_their_side(way, count, features):
    inside = outside = strange = 0
    for one, other, matrix, said in pairs(way, features, count):
        near = 1e-10 * np.ptp(one.points, axis=0).max() + 1e-15 * np.abs(one.points).max()
        for v, (holding, walls) in enumerate(zip(said.right, said.walls, strict=True)):
            nodes = set(matrix[v].indices.tolist())
            if holding:
                assert np.abs(matrix[v] @ other.points - one.points[v]).max() < near
                assert any(nodes <= set(other.cells[cell].tolist()) for cell in holding)
                inside += 1
            elif walls:
                strange += not are_right(nodes, walls, other.cells)
                outside += 1
    assert inside > 500
    assert outside > (0 if "up" in way else 20)
    # of 7,043 such nodes with "drop" and "auto" (seeds 1 to 6), 6 took a value from across a gap: where
    # the boundary of one level leaves a node on the one side of that of the other, and comes back on its other side
    assert strange <= (0 if features == "keep" else 1 + 0.002 * outside)
