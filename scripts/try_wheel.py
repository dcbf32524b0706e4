"""Installs the wheel of a folder into a clean environment and tries it: python scripts/try_wheel.py dist."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from pathlib import Path

TRIAL = """
import numpy as np
import coarsen

assert coarsen.__version__
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
