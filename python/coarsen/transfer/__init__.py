"""Operators between the levels of a hierarchy: nodal fields, cell fields, graphs.

`Hierarchy.prolongation` and its companions are the functions of this package. All work on any two levels of a
hierarchy, nested or not. One file a concept: `location` of the nodes of one level in another, the operators between
`nodes`, what is `held`, `overlap` of cells, `fields`, `graphs`, the `report`; `rows` wraps the core's arrays for SciPy.
"""

from .fields import ON, interpolate
from .graphs import Assignment, Graph, assignment, graph
from .held import free_mask, reduced
from .location import Located, locate, shared_nodes
from .nodes import injection, prolongation, restriction
from .overlap import cell_sizes, cell_transfer
from .report import LevelTransfer, TransferReport, transfer_report
from .rows import sparse

__all__ = [
    "ON",
    "Assignment",
    "Graph",
    "LevelTransfer",
    "Located",
    "TransferReport",
    "assignment",
    "cell_sizes",
    "cell_transfer",
    "free_mask",
    "graph",
    "injection",
    "interpolate",
    "locate",
    "prolongation",
    "reduced",
    "restriction",
    "shared_nodes",
    "sparse",
    "transfer_report",
]
