"""Multigrid on the levels of a hierarchy: for PyAMG and PETSc, with meshes from and to scikit-fem.

The other libraries are imported by the functions that need them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from coarsen import transfer
from coarsen.backend import backend
from coarsen.galerkin import Operators, Stage, stages
from coarsen.mesh import Mesh
from coarsen.vcycle import Solver, small_stages, solver

if TYPE_CHECKING:
    from pyamg.multilevel import MultilevelSolver
    from scipy.sparse import csr_matrix

    from coarsen.multilevel import Hierarchy

Smoother = Callable[[Any, Any, Any], None]
"""Changes x, given A, x and b."""

__all__ = ["SMOOTHER", "Solver", "from_skfem", "laplacian", "petsc_pcmg", "pyamg_solver", "solver", "to_skfem"]

SMOOTHER = ("gauss_seidel", {"sweep": "symmetric", "iterations": 1})
"""One symmetric Gauss-Seidel sweep, in PyAMG's words."""

DENSE = 400
"""Up to this many unknowns a dense pseudo-inverse is affordable."""


def pyamg_solver(
    A: Any,
    hierarchy: Hierarchy,
    free: Any = None,
    *,
    dirichlet: Any = None,
    block_size: int = 1,
    operators: Operators | None = None,
    presmoother: Any = SMOOTHER,
    postsmoother: Any = SMOOTHER,
    coarse_solver: Any = None,
    max_coarse: int = 200,
) -> MultilevelSolver:
    """Return a PyAMG solver that works on the levels of a hierarchy instead of algebraic ones.

    Its `solve`, `aspreconditioner`, cycles and smoothers are PyAMG's.

    Parameters
    ----------
    A : (n b, n b) or (k, k) sparse matrix
        The matrix, for all unknowns or the k free ones; the b unknowns of a node stand together.
    hierarchy : Hierarchy
        Made with ``features="auto"`` levels are small enough to be solved directly in the end.
    free : (n,) or (n b,) bool array, optional
        The nodes, or the unknowns, that are not held by Dirichlet conditions.
    dirichlet : "boundary", int, str or collection of them, optional
        Instead of `free`: the whole boundary, or the facets with these tags or names, are held.
    block_size : int
        b, the number of unknowns of a node.
    operators : callable, optional
        ``operators(i, mesh)`` assembles the matrix of level i for all its unknowns; by default coarse matrices are
        Galerkin's, see `coarsen.galerkin`.
    presmoother, postsmoother
        As for ``pyamg.smoothed_aggregation_solver``; the default is a symmetric Gauss-Seidel sweep, with one more of
        the unknowns that are slow (see `coarsen.galerkin.Stage`) and of clusters of strongly coupled ones; where levels
        drop features, twice on the small ones.
    coarse_solver
        As for PyAMG; by default ``"splu"``, or ``"pinv"`` where nothing is held and the matrix may be singular.
    max_coarse : int
        The first level with at most this many unknowns is the last.

    Returns
    -------
    pyamg.multilevel.MultilevelSolver
        For right-hand sides of the free unknowns.

    Raises
    ------
    ValueError
        If the matrix has another size, or `free` and `dirichlet` do not fit the mesh.

    Examples
    --------
    >>> import coarsen, numpy as np
    >>> from coarsen.multigrid import laplacian, pyamg_solver
    >>> mesh = coarsen.gallery.square(2500)
    >>> solver = pyamg_solver(laplacian(mesh), coarsen.hierarchy(mesh), dirichlet="boundary")
    >>> x = solver.solve(np.ones(solver.levels[0].A.shape[0]), tol=1e-8, accel="cg")
    """
    try:
        from pyamg.multilevel import MultilevelSolver
        from pyamg.relaxation.smoothing import change_smoothers
    except ImportError:
        raise ImportError("the solver is PyAMG's: pip install 'coarsen-mesh[multigrid]'") from None

    made = stages(
        A, hierarchy, free, dirichlet=dirichlet, block_size=block_size, operators=operators, max_coarse=max_coarse
    )
    levels = []
    for stage in made:
        level = MultilevelSolver.Level()
        level.A = stage.A
        if stage.P is not None:
            level.P, level.R = stage.P, stage.R
        levels.append(level)
    if coarse_solver is None:
        held = levels[0].A.shape[0] < hierarchy[0].mesh.n_points * block_size
        coarse_solver = "splu" if held or levels[-1].A.shape[0] > DENSE else "pinv"
    cycles = MultilevelSolver(levels, coarse_solver=coarse_solver)
    change_smoothers(cycles, presmoother, postsmoother)
    if presmoother == postsmoother == SMOOTHER:
        for level, stage, is_small in zip(levels[:-1], made, small_stages(made, hierarchy), strict=False):
            smoothers = _smoothers(stage, 2 if is_small else 1, hierarchy.options.threads)
            level.presmoother, level.postsmoother = smoothers
    return cycles


def petsc_pcmg(
    ksp: Any,
    hierarchy: Hierarchy,
    free: Any = None,
    *,
    dirichlet: Any = None,
    block_size: int = 1,
    max_coarse: int = 200,
) -> Any:
    """Make the preconditioner of a PETSc KSP a multigrid on the levels of a hierarchy.

    The KSP must have its operator set, a sequential AIJ matrix of all unknowns or of the free ones. Interpolations and
    Galerkin's coarse operators are set; smoothers, cycles and the coarsest solver stay PETSc's defaults, or what the
    options ``-mg_levels_*`` and ``-mg_coarse_*`` say.

    Parameters
    ----------
    ksp : petsc4py.PETSc.KSP
    hierarchy, free, dirichlet, block_size, max_coarse
        As for `pyamg_solver`; a matrix of all unknowns needs `free` and `dirichlet` None.

    Returns
    -------
    petsc4py.PETSc.PC
        The preconditioner, of type ``mg``.

    Raises
    ------
    ValueError
        If the matrix has another size than the free unknowns.
    """
    try:
        from petsc4py import PETSc
    except ImportError:
        raise ImportError("the preconditioner is PETSc's: pip install petsc4py, or conda install petsc4py") from None
    from scipy.sparse import csr_matrix

    operator, _ = ksp.getOperators()
    indptr, indices, values = operator.getValuesCSR()
    matrix = csr_matrix((values, indices, indptr), shape=operator.getSize())
    made = stages(matrix, hierarchy, free, dirichlet=dirichlet, block_size=block_size, max_coarse=max_coarse)
    if made[0].A.shape != matrix.shape:
        raise ValueError(f"the KSP's matrix has {matrix.shape[0]} rows, but {made[0].A.shape[0]} unknowns are free")

    def aij(rows: csr_matrix) -> Any:
        return PETSc.Mat().createAIJ(
            size=rows.shape, csr=(rows.indptr, rows.indices, rows.data), comm=operator.getComm()
        )

    pc = ksp.getPC()
    pc.setType("mg")
    pc.setMGLevels(len(made))
    # PETSc counts from the coarsest level
    for depth, stage in enumerate(reversed(made)):
        if depth < len(made) - 1:
            pc.getMGSmoother(depth).setOperators(aij(stage.A))
        else:
            pc.getMGSmoother(depth).setOperators(operator)
        if stage.P is not None:
            pc.setMGInterpolation(depth, aij(stage.P))
    return pc


def _smoothers(stage: Stage, times: int, threads: int | None) -> tuple[Smoother, Smoother]:
    """Return what `coarsen.multigrid.solver` relaxes by, before and after, in PyAMG's terms.

    A symmetric Gauss-Seidel sweep, one more of the slow unknowns, and the clusters as the subdomains of a Schwarz
    sweep. Where the held unknown only chooses the constant it is relaxed, too: with its value moved, all others move
    back by as much, a step along the constant.
    """
    from pyamg.relaxation.relaxation import gauss_seidel, gauss_seidel_indexed, schwarz

    gauge, slow = stage.gauge, np.asarray(stage.slow, dtype=np.int32)
    near = np.empty(0, np.int64) if gauge is None else np.flatnonzero(np.abs(gauge) > 0)
    clusters, starts = (part.astype(np.int32) for part in backend("rust").clusters(stage.A, threads))

    def sweep(A: Any, x: Any, b: Any) -> None:
        gauss_seidel(A, x, b, iterations=1, sweep="forward")
        if gauge is not None:
            x += (b.sum() - gauge[near] @ x[near]) / gauge[near].sum()
        gauss_seidel(A, x, b, iterations=1, sweep="backward")

    def sweep_slow(A: Any, x: Any, b: Any) -> None:
        if len(slow):
            gauss_seidel_indexed(A, x, b, slow, iterations=1, sweep="symmetric")

    def relax_clusters(A: Any, x: Any, b: Any) -> None:
        if len(clusters):
            schwarz(A, x, b, subdomain=clusters, subdomain_ptr=starts, sweep="symmetric")

    def relax(*steps: Smoother) -> Smoother:
        def smoother(A: Any, x: Any, b: Any) -> None:
            for step in steps * times:
                step(A, x, b)

        return smoother

    return relax(sweep, sweep_slow, relax_clusters), relax(relax_clusters, sweep_slow, sweep)


# --- a first matrix, and meshes of scikit-fem ------------------------------------------------------------------------


def laplacian(mesh: Mesh, coefficient: Any = None) -> csr_matrix:
    """Assemble the stiffness matrix of -div(c grad u) with piecewise-linear elements, with natural boundary conditions.

    Parameters
    ----------
    mesh : Mesh
        Of triangles.
    coefficient : (m,) array, optional
        c by cell; 1 by default.

    Returns
    -------
    (n, n) csr_matrix
    """
    coo_matrix = transfer.sparse().coo_matrix
    p = mesh.points[mesh.cells]
    # gradient of the k-th hat function: its opposite edge, turned, over twice the area
    edges = np.roll(p, -2, axis=1) - np.roll(p, -1, axis=1)
    areas = transfer.cell_sizes(mesh)
    scale = 0.25 / areas if coefficient is None else 0.25 * np.asarray(coefficient) / areas
    local = np.einsum("mid,mjd,m->mij", edges, edges, scale)
    rows, columns = np.repeat(mesh.cells, 3, axis=1).ravel(), np.tile(mesh.cells, (1, 3)).ravel()
    shape = (mesh.n_points, mesh.n_points)
    return coo_matrix((local.ravel(), (rows.astype(np.int32), columns.astype(np.int32))), shape=shape).tocsr()


def from_skfem(mesh: Any) -> Mesh:
    """Return a mesh from scikit-fem's `MeshTri`.

    Named boundaries become facets, named subdomains cell tags: 1, 2, ... in the order of their names, which are kept;
    0 for cells in none.
    """
    facets = facet_tags = cell_tags = None
    if mesh.boundaries:
        rows = [np.asarray(mesh.boundaries[name], dtype=np.int64) for name in sorted(mesh.boundaries)]
        facets = mesh.facets.T[np.concatenate(rows)]
        facet_tags = np.repeat(np.arange(1, len(rows) + 1), [len(row) for row in rows])
    if mesh.subdomains:
        cell_tags = np.zeros(mesh.t.shape[1], dtype=np.int64)
        for tag, name in enumerate(sorted(mesh.subdomains), start=1):
            cell_tags[mesh.subdomains[name]] = tag
    return Mesh(
        mesh.p.T,
        mesh.t.T,
        facets=facets,
        facet_tags=facet_tags,
        cell_tags=cell_tags,
        facet_names=dict(enumerate(sorted(mesh.boundaries or ()), start=1)),
        cell_names=dict(enumerate(sorted(mesh.subdomains or ()), start=1)),
    )


def to_skfem(mesh: Mesh) -> Any:
    """Return scikit-fem's `MeshTri` of a mesh; boundaries and subdomains have the names of their tags, or the tags."""
    try:
        from skfem import MeshTri
    except ImportError:
        raise ImportError("that needs scikit-fem: pip install scikit-fem") from None
    facet_names, cell_names = mesh.facet_names or {}, mesh.cell_names or {}
    made = MeshTri(np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.cells.T.astype(np.int64)))
    if mesh.facets is not None and mesh.facet_tags is not None:
        order = {tuple(pair): k for k, pair in enumerate(np.sort(made.facets.T, axis=1).tolist())}
        at = np.array([order[tuple(pair)] for pair in np.sort(mesh.facets, axis=1).tolist()], dtype=np.int32)
        made = made.with_boundaries(
            {facet_names.get(tag, str(tag)): at[mesh.facet_tags == tag] for tag in np.unique(mesh.facet_tags).tolist()}
        )
    if mesh.cell_tags is not None:
        cells = {
            cell_names.get(tag, str(tag)): np.flatnonzero(mesh.cell_tags == tag)
            for tag in np.unique(mesh.cell_tags).tolist()
        }
        made = made.with_subdomains(cells)
    return made
