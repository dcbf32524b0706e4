"""
A coast with islands
====================

What happens to features of the domain that are smaller than a coarse triangle is yours to say.
"""

import matplotlib.pyplot as plt

import coarsen

mesh = coarsen.gallery.coast(6000)

# %%
# ``features="keep"`` holds on to every island and inlet; it stops shrinking when the domain allows no more.
# ``"drop"`` lets go of them one by one, and goes on.

kept = coarsen.hierarchy(mesh, features="keep")
dropped = coarsen.hierarchy(mesh, features="drop")
print(kept.summary())
print(dropped.summary())

# %%
# The coarsest level of each:

figure, axes = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
for ax, h in zip(axes, (kept, dropped), strict=True):
    h[-1].mesh.plot(ax=ax)
    ax.set_title(f"{h[-1].mesh.n_points} nodes")
