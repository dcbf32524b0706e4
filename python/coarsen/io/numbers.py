"""Columns of numbers in text files: reals as Fortran writes them too, whole numbers that are whole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError

_FORTRAN = str.maketrans("dD", "ee")


def real(word: str) -> float:
    """Return a number; ``1.5D+00`` is one as well."""
    return float(word.translate(_FORTRAN))


def reals(rows: Sequence[Sequence[str]], width: int, what: str) -> NDArray[np.float64]:
    """Return the first `width` words of every row as numbers, (len(rows), width).

    Raises
    ------
    MeshError
        If a row has fewer, or other words; names the first such row.
    """
    flat = [word for row in rows for word in row[:width]]
    try:
        if len(flat) == width * len(rows) and all(len(row) >= width for row in rows):
            return np.array(flat, dtype=np.float64).reshape(len(rows), width)
    except ValueError:  # Fortran's exponents, or no numbers
        pass
    found = np.empty((len(rows), width))
    for k, row in enumerate(rows):
        try:
            found[k] = [real(word) for word in row[:width]]
        except ValueError:
            text = " ".join(row)[:60]
            raise MeshError(f"{what} {k + 1}: {text!r}, expected {width} numbers") from None
    return found


def whole(values: NDArray[np.float64], what: str) -> NDArray[np.int64]:
    """Return the values as integers.

    Raises
    ------
    MeshError
        If one is none; names the first.
    """
    with np.errstate(invalid="ignore"):
        bad = ~((np.abs(values) < 2.0**53) & (values == np.floor(values)))
    if bad.any():
        raise MeshError(f"{what}: {values[bad].flat[0]:g}, expected whole numbers")
    return np.asarray(values, dtype=np.int64)
