"""What an installed package promises before it is called: light, typed, documented."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import subprocess
import sys

import pytest

import coarsen

HEAVY = ("scipy", "matplotlib", "meshio", "pyamg", "typer", "rich", "h5py", "netCDF4")


def modules() -> list[str]:
    """Return the names of all modules of the package, the compiled one aside."""
    found = [module.name for module in pkgutil.walk_packages(coarsen.__path__, "coarsen.")]
    return ["coarsen", *(name for name in found if name not in ("coarsen._core", "coarsen.__main__"))]


def test_import_loads_nothing_but_numpy():
    code = f"import sys, coarsen; print(sorted(set({HEAVY!r}) & set(sys.modules)))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "[]"


def test_core_and_package_have_one_version():
    assert coarsen.__version__ == importlib.import_module("coarsen._core").__version__


@pytest.mark.parametrize("name", modules())
def test_every_module_says_what_it_is(name):
    assert (importlib.import_module(name).__doc__ or "").strip()


@pytest.mark.parametrize("name", modules())
def test_examples_in_docstrings_run(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert result.failed == 0


def test_every_public_name_is_documented():
    assert [name for name in coarsen.__all__ if not (getattr(coarsen, name).__doc__ or "").strip()] == []
