"""
Two materials
=============

An edge between cells of different tags is a facet: every coarser mesh has it as a union of its own edges, and
carries the tags.
"""

import matplotlib.pyplot as plt

import coarsen

mesh = coarsen.gallery.interface(3000)
h = coarsen.hierarchy(mesh, levels=3)

figure, axes = plt.subplots(1, len(h), figsize=(14, 4), layout="constrained")
for ax, level in zip(axes, h, strict=True):
    ax.tripcolor(*level.mesh.points.T, level.mesh.cells, facecolors=level.mesh.cell_tags, edgecolors="k", lw=0.2)
    ax.set(aspect="equal", title=f"{level.mesh.n_cells} cells")
