"""What the documents say, done: every Python block of a page runs, in order, in an empty folder."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "docs/index.md", "docs/start.md", "docs/files.md")


@pytest.mark.parametrize("page", PAGES)
def test_python_blocks_of_a_page_run(page, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib").use("agg")
    pytest.importorskip("pyamg")
    pytest.importorskip("meshio")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    assert blocks
    exec(compile("\n".join(blocks), page, "exec"), {"__name__": "__main__"})


def test_links_between_documents_lead_somewhere():
    for page in [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *(ROOT / "benches").glob("*.md")]:
        for link in re.findall(r"\]\((?!https?:|mailto:|#)([^)#]+)", page.read_text(encoding="utf-8")):
            made_when_built = link.startswith(("gallery/", "generated/", "_pictures/"))
            assert made_when_built or (page.parent / link).exists(), f"{page.name}: {link}"


def test_commands_of_the_documents_have_options_that_exist():
    typer = pytest.importorskip("typer")
    from coarsen.cli import app

    top = typer.main.get_command(app)
    found = 0
    for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
        for line in "\n".join(blocks).splitlines():
            name, *words = shlex.split(line, comments=True) or [""]
            if name.rpartition("/")[2] != "coarsen":
                continue
            command = top.commands[words[0]] if words[0] in top.commands else top
            known = {option for param in command.params for option in param.opts + param.secondary_opts}
            assert [word for word in words if word.startswith("-") and word not in known | {"--help"}] == [], line
            found += 1
    assert found > 10
