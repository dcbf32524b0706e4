"""Names of tags: kept by everything that makes a mesh of a mesh, and by files that have names."""

from __future__ import annotations

import copy
import json
import pickle

import numpy as np
import pytest

import coarsen
from coarsen import Mesh, MeshError, gallery
from coarsen.transfer import free_mask

FACETS = {3: "inflow", 7: "outflow", 9: "the rest"}
CELLS = {1: "sand", 2: "clay, wet"}


@pytest.fixture
def mesh() -> Mesh:
    """A square with a disc of another material, its boundary in three parts."""
    plain = gallery.interface(600)
    facets = plain.boundary_facets
    middle = plain.points[facets].mean(axis=1)[:, 0]
    tags = np.select([middle < 1e-9, middle > 1 - 1e-9], [3, 7], 9)
    return Mesh(
        plain.points,
        plain.cells,
        cell_tags=plain.cell_tags,
        facets=facets,
        facet_tags=tags,
        facet_names=FACETS,
        cell_names=CELLS,
    )


def named(mesh, tag):
    """Return the ends of the facets of a name, as sorted coordinates."""
    number = next(number for number, name in mesh.facet_names.items() if name == tag)
    return np.unique(mesh.points[mesh.facets[mesh.facet_tags == number]].reshape(-1, 2), axis=0)


def test_every_level_has_the_names_of_the_input(mesh):
    h = coarsen.hierarchy(mesh)
    assert len(h) > 2
    for level in h:
        assert level.mesh.facet_names == FACETS
        assert level.mesh.cell_names == CELLS
        assert np.all(named(level.mesh, "inflow")[:, 0] == 0)
        assert np.all(named(level.mesh, "outflow")[:, 0] == 1)


def test_names_survive_copies_archives_scaling_and_repair(mesh, tmp_path):
    h = coarsen.hierarchy(mesh)
    h.save(tmp_path / "h.npz")
    mesh.write(tmp_path / "m.npz")
    given = {name: getattr(mesh, name) for name in ("facets", "facet_tags", "cell_tags", "facet_names", "cell_names")}
    mended, _ = Mesh.repaired(mesh.points, mesh.cells, **given)
    for other in (
        pickle.loads(pickle.dumps(mesh)),
        copy.deepcopy(mesh),
        mesh.scaled(1.0),
        mended,
        coarsen.load(tmp_path / "h.npz")[0].mesh,
        coarsen.read(tmp_path / "m.npz"),
    ):
        assert (other.facet_names, other.cell_names) == (FACETS, CELLS)
        assert other == mesh
    assert coarsen.load(tmp_path / "h.npz") == h


def test_meshes_with_other_names_differ(mesh):
    given = {"cell_tags": mesh.cell_tags, "facets": mesh.facets, "facet_tags": mesh.facet_tags}
    assert mesh != Mesh(mesh.points, mesh.cells, **given)
    assert mesh != Mesh(mesh.points, mesh.cells, **given, facet_names=FACETS, cell_names={1: "sand"})


def test_names_can_not_be_changed_from_outside(mesh):
    mesh.facet_names[3] = "changed"
    assert mesh.facet_names == FACETS


@pytest.mark.parametrize("ending", ["msh", "su2", "nc", "npz"])
def test_files_that_have_names_keep_them(mesh, ending, tmp_path):
    pytest.importorskip("meshio")
    pytest.importorskip("netCDF4")
    path = tmp_path / f"mesh.{ending}"
    mesh.write(path)
    back = coarsen.read(path)
    names = {tag: name.replace(" ", "_") for tag, name in FACETS.items()} if ending == "nc" else FACETS
    assert back.facet_names == names
    for mine, theirs in zip(FACETS.values(), names.values(), strict=True):
        assert np.array_equal(named(back, theirs), named(mesh, mine))
    if ending in ("msh", "npz"):  # su2 has no cell tags
        assert back == mesh


def test_gmsh_itself_finds_the_groups_by_name(mesh, tmp_path):
    gmsh = pytest.importorskip("gmsh")
    coarsen.coarsen(mesh).mesh.write(tmp_path / "level.msh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Verbosity", 0)
        gmsh.open(str(tmp_path / "level.msh"))
        found = {(dim, gmsh.model.getPhysicalName(dim, tag)) for dim, tag in gmsh.model.getPhysicalGroups()}
    finally:
        gmsh.finalize()
    assert found == {(1, name) for name in FACETS.values()} | {(2, name) for name in CELLS.values()}


def test_one_name_for_facets_and_cells_stays_two_groups(mesh, tmp_path):
    pytest.importorskip("meshio")
    both = Mesh(mesh.points, mesh.cells, **{**mesh._beside(), "facet_names": {3: "sand"}})
    both.write(tmp_path / "both.msh")
    back = coarsen.read(tmp_path / "both.msh")
    assert back.cell_names == CELLS
    assert back.facet_names == {3: "sand (facets)"}


def test_kinds_of_boundary_are_names_in_fort_14_and_names_become_kinds(tmp_path):
    coast = gallery.coast(2000)
    coast.write(tmp_path / "fort.14")
    assert coarsen.read(tmp_path / "fort.14").facet_names == coast.facet_names
    # the same tags under numbers of one's own, as a mesh from gmsh has them
    own = {101: "Open", 102: "land", 103: "island"}
    tags = np.select([coast.facet_tags == -1, coast.facet_tags == 20], [101, 102], 103)
    renamed = Mesh(coast.points, coast.cells, facets=coast.facets, facet_tags=tags, facet_names=own)
    renamed.write(tmp_path / "own.14")
    back = coarsen.read(tmp_path / "own.14")
    assert back.facet_names == {-1: "open", 1: "island", 20: "mainland, weak"}
    for mine, theirs in (("Open", "open"), ("island", "island")):
        assert np.array_equal(named(renamed, mine), named(back, theirs))


def test_conditions_are_held_by_name(mesh):
    held = ~free_mask(mesh, dirichlet="inflow")
    assert np.array_equal(np.flatnonzero(held), np.unique(mesh.facets[mesh.facet_tags == 3]))
    assert np.array_equal(free_mask(mesh, dirichlet=["inflow", 7]), free_mask(mesh, dirichlet=[3, 7]))
    with pytest.raises(ValueError, match="'dirichlet' is 'inlet', expected 'boundary' or facet tags, one of 'inflow'"):
        free_mask(mesh, dirichlet="inlet")


def test_scikit_fem_gets_and_gives_the_names(mesh):
    pytest.importorskip("skfem")
    from coarsen.multigrid import from_skfem, to_skfem

    there = to_skfem(mesh)
    assert set(there.boundaries) == set(FACETS.values())
    assert set(there.subdomains) == set(CELLS.values())
    back = from_skfem(there)
    assert sorted(back.facet_names.values()) == sorted(FACETS.values())
    assert np.array_equal(named(back, "inflow"), named(mesh, "inflow"))


@pytest.mark.parametrize(
    ("names", "text"),
    [
        ({"a": "b"}, "'facet_names' has the tag 'a', expected a whole number"),
        ({1: 2}, "'facet_names' calls tag 1 2, expected text"),
        ({1: "wall", 2: "wall"}, "'facet_names' calls both tag 1 and tag 2 'wall'"),
    ],
)
def test_names_that_name_nothing_are_refused(names, text):
    with pytest.raises(MeshError, match=text):
        Mesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], facet_names=names)


def test_info_tells_the_names(mesh, tmp_path, capsys):
    pytest.importorskip("typer")
    from coarsen.__main__ import main

    mesh.write(tmp_path / "mesh.npz")
    assert main(["info", str(tmp_path / "mesh.npz")]) == 0
    assert "3 inflow" in capsys.readouterr().out
    assert main(["info", "--json", str(tmp_path / "mesh.npz")]) == 0
    assert json.loads(capsys.readouterr().out)["facet_names"] == {str(tag): name for tag, name in FACETS.items()}


def test_cell_data_of_any_name_can_be_the_tags(mesh, tmp_path, caplog, capsys):
    meshio = pytest.importorskip("meshio")
    from coarsen.__main__ import main

    material = mesh.cell_tags * 10.0
    data = {"material": [material], "heat": [material / 7], "CellID": [np.arange(mesh.n_cells)]}
    meshio.Mesh(np.pad(mesh.points, ((0, 0), (0, 1))), [("triangle", mesh.cells)], cell_data=data).write(
        tmp_path / "vtk.vtu"
    )
    with caplog.at_level("INFO", "coarsen"):
        assert coarsen.read(tmp_path / "vtk.vtu").cell_tags is None
    assert "cell data left out: CellID, heat, material" in caplog.text
    assert np.array_equal(coarsen.read(tmp_path / "vtk.vtu", tags="material").cell_tags, 10 * mesh.cell_tags)
    assert main(["convert", str(tmp_path / "vtk.vtu"), str(tmp_path / "m.npz"), "--tags", "material"]) == 0
    assert np.array_equal(coarsen.read(tmp_path / "m.npz").cell_tags, 10 * mesh.cell_tags)
    for name, told in (
        ("heat", "'vtk.vtu': 'tags' is 'heat', which is not of whole numbers"),
        ("stuff", "'tags' is 'stuff', which is not among the cell data, only 'CellID', 'heat', 'material'"),
    ):
        with pytest.raises(MeshError, match=told):
            coarsen.read(tmp_path / "vtk.vtu", tags=name)
    capsys.readouterr()
    assert main(["info", str(tmp_path / "m.npz"), "--tags", "material"]) == 2
    assert "(NumPy archive) has no cell data by name" in capsys.readouterr().err
