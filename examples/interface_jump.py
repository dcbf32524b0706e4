"""Diffusion with a coefficient that jumps at a circle: -div(c grad u) = 1, u = 0 on the boundary.

The coefficient c is 1 outside, and from 1 to a million inside. The circle is an interface of the mesh (cells of two
tags), which every level keeps, so coarse functions kink where the solution does. Assembled by scikit-fem where it is
there, else by the package's own few lines.

Run: python examples/interface_jump.py [nodes] [picture.png]
"""

import sys

import matplotlib as mpl
import numpy as np

import coarsen
from coarsen import multigrid
from coarsen.transfer import free_mask

mpl.use("agg")
import matplotlib.pyplot as plt


def assembled(mesh, c):
    """Stiffness matrix and load vector."""
    try:
        import skfem
    except ImportError:
        hat = np.bincount(mesh.cells.ravel(), np.repeat(coarsen.transfer.cell_sizes(mesh) / 3, 3))
        return multigrid.laplacian(mesh, c), hat
    from skfem.helpers import dot, grad

    basis = skfem.Basis(multigrid.to_skfem(mesh), skfem.ElementTriP1())
    jump = basis.with_element(skfem.ElementTriP0()).interpolate(c)
    stiffness = skfem.BilinearForm(lambda u, v, w: w["c"] * dot(grad(u), grad(v))).assemble(basis, c=jump)
    return stiffness, skfem.LinearForm(lambda v, _: v).assemble(basis)


def main(n=10_000, picture="interface_jump.png"):
    """Solve for growing jumps, print iterations, draw; return the iterations."""
    mesh = coarsen.gallery.interface(n)
    h = coarsen.hierarchy(mesh, features="auto")
    free = free_mask(mesh, dirichlet="boundary")
    iterations = []
    print(f"{mesh.n_points} nodes, levels of {', '.join(str(level.mesh.n_points) for level in h)}")
    print(f"{'c inside':>9} {'complexity':>11} {'iterations':>11} {'largest u':>10}")
    for jump in (1.0, 1e3, 1e6):
        A, b = assembled(mesh, np.where(mesh.cell_tags == 2, jump, 1.0))
        solver = multigrid.pyamg_solver(A, h, free)
        residuals = []
        u = np.zeros(mesh.n_points)
        u[free] = solver.solve(b[free], tol=1e-8, accel="cg", residuals=residuals)
        iterations.append(len(residuals) - 1)
        print(f"{jump:9.0e} {solver.operator_complexity():11.2f} {iterations[-1]:11d} {u.max():10.4f}")

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 5))
    level = h[min(2, len(h) - 1)].mesh
    left.tripcolor(*level.points.T, level.cells, level.cell_tags, edgecolors="k", linewidth=0.4, cmap="Pastel1")
    left.set_title(f"a coarse level: {level.n_points} nodes, both materials")
    drawn = right.tripcolor(*mesh.points.T, mesh.cells, u, shading="gouraud")
    right.set_title("u, the disc a million times as conductive")
    figure.colorbar(drawn, ax=right)
    for axes in (left, right):
        axes.set_aspect("equal")
    figure.savefig(picture, dpi=100)
    plt.close(figure)
    return iterations


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000, *sys.argv[2:3])
