"""What a long call says while it works: counts that make sense, bars that stand where the work does."""

from __future__ import annotations

import io
import sys

import pytest

import coarsen
from coarsen import gallery
from coarsen.progress import progress_bar

STAGES = {"domain", "spacing", "selection", "triangulation", "guard"}


def test_no_more_is_done_than_there_is():
    calls = []
    coarsen.hierarchy(gallery.crack_plate(200_000), progress=lambda *call: calls.append(call))
    assert {stage for stage, _, _ in calls} <= STAGES
    assert "spacing" in {stage for stage, _, _ in calls}
    assert all(0 <= done <= total for _, done, total in calls)
    assert max(total for _, _, total in calls) > 100_000  # nodes, where they can be counted


class Terminal(io.StringIO):
    """A stream that rich takes for a terminal."""

    def isatty(self):
        return True


def drawn(monkeypatch, *calls):
    """Return what stands on the last lines when these calls have been made."""
    pytest.importorskip("rich")
    pyte = pytest.importorskip("pyte")
    out = Terminal()
    monkeypatch.setattr(sys, "stderr", out)
    monkeypatch.setenv("TERM", "xterm-256color")
    with progress_bar() as step:
        for call in calls:
            step(*call)
    screen = pyte.Screen(100, 12)
    pyte.Stream(screen).feed(out.getvalue().replace("\n", "\r\n"))
    return [line.rstrip() for line in screen.display if line.strip()]


def test_stages_that_come_back_are_one_row_and_all_end_finished(monkeypatch):
    levels = [(stage, done, total) for _ in range(3) for stage, done, total in (("selection", 5, 9), ("guard", 0, 1))]
    lines = drawn(monkeypatch, ("domain", 0, 1), *levels)
    assert [line.split()[1] for line in lines] == ["domain", "selection", "guard"]
    assert all(line.startswith("✓") and "100%" in line for line in lines)


def test_without_rich_the_bars_are_plain_and_end_full(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rich.progress", None)
    with progress_bar() as step:
        for call in (("domain", 0, 1), ("spacing", 3, 9), ("guard", 0, 1)):
            step(*call)
    lines = [line.rpartition("\r")[2] for line in capsys.readouterr().err.split("\n")[:-1]]
    assert [line.split()[0] for line in lines] == ["domain", "spacing", "guard"]
    assert all("." not in line for line in lines)
