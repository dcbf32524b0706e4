"""
Boundaries by name
==================

Physical groups of gmsh, markers of SU2 and kinds of boundary of ADCIRC are facets with tags and names, and are found
again on every level.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection

import coarsen

sea = coarsen.gallery.coast(6000)
h = coarsen.hierarchy(sea, features="auto")
for tag, name in sea.facet_names.items():
    counts = [int(np.count_nonzero(level.mesh.facet_tags == tag)) for level in h]
    print(f"{name:<16} {counts} facets by level")

# %%
# The same boundaries, finest and coarser:

figure, axes = plt.subplots(1, 3, figsize=(12, 4.4), layout="constrained")
for ax, level in zip(axes, (h[0], h[2], h[-1]), strict=True):
    level.mesh.plot(ax=ax, facets=False, color="0.75")
    for color, (tag, name) in zip(("tab:blue", "tab:brown", "tab:green"), sea.facet_names.items(), strict=True):
        ends = level.mesh.points[level.mesh.facets[level.mesh.facet_tags == tag]]
        ax.add_collection(LineCollection(ends, colors=color, label=name, linewidths=1.6, zorder=3), autolim=False)
    ax.set_title(f"{level.mesh.n_points} nodes")
axes[0].legend(fontsize=8, loc="lower right")

# %%
# Conditions are held by name. Water set in motion from the open sea, no flow through the coast:

from coarsen.multigrid import laplacian, pyamg_solver

solver = pyamg_solver(laplacian(sea), h, dirichlet="open")
residuals = []
solver.solve(np.ones(solver.levels[0].A.shape[0]), tol=1e-8, accel="cg", residuals=residuals)
print(f"{len(residuals) - 1} steps, over unknowns {' > '.join(str(level.A.shape[0]) for level in solver.levels)}")
