"""Foreign files as their own programs and libraries write them: ADCIRC, SCHISM, SU2, TELEMAC, UGRID, Triangle."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coarsen
from coarsen import MeshError, gallery, io
from coarsen.mesh import Mesh
from files import SQUARE, TWO, facet_set


@pytest.fixture(scope="module")
def sea() -> Mesh:
    """A coast: tagged facets and a nodal field."""
    return gallery.coast(400, seed=5)


# --- ADCIRC and SCHISM ------------------------------------------------------------------------------------------------

FORT_14 = """a strait with a weir
 8 12   ! elements, nodes
 101 0.0 0.0 10.0
 102 1.0 0.0 11.0
 103 2.0 0.0 12.0
 104 0.0 1.0 13.0
 105 1.0 1.0 14.0
 106 2.0 1.0 15.0
 107 0.0 1.1 16.0
 108 1.0 1.1 17.0
 109 2.0 1.1 18.0
 110 0.0 2.0 19.0
 111 1.0 2.0 20.0
 112 2.0 2.0 21.0
 1 3 101 102 105
 2 3 101 105 104
 3 3 102 103 106
 4 3 102 106 105
 5 3 107 108 111
 6 3 107 111 110
 7 3 108 109 112
 8 3 108 112 111
 1 = Number of open boundaries
 3 = Total number of open boundary nodes
 3 = Number of nodes for open boundary 1
 101
 102
 103
 2 = Number of land boundaries
 9 = Total number of land boundary nodes
 3 24 = Number of nodes for land boundary 1
 104 107 2.5 1.0 0.9
 105 108 2.6 1.0 0.9
 106 109 2.7 1.0 0.9
 3 0 = Number of nodes for land boundary 2
 110
 111
 112
"""


def test_fort_14_gives_depth_boundaries_and_both_sides_of_a_weir(tmp_path: Path) -> None:
    (tmp_path / "fort.14").write_text(FORT_14)
    mesh = coarsen.read(tmp_path / "fort.14")
    assert mesh.point_data["depth"].tolist() == list(range(10, 22))
    open_, weir, land = [(0, 1, -1), (1, 2, -1)], [(3, 4), (4, 5), (6, 7), (7, 8)], [(9, 10, 0), (10, 11, 0)]
    assert facet_set(mesh) == {*open_, *((a, b, 24) for a, b in weir), *land}
    height = mesh.point_data["barrier:0"]
    assert height[3:9].tolist() == [2.5, 2.6, 2.7, 2.5, 2.6, 2.7]
    assert np.isnan(height[:3]).all()


def test_a_weir_is_written_in_pairs_again(tmp_path: Path) -> None:
    (tmp_path / "fort.14").write_text(FORT_14)
    mesh = coarsen.read(tmp_path / "fort.14")
    mesh.write(tmp_path / "again.14")
    assert "4 7 2.5 1.0 0.9" in (tmp_path / "again.14").read_text()
    assert coarsen.read(tmp_path / "again.14") == Mesh(
        mesh.points, mesh.cells, facets=coarsen.read(tmp_path / "again.14").facets,
        facet_tags=coarsen.read(tmp_path / "again.14").facet_tags, point_data=mesh.point_data,
        facet_names={-1: "open", 0: "mainland", 24: "weir"},
    )  # fmt: skip
    assert facet_set(mesh) == facet_set(coarsen.read(tmp_path / "again.14"))


def test_islands_are_rings_though_their_first_node_is_told_once(tmp_path: Path) -> None:
    ring = gallery.ring(60)
    inner = [node for node in np.unique(ring.boundary_facets) if np.hypot(*ring.points[node]) < 0.5]
    facets = [edge for edge in ring.boundary_facets.tolist() if edge[0] in inner]
    mesh = Mesh(ring.points, ring.cells, facets=facets, facet_tags=[21] * len(facets))
    mesh.write(tmp_path / "ring.grd")
    lines = (tmp_path / "ring.grd").read_text().splitlines()
    assert f"{len(inner)} 21 = Number of nodes for land boundary 1" in lines
    assert facet_set(coarsen.read(tmp_path / "ring.grd")) == facet_set(mesh)


def test_gr3_without_boundaries_and_with_a_quad(tmp_path: Path) -> None:
    text = "hgrid\n2 5\n1 0 0 -1\n2 1 0 -2\n3 1 1 -3\n4 0 1 -4\n5 2 0 -5\n1 4 1 2 3 4\n2 3 2 5 3\n"
    (tmp_path / "hgrid.gr3").write_text(text)
    with pytest.raises(MeshError, match="1 quadrilaterals among 2"):
        coarsen.read(tmp_path / "hgrid.gr3")
    mesh = coarsen.read(tmp_path / "hgrid.gr3", split_quads=True)
    assert mesh.n_cells == 3
    assert mesh.facets is None
    assert mesh.point_data["depth"].tolist() == [-1, -2, -3, -4, -5]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.replace(" 8 12 ", " eight 12 "), "line 2"),
        (lambda t: t.replace(" 8 12 ", " 80 12 "), "ends early|expected"),
        (lambda t: t.replace("1 3 101 102 105", "1 3 101 102 999"), "node 999"),
        (lambda t: t.replace("1 3 101 102 105", "1 5 101 102 105 106 107"), "5 nodes"),
        (lambda t: t.replace(" 102 1.0 0.0 11.0", " 102 1.0 0.0"), "fort"),
        (lambda t: t[: t.index(" 110\n 111\n 112\n")], "ends early"),
        (lambda t: "", "0 lines"),
    ],
)
def test_broken_fort_14_says_where(tmp_path: Path, change: Any, words: str) -> None:
    (tmp_path / "fort.14").write_text(change(FORT_14))
    with pytest.raises(MeshError, match=words) as caught:
        coarsen.read(tmp_path / "fort.14")
    assert "\n" not in str(caught.value)


# --- SU2 --------------------------------------------------------------------------------------------------------------


def test_su2_markers_keep_their_names_and_zones_become_tags(tmp_path: Path) -> None:
    zone = (
        "NDIME= 2\nNELEM= 2\n5 0 1 2 0\n5 0 2 3 1\nNPOIN= 4 4\n{x} 0 0\n{x1} 0 1\n{x1} 1 2\n{x} 1 3\n"
        "NMARK= 1\nMARKER_TAG= {name} % comment\nMARKER_ELEMS= 1\n3 0 1\n"
    )
    first, second = zone.format(x=0, x1=1, name="wing"), zone.format(x=5, x1=6, name="far field")
    (tmp_path / "two.su2").write_text(f"NZONE= 2\nIZONE= 1\n{first}IZONE= 2\n{second}")
    mesh = coarsen.read(tmp_path / "two.su2")
    assert mesh.n_points == 8
    assert mesh.cell_tags.tolist() == [1, 1, 2, 2]
    assert facet_set(mesh) == {(0, 1, 0), (4, 5, 1)}
    assert io.read_draft(tmp_path / "two.su2").facet_names == {0: "wing", 1: "far field"}


def test_su2_without_enough_rows_says_which(tmp_path: Path) -> None:
    (tmp_path / "short.su2").write_text("NDIME= 2\nNELEM= 3\n5 0 1 2\nNPOIN= 3\n0 0\n1 0\n0 1\n")
    with pytest.raises(MeshError, match="NELEM announces 3 rows, 1 follow"):
        coarsen.read(tmp_path / "short.su2")


# --- TELEMAC ----------------------------------------------------------------------------------------------------------


def selafin_bytes(real: str, steps: int, *, date: bool) -> bytes:
    """A Selafin file as Fortran writes it, of two triangles, after TELEMAC's own description."""
    size = {"SERAFIN ": ">f4", "SERAFIND": ">f8"}[real]

    def record(content: bytes) -> bytes:
        length = len(content).to_bytes(4, "big")
        return length + content + length

    def ints(*values: int) -> bytes:
        return record(np.array(values, ">i4").tobytes())

    def reals(*values: float) -> bytes:
        return record(np.array(values, size).tobytes())

    out = record(f"{'TELEMAC 2D : STRAIT':<72}{real}".encode()) + ints(2, 0)
    out += record(f"{'BOTTOM':<16}{'M':<16}".encode()) + record(f"{'WATER DEPTH':<16}{'M':<16}".encode())
    out += ints(1, 0, 500, 700, 0, 0, 0, 0, 0, int(date))
    if date:
        out += ints(2020, 1, 2, 3, 4, 5)
    out += ints(2, 4, 3, 1) + ints(1, 2, 3, 1, 3, 4) + ints(1, 2, 3, 4) + reals(0, 1, 1, 0) + reals(0, 0, 1, 1)
    for step in range(steps):
        out += reals(60.0 * step) + reals(-1, -2, -3, -4) + reals(*(step + k for k in range(4)))
    return out


@pytest.mark.parametrize("real", ["SERAFIN ", "SERAFIND"])
@pytest.mark.parametrize("date", [False, True])
def test_selafin_gives_the_last_time_step(tmp_path: Path, real: str, date: bool) -> None:
    (tmp_path / "strait.slf").write_bytes(selafin_bytes(real, 3, date=date))
    mesh = coarsen.read(tmp_path / "strait.slf")
    assert mesh.points.tolist() == [[500, 700], [501, 700], [501, 701], [500, 701]]
    assert mesh.cells.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.point_data["BOTTOM"].tolist() == [-1, -2, -3, -4]
    assert mesh.point_data["WATER DEPTH"].tolist() == [2, 3, 4, 5]


def test_selafin_written_is_read_with_depth_as_bottom(sea: Mesh, tmp_path: Path) -> None:
    sea.write(tmp_path / "sea.slf")
    assert np.array_equal(coarsen.read(tmp_path / "sea.slf").point_data["BOTTOM"], -sea.point_data["depth"])


def test_selafin_cut_anywhere_says_so(tmp_path: Path) -> None:
    whole = selafin_bytes("SERAFIND", 1, date=True)
    for length in range(0, len(whole) - 1, 7):
        (tmp_path / "cut.slf").write_bytes(whole[:length])
        with contextlib.suppress(MeshError):  # a cut between two records of the fields is a shorter file, and legal
            coarsen.read(tmp_path / "cut.slf")


# --- UGRID ------------------------------------------------------------------------------------------------------------


def write_ugrid(path: Path, *, start: int, told: int, turned: bool = False, quad: bool = False) -> None:
    """A UGRID file with an honest or a lying start_index."""
    netcdf = pytest.importorskip("netCDF4")
    faces = np.array([[0, 1, 4, -9], [1, 2, 4, -9], [2, 3, 4, -9], [3, 0, 4, -9]])
    points = np.vstack([SQUARE, [[0.5, 0.5]]])
    if quad:
        points, faces = np.vstack([SQUARE, [[2, 0]]]), np.array([[0, 1, 2, 3], [1, 4, 2, -9]])
    with netcdf.Dataset(path, "w") as file:
        file.createDimension("node", len(points))
        file.createDimension("face", len(faces))
        file.createDimension("corner", 4)
        file.createDimension("time", None)
        mesh = file.createVariable("topology", "i4", ())
        mesh.setncatts({"cf_role": "mesh_topology", "topology_dimension": 2, "node_coordinates": "lat lon"})
        mesh.setncatts({"face_node_connectivity": "faces", "face_dimension": "face"})
        for name, column, unit in (("lon", 0, "degrees_east"), ("lat", 1, "degrees_north")):
            variable = file.createVariable(name, "f8", ("node",))
            variable.units = unit
            variable[:] = points[:, column]
        dims = ("corner", "face") if turned else ("face", "corner")
        variable = file.createVariable("faces", "i4", dims, fill_value=999999)
        variable.start_index = told
        masked = np.ma.masked_equal(np.where(faces < 0, -9, faces + start), -9)
        variable[:] = masked.T if turned else masked
        depth = file.createVariable("depth", "f8", ("node",))
        depth[:] = np.arange(len(points))
        level = file.createVariable("level", "f8", ("time", "node"))
        level[:] = np.arange(2 * len(points)).reshape(2, -1)


@pytest.mark.parametrize("start", [0, 1])
@pytest.mark.parametrize("told", [0, 1])
@pytest.mark.parametrize("turned", [False, True])
def test_ugrid_believes_the_indices_and_not_the_attribute(tmp_path: Path, start: int, told: int, turned: bool) -> None:
    write_ugrid(tmp_path / "sea.nc", start=start, told=told, turned=turned)
    mesh = coarsen.read(tmp_path / "sea.nc")
    assert mesh.cells.tolist() == [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    assert mesh.points[1].tolist() == [1, 0]  # longitude first, though the file names latitude first
    assert mesh.point_data["depth"].tolist() == [0, 1, 2, 3, 4]
    assert mesh.point_data["level"].tolist() == [5, 6, 7, 8, 9]


@pytest.mark.filterwarnings("ignore")
def test_xugrid_reads_ours_and_we_read_xugrid_s(sea: Mesh, tmp_path: Path) -> None:
    xugrid = pytest.importorskip("xugrid")
    sea.write(tmp_path / "ours.nc")
    opened = xugrid.open_dataset(tmp_path / "ours.nc")
    assert np.array_equal(opened.ugrid.grid.face_node_connectivity, sea.cells)
    assert np.array_equal(opened["depth"], sea.point_data["depth"])
    for start in (0, 1):
        grid = xugrid.Ugrid2d(*sea.points.T.copy(), -1, np.asarray(sea.cells) + start, start_index=start)
        grid.to_dataset().to_netcdf(tmp_path / "theirs.nc")
        theirs = coarsen.read(tmp_path / "theirs.nc")
        assert np.array_equal(theirs.points, sea.points)
        assert np.array_equal(theirs.cells, sea.cells)


def test_ugrid_with_quads_offers_to_cut_them(tmp_path: Path) -> None:
    write_ugrid(tmp_path / "mixed.nc", start=0, told=1, quad=True)
    with pytest.raises(MeshError, match="1 quadrilaterals among 2 cells"):
        coarsen.read(tmp_path / "mixed.nc")
    assert coarsen.read(tmp_path / "mixed.nc", split_quads=True).n_cells == 3


def test_fvcom_is_read_from_nv_and_lon_lat(tmp_path: Path) -> None:
    netcdf = pytest.importorskip("netCDF4")
    with netcdf.Dataset(tmp_path / "fvcom.nc", "w") as file:
        file.createDimension("node", 4)
        file.createDimension("nele", 2)
        file.createDimension("three", 3)
        for name, values in (("x", np.zeros(4)), ("y", np.zeros(4)), ("lon", SQUARE[:, 0]), ("lat", SQUARE[:, 1])):
            file.createVariable(name, "f4", ("node",))[:] = values
        file.createVariable("h", "f4", ("node",))[:] = [1, 2, 3, 4]
        file.createVariable("nv", "i4", ("three", "nele"))[:] = TWO.T + 1
    mesh = coarsen.read(tmp_path / "fvcom.nc")
    assert mesh.cells.tolist() == TWO.tolist()
    assert mesh.points.tolist() == SQUARE.tolist()
    assert mesh.point_data["depth"].tolist() == [1, 2, 3, 4]


# --- Triangle ---------------------------------------------------------------------------------------------------------


def test_triangle_counts_from_one_with_attributes_markers_and_comments(tmp_path: Path) -> None:
    (tmp_path / "box.1.node").write_text("# box\n4 2 1 1\n1 0 0 5.5 1\n2 1 0 6.5 1\n3 1 1 7.5 1\n4 0 1 8.5 1\n")
    (tmp_path / "box.1.ele").write_text("2 3 1\n1 1 2 3 10\n2 1 3 4 20\n# done\n")
    (tmp_path / "box.1.poly").write_text("0 2 0 1\n2 1\n1 1 2 33\n2 2 3 44\n0\n")
    for ending in ("node", "ele", "poly"):
        mesh = coarsen.read(tmp_path / f"box.1.{ending}")
        assert mesh.cell_tags.tolist() == [10, 20]
        assert facet_set(mesh) == {(0, 1, 33), (1, 2, 44)}
        assert mesh.point_data["attribute"].tolist() == [5.5, 6.5, 7.5, 8.5]


def test_triangle_edges_with_a_marker_are_facets_where_there_is_no_poly(tmp_path: Path) -> None:
    (tmp_path / "a.node").write_text("4 2 0 0\n0 0 0\n1 1 0\n2 1 1\n3 0 1\n")
    (tmp_path / "a.ele").write_text("2 3 0\n0 0 1 2\n1 0 2 3\n")
    (tmp_path / "a.edge").write_text("5 1\n0 0 1 7\n1 1 2 7\n2 2 3 8\n3 3 0 8\n4 0 2 0\n")
    assert facet_set(coarsen.read(tmp_path / "a.ele")) == {(0, 1, 7), (1, 2, 7), (2, 3, 8), (0, 3, 8)}


def test_triangle_without_its_other_file_says_which_is_missing(tmp_path: Path) -> None:
    (tmp_path / "a.node").write_text("3 2 0 0\n0 0 0\n1 1 0\n2 0 1\n")
    with pytest.raises(MeshError, match=r"'a\.ele' is missing"):
        coarsen.read(tmp_path / "a.node")


def test_tetgen_is_told_from_triangle(tmp_path: Path) -> None:
    (tmp_path / "a.node").write_text("4 3 0 0\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n")
    (tmp_path / "a.ele").write_text("1 4 0\n0 0 1 2 3\n")
    with pytest.raises(MeshError, match="solids"):
        coarsen.read(tmp_path / "a.node")
