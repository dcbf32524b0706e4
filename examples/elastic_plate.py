"""Linear elasticity (plane stress) on a plate with holes: held at the left side, pulled at the right side.

Two unknowns a node, interpolated alike (`block_size=2`).

Run: python examples/elastic_plate.py [nodes] [picture.png]
"""

import sys

import matplotlib as mpl
import numpy as np
from scipy.sparse import coo_matrix

import coarsen
from coarsen.multigrid import pyamg_solver
from coarsen.transfer import cell_sizes

mpl.use("agg")
import matplotlib.pyplot as plt

NU = 0.3
STRESS_OF_STRAIN = np.array([[1, NU, 0], [NU, 1, 0], [0, 0, (1 - NU) / 2]]) / (1 - NU**2)


def strains(mesh):
    """Strain (xx, yy, 2xy) of each cell from its six displacements: (m, 3, 6)."""
    p = mesh.points[mesh.cells]
    edges = np.roll(p, -2, axis=1) - np.roll(p, -1, axis=1)
    gradient = np.stack([-edges[..., 1], edges[..., 0]], axis=-1) / (2 * cell_sizes(mesh)[:, None, None])
    B = np.zeros((mesh.n_cells, 3, 6))
    B[:, 0, 0::2] = B[:, 2, 1::2] = gradient[..., 0]
    B[:, 1, 1::2] = B[:, 2, 0::2] = gradient[..., 1]
    return B


def assembled(mesh):
    """Stiffness matrix and, for each cell, the numbers of its six unknowns."""
    B = strains(mesh)
    local = np.einsum("mki,kl,mlj,m->mij", B, STRESS_OF_STRAIN, B, cell_sizes(mesh))
    unknowns = (2 * mesh.cells[:, :, None] + np.arange(2)).reshape(mesh.n_cells, 6)
    index = np.repeat(unknowns, 6, axis=1).ravel(), np.tile(unknowns, (1, 6)).ravel()
    return coo_matrix((local.ravel(), index), shape=(2 * mesh.n_points,) * 2).tocsr(), unknowns


def main(n=10_000, picture="elastic_plate.png"):
    """Solve, print iterations for two sizes, draw the stress; return the iterations."""
    rows = []
    for size in (n // 4, n):
        mesh = coarsen.gallery.plate_with_holes(size, (2, 2))
        x = mesh.points[:, 0]
        A, unknowns = assembled(mesh)
        # a pull of 1 along x on the right side: half of each edge's length to either end
        facets = mesh.boundary_facets[(x[mesh.boundary_facets] > x.max() - 1e-12).all(axis=1)]
        length = np.linalg.norm(np.diff(mesh.points[facets], axis=1)[:, 0], axis=1)
        b = np.bincount(2 * facets.ravel(), np.repeat(length / 2, 2), minlength=2 * mesh.n_points)
        free = x > x.min() + 1e-12
        h = coarsen.hierarchy(mesh, features="auto")
        solver = pyamg_solver(A, h, free, block_size=2)
        residuals, u = [], np.zeros(2 * mesh.n_points)
        both = np.repeat(free, 2)
        u[both] = solver.solve(b[both], tol=1e-8, accel="cg", residuals=residuals, maxiter=100)
        rows.append((both.sum(), solver.operator_complexity(), len(residuals) - 1, u[::2].max()))
    print(f"{'unknowns':>9} {'complexity':>11} {'iterations':>11} {'largest displacement':>21}")
    for row in rows:
        print("{:9d} {:11.2f} {:11d} {:21.4f}".format(*row))

    stress = np.einsum("kl,mli,mi->mk", STRESS_OF_STRAIN, strains(mesh), u[unknowns])
    moved = mesh.points + 0.1 * u.reshape(-1, 2)
    figure, axes = plt.subplots(figsize=(7, 6))
    drawn = axes.tripcolor(*moved.T, mesh.cells, facecolors=stress[:, 0])
    figure.colorbar(drawn, ax=axes, label="stress along x")
    axes.set_aspect("equal")
    figure.savefig(picture, dpi=100)
    plt.close(figure)
    return [row[2] for row in rows]


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000, *sys.argv[2:3])
