"""
A spacing of your own
=====================

The spacing need not come from the mesh. Here, a coarse mesh that stays fine along a circle.
"""

import numpy as np

import coarsen


def fine_on_circle(points):
    """Return the spacing wished for: small at a distance 0.3 from the centre."""
    return 0.01 + 0.15 * abs(np.linalg.norm(points - 0.5, axis=1) - 0.3)


mesh = coarsen.gallery.square(20_000)
level = coarsen.coarsen(mesh, factor=1.5, spacing=fine_on_circle)
level.mesh.plot()
print(level.quality)
