"""Files: meshes in and out, hierarchies in and out.

One file a format family; each reads into a :class:`~coarsen.io.draft.Draft`, which alone turns what a file says into a
:class:`coarsen.Mesh` or into one clear :class:`coarsen.MeshError`.
"""

from .bridge import from_meshio, to_meshio
from .draft import Draft
from .files import read, read_draft, readable, writable, write
from .hierarchies import load_hierarchy, save_hierarchy, write_hierarchy

__all__ = [
    "Draft",
    "from_meshio",
    "load_hierarchy",
    "read",
    "read_draft",
    "readable",
    "save_hierarchy",
    "to_meshio",
    "writable",
    "write",
    "write_hierarchy",
]
