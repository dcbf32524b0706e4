"""Checks wheel and sdist in a folder: python scripts/inspect_dist.py dist."""

from __future__ import annotations

import email
import sys
import tarfile
import zipfile
from pathlib import Path

MAX_WHEEL_BYTES = 3_000_000
IN_WHEEL = ("coarsen/__init__.py", "coarsen/_core.pyi", "coarsen/py.typed")
IN_SDIST = ("Cargo.toml", "Cargo.lock", "pyproject.toml", "README.md", "LICENSE", "rust/lib.rs")
EXTRAS = {"io", "plot", "multigrid", "cli", "all"}


def faults_of_wheel(path: Path) -> list[str]:
    """Return what is wrong with a wheel, one line a fault."""
    faults = []
    if path.stat().st_size > MAX_WHEEL_BYTES:
        faults.append(f"{path.stat().st_size} bytes, more than {MAX_WHEEL_BYTES}")
    if "cp310-abi3" not in path.name:
        faults.append("no abi3 wheel for CPython 3.10 and newer")
    with zipfile.ZipFile(path) as wheel:
        names = wheel.namelist()
        metadata = email.message_from_bytes(wheel.read(next(n for n in names if n.endswith(".dist-info/METADATA"))))
    faults += [f"lacks {name}" for name in IN_WHEEL if name not in names]
    if not any(name.endswith(".dist-info/licenses/LICENSE") for name in names):
        faults.append("lacks its licence")
    if len([name for name in names if name.endswith((".so", ".pyd"))]) != 1:
        faults.append("does not hold exactly one compiled module")
    if metadata["Name"] != "coarsen-mesh":
        faults.append(f"is called {metadata['Name']}")
    if set(metadata.get_all("Provides-Extra", [])) != EXTRAS:
        faults.append(f"has the extras {metadata.get_all('Provides-Extra')}")
    hard = [need for need in metadata.get_all("Requires-Dist", []) if "extra ==" not in need]
    if [need[:5] for need in hard] != ["numpy"]:
        faults.append(f"needs {hard}")
    return faults


def faults_of_sdist(path: Path) -> list[str]:
    """Return what is wrong with an sdist, one line a fault."""
    with tarfile.open(path) as sdist:
        names = {name.partition("/")[2] for name in sdist.getnames()}
    faults = [f"lacks {name}" for name in (*IN_SDIST, *(f"python/{name}" for name in IN_WHEEL)) if name not in names]
    strays = [name for name in names if name.endswith((".so", ".pyd", ".npz", ".png"))]
    return faults + [f"holds {name}" for name in strays]


def main(folder: Path) -> int:
    """Print the faults of the one wheel and the one sdist in `folder`; return 1 if there are any."""
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    faults = [f"{wheel.name}: {fault}" for fault in faults_of_wheel(wheel)]
    faults += [f"{sdist.name}: {fault}" for fault in faults_of_sdist(sdist)]
    sizes = "; ".join(f"{path.name}: {path.stat().st_size} bytes" for path in (wheel, sdist))
    print("\n".join(faults) or sizes)
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
