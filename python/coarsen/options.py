"""Every option of `coarsen.coarsen` and `coarsen.hierarchy`, its default and its range, checked in one place.

The command line takes names, defaults, choices and help texts from here too.
"""

from __future__ import annotations

import difflib
import math
import numbers
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

METHODS = ("function", "threshold", "mis")
SPACINGS = ("nearest", "quadtree")
FEATURES = ("keep", "drop", "auto", "plain")
CANDIDATES = ("pool", "all")
BACKENDS = ("rust", "numpy")

Spacing = str | NDArray[np.float64] | Callable[[NDArray[np.float64]], Any]


def _option(default: Any, text: str) -> Any:
    return field(default=default, metadata={"help": text})


@dataclass(frozen=True, eq=False, repr=False)
class Options:
    """How a hierarchy is built.

    Attributes
    ----------
    factor : float
        C > 1: level i is spaced by the C^i-coarsening of the spacing of the mesh.
    levels : int or None
        At least 0: how many coarser meshes, exactly. None: until `coarsest` is met or a level no longer shrinks.
    coarsest : int
        At least 1, the paper's b: stop at the first level with at most this many cells.
    nested : bool
        Node-nested levels (Figure 3, coarsest first), or each level on its own.
    method : {"function", "threshold", "mis"}
        Definition 3.3; Definition 3.4 (quasi-uniform); independent sets of the edge skeleton (the baseline of Table 2).
    spacing : {"nearest", "quadtree"}, (n,) array of positive numbers or callable points -> values
        The spacing g of the mesh: Definition 3.2, section 6.2, or one's own.
    beta : float
        β > 1 of the conflict graph (Definition 3.5).
    delta : float
        δ >= 0: interior nodes stay δ·f away from facets.
    gradation : float
        Lipschitz constant L in (0, 1] of the coarsened spacing; 1 is the paper's.
    features : {"keep", "drop", "auto", "plain"}
        Whether every hole, island, channel and slit stays and is well shaped, or those under the spacing are closed or
        cut off, or the one on the finer levels and the other on the coarser, or the spacing is Definition 3.3's alone.
    candidates : {"pool", "all"}
        Whether coarse levels draw from an independent set of a much finer level (O(n) in all) or from every node.
    min_angle : float or None
        In [0, 60) degrees: the quality guard works for it; 0 turns the guard off. None: 25, but 0 with
        ``features="plain"``.
    feature_angle : float
        In (0, 180] degrees: a facet node where the boundary turns by more is a corner.
    backend : {"rust", "numpy"}
        The fast one or the reference.
    threads : int or None
        At least 1. None: all cores. The result never depends on it.

    Raises
    ------
    ValueError
        If an option is out of its range; names option, value and range.
    """

    factor: float = _option(2.0, "C > 1: level i is spaced by the C^i-coarsening of the mesh's spacing")
    levels: int | None = _option(None, "how many coarser meshes, exactly; default: until --coarsest is met")
    coarsest: int = _option(100, "stop at the first level with at most this many cells")
    nested: bool = _option(True, "node-nested levels, or each level on its own")
    method: str = _option("function", "coarsened spacing function, threshold (quasi-uniform) or skeleton baseline")
    spacing: Spacing = _option("nearest", "spacing of the mesh: nearest neighbour or balanced quadtree")  # noqa: RUF009
    beta: float = _option(2.0, "β > 1 of the conflict graph")
    delta: float = _option(0.5, "δ >= 0: interior nodes stay δ·f away from facets")
    gradation: float = _option(0.7, "Lipschitz constant in (0, 1] of the coarsened spacing; 1 is the paper's")
    features: str = _option("keep", "keep or drop holes, inlets and steps smaller than the spacing")
    candidates: str = _option("pool", "draw coarse levels from an independent set of a finer one, or from every node")
    min_angle: float | None = _option(
        None, "quality guard: no angle under this many degrees; default 25, off with plain; 0: off"
    )
    feature_angle: float = _option(60.0, "degrees: the boundary has a corner where it turns by more")
    backend: str = _option("rust", "the fast one or the NumPy reference")
    threads: int | None = _option(None, "threads to work with; default: all cores")

    def __post_init__(self) -> None:
        checked = {
            "factor": _number("factor", self.factor, 1.0, math.inf, "a finite number > 1"),
            "levels": _whole("levels", self.levels, 0, optional=True),
            "coarsest": _whole("coarsest", self.coarsest, 1),
            "nested": _truth("nested", self.nested),
            "method": _choice("method", self.method, METHODS),
            "spacing": _spacing(self.spacing),
            "beta": _number("beta", self.beta, 1.0, math.inf, "a finite number > 1"),
            "delta": _number("delta", self.delta, 0.0, math.inf, "a finite number >= 0", closed="low"),
            "gradation": _number("gradation", self.gradation, 0.0, 1.0, "a number in (0, 1]", closed="high"),
            "features": _choice("features", self.features, FEATURES),
            "candidates": _choice("candidates", self.candidates, CANDIDATES),
            "min_angle": None
            if self.min_angle is None
            else _number("min_angle", self.min_angle, 0.0, 60.0, "None or degrees in [0, 60)", closed="low"),
            "feature_angle": _number(
                "feature_angle", self.feature_angle, 0.0, 180.0, "degrees in (0, 180]", closed="high"
            ),
            "backend": _choice("backend", self.backend, BACKENDS),
            "threads": _whole("threads", self.threads, 1, optional=True),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @classmethod
    def from_kwargs(cls, **options: Any) -> Options:
        """Return the options of a call.

        Raises
        ------
        ValueError
            If an option is unknown (names the nearest one that is known) or out of its range.
        """
        known = [option.name for option in fields(cls)]
        for name in options:
            if name not in known:
                near = difflib.get_close_matches(name.lower(), known, n=1, cutoff=0.5)
                hint = f"did you mean {near[0]!r}?" if near else f"the options are {', '.join(known)}"
                raise ValueError(f"unknown option {name!r}: {hint}")
        return cls(**options)

    def __repr__(self) -> str:
        said = []
        for option in fields(self):
            value = getattr(self, option.name)
            if not _same(value, option.default):
                text = f"array of {len(value)}" if isinstance(value, np.ndarray) else repr(value)
                said.append(f"{option.name}={text}")
        return f"Options({', '.join(said)})"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Options):
            return NotImplemented
        return all(_same(getattr(self, option.name), getattr(other, option.name)) for option in fields(self))

    __hash__ = None  # type: ignore[assignment]


def _same(mine: Any, theirs: Any) -> bool:
    if isinstance(mine, np.ndarray) or isinstance(theirs, np.ndarray):
        return type(mine) is type(theirs) and np.array_equal(mine, theirs)
    return bool(mine == theirs)


def _number(name: str, value: Any, low: float, high: float, expected: str, closed: str = "") -> float:
    """Return a float between `low` and `high`; `closed` is "low" or "high" where that end belongs to the range."""
    if isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_)):
        number = float(value)
        above = number >= low if closed == "low" else number > low
        below = number <= high if closed == "high" else number < high
        if above and below:
            return number
    raise ValueError(f"'{name}' is {value!r}, expected {expected}")


def _whole(name: str, value: Any, low: int, *, optional: bool = False) -> int | None:
    if optional and value is None:
        return None
    whole = isinstance(value, numbers.Real) and not isinstance(value, (bool, np.bool_)) and value == value // 1
    if not whole or value < low or math.isinf(value):
        raise ValueError(f"'{name}' is {value!r}, expected {'None or ' if optional else ''}a whole number >= {low}")
    return int(value)


def _truth(name: str, value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise ValueError(f"'{name}' is {value!r}, expected True or False")
    return bool(value)


def _choice(name: str, value: Any, choices: tuple[str, ...], more: str = "") -> str:
    if not isinstance(value, str) or value not in choices:
        near = difflib.get_close_matches(value.lower(), choices, n=1) if isinstance(value, str) else []
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"'{name}' is {value!r}, expected one of {', '.join(map(repr, choices))}{more}{hint}")
    return value


def _spacing(value: Any) -> Any:
    if callable(value):
        return value
    if isinstance(value, str):
        return _choice("spacing", value, SPACINGS, ", an array of one value a node, or a callable points -> values")
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(())
    if array.ndim != 1:
        choices = ", ".join(map(repr, SPACINGS))
        raise ValueError(
            f"'spacing' is {value!r:.60}, expected one of {choices}, an array of one value a node, or a callable "
            "points -> values"
        )
    array.flags.writeable = False
    return array
