"""
The parts by themselves
=======================

Spacing and selection take nothing but points, in one, two or three dimensions.
"""

import matplotlib.pyplot as plt
import numpy as np

import coarsen

points = np.random.default_rng(7).normal(size=(3000, 2))
g = coarsen.spacing.nearest(points)
f = coarsen.spacing.coarsened(points, g, 8.0)
chosen = coarsen.selection.independent_set(points, f, beta=2.0)
cells = coarsen.delaunay(points[chosen])
print(f"{len(chosen)} of {len(points)} points, {len(coarsen.selection.conflict_graph(points, f, 2.0))} conflicts")

figure, ax = plt.subplots(figsize=(6, 6), layout="constrained")
ax.plot(*points.T, ".", ms=2, color="0.7")
ax.triplot(*points[chosen].T, cells, lw=0.7)
ax.set_aspect("equal")

# %%
# In space, with the same calls:

cloud = np.random.default_rng(7).normal(size=(3000, 3))
f = coarsen.spacing.coarsened(cloud, coarsen.spacing.nearest(cloud), 4.0)
print(len(coarsen.selection.independent_set(cloud, f, beta=2.0)), "of", len(cloud))
