"""Where a level has dropped parts of the domain, unknowns that its mesh does not serve take values by couplings."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

pytest.importorskip("scipy")
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

import coarsen
from coarsen import galerkin, loose, multigrid, transfer
from test_multigrid import held

SEED = 3
NONE = np.empty(0, np.int64)


@pytest.fixture(scope="module")
def coast():
    mesh = coarsen.gallery.coast(4000)
    h = coarsen.hierarchy(mesh, features="drop")
    return mesh, h, multigrid.laplacian(mesh)


def combs():
    """Two basins, joined at one end only, with a wall between them that is thinner than their cells."""
    x, y = np.meshgrid(np.linspace(0, 8, 161), np.linspace(0, 2, 42))
    y = np.where(y < 1, y, y + 0.02)
    k = np.arange(x.size).reshape(x.shape)
    a, b, c, d = k[:-1, :-1], k[:-1, 1:], k[1:, 1:], k[1:, :-1]
    keep = np.ones(a.shape, dtype=bool)
    keep[20, :140] = False
    cells = np.concatenate([np.stack([a, b, c], -1)[keep], np.stack([a, c, d], -1)[keep]])
    points = np.column_stack([x.ravel(), y.ravel()])
    return coarsen.Mesh(points, cells)


def on_a_line(n):
    """The Laplacian of a chain of n unknowns."""
    couplings = np.diag(-np.ones(n - 1), 1)
    couplings = couplings + couplings.T
    return csr_matrix(couplings - np.diag(couplings.sum(axis=1)))


def no_values(n, m):
    return csr_matrix((n, m))


def of_one_kind(n):
    return np.zeros(n, dtype=np.int64)


def test_every_loose_unknown_is_coarse_or_strongly_coupled_to_one_that_is():
    A = multigrid.laplacian(coarsen.gallery.square(400, seed=SEED))
    n = A.shape[0]
    P, own, _ = loose.extended(A, no_values(n, 0), NONE, np.ones(n, dtype=bool), of_one_kind(n), False)
    assert P.shape == (n, len(own))
    assert len(own) < n / 2
    is_own = np.isin(np.arange(n), own)
    assert (P[own].toarray() == np.eye(len(own))).all()
    for i in np.flatnonzero(~is_own):
        row = -A[i].toarray().ravel()
        assert row[is_own].max() >= 0.25 * row.max()


def test_constants_are_interpolated_exactly_unless_zeros_are_near():
    mesh = coarsen.gallery.square(400, seed=SEED)
    A = multigrid.laplacian(mesh)
    P, *_ = loose.extended(
        A, no_values(A.shape[0], 0), NONE, np.ones(A.shape[0], dtype=bool), of_one_kind(A.shape[0]), False
    )
    np.testing.assert_allclose(P.sum(axis=1), 1.0, atol=1e-12)
    free = held(mesh, "whole")
    A = transfer.reduced(A, free, free)
    P, *_ = loose.extended(
        A, no_values(A.shape[0], 0), NONE, np.ones(A.shape[0], dtype=bool), of_one_kind(A.shape[0]), False
    )
    sums = np.asarray(P.sum(axis=1)).ravel()
    near = np.asarray(A.sum(axis=1)).ravel() > 1e-10
    assert sums[near].mean() < 0.9
    assert sums.max() < 1.05


def test_interpolation_tends_to_the_solution_of_the_rows():
    """On a chain with every third unknown coarse the ideal interpolation is linear."""
    n = 13
    given = csr_matrix((np.ones(5), (np.arange(0, n, 3), np.arange(5))), shape=(n, 5))
    loose_ones = np.arange(n) % 3 > 0
    P, own, _ = loose.extended(on_a_line(n), given, np.arange(0, n, 3), loose_ones, of_one_kind(n), False)
    assert len(own) == 0
    np.testing.assert_allclose(P @ np.arange(0, n, 3), np.arange(n), atol=0.05)


def test_unknowns_of_two_kinds_are_not_interpolated_from_each_other():
    A = multigrid.laplacian(coarsen.gallery.square(200, seed=SEED))
    n = A.shape[0]
    two = csr_matrix(np.kron(A.toarray(), [[2.0, -0.5], [-0.5, 1.0]]))
    kind = np.tile([0, 1], n)
    P, own, _ = loose.extended(two, no_values(2 * n, 0), NONE, np.ones(2 * n, dtype=bool), kind, False)
    rows, columns = P.nonzero()
    assert (kind[rows] == kind[own][columns]).all()


def test_columns_hang_together_around_their_own_unknown():
    mesh = combs()
    h, A = coarsen.hierarchy(mesh, features="drop"), multigrid.laplacian(mesh)
    found = transfer.locate(h, 0, len(h) - 1)
    fine_of = transfer.shared_nodes(h, 0, len(h) - 1)
    # a third of the columns get a value far from all others they have
    far = np.arange(0, len(fine_of), 3)
    rows = np.abs(mesh.points[:, 0, None] - mesh.points[fine_of[far], 0]).argmax(axis=0)
    strays = csr_matrix((np.full(len(far), 0.1), (rows, far)), shape=found.matrix.shape)
    mixed = (found.matrix + strays).tocsr()
    kept = loose.hanging_together(A, mixed, fine_of)
    by_column, before = kept.tocsc(), mixed.tocsc()
    cut = 0
    for j, own in enumerate(fine_of):
        given = before.indices[before.indptr[j] : before.indptr[j + 1]]
        part = connected_components(A[given][:, given])[1]
        expected = given[part == part[np.flatnonzero(given == own)[0]]]
        cut += len(given) - len(expected)
        assert sorted(by_column.indices[by_column.indptr[j] : by_column.indptr[j + 1]]) == sorted(expected)
    assert cut > len(far) / 2  # a value may fall where the column hangs together
    assert (kept.data > 0).all()


def test_cells_are_cut_where_the_boundary_runs_through_them(coast):
    mesh, h, _ = coast
    found = transfer.locate(h, 0, 3)
    walls = np.isin(np.arange(mesh.n_points), mesh.boundary_facets)
    cut = loose.in_cut_cells(walls, found.matrix)
    rows = [
        tuple(found.matrix.indices[s:e]) for s, e in zip(found.matrix.indptr, found.matrix.indptr[1:], strict=False)
    ]
    on_boundary = set(mesh.boundary_facets.ravel().tolist())
    through = {row for i, row in enumerate(rows) if len(row) == 3 and i in on_boundary}
    assert through
    assert (cut == [row in through for row in rows]).all()


@pytest.mark.parametrize("kind", ["whole", "part", "one"])
def test_waters_that_a_closed_wall_parts_stay_apart(kind):
    mesh = combs()
    h = coarsen.hierarchy(mesh, features="drop")
    assert any(level.dropped is not None for level in h)
    solver = multigrid.solver(multigrid.laplacian(mesh), h, held(mesh, kind))
    norms = []
    solver.solve(np.random.default_rng(SEED).normal(size=held(mesh, kind).sum()), residuals=norms)
    assert len(norms) - 1 <= 14


def test_edges_without_couplings_are_seen():
    mesh = coarsen.gallery.square(200, seed=SEED)
    A = multigrid.laplacian(mesh).tolil()
    a, b = mesh.cells[10, :2]
    A[a, b] = A[b, a] = 0.0
    A = A.tocsr()
    A.eliminate_zeros()
    out = loose.with_uncoupled_edge(mesh, A, np.arange(mesh.n_points))
    apart = {int(i) for cell in mesh.cells for i in cell for j in cell if A[i, j] == 0}
    assert {int(a), int(b)} <= apart
    assert set(np.flatnonzero(out).tolist()) == apart


@pytest.mark.parametrize("kind", ["whole", "part", "one"])
def test_few_steps_solve_on_a_coast_of_which_much_is_dropped(coast, kind):
    mesh, h, A = coast
    solver = multigrid.solver(A, h, held(mesh, kind))
    norms = []
    solver.solve(np.random.default_rng(SEED).normal(size=held(mesh, kind).sum()), residuals=norms)
    assert len(norms) - 1 <= 13


@pytest.mark.parametrize(("name", "most"), [("thetis_north_sea", 9), ("ocean_nwatl_129k", 9)])
def test_few_steps_solve_on_seas_with_natural_coasts(meshes, name, most):
    mesh = coarsen.read(meshes / f"{name}.npz")
    solver = multigrid.solver(multigrid.laplacian(mesh), coarsen.hierarchy(mesh, features="auto"), held(mesh, "one"))
    norms = []
    b = np.random.default_rng(SEED).normal(size=mesh.n_points - 1)
    solver.solve(b, residuals=norms)
    assert len(norms) - 1 <= most
    solver.solve(b, accel=None, residuals=norms)
    assert len(norms) - 1 <= 13


def test_rows_that_cost_much_energy_are_seen():
    """The middle of three unknowns is all but one with the last, but takes half of its value from the first."""
    A = csr_matrix([[1e-3, -1e-3, 0], [-1e-3, 1.001, -1], [0, -1, 1]])
    kind = of_one_kind(3)
    assert loose.costly(A, csr_matrix([[1, 0], [0.5, 0.5], [0, 1.0]]), kind)[1]
    ideal = csr_matrix([[1, 0], [1e-3 / 1.001, 1 / 1.001], [0, 1.0]])
    assert not loose.costly(A, ideal, kind)[1]
    # of another kind, the row cannot be made by the entries of the matrix
    assert not loose.costly(A, csr_matrix([[1, 0], [0, 0.0], [0, 1]]), np.array([0, 1, 0]))[1]


def test_costly_rows_are_made_anew_where_features_are_dropped():
    A = csr_matrix([[1e-3, -1e-3, 0], [-1e-3, 1.001, -1], [0, -1, 1]])
    given, own = csr_matrix([[1, 0], [0.5, 0.5], [0, 1.0]]), np.array([0, 2])
    P, added, made = loose.extended(A, given, own, np.zeros(3, dtype=bool), of_one_kind(3), True)
    assert len(added) == 0
    assert made.tolist() == [1]
    np.testing.assert_allclose(P.toarray()[1], [0, 1], atol=2e-3)
    P, *_ = loose.extended(A, given, own, np.zeros(3, dtype=bool), of_one_kind(3), False)
    np.testing.assert_allclose(P.toarray(), given.toarray())


def test_arguments_that_do_not_fit_are_refused():
    core = coarsen.backend.backend("rust")
    A = on_a_line(4)
    with pytest.raises(ValueError, match="sizes 4, 4, 4, 3, 4"):
        core.extended(A, no_values(4, 1), np.zeros(4, dtype=bool), np.ones(3, dtype=bool), of_one_kind(4))


def test_stages_on_dropped_levels_are_galerkins(coast):
    _, h, A = coast
    made = galerkin.stages(A, h, dirichlet="boundary")
    for fine, coarse in pairwise(made):
        exact = (fine.P.T @ fine.A @ fine.P).toarray()
        x = np.random.default_rng(SEED).normal(size=(exact.shape[0], 20))
        energies = np.einsum("ik,ij,jk->k", x, exact, x), np.einsum("ik,ij,jk->k", x, coarse.A.toarray(), x)
        assert (energies[1] >= energies[0] * (1 - 1e-10)).all()
        assert (energies[1] <= energies[0] * 1.3).all()


@pytest.mark.parametrize("jump", [1e-6, 1e3, 1e6])
def test_jumps_of_the_coefficients_cost_no_iterations(jump):
    mesh = coarsen.gallery.interface(10_000)
    A = multigrid.laplacian(mesh, np.where(mesh.cell_tags == 2, jump, 1.0))
    solver = multigrid.solver(A, coarsen.hierarchy(mesh, features="auto"), dirichlet="boundary")
    norms = []
    solver.solve(np.ones(solver.stages[0].A.shape[0]), residuals=norms)
    assert len(norms) - 1 <= 10


def test_interpolation_stays_within_materials():
    mesh = coarsen.gallery.interface(3000)
    h = coarsen.hierarchy(mesh)
    tags = [[set() for _ in range(level.mesh.n_points)] for level in h[:2]]
    for level, known in zip(h, tags, strict=False):
        for cell, tag in zip(level.mesh.cells, level.mesh.cell_tags, strict=True):
            for node in cell:
                known[node].add(int(tag))
    before = h.prolongation(1)
    after = loose.within_materials(h[0].mesh, h[1].mesh, before)
    assert after.nnz < before.nnz
    np.testing.assert_allclose(after.sum(axis=1), 1.0, atol=1e-14)
    for i in range(mesh.n_points):
        given, kept = (m.indices[m.indptr[i] : m.indptr[i + 1]] for m in (before, after))
        expected = [j for j in given if tags[0][i] <= tags[1][j]] or given
        assert list(kept) == list(expected)
    # the hierarchy's own operator is as it was
    assert h.prolongation(1).nnz == before.nnz
