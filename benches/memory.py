"""Memory of a hierarchy beyond its input, up to thirty million nodes; needs Linux, and 6 GiB for the largest.

    python benches/memory.py [NODES ...]

Each mesh is built, quasi-uniform, in a process of its own, whose peak is set back before the hierarchy is made. The
levels that the hierarchy gives back are part of the peak. Writes the table of README.md that is its own.
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

import coarsen
import inputs
import tables

NODES = (1_000_000, 10_000_000, 30_000_000)
STATUS, CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")


def resident(kind: str) -> int:
    """Return what this process holds in bytes: now (``VmRSS``) or at most (``VmHWM``)."""
    found = re.search(rf"{kind}:\s+(\d+) kB", STATUS.read_text())
    if found is None:
        raise RuntimeError(f"{STATUS} does not tell {kind}")
    return 1024 * int(found[1])


def measure(nodes: int) -> None:
    """Print bytes before and at the peak, and seconds, of one hierarchy."""
    mesh = coarsen.Mesh(*inputs.quasi_uniform(nodes))
    CLEAR.write_text("5")  # the peak so far counts no more
    before, began = resident("VmRSS"), time.perf_counter()
    coarsen.hierarchy(mesh)
    print(mesh.n_points, before, resident("VmHWM"), time.perf_counter() - began)


def main() -> None:
    """Measure each size in a process of its own; print, write."""
    if sys.argv[1:2] == ["--one"]:
        measure(int(sys.argv[2]))
        return
    rows = []
    for nodes in map(int, sys.argv[1:] or NODES):
        command = [sys.executable, __file__, "--one", str(nodes)]
        n, before, peak, seconds = map(float, subprocess.run(command, capture_output=True, check=True).stdout.split())
        held = [f"{size / 2**30:.2f}" for size in (before, peak)]
        rows.append([f"{n:,.0f}", *held, f"{(peak - before) / n:.0f}", seconds])
    header = ["nodes", "before, GiB", "peak, GiB", "more, bytes for each node", "first hierarchy, s"]
    text = tables.table(header, rows)
    print(text)
    tables.write("memory", text)


if __name__ == "__main__":
    main()
