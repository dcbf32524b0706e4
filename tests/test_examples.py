"""Every example runs, prints its table, draws its picture, and shows what it promises."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")
pytest.importorskip("scipy")

EXAMPLES = Path(__file__).parents[1] / "examples"
MOST_LINES = 100
NEEDS_PYAMG = {"crack_poisson": 9, "interface_jump": 9, "elastic_plate": 13, "ocean_waves": 11}
"""The solvers, and how many iterations they take at most."""


def run(name, size, folder, capsys):
    path = EXAMPLES / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    picture = folder / f"{name}.png"
    result = module.main(picture=picture) if size is None else module.main(size, picture)
    assert len(capsys.readouterr().out.splitlines()) >= 3
    assert picture.stat().st_size > 10_000
    assert len(path.read_text().splitlines()) < MOST_LINES
    return result


@pytest.mark.parametrize("name", NEEDS_PYAMG)
def test_the_example_solves_in_few_iterations(name, tmp_path, capsys):
    pytest.importorskip("pyamg")
    assert max(run(name, 4000, tmp_path, capsys)) <= NEEDS_PYAMG[name]


@pytest.mark.parametrize("name", NEEDS_PYAMG)
def test_it_does_so_at_its_own_size(name, tmp_path, capsys):
    pytest.importorskip("pyamg")
    assert max(run(name, None, tmp_path, capsys)) <= NEEDS_PYAMG[name]


def test_a_message_reaches_far_over_the_coarse_levels(tmp_path, capsys):
    alone, over_levels = run("multiscale_graph", 2000, tmp_path, capsys)
    assert alone < 10
    assert over_levels > 50 * alone


def test_every_example_is_tested():
    # those in gallery/ are run when the documentation is built
    own = {path.stem for path in EXAMPLES.glob("*.py")}
    assert own == {*NEEDS_PYAMG, "multiscale_graph"}
