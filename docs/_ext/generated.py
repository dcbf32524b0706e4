"""Pages that stand elsewhere in the project are copied into the site when it is built, their pictures beside them."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from sphinx.application import Sphinx

PROJECT = Path(__file__).parents[2]
PAGES = {"benches/README.md": "benchmarks.md", "ARCHITECTURE.md": "architecture.md"}
PAGES |= {"CONTRIBUTING.md": "contributing.md", "CHANGELOG.md": "changelog.md"}


def copy_pages(app: Sphinx) -> None:
    """Copy the pages whose original is newer, and the pictures that they show."""
    folder = Path(app.srcdir) / "generated"
    folder.mkdir(exist_ok=True)
    for source, target in PAGES.items():
        page = PROJECT / source
        if not page.exists():
            continue
        text = page.read_text(encoding="utf-8")
        for picture in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", text):
            shutil.copyfile(page.parent / picture, folder / Path(picture).name)
            text = text.replace(f"({picture})", f"({Path(picture).name})")
        if not (folder / target).exists() or (folder / target).read_text(encoding="utf-8") != text:
            (folder / target).write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Copy before anything is read."""
    app.connect("builder-inited", copy_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
