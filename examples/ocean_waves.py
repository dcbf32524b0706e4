"""One implicit time step of shallow-water gravity waves: (1/(g H dt²) - Laplace) η = right-hand side, all coasts free.

On the coast of the gallery or, given one, on an ocean mesh from a file (fort.14, .msh, .npz, ...). Small steps are easy
for anyone; large ones make the operator nearly singular, and islands and inlets count.

Run: python examples/ocean_waves.py [nodes or mesh file] [picture.png]
"""

import sys

import matplotlib as mpl
import numpy as np
from scipy.sparse import diags

import coarsen
from coarsen.multigrid import laplacian, pyamg_solver
from coarsen.transfer import cell_sizes

mpl.use("agg")
import matplotlib.pyplot as plt

SPEED = 30.0
"""Of long waves: the root of g H, in lengths of the mesh (metres) a second; 30 m/s is 90 m of water."""


def main(source=8000, picture="ocean_waves.png"):
    """Solve for growing time steps, print iterations, draw the surface; return the iterations."""
    mesh = coarsen.gallery.coast(source) if isinstance(source, int) else coarsen.read(source)
    h = coarsen.hierarchy(mesh, features="auto")
    share = cell_sizes(mesh) / 3
    mass = np.bincount(mesh.cells.ravel(), np.repeat(share, 3), minlength=mesh.n_points)
    middle = mesh.points.mean(axis=0)
    width = np.ptp(mesh.points, axis=0).max()
    hump = np.exp(-((np.linalg.norm(mesh.points - middle, axis=1) / (0.1 * width)) ** 2))
    print(f"{mesh.n_points} nodes, levels of {', '.join(str(level.mesh.n_points) for level in h)}")
    print(f"{'waves run':>10} {'complexity':>11} {'iterations':>11} {'alone':>6}")
    iterations = []
    for reach in (0.01, 0.1, 1.0):  # how far a wave runs in a step, in widths of the domain
        weight = 1 / (reach * width) ** 2
        solver = pyamg_solver(laplacian(mesh) + weight * diags(mass), h)
        b = weight * mass * hump
        counts = []
        for accel in ("cg", None):
            residuals = []
            eta = solver.solve(b, tol=1e-8, accel=accel, residuals=residuals, maxiter=200)
            counts.append(len(residuals) - 1)
        iterations.append(counts[0])
        print(f"{reach:10.2f} {solver.operator_complexity():11.2f} {counts[0]:11d} {counts[1]:6d}")
        if reach == 0.1:
            shown = eta

    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5))
    level = h[min(2, len(h) - 1)].mesh
    left.triplot(*level.points.T, level.cells, lw=0.4, color="black")
    left.set_title(f"a coarse level: {level.n_points} nodes")
    figure.colorbar(right.tripcolor(*mesh.points.T, mesh.cells, shown, shading="gouraud"), ax=right)
    right.set_title(f"surface after a step of {0.1 * width / SPEED:.0f} s")
    for axes in (left, right):
        axes.set_aspect("equal")
    figure.savefig(picture, dpi=100)
    plt.close(figure)
    return iterations


if __name__ == "__main__":
    given = sys.argv[1] if len(sys.argv) > 1 else "8000"
    main(int(given) if given.isdigit() else given, *sys.argv[2:3])
