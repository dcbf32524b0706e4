"""A bar for every stage of a run, on stderr: with rich where it is installed, as plain text without it."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Step = Callable[[str, int, int], None]
_WIDTH = 36


@contextmanager
def progress_bar() -> Iterator[Step]:
    """Give a function (stage, done, total) that draws one bar a stage; stages come back for every level."""
    try:
        rich = importlib.import_module("rich.progress")
        console = importlib.import_module("rich.console").Console(stderr=True)
    except ImportError:
        yield from _plain()
        return
    progress = rich.Progress(
        rich.SpinnerColumn(finished_text="[green]✓"),
        rich.TextColumn("{task.description}"),
        rich.BarColumn(bar_width=_WIDTH),
        rich.TaskProgressColumn(),
        rich.TimeElapsedColumn(),
        console=console,
    )
    stages: dict[str, Any] = {}
    running = [""]

    def finish() -> None:
        if running[0]:
            progress.update(stages[running[0]], completed=1, total=1)

    def step(stage: str, done: int, total: int) -> None:
        whole = total if total > 1 else None  # of one step nobody knows how far it is: the bar moves to and fro
        if stage != running[0]:
            finish()
            running[0] = stage
            if stage in stages:  # a later level
                progress.reset(stages[stage], total=whole)
            else:
                stages[stage] = progress.add_task(stage, total=whole)
        progress.update(stages[stage], completed=done, total=whole)

    with progress:
        try:
            yield step
        except BaseException:  # leave the screen to what is said about it
            progress.live.transient = True
            raise
        finish()


def _plain() -> Iterator[Step]:
    running = [("", 1)]

    def draw(stage: str, done: int, total: int) -> None:
        full = _WIDTH * done // max(total, 1)
        sys.stderr.write(f"\r{stage:<14} [{'#' * full}{'.' * (_WIDTH - full)}] {done}/{total}")
        sys.stderr.flush()

    def finish() -> None:
        stage, total = running[0]
        if stage:
            draw(stage, total, total)
            sys.stderr.write("\n")

    def step(stage: str, done: int, total: int) -> None:
        if stage != running[0][0]:
            finish()
        running[0] = (stage, total)
        draw(stage, done, total)

    yield step
    finish()
