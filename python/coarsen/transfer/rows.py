"""Matrices by rows as SciPy takes them, and what levels there are."""

from __future__ import annotations

import importlib
import operator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from coarsen.multilevel import Hierarchy


def sparse() -> Any:
    """Return ``scipy.sparse``, or say how to get it.

    Raises
    ------
    ImportError
        If SciPy is not installed.
    """
    try:
        return importlib.import_module("scipy.sparse")
    except ImportError:
        raise ImportError("operators are SciPy matrices: pip install 'coarsen-mesh[multigrid]'") from None


def csr(rows: tuple[Any, Any, Any], columns: int) -> csr_matrix:
    """Wrap sorted rows, without a copy."""
    csr_matrix = sparse().csr_matrix
    indptr, indices, values = rows
    matrix = csr_matrix((values, indices, indptr), shape=(len(indptr) - 1, columns), copy=False)
    matrix.has_sorted_indices = True
    matrix.has_canonical_format = True
    return matrix


def _whole(name: str, level: Any) -> int:
    try:
        return operator.index(level)
    except TypeError:
        raise TypeError(f"'{name}' is {level!r}, expected a whole number: a level") from None


def check_coarser(hierarchy: Hierarchy, i: int) -> None:
    """Refuse a level that has no finer one.

    Raises
    ------
    TypeError
        If it is no whole number.
    ValueError
    """
    _whole("i", i)
    if not 1 <= i < len(hierarchy):
        raise ValueError(f"'i' is {i}, expected a coarser level: 1 <= i <= {len(hierarchy) - 1}")


def check_level(hierarchy: Hierarchy, name: str, level: int) -> int:
    """Return the level counted from the finest, also where it was counted from the coarsest.

    Raises
    ------
    TypeError
        If it is no whole number.
    ValueError
        If there is no such level.
    """
    level = _whole(name, level)
    if not -len(hierarchy) <= level < len(hierarchy):
        raise ValueError(f"'{name}' is {level}, expected a level: 0 <= {name} <= {len(hierarchy) - 1}")
    return level % len(hierarchy)
