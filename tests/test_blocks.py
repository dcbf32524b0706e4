"""Several unknowns a node: coarse operators of elasticity lose weak blocks, and linear functions do not feel it."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("scipy")
from scipy.sparse import coo_matrix, csr_matrix, kron
from scipy.sparse.linalg import LinearOperator, eigsh, splu

import coarsen
from coarsen import _core, galerkin, multigrid, transfer
from coarsen.transfer.rows import csr

SEED = 7


def elasticity(mesh, nu=0.3):
    """Stiffness of plane stress, the two unknowns of a node together."""
    p = mesh.points[mesh.cells]
    edges = np.roll(p, -2, axis=1) - np.roll(p, -1, axis=1)
    area = transfer.cell_sizes(mesh)
    gradient = np.stack([-edges[..., 1], edges[..., 0]], axis=-1) / (2 * area[:, None, None])
    strain = np.zeros((mesh.n_cells, 3, 6))
    strain[:, 0, 0::2] = strain[:, 2, 1::2] = gradient[..., 0]
    strain[:, 1, 1::2] = strain[:, 2, 0::2] = gradient[..., 1]
    stress = np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]) / (1 - nu**2)
    local = np.einsum("mki,kl,mlj,m->mij", strain, stress, strain, area)
    at = (2 * mesh.cells[:, :, None] + np.arange(2)).reshape(-1, 6)
    index = np.repeat(at, 6, axis=1).ravel(), np.tile(at, (1, 6)).ravel()
    return coo_matrix((local.ravel(), index), shape=(2 * mesh.n_points,) * 2).tocsr()


def left_half_free(mesh):
    x = mesh.points[:, 0]
    return x > x.min() + 1e-9 * np.ptp(x)


@pytest.fixture(scope="module")
def plate():
    mesh = coarsen.gallery.plate_with_holes(6000, (2, 2))
    return mesh, coarsen.hierarchy(mesh, features="auto"), elasticity(mesh)


def products(plate, least, threads=None):
    """Galerkin's product on the first coarse level, and without weak blocks."""
    _, h, A = plate
    whole = csr(_core.galerkin(A, galerkin.blocks(h.prolongation(1), 2), 0.0, None)[1], 2 * h[1].mesh.n_points)
    first = 2 * np.arange(h[1].mesh.n_points)
    thin = _core.filtered_blocks(whole, first, h[1].mesh.points, 2, least, threads)
    return whole, csr(thin, whole.shape[1])


def test_linear_functions_do_not_feel_what_is_left_out(plate):
    whole, thin = products(plate, 0.025)
    assert thin.nnz < 0.75 * whole.nnz
    assert abs(thin - thin.T).max() < 1e-13
    points = plate[1][1].mesh.points
    for u in (np.ones(len(points)), *points.T):
        for part in np.eye(2):
            field = np.outer(u, part).ravel()
            np.testing.assert_allclose(thin @ field, whole @ field, atol=1e-10)


def test_a_turn_of_the_body_costs_no_energy(plate):
    _, thin = products(plate, 0.025)
    x, y = plate[1][1].mesh.points.T
    turn = np.stack([-y, x], axis=1).ravel()
    assert np.abs(thin @ turn).max() < 1e-12


def test_energies_stay_nearly_what_they_were(plate):
    whole, thin = products(plate, 0.025)
    keep = np.repeat(left_half_free(plate[1][1].mesh), 2)
    whole, thin = (matrix[keep][:, keep].tocsc() for matrix in (whole, thin))
    for one, other in ((whole, thin), (thin, whole)):
        solve = LinearOperator(other.shape, matvec=splu(other).solve)
        most = eigsh(one, 1, other, Minv=solve, which="LM", tol=1e-3, return_eigenvectors=False)[0]
        assert 1 <= most < 1.5


def test_what_goes_is_weak_and_the_same_for_any_number_of_threads(plate):
    whole, thin = products(plate, 0.025)
    assert abs(products(plate, 0.0)[1] - whole).max() == 0

    def norms(matrix):
        nodes = kron(csr_matrix(np.eye(whole.shape[0] // 2)), np.ones((1, 2)), format="csr")
        return nodes @ matrix.multiply(matrix) @ nodes.T

    before, after = norms(whole), norms(thin)
    i, j = before.nonzero()
    own = np.sqrt(before.diagonal())
    gone = np.asarray(after[i, j]).ravel() == 0
    assert gone.sum() > 1000
    assert (np.sqrt(np.asarray(before[i, j]).ravel())[gone] < 0.025 * np.sqrt(own[i] * own[j])[gone]).all()
    for threads in (1, 2, 3):
        again = products(plate, 0.025, threads)[1]
        assert (again.indices == thin.indices).all()
        assert (again.data == thin.data).all()


@pytest.mark.parametrize("scale", [2.0**-432, 2.0**432])
def test_coordinates_may_be_small_or_large(plate, scale):
    whole, thin = products(plate, 0.025)
    first = 2 * np.arange(whole.shape[0] // 2)
    again = csr(_core.filtered_blocks(whole, first, scale * plate[1][1].mesh.points, 2, 0.025, None), whole.shape[1])
    assert again.nnz == thin.nnz
    assert abs(again - thin).max() < 1e-12


def test_unknowns_of_no_whole_node_stay_as_they_are(plate):
    whole, _ = products(plate, 0.025)
    n = plate[1][1].mesh.n_points
    mask = np.ones(2 * n, dtype=bool)
    mask[[3, 40, 41, 100]] = False
    matrix = transfer.reduced(whole, mask, mask)
    nodes = np.flatnonzero(mask.reshape(-1, 2).all(axis=1))
    thin = galerkin.without_weak_blocks(matrix, plate[1][1].mesh, mask, 2, None)
    alone = np.setdiff1d(np.flatnonzero(mask), (2 * nodes[:, None] + np.arange(2)).ravel())
    rows = (np.cumsum(mask) - 1)[alone]
    assert len(rows) == 2
    assert abs((thin - matrix)[rows]).max() == 0
    assert thin.nnz < 0.8 * matrix.nnz


def test_a_matrix_that_is_not_symmetric_keeps_its_skew_blocks(plate):
    whole, _ = products(plate, 0.0)
    skew = csr_matrix(np.array([[0.0, 1.0], [-1.0, 0.0]]))
    pattern = kron(csr_matrix((np.ones(whole.nnz), whole.indices, whole.indptr), whole.shape)[::2, ::2], skew)
    mixed = galerkin.as_csr((whole + whole.diagonal().mean() * 0.01 * pattern).tocsr())
    first = 2 * np.arange(mixed.shape[0] // 2)
    thin = csr(_core.filtered_blocks(mixed, first, plate[1][1].mesh.points, 2, 0.05, None), mixed.shape[1])
    assert abs(thin - mixed).max() == 0


def test_nodes_that_do_not_fit_are_refused(plate):
    whole, _ = products(plate, 0.0)
    points = plate[1][1].mesh.points
    n = len(points)
    for first in (np.arange(n), 2 * np.arange(n) + 1, 2 * np.arange(n) - 2, np.zeros(3, np.int64)):
        with pytest.raises(ValueError, match="'first' names no 2 unknowns"):
            _core.filtered_blocks(whole, first, points, 2, 0.1, None)


@pytest.mark.parametrize(
    ("name", "arguments", "steps"), [("plate_with_holes", ((2, 2),), 13), ("crack_plate", (), 11), ("lshape", (), 11)]
)
def test_elasticity_takes_few_steps_and_little_memory(name, arguments, steps):
    mesh = getattr(coarsen.gallery, name)(10_000, *arguments)
    solver = multigrid.solver(
        elasticity(mesh), coarsen.hierarchy(mesh, features="auto"), left_half_free(mesh), block_size=2
    )
    norms = []
    solver.solve(np.random.default_rng(SEED).normal(size=solver.stages[0].A.shape[0]), residuals=norms)
    assert len(norms) - 1 <= steps
    assert solver.operator_complexity() <= 1.62
