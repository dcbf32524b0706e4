"""Hierarchies of coarser, well-shaped meshes from one fine unstructured mesh (Miller, Talmor, Teng 1997).

>>> import coarsen
>>> mesh = coarsen.gallery.crack_plate(1000)
>>> h = coarsen.hierarchy(mesh, factor=2.0)
>>> h[-1].mesh.n_cells <= 100
True
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import gallery, io, multigrid, plot, selection, spacing, transfer
    from ._core import __version__
    from .errors import MeshError
    from .io import load_hierarchy as load
    from .io import read
    from .mesh import Mesh
    from .multilevel import Hierarchy, Level, coarsen, hierarchy
    from .options import Options
    from .page import report
    from .quality import Quality
    from .selection import delaunay

# Names are handed on when they are first asked for, so that `import coarsen` costs next to nothing: name -> (module,
# attribute), or (module, None) for the module itself.
_NAMES: dict[str, tuple[str, str | None]] = {
    "Hierarchy": ("multilevel", "Hierarchy"),
    "Level": ("multilevel", "Level"),
    "Mesh": ("mesh", "Mesh"),
    "MeshError": ("errors", "MeshError"),
    "Options": ("options", "Options"),
    "Quality": ("quality", "Quality"),
    "__version__": ("_core", "__version__"),
    "coarsen": ("multilevel", "coarsen"),
    "delaunay": ("selection", "delaunay"),
    "gallery": ("gallery", None),
    "hierarchy": ("multilevel", "hierarchy"),
    "io": ("io", None),
    "load": ("io", "load_hierarchy"),
    "multigrid": ("multigrid", None),
    "plot": ("plot", None),
    "read": ("io", "read"),
    "report": ("page", "report"),
    "selection": ("selection", None),
    "spacing": ("spacing", None),
    "transfer": ("transfer", None),
}

__all__ = [
    "Hierarchy",
    "Level",
    "Mesh",
    "MeshError",
    "Options",
    "Quality",
    "__version__",
    "coarsen",
    "delaunay",
    "gallery",
    "hierarchy",
    "io",
    "load",
    "multigrid",
    "plot",
    "read",
    "report",
    "selection",
    "spacing",
    "transfer",
]


def __getattr__(name: str) -> Any:
    if name not in _NAMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, attribute = _NAMES[name]
    found = import_module(f".{module}", __name__)
    value = found if attribute is None else getattr(found, attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
