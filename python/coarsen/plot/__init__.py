"""Pictures of meshes, levels and hierarchies (matplotlib, imported when a picture is asked for)."""

from .levels import plot_hierarchy, plot_level
from .meshes import plot_mesh
from .quality import angles_of, plot_angles, plot_quality

__all__ = ["angles_of", "plot_angles", "plot_hierarchy", "plot_level", "plot_mesh", "plot_quality"]
