"""
Why not simply an independent set?
==================================

The usual way takes an independent set of the mesh's graph, again and again. The paper's Table 2 shows what becomes of
the angles.
"""

import matplotlib.pyplot as plt

import coarsen

mesh = coarsen.gallery.crack_plate()
figure, ax = plt.subplots(figsize=(7, 4), layout="constrained")
for method in ("function", "mis"):
    h = coarsen.hierarchy(mesh, method=method)
    ax.semilogx([level.mesh.n_points for level in h], [level.quality.min_angle for level in h], "o-", label=method)
    print(h.summary())
ax.set(xlabel="nodes", ylabel="smallest angle, degrees")
ax.invert_xaxis()
ax.legend()
