"""Whole hierarchies in files: a folder ParaView opens as a series, an archive that comes back bit for bit."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

import coarsen
from coarsen import Mesh, MeshError, gallery
from coarsen.io.hierarchies import holds_hierarchy, read_levels
from coarsen.multilevel import Hierarchy

MESHES = {
    "slit": lambda: gallery.crack_plate(600),
    "tags": lambda: gallery.interface(600),
    "sea": lambda: gallery.coast(900, seed=5),
    "line": lambda: gallery.line(200, growth=1.1),
}


@pytest.fixture(scope="module", params=MESHES)
def hierarchy(request: pytest.FixtureRequest) -> Hierarchy:
    """One hierarchy of each kind."""
    return coarsen.hierarchy(MESHES[request.param](), coarsest=30)


def test_saved_and_loaded_is_equal_bit_for_bit(hierarchy: Hierarchy, tmp_path: Path) -> None:
    hierarchy.save(tmp_path / "h.npz")
    back = coarsen.load(tmp_path / "h.npz")
    assert back == hierarchy
    assert back.options == hierarchy.options
    assert back.stopped == hierarchy.stopped
    for one, two in zip(hierarchy, back, strict=True):
        assert one.nodes.tobytes() == two.nodes.tobytes()
        assert one.spacing.tobytes() == two.spacing.tobytes()
        assert one.mesh.points.tobytes() == two.mesh.points.tobytes()
        assert one.mesh.cells.dtype == two.mesh.cells.dtype
        assert np.array_equal(one.mesh.topology.facets, two.mesh.topology.facets)
        assert np.array_equal(one.mesh.topology.facet_cells, two.mesh.topology.facet_cells)
        assert one.mesh.topology.n_boundary == two.mesh.topology.n_boundary
        assert (one.factor, one.visits, one.dropped) == (two.factor, two.visits, two.dropped)
        assert one.quality == two.quality or one.mesh.dim == 1


def test_loaded_has_the_same_operators(tmp_path: Path) -> None:
    h = coarsen.hierarchy(gallery.crack_plate(600))
    h.save(tmp_path / "h.npz", operators=True)
    back = coarsen.load(tmp_path / "h.npz")
    with np.load(tmp_path / "h.npz") as archive:
        for i in range(1, len(h)):
            for part in ("data", "indices", "indptr"):
                kept = archive[f"prolongation:{i}:{part}"]
                assert np.array_equal(kept, getattr(h.prolongation(i), part))
                assert np.array_equal(kept, getattr(back.prolongation(i), part))


def test_spacing_given_as_array_or_function_is_saved_as_far_as_can_be(tmp_path: Path) -> None:
    mesh = gallery.square(300, seed=1)
    values = np.full(mesh.n_points, 0.05)
    for spacing in (values, lambda points: np.full(len(points), 0.05)):
        h = coarsen.hierarchy(mesh, spacing=spacing)
        h.save(tmp_path / "h.npz")
        back = coarsen.load(tmp_path / "h.npz")
        assert back == h
        assert (back.options == h.options) == isinstance(spacing, np.ndarray)


def test_what_was_dropped_comes_back(tmp_path: Path) -> None:
    h = coarsen.hierarchy(gallery.plate_with_holes(900, (3, 3)), features="drop", coarsest=30)
    h.save(tmp_path / "h.npz")
    assert coarsen.load(tmp_path / "h.npz")[-1].quality == h[-1].quality
    assert h[-1].dropped is not None


def test_a_folder_has_every_level_with_nodes_spacing_tags_and_fields(hierarchy: Hierarchy, tmp_path: Path) -> None:
    files = hierarchy.write(tmp_path / "levels")
    assert all(file.is_file() for file in files)
    for level, file in zip(hierarchy, sorted((tmp_path / "levels").glob("level_*.vtu")), strict=True):
        mesh = coarsen.read(file)
        assert np.array_equal(mesh.points, level.mesh.points)
        assert np.array_equal(mesh.cells, level.mesh.cells)
        assert np.array_equal(mesh.point_data["node"], level.nodes)
        assert np.array_equal(mesh.point_data["spacing"], level.spacing)
        assert (mesh.cell_tags is None) == (level.mesh.cell_tags is None)
        for name, values in (level.mesh.point_data or {}).items():
            assert np.array_equal(mesh.point_data[name], values)


def test_the_series_names_every_level_once_in_order(tmp_path: Path) -> None:
    h = coarsen.hierarchy(gallery.crack_plate(600))
    h.write(tmp_path / "levels")
    names = [f"level_{i}.vtu" for i in range(len(h))]
    root = ET.parse(tmp_path / "levels" / "levels.pvd").getroot()
    assert root.get("type") == "Collection"
    assert [data.get("file") for data in root.iter("DataSet")] == names
    assert [float(data.get("timestep")) for data in root.iter("DataSet")] == list(range(len(h)))
    series = json.loads((tmp_path / "levels" / "levels.vtu.series").read_text())
    assert [file["name"] for file in series["files"]] == names


@pytest.mark.parametrize("format", ["vtk", ".msh", "npz", "xdmf", "14", "slf", "nc"])
def test_other_formats_hold_the_levels_too(tmp_path: Path, format: str) -> None:
    h = coarsen.hierarchy(gallery.coast(900, seed=5), coarsest=60)
    h.write(tmp_path / "levels", format)
    levels = read_levels(tmp_path / "levels")
    assert [level.mesh.n_points for level in levels] == [level.mesh.n_points for level in h]
    assert (tmp_path / "levels" / "levels.vtk.series").exists() == (format == "vtk")


def test_a_shorter_hierarchy_leaves_no_levels_of_a_longer_one(tmp_path: Path) -> None:
    mesh = gallery.crack_plate(600)
    (tmp_path / "levels").mkdir()
    (tmp_path / "levels" / "notes.txt").write_text("mine")
    coarsen.hierarchy(mesh, levels=3).write(tmp_path / "levels")
    coarsen.hierarchy(mesh, levels=1).write(tmp_path / "levels")
    found = sorted(file.name for file in (tmp_path / "levels").iterdir())
    assert found == ["level_0.vtu", "level_1.vtu", "levels.pvd", "levels.vtu.series", "notes.txt"]


def test_a_failed_write_leaves_no_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    h = coarsen.hierarchy(gallery.crack_plate(300))
    monkeypatch.setattr("coarsen.io.hierarchies._write_series", lambda *a: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OSError, match="full"):
        h.write(tmp_path / "levels")
    assert list(tmp_path.iterdir()) == []


def test_wrong_formats_files_and_folders_are_named(tmp_path: Path) -> None:
    h = coarsen.hierarchy(gallery.crack_plate(300))
    with pytest.raises(ValueError, match="'format' is 'docx'"):
        h.write(tmp_path / "levels", "docx")
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError, match="is a file"):
        h.write(tmp_path / "file")
    with pytest.raises(FileNotFoundError, match="folder"):
        h.save(tmp_path / "none" / "h.npz")
    with pytest.raises(FileNotFoundError):
        coarsen.load(tmp_path / "nowhere.npz")
    h[0].mesh.write(tmp_path / "mesh.npz")
    assert not holds_hierarchy(tmp_path / "mesh.npz")
    with pytest.raises(MeshError, match="holds no hierarchy"):
        coarsen.load(tmp_path / "mesh.npz")
    h.save(tmp_path / "h.npz")
    assert holds_hierarchy(tmp_path / "h.npz")
    with pytest.raises(MeshError, match=r"coarsen\.load"):
        coarsen.read(tmp_path / "h.npz")
    with pytest.raises(MeshError, match="no levels"):
        read_levels(tmp_path)


@pytest.mark.parametrize("key", ["1:nodes", "1:cells", "1:topology:facets"])
def test_a_damaged_archive_is_refused_before_it_reaches_the_core(tmp_path: Path, key: str) -> None:
    coarsen.hierarchy(gallery.crack_plate(300)).save(tmp_path / "h.npz")
    with np.load(tmp_path / "h.npz") as archive:
        arrays = dict(archive)
    for damage in (arrays[key] - 10**6, arrays[key] + 10**6, None):
        broken = {**arrays, key: damage} if damage is not None else {k: v for k, v in arrays.items() if k != key}
        np.savez(tmp_path / "broken.npz", **broken)
        with pytest.raises(MeshError, match="damaged"):
            coarsen.load(tmp_path / "broken.npz")


def test_cut_archives_are_refused(tmp_path: Path) -> None:
    coarsen.hierarchy(gallery.crack_plate(300)).save(tmp_path / "h.npz")
    whole = (tmp_path / "h.npz").read_bytes()
    for share in (0.0, 0.2, 0.6, 0.99):
        (tmp_path / "cut.npz").write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(MeshError, match=r"cut\.npz"):
            coarsen.load(tmp_path / "cut.npz")


def test_levels_read_from_a_folder_can_be_drawn(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    from coarsen.plot import plot_hierarchy

    coarsen.hierarchy(gallery.crack_plate(300)).write(tmp_path / "levels")
    figure = plot_hierarchy(read_levels(tmp_path / "levels"))
    assert len(figure.axes) >= 2


def test_a_mesh_read_back_is_a_mesh_of_its_own(tmp_path: Path) -> None:
    h = coarsen.hierarchy(gallery.interface(600))
    h.write(tmp_path / "levels", "npz")
    assert isinstance(coarsen.read(tmp_path / "levels" / "level_1.npz"), Mesh)
