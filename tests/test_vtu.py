"""``.vtu`` files: written without any library, read back by meshio and by VTK itself."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

import coarsen
from coarsen import Mesh, gallery

SEED = 3


@pytest.fixture
def mesh() -> Mesh:
    """A coast with nodal fields of every kind."""
    coast = gallery.coast(600)
    rng, n = np.random.default_rng(SEED), gallery.coast(600).n_points
    fields = {
        "depth": coast.point_data["depth"],
        'odd <&"name': rng.random(n).astype(np.float32),
        "velocity": rng.random((n, 2)),
        "count": np.arange(n, dtype=">i4"),
        "wet": np.arange(n) % 2 == 0,
        "unknown": np.full(n, np.nan),
        "wave": rng.random(n) + 1j * rng.random(n),
    }
    return Mesh(coast.points, coast.cells, facets=coast.facets, facet_tags=coast.facet_tags, point_data=fields)


def test_meshio_reads_what_was_written(mesh, tmp_path):
    pytest.importorskip("meshio")
    mesh.write(tmp_path / "mesh.vtu")
    back = coarsen.read(tmp_path / "mesh.vtu")
    assert np.array_equal(back.points, mesh.points)
    assert np.array_equal(back.cells, mesh.cells)
    assert np.array_equal(back.facets, mesh.facets)
    assert np.array_equal(back.facet_tags, mesh.facet_tags)
    wave = mesh.point_data["wave"]
    expected = {**mesh.point_data, "wave:real": wave.real, "wave:imag": wave.imag}
    del expected["wave"]
    assert back.point_data.keys() == expected.keys()
    for name, values in expected.items():
        assert np.array_equal(back.point_data[name], values, equal_nan=True)


def test_vtk_reads_what_was_written(mesh, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    mesh.write(tmp_path / "mesh.vtu")
    grid = pyvista.read(tmp_path / "mesh.vtu")
    assert np.array_equal(grid.points[:, :2], mesh.points)
    assert np.array_equal(grid.cells_dict[5], mesh.cells)
    assert np.array_equal(grid.cells_dict[3], mesh.facets)
    assert np.array_equal(grid.cell_data["cell_tags"][-len(mesh.facets) :], mesh.facet_tags)
    assert grid.point_data["velocity"].shape == (mesh.n_points, 2)


def test_arrays_longer_than_a_block_come_back(tmp_path):
    pytest.importorskip("meshio")
    mesh = gallery.square(60_000)  # 24 bytes a point, blocks of a megabyte
    mesh.write(tmp_path / "mesh.vtu")
    assert coarsen.read(tmp_path / "mesh.vtu") == mesh


def test_a_line_and_tagged_cells_come_back(tmp_path):
    pytest.importorskip("meshio")
    for name, mesh in (("line", gallery.line(20)), ("disc", gallery.interface(300))):
        mesh.write(tmp_path / f"{name}.vtu")
        back = coarsen.read(tmp_path / f"{name}.vtu")
        assert np.array_equal(back.cells, mesh.cells)
        assert mesh.cell_tags is None or np.array_equal(back.cell_tags, mesh.cell_tags)


def test_results_are_written_where_numpy_is_all_there_is(tmp_path):
    code = """
import sys
for name in ("meshio", "scipy", "matplotlib", "h5py", "netCDF4", "rich", "typer"):
    sys.modules[name] = None
import coarsen
h = coarsen.hierarchy(coarsen.gallery.crack_plate(800))
h.write("levels"), h.save("h.npz"), h[1].mesh.write("level.vtu")
assert coarsen.load("h.npz") == h
try:
    coarsen.read("level.vtu")
except ImportError as error:
    assert "pip install 'coarsen-mesh[io]'" in str(error)
"""
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    assert (tmp_path / "levels" / "levels.pvd").is_file()
    assert len(list((tmp_path / "levels").glob("level_*.vtu"))) > 2
