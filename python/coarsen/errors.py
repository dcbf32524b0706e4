"""The exceptions of the package; the Rust core raises these same ones."""

from __future__ import annotations

from typing import Any


class MeshError(ValueError):
    """A mesh breaks a rule of a legal mesh; the message names rule, array, index and value.

    Attributes
    ----------
    rule : str or None
        Short name of the broken rule, e.g. ``"zero area"``; None where the error comes from a file.
    array : str or None
        The array at fault: ``"points"``, ``"cells"``, ``"facets"``, ...
    index : int or None
        The first row at fault.
    more : int
        How many more rows break the same rule.
    """

    def __init__(
        self,
        message: str = "",
        rule: str | None = None,
        array: str | None = None,
        index: int | None = None,
        more: int = 0,
    ) -> None:
        super().__init__(message)
        self.rule = rule
        self.array = array
        self.index = index
        self.more = more

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.rule, self.array, self.index, self.more)
