"""The package's own solver: PyAMG's cycle on the same stages is its oracle."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("scipy")
from scipy.sparse import csr_matrix, kron
from scipy.sparse.linalg import cg, spsolve

import coarsen
from coarsen import galerkin, multigrid, transfer
from test_multigrid import held

SEED = 11
KINDS = ["whole", "part", "one"]


def small():
    return coarsen.gallery.lshape(5000)


def large():
    """More rows than a block of a sweep has."""
    return coarsen.gallery.crack_plate(40_000)


@pytest.fixture(scope="module", params=[small, large], ids=lambda make: make.__name__)
def problem(request):
    mesh = request.param()
    return mesh, coarsen.hierarchy(mesh, features="auto"), multigrid.laplacian(mesh)


def right_hand_side(solver):
    return np.random.default_rng(SEED).normal(size=solver.aspreconditioner().shape[0])


@pytest.mark.parametrize("kind", ["whole", "part"])
def test_a_cycle_is_that_of_pyamg_up_to_single_precision_where_a_sweep_has_one_block(kind):
    pytest.importorskip("pyamg")
    mesh = small()
    h, A, free = coarsen.hierarchy(mesh), multigrid.laplacian(mesh), held(mesh, kind)
    fast, oracle = multigrid.solver(A, h, free), multigrid.pyamg_solver(A, h, free)
    b = right_hand_side(fast)
    expected = oracle.solve(b, tol=0, maxiter=1)
    assert np.linalg.norm(fast.aspreconditioner() @ b - expected) < 2e-6 * np.linalg.norm(expected)
    norms, theirs = [], []
    fast.solve(b, maxiter=6, tol=0, accel=None, residuals=norms)
    oracle.solve(b, maxiter=6, tol=0, residuals=theirs)
    np.testing.assert_allclose(norms, theirs, rtol=1e-3)
    # conjugate gradients, too, go the same way
    with_cg = []
    fast.solve(b, maxiter=6, tol=0, residuals=with_cg)
    theirs = [np.linalg.norm(b)]
    reduced = transfer.reduced(A, free, free)
    M = oracle.aspreconditioner()
    cg(reduced, b, M=M, maxiter=6, rtol=0, callback=lambda x: theirs.append(np.linalg.norm(b - reduced @ x)))
    np.testing.assert_allclose(with_cg, theirs, rtol=1e-2)


@pytest.mark.parametrize("kind", KINDS)
def test_it_needs_as_many_iterations_as_pyamg_with_the_same_stages(problem, kind):
    pytest.importorskip("pyamg")
    mesh, h, A = problem
    free = held(mesh, kind)
    fast, oracle = multigrid.solver(A, h, free), multigrid.pyamg_solver(A, h, free)
    assert fast.operator_complexity() == pytest.approx(oracle.operator_complexity(), rel=2e-3)
    b = right_hand_side(fast)
    for accel in ("cg", None):
        ours, theirs = [], []
        fast.solve(b, accel=accel, residuals=ours)
        oracle.solve(b, tol=1e-8, accel=accel, residuals=theirs)
        assert len(ours) <= len(theirs) + 1


@pytest.mark.parametrize("kind", KINDS)
def test_solutions_are_exact_to_double_precision(problem, kind):
    mesh, h, A = problem
    free = held(mesh, kind)
    solver = multigrid.solver(A, h, free)
    b = right_hand_side(solver)
    norms = []
    x = solver.solve(b, tol=1e-11, residuals=norms)
    reduced = transfer.reduced(A, free, free)
    assert len(norms) < 20
    assert norms[-1] <= 1e-11 * norms[0]
    assert np.linalg.norm(b - reduced @ x) < 1e-10 * np.linalg.norm(b)
    expected = spsolve(reduced.tocsc(), b)
    assert np.linalg.norm(x - expected) < 1e-7 * np.linalg.norm(expected)


@pytest.mark.parametrize("kind", KINDS)
def test_the_preconditioner_is_symmetric_and_positive(problem, kind):
    mesh, h, A = problem
    M = multigrid.solver(A, h, held(mesh, kind)).aspreconditioner()
    u, v = np.random.default_rng(SEED).normal(size=(2, M.shape[0]))
    scale = np.sqrt((u @ (M @ u)) * (v @ (M @ v)))
    assert u @ (M @ u) > 0
    assert abs(u @ (M @ v) - v @ (M @ u)) < 1e-5 * scale


@pytest.mark.parametrize("make", [coarsen.gallery.coast, coarsen.gallery.crack_plate])
def test_blocks_of_a_sweep_cost_no_cycles(make):
    """With values from before the sweep across blocks, both took 12."""
    mesh = make(100_000)
    middle = mesh.points[mesh.boundary_facets].mean(axis=1)[:, 0]
    free = np.ones(mesh.n_points, dtype=bool)
    free[mesh.boundary_facets[middle < np.median(middle)]] = False
    solver = multigrid.solver(multigrid.laplacian(mesh), coarsen.hierarchy(mesh, features="auto"), free)
    norms = []
    solver.solve(np.random.default_rng(20240229).normal(size=free.sum()), accel=None, residuals=norms)
    assert len(norms) - 1 <= 11


def test_the_result_never_depends_on_threads():
    mesh = large()
    A = multigrid.laplacian(mesh)
    results = []
    for threads in (1, 2, 3):
        h = coarsen.hierarchy(mesh, features="auto", threads=threads)
        solver = multigrid.solver(A, h, dirichlet="boundary")
        results.append(solver.solve(right_hand_side(solver), maxiter=3))
    assert (results[0] == results[1]).all()
    assert (results[0] == results[2]).all()


def test_the_scale_of_the_right_hand_side_is_the_scale_of_the_solution():
    mesh = small()
    solver = multigrid.solver(multigrid.laplacian(mesh), coarsen.hierarchy(mesh), dirichlet="boundary")
    b = right_hand_side(solver)
    x = solver.solve(b)
    for scale in (2.0**-400, 2.0**400):
        np.testing.assert_allclose(solver.solve(scale * b) / scale, x, rtol=1e-6, atol=1e-9)
    assert (solver.solve(np.zeros_like(b)) == 0).all()


def test_two_unknowns_a_node_are_solved_for():
    mesh = small()
    two = kron(multigrid.laplacian(mesh), np.array([[2.0, 0.5], [0.5, 1.0]]), format="csr")
    free = np.repeat(held(mesh, "whole"), 2)
    solver = multigrid.solver(two, coarsen.hierarchy(mesh), free, block_size=2)
    norms = []
    solver.solve(right_hand_side(solver), residuals=norms)
    assert len(norms) <= 13


def test_a_problem_that_one_level_solves():
    mesh = coarsen.gallery.square(50)
    A = multigrid.laplacian(mesh)
    for kind in ("whole", "one"):
        free = held(mesh, kind)
        solver = multigrid.solver(A, coarsen.hierarchy(mesh), free)
        assert len(solver.stages) == 1
        b = right_hand_side(solver)
        np.testing.assert_allclose(transfer.reduced(A, free, free) @ solver.solve(b, tol=1e-12), b, atol=1e-10)


def test_what_cannot_be_solved_is_refused():
    mesh = small()
    h, A = coarsen.hierarchy(mesh), multigrid.laplacian(mesh)
    with pytest.raises(ValueError, match="not positive definite: hold an unknown"):
        multigrid.solver(A, h)
    with pytest.raises(ValueError, match=r"row 0 of a matrix has the diagonal -"):
        multigrid.solver(-A, h, dirichlet="boundary")
    solver = multigrid.solver(A, h, dirichlet="boundary")
    n = solver.aspreconditioner().shape[0]
    with pytest.raises(ValueError, match=rf"'b' has shape \(3,\), expected \({n},\)"):
        solver.solve(np.zeros(3))
    with pytest.raises(ValueError, match="'b' holds numbers that are not finite"):
        solver.solve(np.full(n, np.nan))
    with pytest.raises(ValueError, match="'accel' is 'gmres', expected 'cg' or None"):
        solver.solve(np.zeros(n), accel="gmres")
    with pytest.raises(ValueError, match="unknowns, expected at most 3000"):
        multigrid.solver(A, h, dirichlet="boundary", max_coarse=10_000)


def boundary_layer(n=40, thinnest=1e-4):
    """Return a square with rows of nodes that are dense at the bottom."""
    y = np.concatenate([[0.0], np.geomspace(thinnest, 1.0, n)])
    x = np.linspace(0.0, 1.0, n)
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    corner = (np.arange(n)[:, None] * n + np.arange(n - 1)).ravel()
    lower, upper = ([corner, corner + 1, corner + n + 1], [corner, corner + n + 1, corner + n])
    return coarsen.Mesh(points, np.concatenate([np.stack(lower, axis=1), np.stack(upper, axis=1)]))


@pytest.mark.parametrize("make", ["solver", "pyamg_solver"])
def test_boundary_layers_take_no_more_iterations_than_other_meshes(make):
    if make == "pyamg_solver":
        pytest.importorskip("pyamg")
    mesh = boundary_layer()
    h = coarsen.hierarchy(mesh, features="auto")
    made = getattr(multigrid, make)(multigrid.laplacian(mesh), h, dirichlet="boundary")
    norms = []
    made.solve(right_hand_side(made), tol=1e-8, residuals=norms, accel="cg")
    assert len(norms) - 1 <= 8


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_everything_is_made_in_a_forked_process():
    """Threads of the parent's pools are not there in the child."""
    script = """if True:
        import multiprocessing
        import sys

        import coarsen
        from coarsen import multigrid

        mesh = coarsen.gallery.square(30_000)
        A = multigrid.laplacian(mesh)
        line = coarsen.gallery.line(30_000)

        def make():
            coarsen.delaunay(mesh.points)
            coarsen.hierarchy(line)
            h = coarsen.hierarchy(mesh)
            multigrid.solver(A, h, dirichlet="boundary")

        make()
        child = multiprocessing.get_context("fork").Process(target=make)
        child.start()
        child.join(30)
        hangs = child.is_alive()
        if hangs:
            child.kill()
        sys.exit(hangs)
    """
    assert subprocess.run([sys.executable, "-c", script], timeout=120, check=False).returncode == 0


def test_matrices_of_levels_that_do_not_fit_are_refused():
    core = coarsen.backend.backend("rust")
    mesh = small()
    made = galerkin.stages(multigrid.laplacian(mesh), coarsen.hierarchy(mesh), dirichlet="boundary")
    stages = [(stage.A, stage.P, stage.R, stage.slow) for stage in made[:-1]]
    with pytest.raises(ValueError, match="two levels do not fit"):
        core.Cycle([stages[0], stages[0]], made[-1].A)
    with pytest.raises(ValueError, match="coarsest matrix does not fit"):
        core.Cycle(stages, csr_matrix(np.eye(3)))
    cycle = core.Cycle(stages, made[-1].A)
    n = stages[0][0].shape[0]
    with pytest.raises(ValueError, match="'r' has shape"):
        cycle.precondition(np.zeros(n - 1), None)


def test_slow_are_those_that_relaxation_between_coarse_unknowns_leaves_behind():
    mesh = coarsen.gallery.lshape(800)
    A = multigrid.laplacian(mesh)
    h = coarsen.hierarchy(mesh, features="auto")
    stage = galerkin.stages(A, h, dirichlet="boundary")[0]
    free = np.flatnonzero(transfer.free_mask(mesh, dirichlet="boundary"))
    fine = np.flatnonzero(~np.isin(free, h[1].nodes))
    dense = stage.A.toarray()
    e = np.isin(np.arange(len(dense)), fine).astype(float)
    for order in (fine, fine[::-1]) * 2:
        for i in order:
            e[i] -= dense[i] @ e / dense[i, i]
    assert (np.flatnonzero(e > galerkin.SLOW) == stage.slow).all()
    assert 0 < len(stage.slow) < 0.75 * len(e)


def test_a_level_that_is_visited_twice_is_solved_better():
    """Its M becomes 2 M - M A M, which is symmetric, too."""
    mesh = small()
    h, A = coarsen.hierarchy(mesh), multigrid.laplacian(mesh)
    made = galerkin.stages(A, h, dirichlet="boundary", max_coarse=30)
    stages = [(stage.A, stage.P, stage.R, stage.slow) for stage in made[:-1]]
    assert len(stages) > 1
    core = coarsen.backend.backend("rust")
    fine, last = made[0].A, made[-1].A
    rng = np.random.default_rng(SEED)
    r = rng.normal(size=fine.shape[0])
    once, twice = (core.Cycle(stages, last, visits).precondition(r, None) for visits in (None, 1))
    exact = spsolve(fine.tocsc(), r)
    errors = [np.sqrt((x - exact) @ (fine @ (x - exact))) for x in (once, twice)]
    assert errors[1] < errors[0]
    u, v = rng.normal(size=(2, fine.shape[0]))
    cycle = core.Cycle(stages, last, 1)
    left, right = v @ cycle.precondition(u, None), u @ cycle.precondition(v, None)
    assert left == pytest.approx(right, abs=1e-5 * np.linalg.norm(u) * np.linalg.norm(cycle.precondition(v, None)))


def test_slow_unknowns_that_are_not_there_are_refused():
    core = coarsen.backend.backend("rust")
    made = galerkin.stages(multigrid.laplacian(small()), coarsen.hierarchy(small()), dirichlet="boundary")
    stages = [(stage.A, stage.P, stage.R, np.array([-1])) for stage in made[:-1]]
    with pytest.raises(ValueError, match="'slow' names an unknown that is not there"):
        core.Cycle(stages, made[-1].A)
