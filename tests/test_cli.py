"""The command line: what it writes and prints, and one clear line with status 2 for everything that is wrong."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coarsen
from coarsen import gallery
from coarsen.__main__ import main
from coarsen.options import Options

pytest.importorskip("typer")
pytest.importorskip("rich")
pytest.importorskip("matplotlib").use("Agg")

COMMANDS = ("build", "info", "plot", "convert", "demo")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a mesh file, which is the current one."""
    monkeypatch.chdir(tmp_path)
    gallery.coast(900, seed=5).write("sea.vtu")
    return tmp_path


def run(*words: str) -> int:
    return main(list(words))


def test_build_writes_levels_series_and_archive(place: Path, capsys: Any) -> None:
    assert run("build", "sea.vtu", "-o", "levels", "--coarsest", "60") == 0
    said = capsys.readouterr()
    h = coarsen.load("levels/hierarchy.npz")
    assert said.err == ""
    assert f"│ {h[-1].mesh.n_points:>5} │" in said.out
    assert h == coarsen.hierarchy(coarsen.read("sea.vtu"), coarsest=60)
    names = {file.name for file in (place / "levels").iterdir()}
    assert names == {
        *(f"level_{i}.vtu" for i in range(len(h))), "levels.pvd", "levels.vtu.series", "hierarchy.npz"
    }  # fmt: skip


def test_build_takes_every_option(place: Path, capsys: Any) -> None:
    options: dict[str, Any] = {
        "factor": 1.7, "levels": 2, "coarsest": 20, "method": "function", "spacing": "quadtree", "beta": 2.5,
        "delta": 0.4, "gradation": 0.6, "features": "drop", "candidates": "all", "min_angle": 20.0,
        "feature_angle": 70.0, "backend": "rust", "threads": 1,
    }  # fmt: skip
    assert {*options, "nested"} == {field.name for field in dataclasses.fields(Options)}
    words = [word for name, value in options.items() for word in (f"--{name.replace('_', '-')}", str(value))]
    assert run("build", "sea.vtu", "-o", "levels", "--no-nested", "--json", *words) == 0
    told = json.loads(capsys.readouterr().out)
    assert coarsen.load("levels/hierarchy.npz").options == Options(**options, nested=False)
    assert [level["level"] for level in told["levels"]] == [0, 1, 2]
    assert all((place / "levels" / name).is_file() for name in told["files"])


def test_build_draws_and_reports_when_asked(place: Path) -> None:
    words = ("--plot", "--report", "--operators", "--format", "msh", "--levels", "1")
    assert run("build", "sea.vtu", "-o", "levels", *words) == 0
    found = {file.name for file in (place / "levels").iterdir()}
    assert {"levels.png", "report.html", "level_0.msh", "level_1.msh", "hierarchy.npz"} <= found
    with np.load("levels/hierarchy.npz") as archive:
        assert "prolongation:1:data" in archive.files


def test_build_into_the_current_folder_keeps_what_is_there(place: Path) -> None:
    assert run("build", "sea.vtu", "-o", ".", "--levels", "1") == 0
    assert (place / "sea.vtu").is_file()
    assert (place / "level_1.vtu").is_file()
    assert not [file for file in place.iterdir() if file.name.startswith(".coarsen")]


def test_info_of_a_mesh_and_of_a_folder(place: Path, capsys: Any) -> None:
    assert run("info", "sea.vtu", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    mesh = coarsen.read("sea.vtu")
    assert facts["nodes"] == mesh.n_points
    assert facts["fields"] == ["depth"]
    assert sum(facts["facet_tags"].values()) == len(mesh.facets)
    assert run("info", "sea.vtu") == 0
    assert f"│ {mesh.n_points} " in capsys.readouterr().out
    run("build", "sea.vtu", "-o", "levels", "--levels", "1")
    capsys.readouterr()
    for target in ("levels", "levels/hierarchy.npz"):
        assert run("info", target, "--json") == 0
        assert len(json.loads(capsys.readouterr().out)["levels"]) == 2


@pytest.mark.parametrize("words", [
    ["sea.vtu", "-o", "a.png"], ["sea.vtu", "-o", "a.svg", "--zoom", "5e4,5e4,1e4"], ["levels", "-o", "a.png"],
    ["levels", "-o", "a.pdf", "--kind", "angles"], ["levels", "-o", "a.png", "--kind", "quality"],
    ["bare", "-o", "a.png", "--kind", "similarity"],
    ["levels", "-o", "a.png", "--level", "1"], ["levels/hierarchy.npz", "-o", "a.png"], ["bare", "-o", "a.png"],
])  # fmt: skip
def test_plot_makes_one_picture(place: Path, words: list[str]) -> None:
    run("build", "sea.vtu", "-o", "levels", "--levels", "1")
    coarsen.load("levels/hierarchy.npz").write("bare")
    before = set(place.iterdir())
    assert run("plot", *words) == 0
    (made,) = set(place.iterdir()) - before
    assert made.stat().st_size > 5000
    head = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}[made.suffix]
    assert made.read_bytes().startswith(head)


def test_convert_keeps_tags_and_fields(place: Path) -> None:
    assert run("convert", "sea.vtu", "fort.14") == 0
    one, two = coarsen.read("sea.vtu"), coarsen.read("fort.14")
    assert np.array_equal(one.point_data["depth"], two.point_data["depth"])
    assert sorted(one.facet_tags) == sorted(two.facet_tags)


def test_demo_prints_a_table_and_draws(place: Path, capsys: Any) -> None:
    assert run("demo", "--nodes", "600") == 0
    said = capsys.readouterr().out
    assert all(word in said for word in ("level", "factor", "nodes", "triangles", "min angle", "similarity"))
    assert (place / "coarsen-demo.png").stat().st_size > 20_000
    assert run("demo", "--nodes", "600", "--paper", "--json", "-o", "b.png") == 0
    assert json.loads(capsys.readouterr().out)["levels"][0]["min_angle"] == 45


def test_quads_and_orphans_are_mended_when_asked_and_told(place: Path, capsys: Any) -> None:
    meshio = pytest.importorskip("meshio")
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 0]])
    meshio.Mesh(points, [("quad", [[0, 1, 2, 3]])]).write("quad.vtk")
    assert run("info", "quad.vtk") == 2
    assert "--split-quads" in capsys.readouterr().err
    assert run("info", "quad.vtk", "--split-quads") == 2
    assert "--repair" in capsys.readouterr().err
    assert run("info", "quad.vtk", "--split-quads", "--repair", "--json") == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["cells"] == 2
    assert said.err.count("\n") == 1
    assert "1 node in no cell dropped" in said.err


WRONG = [
    (["build"], "MESH"),
    (["build", "sea.vtu"], "--output"),
    (["build", "none.msh", "-o", "out"], "'none.msh' does not exist"),
    (["build", "sea.vtu", "-o", "none/out"], "folder 'none' does not exist"),
    (["build", "sea.vtu", "-o", "sea.vtu"], "is a file"),
    (["build", ".", "-o", "out"], "is a folder"),
    (["build", "empty.msh", "-o", "out"], "empty.msh"),
    (["build", "notes.txt", "-o", "out"], "no format"),
    (["build", "sea.vtu", "-o", "out", "--format", "docx"], "'format' is 'docx', expected .msh"),
    (["build", "sea.vtuu", "-o", "out"], "does not exist"),
    (["convert", "sea.vtu", "sea.mhs"], "did you mean .msh?"),
    (["build", "sea.vtu", "-o", "out", "--factor", "1"], "'factor' is 1.0"),
    (["build", "sea.vtu", "-o", "out", "--factor", "much"], "--factor"),
    (["build", "sea.vtu", "-o", "out", "--factor", "nan"], "'factor' is nan"),
    (["build", "sea.vtu", "-o", "out", "--levels", "-1"], "'levels' is -1"),
    (["build", "sea.vtu", "-o", "out", "--coarsest", "0"], "'coarsest' is 0"),
    (["build", "sea.vtu", "-o", "out", "--method", "magic"], "'method' is 'magic'"),
    (["build", "sea.vtu", "-o", "out", "--spacing", "x"], "'spacing' is 'x'"),
    (["build", "sea.vtu", "-o", "out", "--beta", "0.5"], "'beta' is 0.5"),
    (["build", "sea.vtu", "-o", "out", "--delta", "-1"], "'delta' is -1"),
    (["build", "sea.vtu", "-o", "out", "--gradation", "2"], "'gradation' is 2"),
    (["build", "sea.vtu", "-o", "out", "--features", "some"], "'features' is 'some'"),
    (["build", "sea.vtu", "-o", "out", "--candidates", "few"], "'candidates' is 'few'"),
    (["build", "sea.vtu", "-o", "out", "--min-angle", "95"], "'min_angle' is 95"),
    (["build", "sea.vtu", "-o", "out", "--feature-angle", "0"], "'feature_angle' is 0"),
    (["build", "sea.vtu", "-o", "out", "--backend", "cuda"], "'backend' is 'cuda'"),
    (["build", "sea.vtu", "-o", "out", "--threads", "0"], "'threads' is 0"),
    (["build", "sea.vtu", "-o", "out", "--fctor", "2"], "--fctor"),
    (["build", "sea.vtu", "extra", "-o", "out"], "extra"),
    (["frobnicate"], "frobnicate"),
    (["--frobnicate"], "--frobnicate"),
    (["info"], "MESH"),
    (["info", "none.msh"], "does not exist"),
    (["plot", "sea.vtu"], "--output"),
    (["plot", "sea.vtu", "-o", "a.docx"], "no picture format"),
    (["plot", "sea.vtu", "-o", "picture"], "no picture format"),
    (["plot", "sea.vtu", "-o", "none/a.png"], "does not exist"),
    (["plot", "sea.vtu", "-o", "a.png", "--kind", "x"], "'kind' is 'x'"),
    (["plot", "sea.vtu", "-o", "a.png", "--zoom", "1,2"], "'zoom' is '1,2'"),
    (["plot", "sea.vtu", "-o", "a.png", "--zoom", "1,2,0"], "half width"),
    (["plot", ".", "-o", "a.png"], "no levels"),
    (["convert", "sea.vtu"], "OUT"),
    (["convert", "sea.vtu", "a.docx"], "no format"),
    (["convert", "sea.vtu", "none/a.msh"], "does not exist"),
    (["demo", "--nodes", "3"], "'nodes' is 3"),
    (["demo", "--nodes", "100", "-o", "none/a.png"], "does not exist"),
]


@pytest.mark.parametrize(("words", "told"), WRONG, ids=[" ".join(words) for words, _ in WRONG])
def test_whatever_is_wrong_gives_one_line_status_2_and_nothing_written(
    place: Path, capsys: Any, words: list[str], told: str
) -> None:
    (place / "empty.msh").write_bytes(b"")
    (place / "notes.txt").write_text("hello")
    before = sorted(place.rglob("*"))
    assert run(*words) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("coarsen: ")
    assert told in said.err
    assert said.err.count("\n") == 1
    assert sorted(place.rglob("*")) == before


@pytest.mark.parametrize("command", COMMANDS)
def test_help_has_examples(command: str, capsys: Any) -> None:
    assert run(command, "--help") == 0
    said = capsys.readouterr().out
    assert f"coarsen {command}" in said
    assert "Examples:" in said


def test_without_a_command_help_is_shown(capsys: Any) -> None:
    assert run() == 0
    said = capsys.readouterr().out
    assert all(command in said for command in COMMANDS)
    assert run("--version") == 0
    assert capsys.readouterr().out.startswith("coarsen ")


def test_a_fault_of_ours_is_not_hidden(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("coarsen.cli.hierarchy", lambda *a, **k: {}["fault"])
    with pytest.raises(KeyError, match="fault"):
        run("build", "sea.vtu", "-o", "out")
    assert [file.name for file in place.iterdir()] == ["sea.vtu"]


def test_without_typer_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    for name in [name for name in sys.modules if name.startswith("coarsen.cli")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "typer", None)
    assert run("demo") == 2
    assert capsys.readouterr().err == (
        "coarsen: the command line needs typer and rich: pip install 'coarsen-mesh[cli]'\n"
    )


def test_without_matplotlib_demo_still_prints_and_plot_says_what_is_missing(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert run("demo", "--nodes", "300") == 0
    assert "no picture" in capsys.readouterr().out
    assert run("plot", "sea.vtu", "-o", "a.png") == 2
    assert "coarsen-mesh[plot]" in capsys.readouterr().err
    assert run("build", "sea.vtu", "-o", "out", "--plot") == 2
    assert not (place / "out").exists()


# --- as a process of its own ------------------------------------------------------------------------------------------


def spawn(*words: str, **options: Any) -> subprocess.Popen[str]:
    folder = str(Path(coarsen.__file__).parents[1])
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([folder, os.environ.get("PYTHONPATH", "")])}
    return subprocess.Popen([sys.executable, "-m", "coarsen", *words], env=env, text=True, **options)


def test_python_m_coarsen_works_and_is_silent_on_stderr_in_a_pipe(place: Path) -> None:
    process = spawn("build", "sea.vtu", "-o", "out", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0
    assert "ended:" in out
    assert err == ""
    assert "\x1b" not in out


@pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals")
def test_a_terminal_sees_a_bar_for_every_stage(place: Path) -> None:
    import pty

    gallery.crack_plate(100_000).write("plate.npz")  # long enough for the bars to be drawn
    leader, follower = pty.openpty()
    process = spawn("build", "plate.npz", "--levels", "3", "-o", "out", stdout=subprocess.DEVNULL, stderr=follower)
    os.close(follower)
    seen = b""
    while True:
        try:
            part = os.read(leader, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        seen += part
    os.close(leader)
    assert process.wait(timeout=120) == 0
    text = seen.decode()
    assert sum(stage in text for stage in ("spacing", "selection", "triangulation", "guard")) >= 2
    assert "100%" in text


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_an_interrupt_ends_in_one_line_and_leaves_nothing(place: Path) -> None:
    gallery.crack_plate(20_000).write("plate.npz")
    # a shell's background jobs, and what they start, ignore the signal
    heed = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = spawn("build", "plate.npz", "-o", "out", "--backend", "numpy", stderr=subprocess.PIPE, preexec_fn=heed)
    deadline = time.monotonic() + 60
    while not any(file.name.startswith(".coarsen") for file in place.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.02)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert err == "coarsen: interrupted; nothing was written\n"
    assert {file.name for file in place.iterdir()} == {"sea.vtu", "plate.npz"}


def test_a_reader_that_leaves_early_is_no_fault(place: Path) -> None:
    process = spawn("info", "sea.vtu", "--json", stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    assert process.stderr.read() == ""
    process.wait(timeout=60)
    process.stderr.close()
