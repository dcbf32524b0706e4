"""ADCIRC ``fort.14`` / ``.grd`` and SCHISM ``.gr3``: nodes with depth, triangles, strings of boundary nodes.

After the ADCIRC user's manual (fort.14) and the SCHISM manual (hgrid.gr3). A boundary's facet tag is its IBTYPE (0,
10, 20 mainland, 1, 11, 21 islands, 3, 13, 23 outer barriers, 4, 24 weirs in the sea with nodes in pairs on both
sides, …); open boundaries have tag -1. Depth is the nodal field ``depth``; heights and coefficients of barriers are
the nodal fields ``barrier:0`` … and NaN elsewhere. Tags are called after their kind: "open", "mainland", "island,
weak" (21: the flux through it is held weakly), ….
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import compress, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import MeshError
from .draft import Draft
from .numbers import real, reals, whole
from .strings import node_strings

OPEN = -1
ISLANDS = (1, 11, 21)
OUTER_BARRIERS = (3, 13, 23)
WEIRS = (4, 24, 5, 25, 64)
_HOLDS = {0: "", 10: ", no slip", 20: ", weak"}
KINDS = {OPEN: "open"}
"""What every kind of boundary is called, by its facet tag."""
KINDS |= {
    kind + more: name + hold
    for kind, name in enumerate(("mainland", "island", "river", "outer barrier", "weir", "weir with pipes"))
    for more, hold in _HOLDS.items()
}
KINDS |= {24: "weir", 4: "weir, strong", 25: "weir with pipes", 5: "weir with pipes, strong"}  # the weak ones are usual
KINDS |= {30: "radiation", 32: "river with radiation", 40: "zero gradient", 41: "zero gradient, Galerkin"}
KINDS |= {52: "river with periodic flux", 64: "vertical wall", 94: "periodic"}
_BARRIER = "barrier:{}"


def read_grid(path: Path) -> Draft:
    """Read nodes, depths, cells and, where the file has them, boundaries."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    if len(lines) < 3:
        raise MeshError(f"'{path.name}': {len(lines)} lines, expected a title, two counts, nodes and cells")
    n_cells, n_points = _whole_numbers(lines[1], 2, 2)
    body = lines[2 : 2 + n_points]
    rows = lines[2 + n_points : 2 + n_points + n_cells]
    if len(body) < n_points or len(rows) < n_cells:
        raise MeshError(f"'{path.name}': ends early: {n_points} nodes and {n_cells} cells were announced on line 2")
    nodes = reals([line.split(None, 4) for line in body], 4, f"'{path.name}': node")
    numbers = whole(nodes[:, 0], f"'{path.name}': the numbers of the nodes")
    place = _Places(numbers)
    draft = Draft(
        np.ascontiguousarray(nodes[:, 1:3]),
        [],
        point_data={"depth": nodes[:, 3].copy()},
    )
    _cells(draft, [line.split(None, 6) for line in rows], place, path)
    rest = _Lines(lines, 2 + n_points + n_cells)
    if rest.more():
        _boundaries(draft, rest, place)
    return draft


def _cells(draft: Draft, rows: list[list[str]], place: _Places, path: Path) -> None:
    of = f"'{path.name}': cell"
    counts = whole(reals([row[1:2] for row in rows], 1, of)[:, 0], f"'{path.name}': the numbers of corners")
    if ((counts < 3) | (counts > 4)).any():
        raise MeshError(f"'{path.name}': a cell of {counts[(counts < 3) | (counts > 4)][0]} nodes, expected 3 (or 4)")
    for corners, kind in ((3, "triangle"), (4, "quad")):
        block = rows if (counts == corners).all() else list(compress(rows, counts == corners))
        if block:
            table = whole(reals(block, 2 + corners, of)[:, 2:], f"'{path.name}': the cells")
            draft.blocks.append((kind, place(table), None))


class _Places:
    """Node numbers of the file to rows; most files count 1, 2, 3, …."""

    def __init__(self, numbers: np.ndarray[Any, Any]) -> None:
        self.plain = np.array_equal(numbers, np.arange(1, len(numbers) + 1))
        self.numbers = numbers
        self.order = np.argsort(numbers)

    def __call__(self, wanted: Any) -> Any:
        wanted = np.asarray(wanted, dtype=np.int64)
        if self.plain:
            return wanted - 1
        at = np.minimum(
            np.searchsorted(self.numbers, wanted, sorter=self.order),
            len(self.numbers) - 1,
        )
        found = self.order[at]
        if not np.array_equal(self.numbers[found], wanted):
            missing = wanted[self.numbers[found] != wanted].flat[0]
            raise MeshError(f"node {missing} is named but not in the list of nodes")
        return found


class _Lines:
    def __init__(self, lines: list[str], at: int) -> None:
        self.lines, self.at = lines, at

    def more(self) -> bool:
        while self.at < len(self.lines) and not self.lines[self.at].strip():
            self.at += 1
        return self.at < len(self.lines)

    def next(self) -> str:
        if not self.more():
            raise MeshError("the list of boundaries ends early")
        self.at += 1
        return self.lines[self.at - 1]


def _whole_numbers(line: str, least: int, number: int = 0) -> list[int]:
    found = []
    for word in line.split():
        try:
            found.append(int(word))
        except ValueError:
            break
    if len(found) < least:
        where = f"line {number}" if number else "the list of boundaries"
        raise MeshError(f"{where}: {line.strip()[:60]!r}, expected {least} whole number{'s' * (least > 1)}")
    return found


def _boundaries(draft: Draft, rest: _Lines, place: _Places) -> None:
    facets: list[Any] = []
    tags: list[int] = []
    values: dict[int, tuple[float, ...]] = {}

    edges = _Edges(draft)

    def string(nodes: Any, tag: int, *, closed: bool = False) -> None:
        nodes = [int(node) for node in nodes]
        if closed and edges.have(nodes[0], nodes[-1]):
            nodes.append(nodes[0])  # islands are told without their first node again
        pairs = [pair for pair in pairwise(nodes) if pair[0] != pair[1]]
        facets.extend(pairs)
        tags.extend([tag] * len(pairs))

    n_open = _whole_numbers(rest.next(), 1)[0]
    rest.next()
    for _ in range(n_open):
        count = _whole_numbers(rest.next(), 1)[0]
        string(place([_whole_numbers(rest.next(), 1)[0] for _ in range(count)]), OPEN)
    if rest.more():
        n_land = _whole_numbers(rest.next(), 1)[0]
        rest.next()
        for _ in range(n_land):
            head = _whole_numbers(rest.next(), 1)
            count, kind = head[0], (head[1] if len(head) > 1 else 0)
            rows = [rest.next().split() for _ in range(count)]
            front = place([int(row[0]) for row in rows])
            if kind in WEIRS:
                back = place([int(row[1]) for row in rows])
                string(front, kind)
                string(back, kind)
                for near, far, row in zip(front, back, rows, strict=True):
                    values[int(near)] = values[int(far)] = tuple(map(real, _values(row[2:])))
            else:
                string(front, kind, closed=kind in ISLANDS)
                if kind in OUTER_BARRIERS:
                    values |= {int(n): tuple(map(real, _values(row[1:]))) for n, row in zip(front, rows, strict=True)}
    if facets:
        draft.facets, draft.facet_tags = (
            np.array(facets, dtype=np.int64),
            np.array(tags, dtype=np.int64),
        )
        draft.facet_names = {tag: KINDS[tag] for tag in set(tags) & KINDS.keys()}
    for column in range(max((len(value) for value in values.values()), default=0)):
        field = np.full(len(draft.points), np.nan)
        for node, value in values.items():
            field[node] = value[column] if column < len(value) else np.nan
        draft.point_data[_BARRIER.format(column)] = field


def _values(words: list[str]) -> Iterator[str]:
    """Give the numbers at the head of a row; what follows is a comment."""
    for word in words:
        try:
            real(word)
        except ValueError:
            return
        yield word


class _Edges:
    """Edges of all cells, sorted when the first is asked for."""

    def __init__(self, draft: Draft) -> None:
        self.draft = draft

    @cached_property
    def keys(self) -> Any:
        blocks = [np.asarray(cells) for _, cells, _ in self.draft.blocks]
        sides = [cells[:, [k, k - 1]] for cells in blocks for k in range(cells.shape[1])]
        ends = np.sort(np.concatenate([*sides, np.zeros((0, 2), np.int64)]), axis=1)
        return np.sort(ends[:, 0] * len(self.draft.points) + ends[:, 1])

    def have(self, a: int, b: int) -> bool:
        key = min(a, b) * len(self.draft.points) + max(a, b)
        at = int(np.searchsorted(self.keys, key))
        return at < len(self.keys) and bool(self.keys[at] == key)


def write_grid(draft: Draft, path: Path) -> None:
    """Write nodes, depth, cells and the tagged facets as strings of boundary nodes.

    Weirs are written in pairs where their two sides still pair up node by node, else as mainland (20).
    """
    cells = draft.blocks[0][1]
    if cells.shape[1] != 3:
        raise MeshError("this format holds triangles only")
    depth = np.asarray(draft.point_data.get("depth", np.zeros(len(draft.points)))).reshape(len(draft.points), -1)[:, 0]
    with path.open("w", encoding="utf-8") as out:
        out.write(f"written by coarsen\n{len(cells)} {len(draft.points)}\n")
        for number, (x, y, z) in enumerate(zip(*draft.points.T.tolist(), depth.tolist(), strict=True), 1):
            out.write(f"{number} {x!r} {y!r} {z!r}\n")
        for number, (a, b, c) in enumerate((cells + 1).tolist(), 1):
            out.write(f"{number} 3 {a} {b} {c}\n")
        out.writelines(line + "\n" for line in _boundary_lines(draft))


def _boundary_lines(draft: Draft) -> Iterator[str]:
    strings: list[tuple[int, list[int]]] = []
    if draft.facets is not None:
        tags = np.zeros(len(draft.facets), np.int64) if draft.facet_tags is None else _kinds(draft)
        for tag in np.unique(tags):
            strings += [(int(tag), nodes) for nodes in node_strings(draft.facets[tags == tag])]
    open_ = [nodes for tag, nodes in strings if tag == OPEN]
    yield f"{len(open_)} = Number of open boundaries"
    yield f"{sum(map(len, open_))} = Total number of open boundary nodes"
    for number, nodes in enumerate(open_, 1):
        yield f"{len(nodes)} = Number of nodes for open boundary {number}"
        yield from (str(node + 1) for node in nodes)
    land = [_land(draft, tag, nodes, back) for tag, nodes, back in _paired(draft, strings)]
    yield f"{len(land)} = Number of land boundaries"
    yield f"{sum(count for count, _, _ in land)} = Total number of land boundary nodes"
    for number, (_, kind, lines) in enumerate(land, 1):
        yield f"{len(lines)} {kind} = Number of nodes for land boundary {number}"
        yield from lines


def _kinds(draft: Draft) -> Any:
    """Return the facet tags, as kinds of boundary where their names say which."""
    known = {name: kind for kind, name in KINDS.items()} | {"land": 20, "ocean": OPEN}
    tags = np.array(draft.facet_tags)
    for tag, name in draft.facet_names.items():
        tags[np.asarray(draft.facet_tags) == tag] = known.get(name.lower(), tag)
    return tags


def _paired(draft: Draft, strings: list[tuple[int, list[int]]]) -> Iterator[tuple[int, list[int], list[int]]]:
    """Strings that are not open; of weirs both sides together, the other side in the order of this."""
    waiting = [item for item in strings if item[0] != OPEN]
    while waiting:
        tag, nodes = waiting.pop(0)
        if tag not in WEIRS:
            yield tag, nodes, []
            continue
        partners = [k for k, (other, side) in enumerate(waiting) if other == tag and len(side) == len(nodes)]
        if not partners:
            yield 20, nodes, []
            continue

        def apart(side: list[int], nodes: list[int] = nodes) -> float:
            return float(np.abs(draft.points[side] - draft.points[nodes]).sum())

        sides = [(k, side) for k in partners for side in (waiting[k][1], waiting[k][1][::-1])]
        k, side = min(sides, key=lambda item: apart(item[1]))
        waiting.pop(k)
        yield tag, nodes, side


def _land(draft: Draft, tag: int, nodes: list[int], back: list[int]) -> tuple[int, int, list[str]]:
    fields = [values for name, values in draft.point_data.items() if name.startswith("barrier:")]
    if tag in ISLANDS and nodes[0] == nodes[-1]:
        nodes = nodes[:-1]
    lines = []
    for k, node in enumerate(nodes):
        words = [str(node + 1)] + ([str(back[k] + 1)] if back else [])
        if back or tag in OUTER_BARRIERS:
            words += [repr(float(values[node])) for values in fields if np.isfinite(values[node])]
        lines.append(" ".join(words))
    return len(nodes) * (2 if back else 1), tag, lines
