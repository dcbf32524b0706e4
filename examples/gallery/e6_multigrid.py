"""
Solve with it
=============

A geometric multigrid solver in a few lines: the operator of a coarse level is P^T A P, with the prolongation P.
"""

import matplotlib.pyplot as plt
import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

import coarsen

# %%
# Laplace's stiffness matrix of linear elements, with zero boundary values.


def stiffness(mesh):
    """Return the P1 stiffness matrix of a triangle mesh."""
    corner = mesh.points[mesh.cells]
    edge = np.roll(corner, -1, axis=1) - np.roll(corner, -2, axis=1)
    area = 0.5 * np.abs(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0])
    local = np.einsum("cid,cjd->cij", edge, edge) / (4 * area[:, None, None])
    rows, columns = np.repeat(mesh.cells, 3, axis=1).ravel(), np.tile(mesh.cells, 3).ravel()
    return sp.csr_array((local.ravel(), (rows, columns)), shape=(mesh.n_points, mesh.n_points))


def inside(mesh):
    """Return the indices of the nodes that are not on the boundary."""
    return np.setdiff1d(np.arange(mesh.n_points), mesh.boundary_facets)


mesh = coarsen.gallery.graded_square(40_000)
h = coarsen.hierarchy(mesh, features="auto")
free = [inside(level.mesh) for level in h]
P = [h.prolongation(i)[free[i - 1]][:, free[i]] for i in range(1, len(h))]
A = [stiffness(mesh)[free[0]][:, free[0]]]
for p in P:
    A.append((p.T @ A[-1] @ p).tocsr())
print([a.shape[0] for a in A])

# %%
# One V-cycle: smooth, correct from the next coarser level, smooth.

lower, upper = [sp.tril(a).tocsr() for a in A], [sp.triu(a).tocsr() for a in A]


def cycle(i, b):
    """Return an approximation of the solution on level i."""
    if i == len(A) - 1:
        return spl.spsolve(A[i].tocsc(), b)
    x = spl.spsolve_triangular(lower[i], b)
    x += P[i] @ cycle(i + 1, P[i].T @ (b - A[i] @ x))
    return x + spl.spsolve_triangular(upper[i], b - A[i] @ x, lower=False)


# %%
# As a preconditioner of conjugate gradients it needs a handful of steps, whatever the size of the mesh.

residuals = []
b = np.ones(len(free[0]))
preconditioner = spl.LinearOperator(A[0].shape, matvec=lambda r: cycle(0, r))
x, info = spl.cg(
    A[0], b, rtol=1e-8, M=preconditioner, callback=lambda x: residuals.append(np.linalg.norm(b - A[0] @ x))
)
print(f"{len(residuals)} steps, residual {residuals[-1]:.1e}")
figure, ax = plt.subplots(figsize=(6, 3.5), layout="constrained")
ax.semilogy(residuals, "o-")
ax.set(xlabel="step", ylabel="residual")
