"""
A first hierarchy
=================

The paper's example: a plate with a crack, refined towards the tip of it.
"""

import coarsen

mesh = coarsen.gallery.crack_plate()
h = coarsen.hierarchy(mesh)
print(h.summary())

# %%
# Every level is a mesh of its own, made of nodes of the first one. The crack is a line of doubled nodes, and
# remains one on every level.

h.plot()

# %%
# Definition 2.4, measured: angles and local similarity.

print(h.check(min_angle=15))
