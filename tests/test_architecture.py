"""The walls that ARCHITECTURE.md speaks of: who may know whom, in Rust and in Python."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
RUST = ROOT / "rust"
PYTHON = ROOT / "python" / "coarsen"
FLOORS = [name for name in re.findall(r"^(?:pub )?mod (\w+);", (RUST / "lib.rs").read_text(), re.M) if name != "python"]
ONE_FLOOR = {"drop", "hierarchy", "skeleton"}  # three ways to build the same levels, which share options and results
SOURCES = [
    path
    for path in sorted(RUST.rglob("*.rs"))
    if path.name != "lib.rs" and not {"tests", "examples"} & set(path.relative_to(RUST).parts)
]


def code(path: Path) -> str:
    """Return a file's text without comments and without its own tests."""
    text = path.read_text(encoding="utf-8").partition("#[cfg(test)]")[0]
    return re.sub(r"//.*", "", text)


def module(path: Path) -> str:
    """Return the top-level module that a Rust file belongs to."""
    return path.relative_to(RUST).parts[0].removesuffix(".rs")


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(RUST)))
def test_a_rust_module_knows_only_those_listed_above_it(path):
    if module(path) == "python":
        return
    known = set(re.findall(r"crate::(\w+)", code(path)))
    above = set(FLOORS[: FLOORS.index(module(path)) + 1])
    assert sorted(known - above - (ONE_FLOOR if module(path) in ONE_FLOOR else set())) == []


@pytest.mark.parametrize(("crate", "only"), [("spade", {"triangulation"}), ("rstar", {"domain"}), ("pyo3", {"python"})])
def test_a_foreign_crate_is_named_in_one_module_only(crate, only):
    named = {module(path) for path in SOURCES if re.search(rf"\b{crate}::", code(path))}
    assert named <= only


def test_only_the_backend_module_names_the_core():
    text = {path: path.read_text(encoding="utf-8") for path in PYTHON.rglob("*.py")}
    named = {
        path.name
        for path, lines in text.items()
        if re.search(r"(from|import) +[\w.]*_core\b|\"coarsen\._core\"", lines)
    }
    assert named <= {"backend.py", "__init__.py"}


def test_the_reference_knows_errors_and_options_only():
    for path in (PYTHON / "reference").glob("*.py"):
        outside = re.findall(r"from (coarsen(?:\.(?!reference)\w+)*|\.\.\w*) import", path.read_text(encoding="utf-8"))
        assert set(outside) <= {"coarsen.errors", "coarsen.options"}, path.name
