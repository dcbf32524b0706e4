"""Installs the wheel of a folder into a clean environment and tries it: python scripts/try_wheel.py dist."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from pathlib import Path

TRIAL = """
import pickle, sys
import numpy as np
import coarsen

mesh = coarsen.gallery.square(2000)
h = coarsen.hierarchy(mesh)
assert len(h) > 3 and h[-1].mesh.n_cells <= 100, h
assert all(np.array_equal(level.mesh.points, mesh.points[level.nodes]) for level in h)
assert all(set(coarse.nodes) <= set(fine.nodes) for fine, coarse in zip(h, h[1:]))
assert coarsen.hierarchy(mesh, threads=1) == h == pickle.loads(pickle.dumps(h))
assert h.check() and h.summary()
try:
    coarsen.Mesh([[0, 0], [1, 0], [2, 0]], [[0, 1, 2]])
except coarsen.MeshError as error:
    assert "zero area" in str(error), error
else:
    raise AssertionError("a flat cell was taken")
for absent in ("scipy", "matplotlib", "meshio"):
    assert absent not in sys.modules
try:
    h.prolongation(1)
except ImportError as error:
    assert "coarsen-mesh[" in str(error), error  # says what to install
"""


def main(folder: Path) -> None:
    """Install the wheel with its hard dependencies only, and run the trial outside the project's folder."""
    (wheel,) = folder.resolve().glob("*.whl")
    with tempfile.TemporaryDirectory() as place:
        venv.create(Path(place) / "clean", with_pip=True)
        python = next(path for path in (Path(place) / "clean").glob("*/python*") if path.stem == "python")
        subprocess.run([python, "-m", "pip", "install", "--quiet", wheel], check=True)
        subprocess.run([python, "-c", TRIAL], check=True, cwd=place)
    print(f"{wheel.name} works by itself")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
