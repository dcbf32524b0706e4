"""Multigrid on hierarchies against algebraic multigrid: iterations, complexity, seconds, memory.

    python benches/multigrid.py [--sizes 10000 100000] [--meshes FOLDER] [--only NAME ...] [--write docs]

P1 Poisson, random right-hand side, relative residual 1e-8; V-cycles with one symmetric Gauss-Seidel sweep before and
after, as preconditioner of CG and alone; against PyAMG's two solvers on the same matrix in the same run. The
hierarchy is tried with the package's own cycle and, on the same stages, with PyAMG's; both sweep the slow unknowns,
up to two thirds of all, once more; the package's own visits one small level twice where features are dropped. The
boundary is held as a whole (Dirichlet), in its left half (partial), or at one node only (Neumann); in each part of a
mesh that this leaves without a held node, one is held, for the matrix would be singular. Each method runs in a
process of its own, forked when mesh and matrix are there: its memory is the growth of that process's peak.

A second table is about shapes: coarse operators that are assembled on the coarse meshes instead of Galerkin's, and
convection-diffusion, with the default levels (angles guarded), the paper's plain ones and the edge-skeleton baseline.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import platform
import resource
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

# before NumPy is there: on a busy machine, threads of a BLAS that wait for each other slow PyAMG down a hundredfold
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pyamg
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components

import coarsen
from coarsen.multigrid import SMOOTHER, laplacian, pyamg_solver, solver
from coarsen.transfer import cell_sizes, reduced
from tables import table

SEED = 20240229
TOLERANCE = 1e-8
MOST_CYCLES = 100
ALONE_UP_TO = 300_000
"""PyAMG's solvers are run with CG only on larger problems, to keep the bench short."""

KINDS = ("Dirichlet", "partial", "Neumann")
METHODS = ("coarsen", "coarsen in PyAMG", "Ruge-Stüben", "smoothed aggregation")
FOLDER = Path(os.environ.get("COARSEN_MESHES", "meshes"))
LARGEST_DOMAIN = 100_000
"""Nodes of the meshes that are made by code, but the square."""
REAL = {
    "airfoil": "airfoil1_4253",
    "ocean": "ocean_nwatl_129k",
    "North Sea": "thetis_north_sea",
    "naca0012": "su2_naca0012_inv",
}

Seconds = dict[str, float]
Row = list[object]


def inputs(sizes: list[int], folder: Path) -> Iterator[tuple[str, coarsen.Mesh]]:
    """Yield the meshes by name."""
    for n in sizes:
        yield "square", coarsen.gallery.square(n, seed=SEED)
    n = min(LARGEST_DOMAIN, sizes[-1])
    for name, make in {
        "L-shape": coarsen.gallery.lshape,
        "crack plate": coarsen.gallery.crack_plate,
        "perforated plate": lambda n: coarsen.gallery.plate_with_holes(n, (6, 6)),
        "coast": coarsen.gallery.coast,
    }.items():
        yield name, make(n)
    for name, file in REAL.items():
        if (folder / f"{file}.npz").exists():
            yield name, coarsen.read(folder / f"{file}.npz")


def free_nodes(mesh: coarsen.Mesh, kind: str) -> np.ndarray:
    """Return the nodes that the boundary condition leaves free; each part of the mesh has one that it does not."""
    free = np.ones(mesh.n_points, dtype=bool)
    if kind == "Dirichlet":
        free[mesh.boundary_facets] = False
    elif kind == "partial":
        middle = mesh.points[mesh.boundary_facets].mean(axis=1)[:, 0]
        free[mesh.boundary_facets[middle < np.median(middle)]] = False
    part = parts(mesh)
    for loose in np.setdiff1d(part, part[~free]):
        nodes = np.flatnonzero(part == loose)
        free[nodes[len(nodes) // 2]] = False
    return free


def parts(mesh: coarsen.Mesh) -> np.ndarray:
    """Return the part of the mesh, by its number, that each node belongs to."""
    ends = np.concatenate([mesh.cells[:, [k, (k + 1) % 3]] for k in range(3)])
    edges = coo_matrix((np.ones(len(ends), dtype=bool), tuple(ends.T)), shape=(mesh.n_points,) * 2)
    return np.asarray(connected_components(edges, directed=False)[1])


def peak() -> float:
    """Return the peak memory of this process in MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def now() -> float:
    """Return the memory of this process in MB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") / 2**20


def apart(work: Callable[..., Any], *arguments: Any) -> Any:
    """Return what `work` returns in a forked process."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)

    def send() -> None:
        there.send(work(*arguments))

    process = context.Process(target=send)
    process.start()
    there.close()
    result = here.recv()
    process.join()
    return result


def set_up(method: str, mesh: coarsen.Mesh, A: csr_matrix, free: np.ndarray) -> tuple[Any, Seconds]:
    """Return a solver, and the seconds of its parts."""
    seconds: Seconds = {"hierarchy": 0.0, "operators": 0.0}
    start = time.perf_counter()
    if method.startswith("coarsen"):
        h = coarsen.hierarchy(mesh, features="auto")
        seconds["hierarchy"] = time.perf_counter() - start
        start = time.perf_counter()
        for i in range(1, len(h)):
            h.prolongation(i)
        seconds["operators"] = time.perf_counter() - start
        start = time.perf_counter()
        made = (solver if method == "coarsen" else pyamg_solver)(A, h, free)
    else:
        make = pyamg.ruge_stuben_solver if method == "Ruge-Stüben" else pyamg.smoothed_aggregation_solver
        made = make(A, presmoother=SMOOTHER, postsmoother=SMOOTHER)
    seconds["products"] = time.perf_counter() - start
    return made, seconds


def measured(method: str, mesh: coarsen.Mesh, A: csr_matrix, free: np.ndarray) -> Row:
    """Return iterations, complexity, seconds and memory of a method."""
    before = now()
    made, seconds = set_up(method, mesh, A, free)
    b = np.random.default_rng(SEED).normal(size=A.shape[0])
    start = time.perf_counter()
    steps = iterations(made, b, accel="cg")
    seconds["solve"] = time.perf_counter() - start
    memory = max(0.0, peak() - before)
    quick = method == "coarsen" or A.shape[0] <= ALONE_UP_TO
    alone: object = iterations(made, b, accel=None) if quick else "–"
    parts = [f"{value:.2f}" for value in seconds.values()]
    return [
        shown(steps),
        shown(alone),
        f"{made.operator_complexity():.2f}",
        *parts,
        f"{sum(seconds.values()):.2f}",
        f"{memory:.0f}",
    ]


def iterations(made: Any, b: np.ndarray, **options: Any) -> int:
    """Return the number of iterations to the tolerance."""
    residuals: list[float] = []
    made.solve(b, tol=TOLERANCE, residuals=residuals, maxiter=MOST_CYCLES, **options)
    return len(residuals) - 1


def shown(count: object) -> str:
    """Return a count, or that it is beyond the most that are tried."""
    return f"> {MOST_CYCLES}" if count == MOST_CYCLES else str(count)


def comparison(sizes: list[int], folder: Path, only: list[str] | None) -> str:
    """Return the table of methods."""
    header = [
        "mesh",
        "boundary",
        "unknowns",
        "method",
        "CG",
        "alone",
        "complexity",
        "hierarchy",
        "operators",
        "products",
        "solve",
        "total s",
        "MB",
    ]
    rows: list[Row] = []
    for name, mesh in inputs(sizes, folder):
        if only and name not in only:
            continue
        whole = laplacian(mesh)
        for kind in KINDS:
            free = free_nodes(mesh, kind)
            A = reduced(whole, free, free)
            for method in METHODS:
                row = apart(measured, method, mesh, A, free)
                rows.append([name, kind, str(A.shape[0]), method, *row])
                print(*rows[-1], flush=True)
    return table(header, rows)


# --- shapes ----------------------------------------------------------------------------------------------------------


def convection(mesh: coarsen.Mesh, diffusion: float = 1e-2) -> csr_matrix:
    """Return -ε Laplace u + w · grad u with a turning flow w, streamline-upwinded by the mesh's own cell sizes."""
    p = mesh.points[mesh.cells]
    areas = cell_sizes(mesh)
    edges = np.roll(p, -2, axis=1) - np.roll(p, -1, axis=1)
    gradient = np.stack([-edges[..., 1], edges[..., 0]], axis=-1) / (2 * areas[:, None, None])
    x, y = (p.mean(axis=1) - mesh.points.mean(axis=0)).T
    flow = np.stack([-y, x], axis=1) / np.ptp(mesh.points, axis=0).max()
    along = np.einsum("mid,md->mi", gradient, flow)
    speed = np.linalg.norm(flow, axis=1)
    size = 2 * speed / np.maximum(np.abs(along).sum(axis=1), 1e-300)
    peclet = np.maximum(speed * size / (2 * diffusion), 1e-12)
    tau = size / np.maximum(2 * speed, 1e-300) * (1 / np.tanh(peclet) - 1 / peclet)
    local = diffusion * np.einsum("mid,mjd->mij", gradient, gradient) + along[:, None, :] / 3
    local += tau[:, None, None] * along[:, :, None] * along[:, None, :]
    index = np.repeat(mesh.cells, 3, axis=1).ravel(), np.tile(mesh.cells, (1, 3)).ravel()
    return coo_matrix(((local * areas[:, None, None]).ravel(), index), shape=(mesh.n_points,) * 2).tocsr()


LEVELS = {
    "guarded (default)": {"features": "auto"},
    "plain (the paper's)": {"features": "plain", "gradation": 1.0},
    "edge-skeleton sets": {"method": "mis"},
}


def shapes(n: int) -> str:
    """Return the table of coarse operators by the shapes of the levels."""
    header = [
        "mesh",
        "levels",
        "smallest angle",
        "Poisson, Galerkin",
        "Poisson, assembled",
        "convection, Galerkin",
        "convection, assembled",
    ]
    rows: list[Row] = []
    for name, make in {
        "square": lambda n: coarsen.gallery.square(n, seed=SEED),
        "crack plate": coarsen.gallery.crack_plate,
    }.items():
        mesh = make(n)
        free = free_nodes(mesh, "Dirichlet")
        for label, options in LEVELS.items():
            h = coarsen.hierarchy(mesh, **options)
            row: Row = [name, label, f"{min(level.quality.min_angle for level in h[1:]):.1f}°"]
            for assemble, accel in ((laplacian, "cg"), (convection, "gmres")):
                A = assemble(mesh)
                b = np.random.default_rng(SEED).normal(size=np.count_nonzero(free))
                for operators in (None, lambda _, coarse, assemble=assemble: assemble(coarse)):
                    made = pyamg_solver(A, h, free, operators=operators)
                    row.append(shown(iterations(made, b, accel=accel)))
            rows.append(row)
            print(*row, flush=True)
    return table(header, rows)


def main() -> None:
    """Run the benches and, if told so, write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--sizes", type=int, nargs="+", default=[10_000, 100_000], help="nodes of the squares, ascending"
    )
    parser.add_argument("--meshes", type=Path, default=FOLDER, help="folder of real meshes")
    parser.add_argument("--only", nargs="+", help="some of the meshes, by name")
    parser.add_argument("--write", type=Path, help="folder for multigrid-table.md")
    arguments = parser.parse_args()
    methods = comparison(arguments.sizes, arguments.meshes, arguments.only)
    coarse = shapes(min(20_000, arguments.sizes[-1]))
    sizes = " ".join(map(str, arguments.sizes))
    text = (
        f"Made by `python benches/multigrid.py --sizes {sizes} --write docs` on {os.cpu_count()} cores, "
        f"{platform.machine()}. Iterations to a relative residual of 1e-8, seconds, MB.\n\n{methods}\n\n"
        "Iterations (CG for Poisson, GMRES for convection-diffusion) by the shapes of the coarse levels:\n\n"
        f"{coarse}\n"
    )
    if arguments.write:
        (arguments.write / "multigrid-table.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
