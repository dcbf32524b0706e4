"""Multigrid on hierarchies for elasticity, two unknowns a node, against smoothed aggregation.

    python benches/elasticity.py [--sizes 10000 100000] [--write docs]

Plane stress, held at the left side, random right-hand side, relative residual 1e-8, as preconditioner of CG. PyAMG's
smoothed aggregation is given the three motions of a rigid body and 2x2 blocks, as its documentation advises.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
from pathlib import Path
from typing import Any

# before NumPy is there, as in multigrid.py
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pyamg

import coarsen
from coarsen.multigrid import solver
from coarsen.transfer import reduced
from tables import table

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))
from elastic_plate import assembled

SEED = 20240229
TOLERANCE = 1e-8
MOST_CYCLES = 100
MESHES = {
    "square": coarsen.gallery.square,
    "L-shape": coarsen.gallery.lshape,
    "crack plate": coarsen.gallery.crack_plate,
    "plate with 4 holes": lambda n: coarsen.gallery.plate_with_holes(n, (2, 2)),
    "plate with 36 holes": lambda n: coarsen.gallery.plate_with_holes(n, (6, 6)),
}


def rigid_motions(points: np.ndarray) -> np.ndarray:
    """Return two shifts and a turn, by unknown."""
    x, y = (points - points.mean(axis=0)).T
    zero, one = np.zeros_like(x), np.ones_like(x)
    return np.stack([np.stack(motion, axis=1).ravel() for motion in ((one, zero), (zero, one), (-y, x))], axis=1)


def measured(mesh: coarsen.Mesh, name: str) -> list[list[object]]:
    """Return the rows of both methods."""
    A, _ = assembled(mesh)
    x = mesh.points[:, 0]
    free = np.repeat(x > x.min() + 1e-9 * np.ptp(x), 2)
    A = reduced(A, free, free)
    b = np.random.default_rng(SEED).normal(size=A.shape[0])

    def ours() -> Any:
        h = coarsen.hierarchy(mesh, features="auto")
        return solver(A, h, free, block_size=2)

    def theirs() -> Any:
        return pyamg.smoothed_aggregation_solver(A.tobsr(blocksize=(2, 2)), B=rigid_motions(mesh.points)[free])

    rows = []
    for label, make in (("coarsen", ours), ("smoothed aggregation", theirs)):
        start = time.perf_counter()
        made = make()
        middle = time.perf_counter()
        residuals: list[float] = []
        made.solve(b, tol=TOLERANCE, accel="cg", maxiter=MOST_CYCLES, residuals=residuals)
        seconds = middle - start, time.perf_counter() - middle
        steps, complexity = str(len(residuals) - 1), f"{made.operator_complexity():.2f}"
        rows.append([name, str(A.shape[0]), label, steps, complexity, *(f"{s:.2f}" for s in (*seconds, sum(seconds)))])
        print(*rows[-1], flush=True)
    return rows


def main() -> None:
    """Run the bench and, if told so, write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[10_000, 100_000], help="nodes")
    parser.add_argument("--write", type=Path, help="folder for elasticity-table.md")
    arguments = parser.parse_args()
    header = ["mesh", "unknowns", "method", "CG", "complexity", "set-up", "solve", "total s"]
    rows = [row for name, make in MESHES.items() for n in arguments.sizes for row in measured(make(n), name)]
    sizes = " ".join(map(str, arguments.sizes))
    text = (
        f"Made by `python benches/elasticity.py --sizes {sizes} --write docs` on {os.cpu_count()} cores, "
        f"{platform.machine()}. Steps to a relative residual of 1e-8, seconds, the hierarchy in the set-up.\n\n"
        f"{table(header, rows)}\n"
    )
    if arguments.write:
        (arguments.write / "elasticity-table.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
