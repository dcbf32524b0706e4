"""Levels of a simplified domain (``features="drop"``): what is smaller than the spacing is closed or cut off.

Nodes are selected as in Figure 2, but none is forced. Facet vertices that stand out at the scale of f come first, and
those that do so at f/2 too (corners, not the vertices beside one) may be twice as near to each other. Then come those
that stand out at f/2 only, the other vertices of walls, and last those of interfaces, all under the conflict rule. No
vertex is put back: chords that would be no valid domain are given up instead. The cells of the constrained Delaunay
triangulation of what is kept are inside where valid chords say so; elsewhere most of their sample points must lie in
the input mesh. Then slivers are peeled off the rim, or a node of them is taken out.

Selection goes from coarse to fine, as in Figure 3. A node that ends in no cell is taken out, of this level and of all
coarser ones: levels are settled from fine to coarse, and as the sets only shrink, once is enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .domain import Domain, FacetArrays
from .drop_assemble import Dropped, Origin, assemble, is_given, loops
from .drop_flip import free_moot_chords
from .drop_label import Views, triangulate
from .drop_mend import victims
from .drop_parts import parts_of
from .drop_pinch import unpinch
from .drop_trim import Trimmed, area
from .level import Candidates, Choice, LevelMesh, Rules, select_interior
from .loose import specks, stands_out, valid_chords
from .point import Bools, Floats, Ints
from .selection import greedy, rank

RIM_ANGLE_DEG = 15.0
"""Smallest angle of a cell that is left on the rim, in degrees."""
MOST_CHANGE = 0.05
"""Mending may change the area by this share of the input's more than dropping features did."""
PEEL = 0.01
"""Larger cells, by their share of the area of the input, are peeled off the rim only if they can't be mended."""
MENDING = 4
"""Rounds in which that is tried."""
MOST_ROUNDS = 32
"""Triangulations of one level at most: each but the last takes out nodes that end in no cell."""

Settled = tuple[LevelMesh, Dropped]


@dataclass(frozen=True)
class Terms:
    """What selection goes by; `barred` are the facet vertices that may not be kept."""

    rules: Rules
    cos_feature: float
    barred: Bools


def select(
    domain: Domain, candidates: Candidates, f: Floats, seeds: Choice, candidate_of: Ints, terms: Terms
) -> Choice:
    """Select a level's nodes among the candidates, keeping `seeds`; see `coarsen.reference.level.select`."""
    facets, rules = len(domain), terms.rules
    seeded = candidate_of[seeds.interior]
    kept = seeds.kept.copy()
    is_speck = specks(domain, f[:facets])
    room = f.copy()
    corners: list[tuple[float, int]] = []
    lesser: list[tuple[float, int]] = []
    rest: list[int] = []
    for v in range(facets):
        if terms.barred[v] or kept[v] or is_speck[domain.place[v][0]]:
            continue
        at_f, at_half = (stands_out(domain, v, scale * float(f[v]), terms.cos_feature) for scale in (1.0, 0.5))
        if at_f is not None:
            corners.append((-at_f, v))
            if at_half is not None:
                room[v] /= 2.0
        elif at_half is not None:
            lesser.append((-at_half, v))
        else:
            rest.append(v)

    def join(order: list[int], spacing: Floats) -> None:
        keep = np.concatenate([np.flatnonzero(kept), seeded])
        kept[greedy(candidates.points, spacing, rules.beta, np.array(order, np.int64), keep)] = True

    join([v for _, v in sorted(corners)], room)
    ranked = rank(np.array(rest, np.int64), f).tolist()
    is_inner = [domain.chains[domain.place[v][0]].edges[0].interior for v in ranked]
    walls = [v for v, inner in zip(ranked, is_inner, strict=True) if not inner]
    interfaces = [v for v, inner in zip(ranked, is_inner, strict=True) if inner]
    join([v for _, v in sorted(lesser)] + walls + interfaces, f)
    chords = valid_chords(domain, kept, f[:facets], candidates.points[seeded], [])
    interior, _ = select_interior(domain, candidates, f, seeds, candidate_of, kept, chords, rules)
    return Choice(kept, interior, chords)


class Ground:
    """The input as the settling of levels sees it."""

    def __init__(self, domain: Domain, points: Floats, cells: Ints, facets: FacetArrays, cos_feature: float) -> None:
        self.domain, self.points, self.cos_feature = domain, points, cos_feature
        corners = [[(x, y) for x, y in rows] for rows in points[cells].tolist()]
        # a needle's may be rounded below zero
        self.area = sum(max(area(*rows), 0.0) for rows in corners)
        boundary = facets.facets[: facets.n_boundary].tolist()
        self.origin = Origin(domain, parts_of(len(points), cells), self.area, loops(boundary))
        self.views = Views(domain, points, cells, facets)
        self.vertex_of = {node: v for v, copies in enumerate(domain.copies) for node in copies}
        self.outer = [0] * len(domain)
        """Facet edges at each facet vertex that have cells on one side only."""
        for chain in domain.chains:
            for edge in chain.edges:
                if edge.sides[0].is_inside != edge.sides[1].is_inside:
                    for v in edge.vertices:
                        self.outer[v] += 1

    def settle(self, choice: Choice, f: Floats, allowed: Bools | None) -> tuple[Choice, Settled | None]:
        """Make the mesh of a choice from the nodes that are allowed, and take out of the choice what is not in it.

        `f` is by facet vertex. The mesh is None where no cell is left.
        """
        domain = self.domain

        def is_allowed(node: int) -> bool:
            return allowed is None or bool(allowed[node])

        if allowed is not None:
            kept = choice.kept & np.array([allowed[copies].any() for copies in domain.copies], np.bool_)
            choice = replace(choice, kept=kept, interior=choice.interior[allowed[choice.interior]])
        most_change = None
        best: tuple[tuple[int, float], Choice, Trimmed] | None = None
        most_area = PEEL * self.area
        for round_ in range(MOST_ROUNDS):
            obstacles = self.points[choice.interior]
            chords = valid_chords(domain, choice.kept, f, obstacles, choice.chords)
            choice = replace(choice, chords=chords)
            cells = triangulate(self.views, self.origin.parts, choice, f, is_allowed)
            if cells is None:
                break
            cells.peel(RIM_ANGLE_DEG, most_area)
            unpinch(cells, RIM_ANGLE_DEG, self.runs)
            cells.drop_crumbs()
            free_moot_chords(cells, lambda c, chords=chords: is_given(domain, chords[c]))  # type: ignore[misc]
            lost = victims(cells, RIM_ANGLE_DEG, lambda s, cells=cells: self.cost(cells.sites[s], f))  # type: ignore[misc]
            shape = cells.shape(RIM_ANGLE_DEG)
            change = abs(cells.area() - self.area)
            if most_change is None:
                most_change = change + MOST_CHANGE * self.area
            fewer, takes_out = self.without(choice, cells, lost)
            slivers, least = shape
            if change <= most_change and (best is None or (slivers, -least) <= (best[0][0], -best[0][1])):
                best = shape, choice, cells
            choice = fewer
            if slivers > 0 and most_area < math.inf and (not takes_out or round_ >= MENDING):
                # what can't be mended is peeled off, however large
                most_area = math.inf
            elif not takes_out:
                break
        if best is None:
            return choice, None
        _, choice, cells = best
        made = assemble(self.origin, choice, cells, is_allowed)
        return self.without(choice, cells, set())[0], made

    def runs(self, site: int) -> int:
        """Return the runs of cells around a site in the input: two boundary edges bound each."""
        return max(self.outer[site] // 2, 1) if site < len(self.domain) else 1

    def cost(self, site: int, f: Floats) -> int:
        """Return what taking out a site costs: nothing for an interior node, most for a corner of the domain."""
        if site >= len(self.domain):
            return 0
        return 1 if stands_out(self.domain, site, float(f[site]), self.cos_feature) is None else 2

    def without(self, choice: Choice, cells: Trimmed, lost: set[int]) -> tuple[Choice, bool]:
        """Return a choice without the sites that are in no cell and some others, and whether there were any."""
        used = {s for cell in cells.label for s in cell} - lost
        gone = [site for s, site in enumerate(cells.sites) if s not in used]
        kept, facets = choice.kept.copy(), len(self.domain)
        kept[[site for site in gone if site < facets]] = False
        interior = choice.interior[~np.isin(choice.interior, [site - facets for site in gone if site >= facets])]
        return replace(choice, kept=kept, interior=interior), bool(gone)
