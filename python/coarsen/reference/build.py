"""The border to `coarsen.multilevel`: which builder a mesh of the plane needs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .domain import FacetArrays
from .drop_levels import build_dropping
from .hierarchy import Builder, Made, Report
from .layers import hierarchy_in_layers
from .point import Floats, Ints
from .skeleton import skeleton_levels

if TYPE_CHECKING:
    from coarsen.options import Options


def hierarchy(
    points: Floats,
    cells: Ints,
    facets: FacetArrays,
    spacing: Floats | None,
    options: Options,
    report: Report = None,
    threads: int | None = None,
) -> Made:
    """Build the coarser levels of a triangle mesh; `report` and `threads` are passed over."""
    if facets.layer is not None:
        return hierarchy_in_layers(one_layer, points, cells, facets, spacing, options)
    return one_layer(points, cells, facets, spacing, options)


def one_layer(points: Floats, cells: Ints, facets: FacetArrays, spacing: Floats | None, options: Options) -> Made:
    """Build the coarser levels of a mesh whose parts don't overlap."""
    builder = Builder(points, cells, facets, spacing, options)
    if options.method == "mis":
        levels, stopped = skeleton_levels(points, cells, builder.domain, options)
        return levels, stopped, builder.at_nodes(builder.g)
    if options.features in {"drop", "auto"}:
        return build_dropping(builder)
    return builder.build()
