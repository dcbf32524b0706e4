"""The package's own multigrid solver: V-cycles in Rust on the stages of `coarsen.galerkin`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coarsen import transfer
from coarsen.backend import backend
from coarsen.galerkin import Operators, Stage, stages

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.sparse.linalg import LinearOperator

    from coarsen.multilevel import Hierarchy

MOST_DENSE = 3000
"""More unknowns than this on the coarsest level are not factored as a dense matrix."""

TWICE = 4
"""Where features are dropped, the finest stage with at most a quarter of the unknowns is visited twice in a row: what
the stages below leave of an error adds up from one to the next, most where a lagoon hangs on a narrow neck."""


class Solver:
    """The package's own V-cycle for symmetric positive definite matrices; made by `solver`.

    One symmetric Gauss-Seidel sweep before and after, and one more of the slow unknowns (see `coarsen.galerkin.Stage`),
    in single precision and on all cores, as preconditioner of conjugate gradients in double precision. Several times as
    fast as the same cycle in PyAMG. Where a level has dropped features, one small stage is visited twice (`TWICE`).
    """

    def __init__(self, made: list[Stage], held: int | None, threads: int | None, twice: int | None = None) -> None:
        self.stages = made
        self._held = held
        self._threads = threads
        coarsened: list[Any] = [(stage.A, stage.P, stage.R, stage.slow) for stage in made[:-1]]
        self._cycle = backend("rust").Cycle(coarsened, made[-1].A, twice, threads)

    def __repr__(self) -> str:
        return f"Solver(unknowns {' > '.join(str(stage.A.shape[0]) for stage in self.stages)})"

    def operator_complexity(self) -> float:
        """Return the entries of all matrices over those of the finest one."""
        return float(sum(stage.A.nnz for stage in self.stages) / self.stages[0].A.nnz)

    def solve(
        self,
        b: ArrayLike,
        *,
        tol: float = 1e-8,
        maxiter: int = 100,
        accel: str | None = "cg",
        residuals: list[float] | None = None,
    ) -> NDArray[np.float64]:
        """Solve for a right-hand side of the free unknowns, from 0.

        Parameters
        ----------
        b : (k,) array
        tol : float
            Norm of the residual relative to that of `b`.
        maxiter : int
        accel : "cg" or None
            None: cycles alone.
        residuals : list, optional
            Is filled with the norms of the residuals, the first one before any iteration.

        Returns
        -------
        (k,) float64 array

        Raises
        ------
        ValueError
            If `b` has another length or holds other than finite numbers, or `accel` is unknown.
        """
        if accel not in ("cg", None):
            raise ValueError(f"'accel' is {accel!r}, expected 'cg' or None")
        right = self._whole(np.ascontiguousarray(b, dtype=np.float64))
        if not np.isfinite(right).all():
            raise ValueError("'b' holds numbers that are not finite")
        x, norms = self._cycle.solve(self.stages[0].A, right, tol, maxiter, accel == "cg", self._threads)
        if residuals is not None:
            residuals[:] = norms.tolist()
        return self._free(x)

    def aspreconditioner(self) -> LinearOperator:
        """Return one cycle as SciPy's `LinearOperator`."""
        from scipy.sparse.linalg import LinearOperator

        def matvec(r: Any) -> NDArray[np.float64]:
            right = self._whole(np.ascontiguousarray(r, dtype=np.float64).ravel())
            return self._free(self._cycle.precondition(right, self._threads))

        size = self.stages[0].A.shape[0] - (self._held is not None)
        return LinearOperator((size, size), matvec=matvec, rmatvec=matvec, dtype=np.float64)

    def _whole(self, b: NDArray[np.float64]) -> NDArray[np.float64]:
        """Put in the right-hand side of the held unknown, which makes the sum 0."""
        size = self.stages[0].A.shape[0] - (self._held is not None)
        if b.shape != (size,):
            raise ValueError(f"'b' has shape {b.shape}, expected ({size},)")
        return b if self._held is None else np.insert(b, self._held, -b.sum())

    def _free(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Choose the constant so that the held unknown is 0, and leave that one out."""
        return x if self._held is None else np.delete(x, self._held) - x[self._held]


def solver(
    A: Any,
    hierarchy: Hierarchy,
    free: Any = None,
    *,
    dirichlet: Any = None,
    block_size: int = 1,
    operators: Operators | None = None,
    max_coarse: int = 200,
) -> Solver:
    """Return the package's own solver for symmetric positive definite matrices; the parameters are `pyamg_solver`'s.

    Raises
    ------
    ValueError
        If the matrix has another size or is seen not to be positive definite, if `free` and `dirichlet` do not fit the
        mesh, or if more than 3000 unknowns are left on the coarsest level (``features="auto"`` makes smaller ones).

    Examples
    --------
    >>> import coarsen, numpy as np
    >>> from coarsen.multigrid import laplacian, solver
    >>> mesh = coarsen.gallery.square(2500)
    >>> fast = solver(laplacian(mesh), coarsen.hierarchy(mesh), dirichlet="boundary")
    >>> x = fast.solve(np.ones(fast.stages[0].A.shape[0]), tol=1e-8)
    """
    made = stages(
        A,
        hierarchy,
        free,
        dirichlet=dirichlet,
        block_size=block_size,
        operators=operators,
        max_coarse=max_coarse,
        singular=True,
    )
    if made[-1].A.shape[0] > MOST_DENSE:
        raise ValueError(
            f"the coarsest level has {made[-1].A.shape[0]} unknowns, expected at most {MOST_DENSE}: "
            "make the hierarchy with features='auto', or use pyamg_solver"
        )
    held = None
    if made[0].gauge is not None:
        mask = transfer.free_mask(hierarchy[0].mesh, free, dirichlet)
        held = None if mask is None else int(np.argmin(mask))
    twice = next((k for k, is_small in enumerate(small_stages(made[:-1], hierarchy)) if is_small), None)
    return Solver(made, held, hierarchy.options.threads, twice)


def small_stages(made: list[Stage], hierarchy: Hierarchy) -> list[bool]:
    """Return which stages are so small that more work on them is cheap, where features are dropped; none elsewhere."""
    drops = any(level.dropped is not None for level in hierarchy)
    return [drops and TWICE * stage.A.shape[0] <= made[0].A.shape[0] for stage in made]
