"""The NumPy twin of the core: the same functions, named by the same files, written to be read beside the paper.

Spacing agrees with the core bit for bit, selected nodes exactly; triangulations are both (constrained) Delaunay.
Positional arguments and results are those of ``coarsen._core``; `threads` is taken and passed over.
"""

from .build import hierarchy
from .line import line_hierarchy
from .quadtree import quadtree
from .selection import conflict_graph, independent_set, skeleton_independent_set
from .spacing import coarsened, nearest, nearest_at, threshold
from .transfer import galerkin, overlap, prolongation, slow, stage
from .triangulation import delaunay

__all__ = [
    "coarsened",
    "conflict_graph",
    "delaunay",
    "galerkin",
    "hierarchy",
    "independent_set",
    "line_hierarchy",
    "nearest",
    "nearest_at",
    "overlap",
    "prolongation",
    "quadtree",
    "skeleton_independent_set",
    "slow",
    "stage",
    "threshold",
]
