"""Levels of a simplified domain (``features="drop"``): what is smaller than the spacing is closed or cut off.

Nodes are selected as in Figure 2 (see `drop_select`), but none is forced, and no vertex is put back to make chords
valid: chords that would be no valid domain are given up instead. The cells of the constrained Delaunay triangulation of
what is kept are inside where valid chords say so; elsewhere most of their sample points must lie in the input mesh.
Then slivers are peeled off the rim, or a node of them is taken out. Where neither helps, a sliver is the thin bridge
between two pieces of a level, which are cut apart there.

Selection goes from coarse to fine, as in Figure 3. A node that ends in no cell is taken out, of this level and of all
coarser ones: levels are settled from fine to coarse, and as the sets only shrink, once is enough.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from .domain import Domain, FacetArrays
from .drop_assemble import Dropped, Origin, assemble, is_given, loops
from .drop_flip import free_moot_chords
from .drop_label import Views, triangulate
from .drop_mend import victims
from .drop_parts import Parts
from .drop_pinch import unpinch
from .drop_trim import Trimmed, area
from .level import Choice, LevelMesh
from .loose import stands_out, valid_chords
from .point import Bools, Floats, Ints

RIM_ANGLE_DEG = 15.0
"""Smallest angle of a cell that is left on the rim, in degrees."""
MOST_CHANGE = 0.05
"""Mending may change the area by this share of the input's more than dropping features did."""
MOST_FOR_ALL = 0.08
"""By this share where that leaves no sliver."""
MOST_AT_LAST = 0.25
"""By this share where that leaves no sliver once they are cut through: there is no other means then."""
PEEL = 0.01
"""Larger cells, by their share of the area of the input, are peeled off the rim only if they can't be mended."""
MENDING = 4
"""Rounds in which that is tried."""
IN_VAIN = 6
"""Rounds after which mending is given up where none of them made the level better."""
MOST_ROUNDS = 32
"""Triangulations of one level at most before slivers are cut through, and then again.

Each but the last takes out nodes."""

Settled = tuple[LevelMesh, Dropped]


class Ground:
    """The input as the settling of levels sees it."""

    def __init__(
        self, domain: Domain, points: Floats, cells: Ints, facets: FacetArrays, parts: Parts, cos_feature: float
    ) -> None:
        self.domain, self.points, self.cos_feature = domain, points, cos_feature
        corners = [[(x, y) for x, y in rows] for rows in points[cells].tolist()]
        # a needle's may be rounded below zero
        self.area = sum(max(area(*rows), 0.0) for rows in corners)
        boundary = facets.facets[: facets.n_boundary].tolist()
        self.origin = Origin(domain, parts, self.area, loops(boundary))
        self.views = Views(domain, points, cells)
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
        first_change = None
        best: tuple[tuple[int, float], Choice, Trimmed] | None = None
        most_area, severs, better_at = PEEL * self.area, False, 0
        for round_ in range(2 * MOST_ROUNDS):
            obstacles = self.points[choice.interior]
            chords = valid_chords(domain, choice.kept, f, obstacles, choice.chords)
            choice = replace(choice, chords=chords)
            cells = triangulate(self.views, self.origin.parts, choice, f, is_allowed)
            if cells is None:
                break
            cells.peel(RIM_ANGLE_DEG, most_area, severs=severs)
            unpinch(cells, RIM_ANGLE_DEG, self.runs)
            cells.drop_crumbs()
            free_moot_chords(cells, lambda c, chords=chords: is_given(domain, chords[c]))  # type: ignore[misc]
            lost = victims(cells, RIM_ANGLE_DEG, lambda s, cells=cells: self.cost(cells.sites[s], f))  # type: ignore[misc]
            shape = cells.shape(RIM_ANGLE_DEG)
            change = abs(cells.area() - self.area)
            if first_change is None:
                first_change = change
            share = MOST_CHANGE if shape[0] else MOST_AT_LAST if severs else MOST_FOR_ALL
            most_change = first_change + share * self.area
            fewer, takes_out = self.without(choice, cells, lost)
            slivers, least = shape
            if change <= most_change and (best is None or (slivers, -least) <= (best[0][0], -best[0][1])):
                best, better_at = (shape, choice, cells), round_
            choice = fewer
            gives_up = not severs and (round_ - better_at >= IN_VAIN or round_ + 1 == MOST_ROUNDS)
            if slivers > 0 and most_area < math.inf and (not takes_out or round_ >= MENDING):
                # what can't be mended is peeled off, however large
                most_area = math.inf
            elif not takes_out or gives_up:
                if severs or best is None or best[0][0] == 0:
                    break
                # slivers that are left hold larger pieces together, which are cut apart there
                choice = best[1]
                most_area, severs, first_change = math.inf, True, None
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
