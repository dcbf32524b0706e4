"""The only place that chooses between the Rust core and the NumPy reference.

Both offer the same functions under the same names and signatures (see ``_core.pyi``).
"""

from __future__ import annotations

import importlib
from types import ModuleType

BACKENDS = ("rust", "numpy")


def backend(name: str) -> ModuleType:
    """Return the module that does the work: the Rust core or its NumPy twin.

    Raises
    ------
    ValueError
        If `name` is not one of ``"rust"`` and ``"numpy"``.
    """
    if name == "rust":
        return importlib.import_module("coarsen._core")
    if name == "numpy":
        return importlib.import_module("coarsen.reference")
    raise ValueError(f"'backend' is {name!r}, expected one of {', '.join(map(repr, BACKENDS))}")
