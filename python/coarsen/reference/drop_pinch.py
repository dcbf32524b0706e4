"""Nodes where a level only touches itself, though the input does not: see the sketch in ``rust/drop/pinch.rs``.

The cells around such a node form several runs with gaps between. A short run is cut off, or a short gap filled with
cells that are no slivers, where that leaves fewer such nodes; of the ways that do, the one that changes the area least.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

from .drop_parts import fits
from .drop_trim import Trimmed, after
from .patch import Cell

MOST_CELLS = 3
"""Runs and gaps of more cells are left alone."""


@dataclass(frozen=True)
class Way:
    """Cells that get a label and a part, or lose their label."""

    cells: list[Cell]
    label: int | None
    part: int


def unpinch(trimmed: Trimmed, limit_deg: float, natural: Callable[[int], int]) -> None:
    """Cut off runs and fill gaps at nodes that have more runs than `natural` says of their site."""
    cell_at = {s: cell for cell in trimmed.cells() for s in cell}

    def excess(s: int) -> int:
        fan = _fan(trimmed, cell_at[s], s)
        runs = sum(cell in trimmed.label and fan[i - 1] not in trimmed.label for i, cell in enumerate(fan))
        return max(runs - natural(trimmed.sites[s]), 0)

    for s in sorted(cell_at):
        while excess(s) > 0:
            best: tuple[float, Way] | None = None
            for way in _ways(trimmed, cell_at[s], s, limit_deg):
                touched = {s for cell in way.cells for s in cell}
                before = sum(map(excess, touched))
                old = [trimmed.label.get(cell) for cell in way.cells]
                _set(trimmed, way.cells, [way.label] * len(old))
                less = sum(map(excess, touched)) < before
                _set(trimmed, way.cells, old)
                change = sum(trimmed.area_of(cell) for cell in way.cells)
                if less and (best is None or change < best[0]):
                    best = change, way
            if best is None:
                break
            way = best[1]
            _set(trimmed, way.cells, [way.label] * len(way.cells))
            trimmed.part.update(dict.fromkeys(way.cells, way.part))


def _set(trimmed: Trimmed, cells: list[Cell], labels: list[int | None]) -> None:
    for cell, label in zip(cells, labels, strict=True):
        if label is None:
            trimmed.label.pop(cell, None)
        else:
            trimmed.label[cell] = label


def _fan(trimmed: Trimmed, cell: Cell, s: int) -> list[Cell | None]:
    """Return the cells around a site; at a corner of the hull None stands for what is beyond it."""
    fan: list[Cell | None] = [*trimmed.around(cell, s)]
    first = trimmed.around(cell, s)[0]
    return fan if trimmed.beyond(s, after(first, s)) is not None else [*fan, None]


def _ways(trimmed: Trimmed, cell: Cell, s: int, limit_deg: float) -> list[Way]:
    """Return short runs to be cut off and short gaps to be filled."""
    fan = _fan(trimmed, cell, s)
    starts = [i for i, own in enumerate(fan) if own in trimmed.label and fan[i - 1] not in trimmed.label]
    if not starts:
        return []
    fan = fan[starts[0] :] + fan[: starts[0]]
    ways: list[Way] = []
    label, part = None, 0
    for is_in, group in itertools.groupby(fan, key=lambda cell: cell in trimmed.label):
        whole = list(group)
        run = [cell for cell in whole if cell is not None]
        if is_in:
            label, part = trimmed.label[run[-1]], trimmed.part[run[-1]]
        # a gap that is open to the outside of the hull can't be filled
        fills = len(run) == len(whole) and all(
            trimmed.angle(cell) >= limit_deg and fits(trimmed, cell, part) for cell in run
        )
        if len(run) <= MOST_CELLS and (is_in or fills):
            ways.append(Way(run, None if is_in else label, part))
    return ways
