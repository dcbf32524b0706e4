"""coarsen against what else there is: same nodes, same run, medians, ratios.

    pip install --group bench
    python benches/compare.py                    # 1M nodes, and times from 1e4 to 1e7 nodes
    python benches/compare.py --nodes 100000 --repeat 3 --parts compare --no-write

Writes results/compare.json and results/times.svg, and the tables of README.md that are its own. Contestants take
turns within every repetition, so that a noisy minute troubles all of them alike. Rivals that are not installed are left
out. shull is GPL: it is measured, never linked or shipped.
"""

from __future__ import annotations

import argparse
import gc
import importlib.metadata
import json
import os
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path

# before NumPy is there: on a busy machine, threads of a BLAS that wait for each other slow PyAMG down a hundredfold
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import coarsen
import inputs
import rivals
import tables

RESULTS = Path(__file__).with_name("results")
TWIN_NODES = (5_000, 100_000)
GROWTH_NODES = (10_000, 100_000, 1_000_000, 10_000_000)
GROWTH_LIMIT = {"scipy Delaunay": 10**6, "mmg, hierarchy": 10**6, "PyAMG, smoothed aggregation": 10**6}
LONG = 20.0  # seconds: what takes longer is run once

# what the ratios are meant to be, and of what: (ours, theirs, input, at most)
CLAIMS = (
    ("hierarchy", "scipy Delaunay", "quasi-uniform", 0.12),
    ("hierarchy", "shull Delaunay", "quasi-uniform", 1.25),
    ("hierarchy", "scipy Delaunay", "graded", 0.15),
    ("hierarchy + prolongations", "scipy Delaunay", "quasi-uniform", 0.15),
    ("hierarchy + prolongations", "scipy Delaunay", "graded", 0.18),
    ("prolongations", "hierarchy", "quasi-uniform", 0.25),
    ("Mesh", "scipy Delaunay", "quasi-uniform", 0.04),
    ("hierarchy", "mmg, hierarchy", "quasi-uniform", 1 / 12),
    ("hierarchy", "PyAMG, Ruge-Stüben", "quasi-uniform", 1 / 2),
    ("hierarchy", "PyAMG, smoothed aggregation", "quasi-uniform", 1 / 4),
    ("hierarchy", "skeleton sets + shull", "quasi-uniform", 1.0),
)
GROWTH_MOST = 12.0


def prolongations(h: coarsen.Hierarchy) -> list[object]:
    """Return the interpolation operators of all levels."""
    return [h.prolongation(i) for i in range(1, len(h))]


def contestants(points: inputs.Points, cells: inputs.Cells) -> dict[str, Callable[[], object]]:
    """Return everything that is timed on one mesh; what a contestant is given is made beforehand."""
    mesh, far = coarsen.Mesh(points, cells), coarsen.Mesh(*inputs.shuffled(points, cells))
    ours = {
        "Mesh": lambda: coarsen.Mesh(points, cells),
        "hierarchy": lambda: coarsen.hierarchy(mesh),
        "hierarchy, guard off": lambda: coarsen.hierarchy(mesh, min_angle=0),
        "hierarchy + prolongations": lambda: prolongations(coarsen.hierarchy(mesh)),
        "hierarchy, nodes shuffled": lambda: coarsen.hierarchy(far),
    }
    others = {
        "scipy Delaunay": (rivals.delaunay_by_scipy, "scipy"),
        "shull Delaunay": (rivals.delaunay_by_shull, "shull"),
        "scipy, nearest neighbours": (rivals.neighbours_by_scipy, "scipy"),
        "pykdtree, nearest neighbours": (rivals.neighbours_by_pykdtree, "pykdtree"),
        "mmg, hierarchy": (rivals.hierarchy_by_mmg, "mmgpy"),
        "fast-simplification, hierarchy": (rivals.hierarchy_by_decimation, "fast-simplification"),
        "skeleton sets + shull": (rivals.hierarchy_by_skeleton, "shull"),
    }
    found = {name: (lambda f=f: f(points, cells)) for name, (f, need) in others.items() if installed(need)}
    if installed("pyamg"):
        matrix = rivals.stiffness(points, cells)
        found["PyAMG, Ruge-Stüben"] = lambda: rivals.amg_by_ruge_stuben(points, cells, matrix)
        found["PyAMG, smoothed aggregation"] = lambda: rivals.amg_by_smoothed_aggregation(points, cells, matrix)
    return ours | found


def installed(distribution: str) -> bool:
    """Say whether a distribution is there."""
    try:
        importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def medians(runs: dict[str, Callable[[], object]], repeat: int) -> dict[str, float]:
    """Return the median time of each, in seconds; they take turns."""
    times: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repeat):
        for name, run in runs.items():
            if times[name] and times[name][0] > LONG:
                continue
            gc.collect()
            start = time.perf_counter()
            run()
            times[name].append(time.perf_counter() - start)
    return {name: statistics.median(seconds) for name, seconds in times.items()}


def compare(nodes: int, repeat: int) -> dict[str, dict[str, float]]:
    """Time everybody on both inputs, and the operators of hierarchies at hand."""
    times = {}
    for name, make in (("quasi-uniform", inputs.quasi_uniform), ("graded", inputs.graded)):
        points, cells = make(nodes)
        mesh = coarsen.Mesh(points, cells)
        # operators are made once and kept: each repetition has a hierarchy of its own
        ready = [coarsen.hierarchy(mesh) for _ in range(repeat)]
        alone = {"prolongations": lambda ready=ready: prolongations(ready.pop())}
        times[name] = medians(contestants(points, cells) | alone, repeat)
    return times


def growth(sizes: list[int], repeat: int) -> dict[str, dict[str, float]]:
    """Time everybody on quasi-uniform meshes of growing size, up to what each can bear."""
    times: dict[str, dict[str, float]] = {}
    for nodes in sizes:
        runs = contestants(*inputs.quasi_uniform(nodes))
        kept = {name: run for name, run in runs.items() if nodes <= GROWTH_LIMIT.get(name, GROWTH_NODES[-1])}
        for name, seconds in medians(kept, repeat if nodes < GROWTH_NODES[-1] else 1).items():
            times.setdefault(name, {})[str(nodes)] = seconds
    return times


def twins(sizes: list[int]) -> dict[str, dict[str, float]]:
    """Time the NumPy reference and the Rust core on the same meshes."""
    times: dict[str, dict[str, float]] = {}
    for nodes in sizes:
        mesh = coarsen.Mesh(*inputs.quasi_uniform(nodes))
        rust = medians({"rust": lambda mesh=mesh: coarsen.hierarchy(mesh)}, 3)
        times[str(nodes)] = rust | medians({"numpy": lambda mesh=mesh: coarsen.hierarchy(mesh, backend="numpy")}, 1)
    return times


def machine() -> str:
    """Return what the figures were measured with."""
    names = ("numpy", "scipy", "shull", "pykdtree", "pyamg", "mmgpy", "fast-simplification")
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in names if installed(name))
    load = f", {os.getloadavg()[0]:.1f} others at work when it began" if hasattr(os, "getloadavg") else ""
    return f"{os.cpu_count()} cores{load}, {platform.machine()}, Python {platform.python_version()}, {versions}"


def draw(times: dict[str, dict[str, float]], path: Path) -> None:
    """Write the picture of time against nodes, on log axes."""
    import matplotlib as mpl

    mpl.use("agg")
    mpl.rcParams["svg.hashsalt"] = "coarsen"
    from matplotlib import pyplot as plt

    figure, ax = plt.subplots(figsize=(9.5, 5), layout="constrained")
    for name, seconds in times.items():
        mine = name == "Mesh" or name.startswith("hierarchy")
        nodes = [int(n) for n in seconds]
        label = f"coarsen: {name}" if mine else name
        ax.loglog(nodes, list(seconds.values()), "o-" if mine else "s--", lw=2.2 if mine else 1, ms=4, label=label)
    ax.set(xlabel="nodes", ylabel="seconds", title="Time against size, quasi-uniform meshes, median")
    ax.grid(which="major", alpha=0.3)
    figure.legend(fontsize=8, loc="outside right upper")
    figure.savefig(path, metadata={"Date": None})


def write_tables(results: dict) -> None:
    """Write the README's tables from the results."""
    if "compare" in results:
        times = results["compare"]
        names = list(times["quasi-uniform"])
        base = {name: seconds["scipy Delaunay"] for name, seconds in times.items() if "scipy Delaunay" in seconds}
        rows = [[n, *(f for t in times for f in (times[t][n], times[t][n] / base[t]))] for n in names]
        header = ["", *(text for t in times for text in (f"{t}, s", "/ scipy Delaunay"))]
        tables.write("compare", f"{results['nodes']:,} nodes; {results['machine']}.\n\n{tables.table(header, rows)}")
        checked = [c for c in CLAIMS if c[1] in times[c[2]]]
        rows = [[f"{a} / {b}", kind, times[kind][a] / times[kind][b], most] for a, b, kind, most in checked]
        grown = results.get("growth", {}).get("hierarchy", {})
        large, small = grown.get(str(10**7)), grown.get(str(10**6))
        if large and small:
            rows.append(["hierarchy of 10M nodes / of 1M nodes", "quasi-uniform", large / small, GROWTH_MOST])
        tables.write("claims", tables.table(["ratio", "input", "measured", "meant to be at most"], rows))
    if "twins" in results:
        rows = [[n, t["rust"], t["numpy"], t["numpy"] / t["rust"]] for n, t in results["twins"].items()]
        tables.write("twins", tables.table(["nodes", "Rust, s", "NumPy, s", "NumPy / Rust"], rows))
    if "growth" in results:
        sizes = sorted({int(n) for seconds in results["growth"].values() for n in seconds})
        header = ["", *(f"{n:,}, s" for n in sizes)]
        rows = [[k, *(v.get(str(n), "–") for n in sizes)] for k, v in results["growth"].items()]
        tables.write("growth", f"![Time against nodes](results/times.svg)\n\n{tables.table(header, rows)}")


def main() -> None:
    """Measure, and rewrite results, tables and picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodes", type=int, default=1_000_000)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument(
        "--parts", nargs="*", default=["compare", "twins", "growth"], help="what to measure (nothing: write only)"
    )
    parser.add_argument("--growth-nodes", type=int, nargs="+", default=GROWTH_NODES)
    parser.add_argument("--twin-nodes", type=int, nargs="+", default=TWIN_NODES)
    parser.add_argument("--no-write", action="store_true", help="print, and leave the README alone")
    options = parser.parse_args()
    path = RESULTS / "compare.json"
    results = json.loads(path.read_text()) if path.exists() else {}
    if "compare" in options.parts:
        results |= {"machine": machine(), "nodes": options.nodes, "compare": compare(options.nodes, options.repeat)}
    if "twins" in options.parts:
        results["twins"] = twins(options.twin_nodes)
    if "growth" in options.parts:
        results["growth"] = growth(options.growth_nodes, options.repeat)
    print(json.dumps(results, indent=1, ensure_ascii=False))
    if not options.no_write:
        RESULTS.mkdir(exist_ok=True)
        path.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        if "growth" in results:
            draw(results["growth"], RESULTS / "times.svg")
        write_tables(results)


if __name__ == "__main__":
    main()
