"""The baseline of Table 2: maximal independent sets of the edge skeleton, retriangulated, again and again.

Classes as in Figure 2 (corners are kept, then facet vertices, then interior nodes, each by index); coincident nodes are
one. The domain is kept valid by putting facet vertices back, nothing else.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .chords import repair
from .domain import Domain
from .hierarchy import STALL, as_dict, enough, power
from .level import Choice, assemble, triangulate
from .point import Floats, Ints

if TYPE_CHECKING:
    from coarsen.options import Options


def skeleton_levels(points: Floats, cells: Ints, domain: Domain, options: Options) -> tuple[list[dict[str, Any]], str]:
    """Return the levels, finest first, and why they end; no spacing is known of them."""
    first = np.arange(len(points))
    for copies in domain.copies:
        first[copies] = copies[0]
    on_facet = {copies[0] for copies in domain.copies}
    # what is put back must be of the finer level, so its chains are those at hand
    thin = domain
    levels: list[dict[str, Any]] = []
    while True:
        stopped = enough(options, len(levels), len(cells))
        if stopped is not None:
            return levels, stopped
        ends = first[cells][:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        edges = np.unique(np.concatenate([ends, ends[:, ::-1]]), axis=0)
        around: dict[int, list[int]] = {}
        for a, b in edges.tolist():
            around.setdefault(a, []).append(b)
        corners = [domain.copies[v][0] for v in np.flatnonzero(domain.corner)]
        facet = [node for node in around if node in on_facet]
        interior = [node for node in around if node not in on_facet]
        chosen, blocked = set(corners), set()
        for node in [*corners, *facet, *interior]:
            if node in chosen or node not in blocked:
                chosen.add(node)
                blocked.update(around[node])
        inside = np.array([node for node in interior if node in chosen], np.int64)
        kept = np.array([copies[0] in chosen for copies in domain.copies], np.bool_)
        chords = repair(thin, kept, points[inside], wide=False)
        choice = Choice(kept, inside, chords)
        mesh = assemble(thin, choice, triangulate(thin, points, choice))
        if options.levels is None and len(mesh.cells) > STALL * len(cells):
            return levels, "stalled"
        cells = mesh.nodes[mesh.cells]
        thin = thin.thinned(choice.kept)
        levels.append(as_dict(mesh, power(options.factor, len(levels) + 1), np.empty(0), len(edges)))
