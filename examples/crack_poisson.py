"""Poisson's equation on the cracked plate of the paper: -Δu = 1, u = 0 on the outer boundary, the crack's banks free.

Run: python examples/crack_poisson.py [nodes] [picture.png]
"""

import sys
import time

import matplotlib as mpl
import numpy as np

import coarsen
from coarsen.multigrid import laplacian, pyamg_solver
from coarsen.transfer import cell_sizes

mpl.use("agg")
import matplotlib.pyplot as plt


def outer_nodes(mesh):
    """Nodes on the sides of the unit square (the crack opens at the left side, its banks lie inside)."""
    x, y = mesh.points.T
    return (x == 0) | (x == 1) | (y == 0) | (y == 1)


def load(mesh):
    """Integrals of the hat functions: a third of the area of each cell around a node."""
    return np.bincount(mesh.cells.ravel(), np.repeat(cell_sizes(mesh) / 3, 3), minlength=mesh.n_points)


def main(n=20_000, picture="crack_poisson.png"):
    """Solve, print iterations for three sizes, draw the solution; return the iterations."""
    rows = []
    for size in (n // 16, n // 4, n):
        mesh = coarsen.gallery.crack_plate(size)
        free = ~outer_nodes(mesh)
        start = time.perf_counter()
        h = coarsen.hierarchy(mesh, features="auto")
        solver = pyamg_solver(laplacian(mesh), h, free)
        residuals = []
        u = np.zeros(mesh.n_points)
        u[free] = solver.solve(load(mesh)[free], tol=1e-8, accel="cg", residuals=residuals)
        seconds = time.perf_counter() - start
        rows.append((mesh.n_points, len(solver.levels), solver.operator_complexity(), len(residuals) - 1, seconds))
    print(f"{'nodes':>8} {'levels':>7} {'complexity':>11} {'iterations':>11} {'seconds':>8}")
    for row in rows:
        print("{:8d} {:7d} {:11.2f} {:11d} {:8.2f}".format(*row))

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5))
    left.triplot(*h[2].mesh.points.T, h[2].mesh.cells, lw=0.4, color="black")
    left.set_title(f"level 2: {h[2].mesh.n_points} nodes")
    drawn = right.tripcolor(*mesh.points.T, mesh.cells, u, shading="gouraud")
    right.set_title("u")
    figure.colorbar(drawn, ax=right)
    for axes in (left, right):
        axes.set_aspect("equal")
    figure.savefig(picture, dpi=100)
    plt.close(figure)
    return [row[3] for row in rows]


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20_000, *sys.argv[2:3])
