"""Tables and the page: every level in both, one file without others, and a browser that shows it."""

from __future__ import annotations

import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import coarsen
from coarsen import gallery
from coarsen.multilevel import Hierarchy
from coarsen.tables import rows

pytest.importorskip("matplotlib").use("Agg")

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def h() -> Hierarchy:
    """The paper's example, small."""
    return coarsen.hierarchy(gallery.crack_plate(1200))


@pytest.fixture(scope="module")
def page(h: Hierarchy, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its page."""
    return coarsen.report(h, tmp_path_factory.mktemp("page") / "report.html", title="A plate <with> a crack")


def test_the_summary_has_a_line_for_every_level_and_says_why_it_ended(h: Hierarchy) -> None:
    lines = h.summary().splitlines()
    assert lines[0].split()[:4] == ["level", "factor", "nodes", "triangles"]
    assert len({len(line) for line in lines[:-1]}) == 1
    for i, (line, level) in enumerate(zip(lines[2:-1], h, strict=True)):
        assert line.split()[:4] == [str(i), f"{level.factor:g}", str(level.mesh.n_points), str(level.mesh.n_cells)]
        assert f"{level.quality.min_angle:.2f}°" in line
    assert lines[-1] == f"ended: {h.stopped}"


def test_rows_hold_the_local_similarity_of_the_check(h: Hierarchy) -> None:
    found = [row.similarity for row in rows(h)]
    assert found[0] is None
    assert found[1:] == [one.similarity for one in h.check().levels[1:]]
    assert min(found[1:]) >= 1


def test_a_line_has_edges_and_no_angles() -> None:
    h = coarsen.hierarchy(gallery.line(60, growth=1.2), coarsest=8)
    text = h.summary()
    assert "edges" in text.splitlines()[0]
    assert all(row.min_angle is None for row in rows(h))


class Reader(HTMLParser):
    """Collects tags, addresses and table cells."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.addresses: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.addresses += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in ("meta", "img", "br", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_the_page_is_well_formed_and_needs_no_other_file(page: Path, h: Hierarchy) -> None:
    reader = Reader()
    reader.feed(page.read_text(encoding="utf-8"))
    assert reader.open == []
    assert len(reader.addresses) >= 4
    assert all(address.startswith("data:image/png;base64,") for address in reader.addresses)
    text = " ".join(reader.texts)
    assert "A plate <with> a crack" in text
    assert "Local similarity" in reader.texts
    assert "None" not in reader.texts
    for level in h:
        assert str(level.mesh.n_cells) in reader.texts
    assert h.stopped in text
    assert not re.search(r"https?://", page.read_text(encoding="utf-8"))


def test_the_page_of_a_line_and_of_one_level_is_made_too(tmp_path: Path) -> None:
    coarsen.report(coarsen.hierarchy(gallery.line(60)), tmp_path / "line.html")
    coarsen.report(coarsen.hierarchy(gallery.square(100), levels=0), tmp_path / "one.html")
    assert {file.name for file in tmp_path.iterdir()} == {"line.html", "one.html"}


@pytest.mark.skipif(BROWSER is None, reason="no chromium")
def test_a_browser_shows_the_page(page: Path, tmp_path: Path) -> None:
    shot = tmp_path / "shot.png"
    subprocess.run(
        [
            str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1200,3600",
            f"--user-data-dir={tmp_path / 'profile'}", f"--screenshot={shot}", page.as_uri(),
        ],
        check=True, capture_output=True, timeout=120,
    )  # fmt: skip
    from matplotlib.image import imread

    image = imread(shot)[..., :3]
    assert image.shape[1] == 1200
    dark = (image.max(axis=2) < 0.5).mean(axis=1)  # text, lines and pictures in every stretch of the page
    stretches = [dark[k : k + 300].max() for k in range(0, 2400, 300)]
    assert min(stretches) > 0
    blue = (image[..., 2] > image[..., 0] + 0.3).any(axis=1)
    red = (image[..., 0] > image[..., 1] + 0.4).any(axis=1)
    assert blue.sum() > 100  # histograms
    assert red.sum() > 20  # the slit
    assert np.all(image[:20, :20] == 1)  # a margin


def test_a_hierarchy_that_the_domain_holds_up_says_what_goes_on() -> None:
    sea = gallery.coast(600)
    kept, dropped = coarsen.hierarchy(sea, coarsest=1), coarsen.hierarchy(sea, coarsest=1, features="drop")
    assert "features='auto' or 'drop' goes on" in kept.summary()
    assert dropped[-1].mesh.n_cells < kept[-1].mesh.n_cells
    assert "features=" not in dropped.stopped
