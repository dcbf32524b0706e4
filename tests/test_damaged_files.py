"""Files damaged at random: each is read or refused in one line, without a warning, whatever was done to it."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coarsen
from coarsen import MeshError, gallery

SEED = 1997
ENDINGS = (".14", ".gr3", ".poly", ".su2", ".slf", ".npz", ".vtu", ".msh", ".nc")
WORDS = [b"nan", b"inf", b"-1", b"0", b"1.5", b"abc", b"", b"99999999999", b"1e400", b"2147483648", b"1D0"]


def damaged(content: bytes, rng: random.Random) -> bytes:
    """Return the content cut, with bytes changed, put in or doubled, or with a number replaced."""
    at = rng.randrange(len(content))
    kind = rng.randrange(6)
    if kind == 0:
        return content[:at]
    if kind == 1:
        return content[:at] + rng.randbytes(rng.randrange(1, 40)) + content[at:]
    if kind == 2:
        return content[:at] + rng.randbytes(1) + content[at + 1 :]
    if kind == 3:
        return content[:at] + 2 * content[at : at + 200] + content[at + 200 :]
    if kind == 4:
        return content.replace(b"\n", b"\r\n")
    numbers = list(re.finditer(rb"[-+0-9.eE]+", content))
    chosen = rng.choice(numbers[:40] if rng.random() < 0.5 else numbers)
    return content[: chosen.start()] + rng.choice(WORDS) + content[chosen.end() :]


def refusal(read: Any, *args: Any, **options: Any) -> str | None:
    """Return what a reader says against a file, None where it takes it."""
    try:
        read(*args, **options)
    except MeshError as error:
        return str(error)
    return None


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_damaged_mesh_is_read_or_refused_in_one_line(ending: str, tmp_path: Path) -> None:
    pytest.importorskip("meshio")
    pytest.importorskip("netCDF4")
    rng = random.Random(SEED)
    gallery.coast(200).write(tmp_path / f"whole{ending}")
    parts = {path: path.read_bytes() for path in sorted(tmp_path.glob("whole.*"))}
    refused = 0
    for _ in range(60):
        for path, content in parts.items():
            path.write_bytes(content)
        path = rng.choice(list(parts))
        path.write_bytes(damaged(parts[path], rng))
        told = refusal(coarsen.read, tmp_path / f"whole{ending}", repair=rng.random() < 0.5)
        refused += told is not None
        assert told is None or re.search("^[^\n]*whole[^\n]*$", told)
    assert refused > 10


def test_a_damaged_hierarchy_is_loaded_or_refused_in_one_line(tmp_path: Path) -> None:
    rng = random.Random(SEED)
    path = tmp_path / "h.npz"
    coarsen.hierarchy(gallery.crack_plate(300)).save(path)
    whole = path.read_bytes()
    for _ in range(80):
        path.write_bytes(damaged(whole, rng))
        assert "\n" not in (refusal(coarsen.load, path) or "")


FORT_14 = "title\n2 4\n1 0D0 0.0D+00 1.5d1\n2 1.D0 0 2\n3 1 1 3\n4 0 1 4\n1 3 1 2 3\n2 3 1 3 4\n"


def test_exponents_of_fortran_are_read(tmp_path: Path) -> None:
    (tmp_path / "fort.14").write_text(FORT_14)
    mesh = coarsen.read(tmp_path / "fort.14")
    assert mesh.points.tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]
    assert mesh.point_data["depth"].tolist() == [15, 2, 3, 4]


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("4 0 1 4\n", "4 0 x 4\n", "node 4: '4 0 x 4', expected 4 numbers"),
        ("4 0 1 4\n", "nan 0 1 4\n", "the numbers of the nodes: nan, expected whole numbers"),
        ("1 3 1 2 3\n", "1 3 1 2.5 3\n", "the cells: 2.5, expected whole numbers"),
        ("1 3 1 2 3\n", "1 3 1 2\n", "cell 1: '1 3 1 2', expected 5 numbers"),
        ("1 3 1 2 3\n", "1 5 1 2 3 4 4\n", "a cell of 5 nodes, expected 3"),
        ("1 3 1 2 3\n", "1 3 1 2 9\n", "."),
    ],
)
def test_a_wrong_word_is_named_with_its_row(old: str, new: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "fort.14").write_text(FORT_14.replace(old, new))
    with pytest.raises(MeshError, match=re.escape(text)) as caught:
        coarsen.read(tmp_path / "fort.14")
    assert "fort.14" in str(caught.value)


def test_half_a_node_of_triangle_is_no_node(tmp_path: Path) -> None:
    (tmp_path / "a.node").write_text("3 2 0 0\n0 0 0\n1 1 0\n2 0 1\n")
    (tmp_path / "a.ele").write_text("1 3 0\n0 0 1 1.5\n")
    with pytest.raises(MeshError, match=r"'a\.ele': the cells: 1\.5, expected whole numbers"):
        coarsen.read(tmp_path / "a.ele")
    (tmp_path / "a.ele").write_text("2 3 0\n0 0 1 2\n")
    with pytest.raises(MeshError, match=r"'a\.ele': 2 rows were announced, 1 follow"):
        coarsen.read(tmp_path / "a.ele")


def test_a_million_numbers_are_not_read_one_by_one(tmp_path: Path) -> None:
    mesh = gallery.square(20_000)
    mesh.write(tmp_path / "square.14")
    back = coarsen.read(tmp_path / "square.14")
    assert np.array_equal(back.points, mesh.points)
    assert np.array_equal(back.cells, mesh.cells)
