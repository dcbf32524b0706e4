"""The exceptions of the package; the Rust core raises these same ones."""

from __future__ import annotations


class MeshError(ValueError):
    """A mesh breaks a rule of a legal mesh; the message names rule, array, index and value."""
