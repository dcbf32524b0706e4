"""What users see of objects at the prompt, and what happens to them in other processes."""

from __future__ import annotations

import copy
import logging
import pickle
import subprocess
import sys

import numpy as np
import pytest

import coarsen
from coarsen import gallery
from coarsen.io import Draft


@pytest.fixture(scope="module")
def objects():
    """Return one of each kind, of a mesh with tags, names and fields."""
    pytest.importorskip("scipy")
    sea = gallery.coast(400)
    h = coarsen.hierarchy(sea, spacing=np.full(sea.n_points, 900.0), features="auto")
    _, repairs = coarsen.Mesh.repaired([[0, 0], [1, 0], [0, 1], [2, 2]], [[0, 1, 2]])
    return [
        sea,
        gallery.line(20),
        h,
        h[1],
        h.options,
        h[1].quality,
        h.check(min_angle=50),
        h.check().levels[0],
        h.transfer_report(),
        h.graph(1),
        h.assignment(1),
        sea.topology,
        repairs,
        Draft(sea.points, [("triangle", sea.cells, None)]),
        *coarsen.multigrid.stages(coarsen.multigrid.laplacian(sea), h, dirichlet="open"),
    ]


def test_every_repr_is_one_short_line_that_says_something(objects):
    for one in objects:
        text = repr(one)
        assert "\n" not in text
        assert len(text) <= 120
        assert text.startswith(type(one).__name__ + "(")
        assert "array(" not in text
        assert "object at" not in text


def test_copies_and_pickles_are_equal_to_the_original(objects):
    for one in objects[:9]:
        for other in (copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
            assert other == one
            assert not other != one
    for one in objects[9:]:
        assert repr(pickle.loads(pickle.dumps(one))) == repr(one)


def test_options_at_the_prompt_are_those_that_were_changed():
    assert repr(coarsen.Options()) == "Options()"
    assert repr(coarsen.Options(factor=3, features="drop")) == "Options(factor=3.0, features='drop')"


def test_nothing_is_logged_or_printed_unless_asked(tmp_path):
    code = """
import coarsen
points, cells = [[0, 0], [1, 0], [0, 1], [5, 5]], [[0, 1, 2]]
import numpy as np
np.savez("untidy.npz", points=points, cells=cells)
mesh = coarsen.read("untidy.npz", repair=True)
coarsen.hierarchy(coarsen.gallery.crack_plate(500)).write("levels")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert done.stdout == done.stderr == ""


def test_who_listens_hears_what_was_done(tmp_path, caplog):
    np.savez(tmp_path / "untidy.npz", points=[[0, 0], [1, 0], [0, 1], [5, 5]], cells=[[0, 1, 2]])
    with caplog.at_level(logging.INFO, "coarsen"):
        coarsen.read(tmp_path / "untidy.npz", repair=True).write(tmp_path / "tidy.14")
        coarsen.hierarchy(gallery.square(200), beta=3)
    for told in (
        "1 node in no cell dropped",
        "untidy.npz: Mesh(3 points",
        "tidy.14: Draft(3 points, 1 triangle)",
        "Options(beta=3.0)",
        "ended: ",
    ):
        assert told in caplog.text
