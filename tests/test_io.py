"""Files: what goes out comes back, and what is no mesh says so in one line."""

from __future__ import annotations

import contextlib
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import coarsen
from coarsen import MeshError, gallery, io
from coarsen.io.strings import node_strings
from coarsen.mesh import Mesh
from files import SQUARE, TWO, assert_same_cells, facet_set, refusal

meshio = pytest.importorskip("meshio")

SEED = 20

# what formats keep besides points and cells
EVERYTHING = [".npz", ".vtu", ".vtk", ".xdmf", ".msh", ".nc", ".med", ".vol", ".avs"]
FACETS_AND_FIELDS = [".14", ".grd", ".gr3"]
FACETS = [".su2", ".node", ".poly", ".ele", ".mesh", ".meshb"]
CELLS = [".obj", ".off", ".ply", ".inp", ".e", ".slf"]


@pytest.fixture(scope="module")
def sea() -> Mesh:
    """A coast: tagged facets and a nodal field."""
    return gallery.coast(400, seed=5)


@pytest.fixture(scope="module")
def disc() -> Mesh:
    """Two materials: tagged cells."""
    return gallery.interface(300)


@pytest.mark.parametrize("ending", EVERYTHING + FACETS_AND_FIELDS + FACETS)
def test_facets_and_their_tags_come_back(sea: Mesh, tmp_path: Path, ending: str) -> None:
    sea.write(tmp_path / f"sea{ending}")
    back = coarsen.read(tmp_path / f"sea{ending}")
    assert_same_cells(sea, back)
    assert facet_set(sea) == facet_set(back)


@pytest.mark.parametrize("ending", [*EVERYTHING, ".node", ".mesh", ".meshb"])
def test_cell_tags_come_back(disc: Mesh, tmp_path: Path, ending: str) -> None:
    disc.write(tmp_path / f"disc{ending}")
    back = coarsen.read(tmp_path / f"disc{ending}")
    assert_same_cells(disc, back)
    assert np.array_equal(disc.cell_tags, back.cell_tags)


@pytest.mark.parametrize("ending", [*(e for e in EVERYTHING if e not in (".vol", ".avs")), *FACETS_AND_FIELDS])
def test_nodal_fields_come_back(sea: Mesh, tmp_path: Path, ending: str) -> None:
    sea.write(tmp_path / f"sea{ending}")
    back = coarsen.read(tmp_path / f"sea{ending}")
    assert np.array_equal(sea.point_data["depth"], back.point_data["depth"])


@pytest.mark.parametrize("ending", CELLS)
def test_points_and_cells_come_back(disc: Mesh, tmp_path: Path, ending: str) -> None:
    disc.write(tmp_path / f"disc{ending}")
    assert_same_cells(disc, coarsen.read(tmp_path / f"disc{ending}"))


@pytest.mark.parametrize("ending", [".npz", ".vtu", ".msh"])
def test_a_slit_comes_back_with_its_nodes_doubled(tmp_path: Path, ending: str) -> None:
    plate = gallery.crack_plate(300)
    plate.write(tmp_path / f"plate{ending}")
    assert_same_cells(plate, coarsen.read(tmp_path / f"plate{ending}"))


@pytest.mark.parametrize("ending", [".npz", ".vtu", ".vtk", ".msh"])
def test_a_line_comes_back(tmp_path: Path, ending: str) -> None:
    line = gallery.line(12, growth=2.0)
    line.write(tmp_path / f"line{ending}")
    back = coarsen.read(tmp_path / f"line{ending}")
    assert back.dim == 1
    assert_same_cells(line, back)


def test_every_ending_that_can_be_written_is_written_or_refused_in_one_line(disc: Mesh, tmp_path: Path) -> None:
    refused = []
    for ending in io.writable():
        path = tmp_path / f"disc{ending}"
        told = refusal(lambda path=path: io.write(disc, path))
        if told:
            assert "\n" not in told
            assert not path.exists()
            refused.append(ending)
    assert set(refused) <= {".f3grid", ".h5m", ".ugrid"}  # of solids only, or broken in meshio
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 10**6), n=st.integers(4, 60), power=st.integers(-300, 300), ending=st.sampled_from(
    [".npz", ".vtu", ".msh", ".nc", ".14", ".su2", ".node", ".slf"]
))  # fmt: skip
def test_coordinates_of_any_size_come_back_bit_for_bit(
    tmp_path: Path, seed: int, n: int, power: int, ending: str
) -> None:
    square = gallery.square(n, seed=seed)
    mesh = Mesh(square.points * 2.0 ** (power // 3), square.cells)
    mesh.write(tmp_path / f"mesh{ending}")
    assert_same_cells(mesh, coarsen.read(tmp_path / f"mesh{ending}"))


@settings(max_examples=40)
@given(st.data())
def test_node_strings_hold_every_edge_once(data: Any) -> None:
    edges = data.draw(st.lists(st.tuples(st.integers(0, 12), st.integers(13, 25)), unique=True, max_size=30))
    flipped = [edge[::-1] if data.draw(st.booleans()) else edge for edge in edges]
    strings = node_strings(flipped)
    walked = [tuple(sorted(pair)) for string in strings for pair in pairwise(string)]
    assert sorted(walked) == sorted(edges)


def test_a_chain_is_one_string_in_its_own_direction() -> None:
    assert node_strings([(3, 4), (1, 2), (2, 3)]) == [[1, 2, 3, 4]]
    assert node_strings([(3, 1), (1, 2), (2, 3)]) == [[3, 1, 2, 3]]


# --- gmsh, VTK, meshio -----------------------------------------------------------------------------------------------

GMSH_41 = """$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
3
1 7 "shore"
2 11 "sea"
2 12 "lagoon"
$EndPhysicalNames
$Entities
0 1 2 0
1 0 0 0 1 0 0 1 7 0
1 0 0 0 1 1 0 1 11 0
2 0 0 0 1 1 0 1 12 0
$EndEntities
$Nodes
1 4 1 4
2 1 0 4
1
2
3
4
0 0 5
1 0 5
1 1 5
0 1 5
$EndNodes
$Elements
3 3 1 3
1 1 1 1
1 1 2
2 1 2 1
2 1 2 3
2 2 2 1
3 1 3 4
$EndElements
"""


def test_gmsh_4_1_gives_physical_groups_names_and_a_flat_mesh(tmp_path: Path) -> None:
    path = tmp_path / "lagoon.msh"
    path.write_text(GMSH_41)
    mesh = coarsen.read(path)
    assert mesh.dim == 2
    assert mesh.cell_tags.tolist() == [11, 12]
    assert facet_set(mesh) == {(0, 1, 7)}
    draft = io.read_draft(path)
    assert draft.facet_names == {7: "shore"}
    assert draft.cell_names == {11: "sea", 12: "lagoon"}


def test_names_go_along_when_a_file_is_converted(tmp_path: Path) -> None:
    (tmp_path / "lagoon.msh").write_text(GMSH_41)
    io.files.convert(tmp_path / "lagoon.msh", tmp_path / "lagoon.su2")
    assert io.read_draft(tmp_path / "lagoon.su2").facet_names == {7: "shore"}
    io.files.convert(tmp_path / "lagoon.msh", tmp_path / "again.msh")
    assert io.read_draft(tmp_path / "again.msh").cell_names == {11: "sea", 12: "lagoon"}
    io.files.convert(tmp_path / "lagoon.msh", tmp_path / "lagoon.npz")
    assert io.read_draft(tmp_path / "lagoon.npz").facet_names == {7: "shore"}


def test_an_orphan_of_gmsh_raises_and_says_what_mends_it(tmp_path: Path) -> None:
    points = np.vstack([SQUARE, [[0.5, 0.2]]])
    meshio.Mesh(points, [("triangle", TWO)]).write(tmp_path / "arc.vtk")
    with pytest.raises(MeshError, match=r"arc\.vtk.*repair=True") as caught:
        coarsen.read(tmp_path / "arc.vtk")
    assert caught.value.array is not None
    assert coarsen.read(tmp_path / "arc.vtk", repair=True).n_points == 4


def test_meshio_there_and_back(sea: Mesh, disc: Mesh) -> None:
    for mesh in (sea, disc):
        back = Mesh.from_meshio(mesh.to_meshio())
        assert_same_cells(mesh, back)
        assert facet_set(mesh) == facet_set(back)
        assert (mesh.cell_tags is None) == (back.cell_tags is None)


def test_cell_sets_become_tags() -> None:
    other = meshio.Mesh(SQUARE, [("triangle", TWO)], cell_sets={"a": [np.array([0])], "b": [np.array([1])]})
    assert Mesh.from_meshio(other).cell_tags.tolist() == [1, 2]


def test_facets_named_twice_by_overlapping_groups_are_taken_once() -> None:
    cells = [("triangle", TWO), ("line", np.array([[0, 1], [1, 0], [1, 2]]))]
    tags = {"gmsh:physical": [np.array([1, 1]), np.array([5, 6, 6])]}
    mesh = Mesh.from_meshio(meshio.Mesh(SQUARE, cells, cell_data=tags))
    assert facet_set(mesh) == {(0, 1, 5), (1, 2, 6)}


# --- quadrilaterals, solids, surfaces -------------------------------------------------------------------------------


def test_quads_raise_with_count_and_offer_and_are_cut_when_asked(tmp_path: Path) -> None:
    points = np.array([[0.0, 0], [1, 0], [1.5, 1], [0, 1], [2, 0]])
    other = meshio.Mesh(np.pad(points, ((0, 0), (0, 1))), [("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 2]])])
    other.write(tmp_path / "mixed.vtu")
    with pytest.raises(MeshError, match=r"mixed\.vtu.*1 quadrilaterals among 2 cells \(type 'quad'\).*--split-quads"):
        coarsen.read(tmp_path / "mixed.vtu")
    mesh = coarsen.read(tmp_path / "mixed.vtu", split_quads=True)
    assert mesh.n_cells == 3
    assert mesh.quality().area == pytest.approx(1.25 + 0.5)
    edges = {
        tuple(sorted(edge)) for cell in mesh.cells.tolist() for edge in zip(cell, [*cell[1:], cell[0]], strict=True)
    }
    assert (1, 3) in edges  # the shorter diagonal
    assert (0, 2) not in edges


def test_a_quad_that_is_not_convex_is_cut_inside() -> None:
    dart = np.array([[0.0, 0], [3, -1], [0, 3], [1, 0.5]])  # the shorter diagonal, 1-3, is the one inside
    dent = np.array([[0.0, 0], [2, 2], [0, 0.5], [-2, 2]])  # the shorter one, 0-2, inside too; the other lies outside
    for points in (dart, dent):
        other = meshio.Mesh(points, [("quad", [[0, 1, 2, 3]])])
        mesh = Mesh.from_meshio(other, split_quads=True)
        x, y = points.T
        shoelace = abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
        assert mesh.quality().area == pytest.approx(shoelace)


def test_tags_of_a_quad_go_to_both_halves() -> None:
    data = {"cell_tags": [np.array([4]), np.array([9])]}
    points = np.vstack([SQUARE, [[2, 0]]])
    other = meshio.Mesh(points, [("quad", [[0, 1, 2, 3]]), ("triangle", [[1, 4, 2]])], cell_data=data)
    assert Mesh.from_meshio(other, split_quads=True).cell_tags.tolist() == [4, 4, 9]


@pytest.mark.parametrize(
    ("points", "cells", "words"),
    [
        (np.eye(4)[:, :3], [("tetra", [[0, 1, 2, 3]])], r"1 cells of type 'tetra': a mesh of solids"),
        (np.eye(3), [("triangle", [[0, 1, 2]])], r"triangles of a surface: coordinate z runs from 0 to 1"),
        (np.eye(3), [("line", [[0, 1], [1, 2]])], r"edges without triangles: coordinate y"),
        (SQUARE, [("vertex", [[0], [1]])], r"no cells"),
        (np.random.default_rng(SEED).random((6, 2)), [("triangle6", [[0, 1, 2, 3, 4, 5]])], r"'triangle6'.*corners"),
        (np.random.default_rng(SEED).random((5, 2)), [("polygon", [[0, 1, 2, 3, 4]])], r"'polygon5'"),
    ],
)
def test_what_is_no_mesh_of_triangles_is_refused_by_name(points: Any, cells: Any, words: str) -> None:
    with pytest.raises(MeshError, match=words):
        Mesh.from_meshio(meshio.Mesh(points, cells))


def test_corners_of_curved_triangles_are_kept_when_repair_is_asked(tmp_path: Path) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]])
    meshio.Mesh(points, [("triangle6", [[0, 1, 2, 3, 4, 5]])]).write(tmp_path / "p2.vtu")
    mesh = coarsen.read(tmp_path / "p2.vtu", repair=True)
    assert mesh.n_points == 3


# --- archives, and what is no mesh ------------------------------------------------------------------------------------


def test_loose_archives_are_read(tmp_path: Path) -> None:
    np.savez(
        tmp_path / "loose.npz",
        points=SQUARE,
        triangles=TWO,
        segments=[[0, 1], [1, 2]],
        segment_markers=[0, 1],
        segment_names=["shore", "sea"],
        cell_tags=[3, 4],
        depth=[1.0, 2, 3, 4],
    )
    mesh = coarsen.read(tmp_path / "loose.npz")
    assert facet_set(mesh) == {(0, 1, 0), (1, 2, 1)}
    assert mesh.cell_tags.tolist() == [3, 4]
    assert mesh.point_data["depth"].tolist() == [1, 2, 3, 4]
    assert io.read_draft(tmp_path / "loose.npz").facet_names == {0: "shore", 1: "sea"}


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"cells": TWO}, "no array 'points'"),
        ({"points": SQUARE}, "no array 'cells'"),
        ({"points": SQUARE, "quads": [[0, 1, 2, 3]]}, "1 quadrilaterals"),
        ({"points": SQUARE, "triangles": TWO, "cell_tags": [1]}, "'cell_tags' has 1 entries, expected 2"),
        ({"points": SQUARE, "triangles": TWO + 1}, "index|range"),
        ({"points": SQUARE, "triangles": np.zeros((0, 3), int)}, "no cells|cells"),
    ],
)
def test_incomplete_archives_say_what_is_missing(tmp_path: Path, arrays: Any, words: str) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(MeshError, match=words):
        coarsen.read(tmp_path / "a.npz")


def test_pickled_objects_are_not_loaded(tmp_path: Path) -> None:
    np.savez(tmp_path / "evil.npz", points=np.array([{}], dtype=object), triangles=TWO)
    with pytest.raises(MeshError, match="evil"):
        coarsen.read(tmp_path / "evil.npz")


@pytest.mark.parametrize("ending", io.readable())
@pytest.mark.parametrize("content", [b"", b"hello\n", b"\x00\xff\x00\xfe" * 50, b"1 2 3\n4 5 6\n7 8 9\n"])
def test_any_file_that_is_no_mesh_gives_one_line(tmp_path: Path, ending: str, content: bytes, capfd: Any) -> None:
    path = tmp_path / f"bad{ending}"
    path.write_bytes(content)
    with pytest.raises(MeshError, match=f"bad{ending.rpartition('.')[0]}") as caught:
        coarsen.read(path)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("ending", [".vtu", ".vtk", ".msh", ".npz", ".14", ".su2", ".nc", ".xdmf", ".med", ".mesh"])
def test_files_cut_short_give_a_mesh_or_one_line(sea: Mesh, tmp_path: Path, ending: str, capfd: Any) -> None:
    path = tmp_path / f"sea{ending}"
    sea.write(path)
    whole = path.read_bytes()
    for share in np.linspace(0, 0.98, 12):
        path.write_bytes(whole[: int(share * len(whole))])
        with contextlib.suppress(MeshError):
            coarsen.read(path)
    assert capfd.readouterr() == ("", "")


def test_no_file_a_folder_and_an_unknown_ending_are_told_apart(tmp_path: Path, disc: Mesh) -> None:
    with pytest.raises(FileNotFoundError, match="does not exist"):
        coarsen.read(tmp_path / "nowhere.msh")
    with pytest.raises(IsADirectoryError, match="folder"):
        coarsen.read(tmp_path)
    (tmp_path / "a.docx").write_text("x")
    with pytest.raises(MeshError, match=r"a\.docx.*no format.*\.msh"):
        coarsen.read(tmp_path / "a.docx")
    with pytest.raises(MeshError, match=r"b\.docx.*no format.*\.vtu"):
        disc.write(tmp_path / "b.docx")
    with pytest.raises(FileNotFoundError, match="folder"):
        disc.write(tmp_path / "none" / "a.vtu")


def test_a_failed_write_leaves_the_old_file(sea: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "sea.npz"
    sea.write(path)
    before = path.read_bytes()
    monkeypatch.setattr(np, "savez_compressed", lambda *a, **k: (_ for _ in ()).throw(OSError("disc full")))
    with pytest.raises(OSError, match="disc full"):
        sea.write(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["sea.npz"]


def test_without_meshio_own_formats_work_and_others_say_how_to_get_it(
    disc: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "meshio", None)
    disc.write(tmp_path / "a.npz")
    assert_same_cells(disc, coarsen.read(tmp_path / "a.npz"))
    with pytest.raises(ImportError, match=r"coarsen-mesh\[io\]"):
        disc.write(tmp_path / "a.vtk")


def test_real_meshes_are_read_or_refused_as_their_names_say(meshes: Path) -> None:
    for path in sorted(meshes.glob("*.npz")):
        name = path.stem
        solid = name.startswith(("dolfin3d", "ngs3d", "su2_brick", "skfem_beams", "surf_"))
        quads = any(word in name for word in ("quad", "mfem_star", "turb_mixed"))
        told = refusal(lambda path=path: coarsen.read(path))
        if not told:
            assert not solid
            assert not quads
            continue
        assert "\n" not in told
        assert name in told
        assert solid or quads or name.startswith("broken") or name.endswith("__asis"), told
        if quads:
            assert "--split-quads" in told
            assert coarsen.read(path, split_quads=True).n_cells > 0
