"""Which cells of a triangulation lie inside, and in which material.

Cells are labelled beside a valid chord as the chord says, from there over the cells without loose corners up to the
next chord, and by sample points (centroid and three towards the corners) where nothing or more than one thing is said.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .domain import Domain
from .drop_parts import Parts, tell_parts
from .drop_trim import Trimmed, centroid, edges_of, regions
from .level import Choice
from .loose import is_hole, specks
from .patch import Cell
from .point import NONE, Floats, Ints, Point
from .sight import Sight
from .triangulation import Edge, Triangulation, is_one_line


class Views:
    """The input mesh as it is seen from inside: what lies at a point of the plane."""

    def __init__(self, domain: Domain, points: Floats, cells: Ints) -> None:
        self.domain, self.points, self.cells = domain, points, cells
        self.sight = Sight(domain)
        self.home = np.full(len(points), NONE)
        """For each node a cell that has it, the last."""
        for t, cell in enumerate(cells):
            self.home[cell] = t
        self.degree = [0] * len(domain)
        """Facet edges at each facet vertex."""
        for chain in domain.chains:
            for edge in chain.edges:
                for v in edge.vertices:
                    self.degree[v] += 1

    def sample(self, trimmed: Trimmed, cells: list[Cell], is_gone: list[bool]) -> list[int | None]:
        """Return the tag of most sample points of each of some cells, None where not most of them lie inside."""
        eyes, samples = [], []
        for cell in cells:
            corners = trimmed.corners(cell)
            x, y = centroid(*corners)
            samples += [(x, y), *(((x + px) / 2.0, (y + py) / 2.0) for px, py in corners)]
            eyes += [self._eye(max(trimmed.sites[s] for s in cell))] * 4
        seen = self.sight.look(eyes, samples, is_gone)
        result = []
        for k in range(0, len(seen), 4):
            tags = [tag for tag in seen[k : k + 4] if tag is not None]
            result.append(max(tags, key=tags.count) if len(tags) >= 3 else None)
        return result

    def _eye(self, site: int) -> Point:
        """Return a point inside the mesh near a site."""
        facets = len(self.domain)
        node = site - facets if site >= facets else self.domain.copies[site][0]
        a, b, c = ((x, y) for x, y in self.points[self.cells[self.home[node]]].tolist())
        return centroid(a, b, c)


def triangulate(
    views: Views, parts: Parts, choice: Choice, f: Floats, is_allowed: Callable[[int], bool]
) -> Trimmed | None:
    """Triangulate a choice and tell inside from outside; None where there is no cell at all."""
    domain = views.domain
    vertices = np.flatnonzero(choice.kept)
    inner = np.sort(choice.interior)
    sites = [*vertices.tolist(), *(len(domain) + inner).tolist()]
    points = np.concatenate([domain.points[vertices], views.points[inner]])
    if is_one_line(points):
        return None
    triangulation = Triangulation(points)
    site_of = {v: s for s, v in enumerate(vertices.tolist())}
    on_edge: dict[Edge, tuple[int, int]] = {}
    failed = set()
    for c, chord in enumerate(choice.chords):
        a, b = (site_of[v] for v in chord.vertices)
        if triangulation.constrain(a, b):
            on_edge[a, b], on_edge[b, a] = (c, 0), (c, 1)
        else:
            failed.add(c)
    trimmed = Trimmed(sites, triangulation, on_edge)
    for c, chord in enumerate(choice.chords):
        edge = domain.chains[chord.chain].edge(chord.start)
        both = all(side.is_inside for side in edge.sides)
        trimmed.is_slit.append(both and not edge.interior and c not in failed)
    _label(views, trimmed, choice, f, failed)

    def beside(cell: Cell) -> int | None:
        known = [trimmed.on_edge[edge] for edge in edges_of(cell) if edge in trimmed.on_edge]
        nodes = [copy_at(domain, choice, c, side, at_start=True) for c, side in known]
        return next((node for node in nodes if node != NONE), None)

    tell_parts(parts, domain, trimmed, is_allowed, beside)
    return trimmed if trimmed.label else None


def copy_at(domain: Domain, choice: Choice, c: int, side: int, *, at_start: bool) -> int:
    """Return the copy that the cell beside a chord has where its edge starts, or else ends; none if outside."""
    chord = choice.chords[c]
    chain = domain.chains[chord.chain]
    if at_start == (side == 0):
        return chain.edge(chord.start).sides[side].tail
    return chain.edge(chord.stop - 1).sides[side].head


def _label(views: Views, trimmed: Trimmed, choice: Choice, f: Floats, failed: set[int]) -> None:
    domain = views.domain
    missing = list(views.degree)
    for c, chord in enumerate(choice.chords):
        if c not in failed:
            for v in chord.vertices:
                missing[v] -= 1
    loose = [site < len(domain) and missing[site] > 0 for site in trimmed.sites]
    cells = trimmed.cells()

    def says(edge: Edge) -> int | None:
        c, k = trimmed.on_edge[edge]
        chord = choice.chords[c]
        side = domain.chains[chord.chain].edge(chord.start).sides[k]
        return side.cell_tag if side.is_inside else None

    said: dict[Cell, int | None] = {}
    """What the chords say of a cell: a tag, or None for outside."""
    unsure = set()
    for cell in cells:
        votes = [says(edge) for edge in edges_of(cell) if edge in trimmed.on_edge]
        is_loose = any(loose[s] for s in cell)
        if votes:
            said[cell] = votes[0]
            # beyond a wall is outside for sure, but what is inside at one chord may lie beyond another, given up
            is_unsure = (is_loose and votes[0] is not None) or any(vote != votes[0] for vote in votes)
        else:
            is_unsure = is_loose
        if is_unsure:
            unsure.add(cell)
    sure = dict.fromkeys(cell for cell in cells if cell not in unsure)

    def beside(cell: Cell) -> list[Cell]:
        free = [edge for edge in edges_of(cell) if edge not in trimmed.on_edge]
        return [other for edge in free if (other := trimmed.beyond(*edge)) is not None and other in sure]

    for region in regions(sure, beside):
        votes = [said[cell] for cell in region if cell in said]
        silent = [cell for cell in region if cell not in said]
        if votes and all(vote == votes[0] for vote in votes):
            said.update(dict.fromkeys(silent, votes[0]))
        else:
            unsure.update(silent)
    is_gone = [speck and is_hole(domain, c) for c, speck in enumerate(specks(domain, f))]
    asked = [cell for cell in cells if cell in unsure]
    said.update(zip(asked, views.sample(trimmed, asked, is_gone), strict=True))
    for cell in cells:
        label = said[cell]
        if label is not None:
            trimmed.label[cell] = label
