"""Arguments of the parts, checked once at the door: arrays of any real dtype, order or nesting, numbers in their range.

What comes out is what the core takes: float64 or int64, C-contiguous, without a copy where it is so already.
"""

from __future__ import annotations

import math
import numbers
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def _real_array(name: str, value: npt.ArrayLike, shape: str) -> npt.NDArray[Any]:
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ValueError(f"'{name}' is no array of shape {shape}: {error}") from None
    if array.dtype.kind not in "biuf":
        raise ValueError(f"'{name}' has dtype {array.dtype}, expected real numbers")
    return array


def _first(bad: npt.NDArray[np.bool_]) -> tuple[tuple[int, ...], str]:
    """Return the first index where `bad` holds and a phrase for how many more there are."""
    count = int(np.count_nonzero(bad))
    more = f" (and {count - 1} more)" if count > 1 else ""
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(bad)), bad.shape)), more


def points_array(points: npt.ArrayLike, name: str = "points", dim: int | None = None) -> FloatArray:
    """Return finite points of shape (n, d), d from 1 to 3 or exactly `dim`.

    Raises
    ------
    ValueError
        If shape or dtype is another or a coordinate is not finite; names the argument, the first index and its value.
    """
    expected = "(n, d) with d from 1 to 3" if dim is None else f"(k, {dim})"
    array = _real_array(name, points, expected)
    if array.ndim != 2 or not (1 <= array.shape[1] <= 3 if dim is None else array.shape[1] == dim):
        raise ValueError(f"'{name}' has shape {array.shape}, expected {expected}")
    with np.errstate(over="ignore"):
        array = np.ascontiguousarray(array, dtype=np.float64)
    bad = ~np.isfinite(array)
    if bad.any():
        at, more = _first(bad)
        raise ValueError(f"'{name}[{at[0]}, {at[1]}]' is {array[at]}, expected finite coordinates{more}")
    return array


def spacing_array(name: str, values: npt.ArrayLike, n: int) -> FloatArray:
    """Return the values of a spacing function at `n` points: at least 0, infinite where nothing is near.

    Raises
    ------
    ValueError
        If shape or dtype is another or a value is NaN or under 0; names the argument, the first index and its value.
    """
    array = _real_array(name, values, f"({n},)")
    if array.shape != (n,):
        raise ValueError(f"'{name}' has shape {array.shape}, expected ({n},)")
    array = np.ascontiguousarray(array, dtype=np.float64)
    bad = ~(array >= 0.0)
    if bad.any():
        at, more = _first(bad)
        raise ValueError(f"'{name}[{at[0]}]' is {array[at]}, expected at least 0{more}")
    return array


def index_array(name: str, values: npt.ArrayLike, n: int) -> IntArray:
    """Return indices of shape (k,) from 0 to n - 1; no list at all is one of none.

    Raises
    ------
    ValueError
        If they are no whole numbers or one is out of range; names the argument, the first index and its value.
    """
    array = _real_array(name, values, "(k,)")
    if array.ndim != 1:
        raise ValueError(f"'{name}' has shape {array.shape}, expected (k,)")
    if array.size and array.dtype.kind not in "iu":
        raise ValueError(f"'{name}' has dtype {array.dtype}, expected indices")
    bad = (array < 0) | (array >= n)
    if bad.any():
        at, more = _first(bad)
        raise ValueError(f"'{name}[{at[0]}]' is {array[at]}, expected an index from 0 to {n - 1}{more}")
    return np.ascontiguousarray(array, dtype=np.int64)


def rank_array(name: str, values: npt.ArrayLike, n: int) -> IntArray:
    """Return ranks of shape (n,) as int64 that sort as the given real numbers do.

    Raises
    ------
    ValueError
        If shape or dtype is another or a rank is NaN.
    """
    array = _real_array(name, values, f"({n},)")
    if array.shape != (n,):
        raise ValueError(f"'{name}' has shape {array.shape}, expected ({n},)")
    if array.dtype.kind == "i":
        return np.ascontiguousarray(array, dtype=np.int64)
    bad = np.isnan(array) if array.dtype.kind == "f" else np.zeros(n, dtype=np.bool_)
    if bad.any():
        at, more = _first(bad)
        raise ValueError(f"'{name}[{at[0]}]' is NaN, expected ranks that can be sorted{more}")
    ranks: IntArray = np.unique(array, return_inverse=True)[1].astype(np.int64).reshape(n)
    return ranks


def number(name: str, value: object, expected: str, *, over: float, upto: float = math.inf) -> float:
    """Return a finite real number in (over, upto], said in words by `expected`.

    Raises
    ------
    ValueError
        If it is none; names the argument, its value and its range.
    """
    real = float(value) if isinstance(value, (numbers.Real, np.number)) and not isinstance(value, bool) else math.nan
    if not (math.isfinite(real) and over < real <= upto):
        raise ValueError(f"'{name}' is {value!r}, expected {expected}")
    return real


def factor_over_1(factor: object) -> float:
    """Return C > 1."""
    return number("factor", factor, "a finite number over 1", over=1.0)


def thread_count(threads: int | None) -> int | None:
    """Return the number of threads, at least 1, or None for all cores.

    Raises
    ------
    ValueError
        If it is neither.
    """
    if threads is None:
        return None
    if not isinstance(threads, (int, np.integer)) or isinstance(threads, bool) or threads < 1:
        raise ValueError(f"'threads' is {threads!r}, expected None or a whole number of at least 1")
    return int(threads)
