"""What an installed package promises before it is called: light, typed, documented."""

from __future__ import annotations

import ast
import doctest
import importlib
import pkgutil
import subprocess
import sys
from pathlib import Path

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


def test_the_stub_exports_what_the_core_has():
    core = importlib.import_module("coarsen._core")
    stub = ast.parse(Path(coarsen.__file__).with_name("_core.pyi").read_text(encoding="utf-8"))
    (names,) = (ast.literal_eval(node.value) for node in stub.body if isinstance(node, ast.Assign) and is_all(node))
    own = {name for name in dir(core) if not name.startswith("_")} | {"__version__"}
    assert set(names) == own


def is_all(node: ast.Assign) -> bool:
    """Tell whether a statement gives ``__all__``."""
    return [target.id for target in node.targets if isinstance(target, ast.Name)] == ["__all__"]


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


@pytest.mark.parametrize(
    ("missing", "call", "told"),
    [
        ("scipy", "h.prolongation(1)", "pip install 'coarsen-mesh[multigrid]'"),
        ("scipy", "coarsen.multigrid.laplacian(m)", "pip install 'coarsen-mesh[multigrid]'"),
        ("scipy", "h.interpolate(m.cell_tags, 0, 1, on='cells')", "pip install 'coarsen-mesh[multigrid]'"),
        ("pyamg", "coarsen.multigrid.pyamg_solver(None, h)", "pip install 'coarsen-mesh[multigrid]'"),
        ("matplotlib", "h.plot()", "pip install 'coarsen-mesh[plot]'"),
        ("matplotlib", "coarsen.report(h, 'page.html')", "pip install 'coarsen-mesh[plot]'"),
        ("meshio", "m.write('mesh.msh')", "pip install 'coarsen-mesh[io]'"),
        ("meshio", "m.to_meshio()", "pip install 'coarsen-mesh[io]'"),
        ("netCDF4", "m.write('mesh.nc')", "pip install 'coarsen-mesh[io]'"),
        ("pyvista", "h.view()", "pip install pyvista"),
        ("skfem", "coarsen.multigrid.to_skfem(m)", "pip install scikit-fem"),
    ],
)
def test_what_a_missing_package_would_do_says_how_to_get_it(missing, call, told, tmp_path):
    code = f"""
import sys
sys.modules[{missing!r}] = None
import coarsen
m = coarsen.gallery.interface(200)
h = coarsen.hierarchy(m)
try:
    {call}
except ImportError as error:
    print(error)
"""
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path).stdout
    assert told in out
    assert out.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
