"""Arrays of a mesh at the door: converted to what the core takes, or refused with words."""

from __future__ import annotations

from collections.abc import Mapping
from operator import index
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import MeshError

FloatArray = npt.NDArray[np.float64]
IndexArray = npt.NDArray[np.int32] | npt.NDArray[np.int64]
Fields = dict[str, npt.NDArray[Any]]


def _refused(name: str, rule: str, reason: str) -> MeshError:
    return MeshError(f"'{name}' {reason}", rule=rule, array=name)


def real_array(name: str, value: Any, expected: str) -> npt.NDArray[Any]:
    """Return an array of integers or real floating-point numbers.

    Raises
    ------
    MeshError
        If it is ragged, or of booleans, complex numbers, strings or objects.
    """
    try:
        array = np.asarray(value)
    except (ValueError, OverflowError) as error:
        raise _refused(name, "wrong shape", f"is no array of shape {expected}: {error}") from None
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise _refused(name, "wrong dtype", "is a masked array with masked values, expected all of them")
    if array.dtype.kind not in "iuf" and array.size:
        raise _refused(name, "wrong dtype", f"has dtype {array.dtype}, expected numbers that are real")
    return array


def read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return a view of the same memory that can't be written to."""
    view = array.view(np.ndarray)
    view.flags.writeable = False
    return view


def points_array(points: Any) -> FloatArray:
    """Return points as float64 in C order, without a copy where they are so.

    Raises
    ------
    MeshError
        If shape or dtype is another.
    """
    array = real_array("points", points, "(n, 2)")
    if array.ndim != 2:
        raise _refused("points", "wrong shape", f"has shape {array.shape}, expected (n, 2)")
    if array.shape[1] not in (1, 2):
        hint = (
            "; meshes of solids or surfaces are not supported (coarsen.spacing and coarsen.selection take their points)"
            if array.shape[1] == 3
            else ""
        )
        raise _refused("points", "wrong shape", f"has shape {array.shape}, expected (n, 2), or (n, 1) on a line{hint}")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, dtype=np.float64)


def index_rows(name: str, value: Any, width: int | None, expected: str) -> IndexArray:
    """Return rows of indices as int32 or int64 in C order, without a copy where they are so.

    Raises
    ------
    MeshError
        If shape or dtype is another, or a value is no whole number or beyond int64.
    """
    array = whole_numbers(name, value, expected)
    if array.ndim != 2 or array.shape[1] != width:
        raise _refused(name, "wrong shape", f"has shape {array.shape}, expected {expected}")
    if array.dtype in (np.dtype(np.int32), np.dtype(np.int64)):
        return np.ascontiguousarray(array)
    return np.ascontiguousarray(array, dtype=np.int64)


def tags_array(name: str, value: Any, rows: int, of: str) -> npt.NDArray[Any]:
    """Return one integer tag for each of `rows` rows.

    Raises
    ------
    MeshError
        If shape or dtype is another, or a value is no whole number or beyond int64.
    """
    array = whole_numbers(name, value, f"({rows},)")
    if array.shape != (rows,):
        raise _refused(name, "wrong shape", f"has shape {array.shape}, expected ({rows},): one tag for each of {of}")
    if array.dtype.kind == "i" and array.dtype.isnative:
        return np.ascontiguousarray(array)
    return np.ascontiguousarray(array, dtype=np.int64)


def whole_numbers(name: str, value: Any, expected: str) -> npt.NDArray[Any]:
    """Return an array of integers that fit int64; floats are taken where each is a whole number.

    Raises
    ------
    MeshError
        If they are no such numbers; names the first and its value.
    """
    array = real_array(name, value, expected)
    if array.size == 0:
        return array.astype(np.int64)
    kind = array.dtype.kind
    if kind == "f":
        with np.errstate(invalid="ignore"):
            bad = ~((np.abs(array) < 2.0**63) & (array == np.floor(array)))
        wanted = "whole numbers"
    elif array.dtype == np.uint64:
        bad, wanted = array > np.uint64(2**63 - 1), "numbers under 2**63"
    else:
        return array
    if bad.any():
        at = tuple(int(i) for i in np.unravel_index(int(np.argmax(bad)), bad.shape))
        more = int(np.count_nonzero(bad)) - 1
        where = ", ".join(map(str, at))
        text = f"'{name}[{where}]' is {array[at]}, expected {wanted}" + (f" ({more} more)" if more else "")
        raise MeshError(text, rule="wrong dtype", array=name, index=at[0], more=more)
    return array.astype(np.int64)


def fields_of(point_data: Mapping[str, Any] | None, n_points: int) -> Fields | None:
    """Return nodal fields as read-only arrays of shape (n, ...).

    Raises
    ------
    MeshError
        If one has not a row for each node.
    """
    if point_data is None:
        return None
    out: Fields = {}
    for name, values in dict(point_data).items():
        array = np.asarray(values)
        if array.ndim == 0 or len(array) != n_points:
            shape = array.shape
            raise _refused(f"point_data[{name!r}]", "wrong shape", f"has shape {shape}, expected ({n_points}, ...)")
        if array.dtype.kind not in "biufc":
            raise _refused(f"point_data[{name!r}]", "wrong dtype", f"has dtype {array.dtype}, expected numbers")
        out[str(name)] = read_only(np.ascontiguousarray(array))
    return out


def names_of(name: str, value: Mapping[int, str] | None) -> dict[int, str] | None:
    """Return what tags are called, in the order of the tags; None where nothing is.

    Raises
    ------
    MeshError
        If a tag is no whole number, a name no text, or two tags are called the same.
    """
    if not value:
        return None
    names: dict[int, str] = {}
    owners: dict[str, int] = {}
    for tag, text in dict(value).items():
        try:
            number = index(tag)
        except TypeError:
            raise _refused(name, "wrong names", f"has the tag {tag!r}, expected a whole number") from None
        if not isinstance(text, str):
            raise _refused(name, "wrong names", f"calls tag {number} {text!r}, expected text")
        if text in owners:
            raise _refused(name, "wrong names", f"calls both tag {owners[text]} and tag {number} {text!r}")
        names[number] = text
        owners[text] = number
    return dict(sorted(names.items()))
