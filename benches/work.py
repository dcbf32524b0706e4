"""The work of a hierarchy: instructions and visited candidates, which no busy machine changes, and time by stage.

    python benches/work.py [MESH ...]

Instructions come from `valgrind --tool=callgrind`, one thread, 20,000 nodes: those of a process that builds the
hierarchy twice less those of one that builds it once. Visits are the candidates looked at, over all levels, for each
node of the input. Stages are those that progress tells, looked at every 25 ms, for a million nodes and for the meshes
given. Writes the tables of README.md that are its own.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import coarsen
import inputs
import tables

NODES = 20_000
STAGED_NODES = 1_000_000
STAGES = ("domain", "spacing", "selection", "triangulation", "guard")
VISITED_NODES = (20_000, 80_000, 320_000)
MAKERS = {
    "quasi-uniform": "coarsen.Mesh(*inputs.quasi_uniform({n}))",
    "graded": "coarsen.Mesh(*inputs.graded({n}))",
    "crack plate": "coarsen.gallery.crack_plate({n})",
}


def instructions(maker: str, builds: int) -> int:
    """Return the instructions of a process that makes a mesh and builds its hierarchy so many times."""
    build = f"import coarsen, inputs; m = {maker}; [coarsen.hierarchy(m, threads=1) for _ in range({builds})]"
    with tempfile.TemporaryDirectory() as folder:
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={folder}/out", sys.executable, "-c", build]
        paths = [str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "OPENBLAS_NUM_THREADS": "1"}
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    found = re.search(r"Collected : (\d+)", run.stderr)
    if found is None:
        raise RuntimeError(f"callgrind tells no count: {run.stderr[-500:]}")
    return int(found[1])


def by_stage(mesh: coarsen.Mesh, repeat: int = 5) -> dict[str, float]:
    """Return the seconds of a hierarchy by stage: the share of looks that found it there, over some builds."""
    looks: Counter[str] = Counter()
    start = time.perf_counter()
    for _ in range(repeat):
        coarsen.hierarchy(mesh, progress=lambda stage, done, total: looks.update([stage]))
    seconds = (time.perf_counter() - start) / repeat
    return {stage: seconds * count / looks.total() for stage, count in looks.items()}


def stages(paths: list[str]) -> None:
    """Write the table of stages."""
    meshes = {
        "quasi-uniform, 1M": coarsen.Mesh(*inputs.quasi_uniform(STAGED_NODES)),
        "graded, 1M": coarsen.Mesh(*inputs.graded(STAGED_NODES)),
        **{Path(path).stem: coarsen.read(path) for path in paths},
    }
    rows = {name: by_stage(mesh) for name, mesh in meshes.items()}
    header = ["input", *STAGES, "all, s"]
    lines = [[name, *(row.get(stage, 0.0) for stage in STAGES), sum(row.values())] for name, row in rows.items()]
    timed = tables.table(header, lines)
    print(timed)
    tables.write("stages", timed)


def main() -> None:
    """Count, print, write."""
    stages(sys.argv[1:])
    rows = []
    for name, maker in MAKERS.items():
        made = maker.format(n=NODES)
        count = instructions(made, 2) - instructions(made, 1)
        n = eval(made, {"coarsen": coarsen, "inputs": inputs}).n_points
        rows.append([name, str(n), f"{count / 1e6:.0f}", f"{count / n:.0f}"])
    counted = tables.table(["input", "nodes", "million instructions", "for each node"], rows)
    print(counted)
    tables.write("instructions", counted)
    rows = []
    for nodes in VISITED_NODES:
        mesh = coarsen.Mesh(*inputs.quasi_uniform(nodes))
        for candidates in ("pool", "all"):
            h = coarsen.hierarchy(mesh, candidates=candidates)
            visits = sum(level.visits for level in h[1:]) / mesh.n_points
            sizes = ", ".join(str(level.mesh.n_points) for level in h[1:])
            angles = ", ".join(f"{level.quality.min_angle:.1f}" for level in h[1:])
            rows.append([str(mesh.n_points), candidates, f"{visits:.1f}", sizes, angles])
    visited = tables.table(["nodes", "candidates", "visits for each node", "nodes by level", "smallest angle"], rows)
    print(visited)
    tables.write("visits", visited)


if __name__ == "__main__":
    main()
