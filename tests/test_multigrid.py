"""Multigrid on a hierarchy: the operators are Galerkin's, and the solvers that are made of them are fast."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("scipy")
from scipy.sparse import diags, identity, kron
from scipy.sparse.linalg import spsolve

import coarsen
from coarsen import _core, galerkin, multigrid, transfer
from coarsen.transfer.rows import csr

SEED = 7


def product(A, P, least=0.0, threads=None):
    restriction, made = _core.galerkin(A, P, least, threads)
    return csr(restriction, P.shape[0]), csr(made, P.shape[1])


@pytest.fixture(scope="module")
def square():
    mesh = coarsen.gallery.square(6000, seed=SEED)
    return mesh, coarsen.hierarchy(mesh), multigrid.laplacian(mesh)


def held(mesh, kind):
    """Free nodes: the whole boundary held, the left half of it, one node."""
    free = np.ones(mesh.n_points, dtype=bool)
    if kind == "whole":
        free[mesh.boundary_facets] = False
    elif kind == "part":
        middle = mesh.points[mesh.boundary_facets].mean(axis=1)[:, 0]
        free[mesh.boundary_facets[middle < np.median(middle)]] = False
    else:
        free[mesh.n_points // 3] = False
    return free


def cycles(solver, b, **options):
    residuals = []
    x = solver.solve(b, tol=1e-8, residuals=residuals, maxiter=100, **options)
    A = solver.levels[0].A
    assert np.linalg.norm(b - A @ x) < 2e-8 * np.linalg.norm(b)
    return len(residuals) - 1


# --- products --------------------------------------------------------------------------------------------------------


def test_the_product_is_that_of_scipy_for_any_number_of_threads(square):
    _, h, A = square
    P = h.prolongation(1)
    restriction, made = product(A, P)
    assert (restriction != P.T).nnz == 0
    expected = (P.T @ A @ P).tocsr()
    assert abs(made - expected).max() < 1e-13 * abs(expected).max()
    for threads in (1, 2, 3):
        again = product(A, P, threads=threads)[1]
        assert (again.data == made.data).all()
        assert (again.indices == made.indices).all()


def test_filtered_products_keep_row_sums_and_symmetry_and_lose_weak_entries_only(square):
    _, h, A = square
    plain, thin = (product(A, h.prolongation(1), least)[1] for least in (0.0, 0.01))
    assert thin.nnz < 0.9 * plain.nnz
    np.testing.assert_allclose(thin.sum(axis=1), plain.sum(axis=1), atol=1e-12)
    assert abs(thin - thin.T).max() < 1e-13
    scale = diags(1 / np.sqrt(plain.diagonal()))
    relative = abs(scale @ plain @ scale).tocoo()
    gone = np.asarray(thin[relative.row, relative.col]).ravel() == 0
    assert relative.data[gone].max() < 0.01
    # no energy is less than it was, and those of linear functions are nearly what they were
    x = np.random.default_rng(SEED).normal(size=(20, thin.shape[0]))
    assert (((x @ thin) * x).sum(axis=1) > ((x @ plain) * x).sum(axis=1)).all()
    line = h[1].mesh.points[:, 0]
    assert line @ (thin @ line) == pytest.approx(line @ (plain @ line), rel=0.02)


def test_products_of_matrices_that_do_not_fit_are_refused(square):
    _, h, A = square
    with pytest.raises(ValueError, match="do not fit"):
        _core.galerkin(A[1:], h.prolongation(1), 0.0, None)
    broken = h.prolongation(1).copy()
    broken.indices[0] = 10**6
    with pytest.raises(ValueError, match="'P' is no matrix by rows"):
        _core.galerkin(A, broken, 0.0, None)


# --- stages ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["whole", "part"])
def test_stages_are_galerkins_up_to_weak_entries(square, kind):
    mesh, h, A = square
    made = galerkin.stages(A, h, held(mesh, kind))
    assert len(made) > 2
    for fine, coarse in pairwise(made):
        exact = fine.P.T @ fine.A @ fine.P
        assert (fine.R != fine.P.T).nnz == 0
        assert coarse.A.shape == exact.shape
        assert abs(exact.sum(axis=1) - coarse.A.sum(axis=1)).max() < 1e-10
        assert np.linalg.eigvalsh(coarse.A.toarray()[:300, :300]).min() > 0


def test_a_full_matrix_and_a_reduced_one_give_the_same_stages(square):
    mesh, h, A = square
    for kind in ("whole", "one"):
        free = held(mesh, kind)
        one = galerkin.stages(A, h, free)
        two = galerkin.stages(transfer.reduced(A, free, free), h, free)
        for a, b in zip(one, two, strict=True):
            assert abs(a.A - b.A).max() < 1e-12
    boundary = galerkin.stages(A, h, dirichlet="boundary")
    assert (boundary[0].A != galerkin.stages(A, h, held(mesh, "whole"))[0].A).nnz == 0


def test_one_held_node_of_a_natural_problem_is_only_a_choice_of_the_constant(square):
    mesh, h, A = square
    free = held(mesh, "one")
    reduced = transfer.reduced(A, free, free)
    whole = galerkin.whole_matrix(reduced, free)
    assert abs(whole - A).max() < 1e-10
    # with a term of order zero, or of a corner held twice, it is not
    assert galerkin.whole_matrix(as_screened(reduced), free) is None
    assert galerkin.whole_matrix(A, np.ones(mesh.n_points, dtype=bool)) is None
    stages = galerkin.stages(reduced, h, free)
    assert stages[0].gauge is not None
    assert np.linalg.matrix_rank(stages[-1].A.toarray()) == stages[-1].A.shape[0]


def as_screened(matrix):
    return (matrix + 0.01 * identity(matrix.shape[0])).tocsr()


def test_arguments_that_do_not_fit_are_refused(square):
    mesh, h, A = square
    with pytest.raises(ValueError, match=r"'A' has shape \(5, 5\)"):
        multigrid.pyamg_solver(A[:5, :5], h)
    with pytest.raises(ValueError, match="'block_size' is 0"):
        multigrid.pyamg_solver(A, h, block_size=0)
    with pytest.raises(ValueError, match="complex128"):
        multigrid.pyamg_solver(A.astype(complex), h)
    with pytest.raises(ValueError, match="expected bool"):
        multigrid.pyamg_solver(A, h, free=np.ones(mesh.n_points))


# --- PyAMG -----------------------------------------------------------------------------------------------------------

CASES = {
    "square": lambda: coarsen.gallery.square(10_000, seed=SEED),
    "lshape": lambda: coarsen.gallery.lshape(10_000),
    "crack": lambda: coarsen.gallery.crack_plate(10_000),
    "holes": lambda: coarsen.gallery.plate_with_holes(10_000),
    "ring": lambda: coarsen.gallery.ring(10_000),
}


@pytest.mark.parametrize("kind", ["whole", "part", "one"])
@pytest.mark.parametrize("name", CASES)
def test_few_cycles_solve_poisson_however_the_boundary_is_held(name, kind):
    pytest.importorskip("pyamg")
    mesh = CASES[name]()
    h = coarsen.hierarchy(mesh, features="auto")
    solver = multigrid.pyamg_solver(multigrid.laplacian(mesh), h, held(mesh, kind))
    b = np.random.default_rng(SEED).normal(size=solver.levels[0].A.shape[0])
    assert cycles(solver, b, accel="cg") <= 8
    assert cycles(solver, b) <= 15
    assert solver.operator_complexity() <= 1.7


@pytest.mark.parametrize("kind", ["whole", "part", "one"])
def test_few_cycles_solve_poisson_around_an_airfoil(meshes, kind):
    pytest.importorskip("pyamg")
    arrays = np.load(meshes / "airfoil1_4253.npz")
    mesh = coarsen.Mesh(arrays["points"], arrays["triangles"])
    h = coarsen.hierarchy(mesh, features="auto")
    solver = multigrid.pyamg_solver(multigrid.laplacian(mesh), h, held(mesh, kind))
    b = np.random.default_rng(SEED).normal(size=solver.levels[0].A.shape[0])
    assert cycles(solver, b, accel="cg") <= 9
    assert cycles(solver, b) <= 16


def test_the_solution_is_that_of_the_matrix(square):
    pytest.importorskip("pyamg")
    mesh, h, A = square
    for kind in ("whole", "part", "one"):
        free = held(mesh, kind)
        solver = multigrid.pyamg_solver(A, h, free)
        b = np.random.default_rng(SEED).normal(size=free.sum())
        x = solver.solve(b, tol=1e-12, accel="cg")
        np.testing.assert_allclose(x, spsolve(transfer.reduced(A, free, free).tocsc(), b), rtol=1e-6, atol=1e-8)


def test_the_preconditioner_is_symmetric_also_where_one_node_is_held(square):
    pytest.importorskip("pyamg")
    mesh, h, A = square
    for kind in ("whole", "one"):
        M = multigrid.pyamg_solver(A, h, held(mesh, kind)).aspreconditioner()
        u, v = np.random.default_rng(SEED).normal(size=(2, M.shape[0]))
        assert u @ (M @ v) == pytest.approx(v @ (M @ u), rel=1e-9)


def test_two_unknowns_a_node_are_interpolated_alike(square):
    pytest.importorskip("pyamg")
    mesh, h, A = square
    two = kron(A, np.array([[2.0, 0.5], [0.5, 1.0]]), format="csr")
    free = np.repeat(held(mesh, "whole"), 2)
    solver = multigrid.pyamg_solver(two, h, free, block_size=2)
    b = np.random.default_rng(SEED).normal(size=free.sum())
    assert cycles(solver, b, accel="cg") <= 12
    by_nodes = multigrid.pyamg_solver(two, h, held(mesh, "whole"), block_size=2)
    assert (by_nodes.levels[1].A != solver.levels[1].A).nnz == 0


def test_coarse_operators_may_be_assembled_anew(square):
    pytest.importorskip("pyamg")
    mesh, h, A = square
    solver = multigrid.pyamg_solver(A, h, dirichlet="boundary", operators=lambda i, coarse: multigrid.laplacian(coarse))
    free = held(mesh, "whole")[h[1].nodes]
    assert abs(solver.levels[1].A - multigrid.laplacian(h[1].mesh)[free][:, free]).max() == 0
    b = np.ones(solver.levels[0].A.shape[0])
    assert cycles(solver, b, accel="cg") <= 12


def test_levels_that_are_not_nested_solve_too():
    pytest.importorskip("pyamg")
    mesh = coarsen.gallery.square(5000, seed=2)
    solver = multigrid.pyamg_solver(
        multigrid.laplacian(mesh), coarsen.hierarchy(mesh, nested=False), dirichlet="boundary"
    )
    assert cycles(solver, np.ones(solver.levels[0].A.shape[0]), accel="cg") <= 10


# --- other libraries -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["whole", "part", "one"])
def test_petsc_solves_with_the_hierarchy(square, kind):
    """With Debian's python3-petsc4py, for one: its folder on the PYTHONPATH, and a NumPy that it was built for."""
    PETSc = pytest.importorskip("petsc4py.PETSc")
    mesh, h, A = square
    free = held(mesh, kind)
    reduced = transfer.reduced(A, free, free)
    matrix = PETSc.Mat().createAIJ(size=reduced.shape, csr=(reduced.indptr, reduced.indices, reduced.data))
    ksp = PETSc.KSP().create()
    ksp.setOperators(matrix)
    ksp.setType("cg")
    ksp.setTolerances(rtol=1e-8)
    pc = multigrid.petsc_pcmg(ksp, h, free)
    assert pc.getType() == "mg"
    b, x = matrix.createVecs()
    b.setArray(np.random.default_rng(SEED).normal(size=reduced.shape[0]))
    ksp.solve(b, x)
    assert ksp.getConvergedReason() > 0
    assert ksp.getIterationNumber() <= 9
    assert np.linalg.norm(reduced @ x.getArray() - b.getArray()) < 1e-5 * np.linalg.norm(b.getArray())


def test_meshes_go_to_scikit_fem_and_back():
    skfem = pytest.importorskip("skfem")
    start = skfem.MeshTri.init_circle(3)
    start = start.with_boundaries({"left": lambda x: x[0] < 0}).with_subdomains({"up": lambda x: x[1] > 0})
    mesh = multigrid.from_skfem(start)
    assert mesh.n_points == start.p.shape[1]
    assert set(np.unique(mesh.cell_tags)) == {0, 1}
    assert len(mesh.facets) == len(start.boundaries["left"])
    again = multigrid.to_skfem(mesh)
    assert (again.p == start.p).all()
    assert (np.sort(again.t, axis=0) == np.sort(start.t, axis=0)).all()
    assert len(again.boundaries["left"]) == len(mesh.facets)
    assert len(again.subdomains["up"]) == len(start.subdomains["up"])


def test_the_laplacian_is_that_of_scikit_fem():
    skfem = pytest.importorskip("skfem")
    from skfem.models.poisson import laplace

    mesh = coarsen.gallery.interface(500)
    expected = laplace.assemble(skfem.Basis(multigrid.to_skfem(mesh), skfem.ElementTriP1()))
    assert abs(multigrid.laplacian(mesh) - expected).max() < 1e-12
    twice = multigrid.laplacian(mesh, np.full(mesh.n_cells, 2.0))
    assert abs(twice - 2 * expected).max() < 1e-12
