"""Pictures of meshes, levels and hierarchies: matplotlib, and PyVista for views, imported when one is asked for."""

from .levels import plot_hierarchy, plot_level
from .meshes import plot_mesh
from .quality import angles_of, plot_angles, plot_quality, plot_similarity
from .views import grid_of, level_grid, view_hierarchy, view_mesh

__all__ = [
    "angles_of",
    "grid_of",
    "level_grid",
    "plot_angles",
    "plot_hierarchy",
    "plot_level",
    "plot_mesh",
    "plot_quality",
    "plot_similarity",
    "view_hierarchy",
    "view_mesh",
]
