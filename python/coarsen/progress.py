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
    """Give a function (stage, done, total) that draws one bar a stage; stages follow each other."""
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
    totals: dict[str, int] = {}

    def finish() -> None:
        for stage, task in stages.items():
            progress.update(task, completed=totals[stage])
            progress.stop_task(task)

    def step(stage: str, done: int, total: int) -> None:
        totals[stage] = max(total, 1)
        if stage not in stages:
            finish()
            stages[stage] = progress.add_task(stage, total=totals[stage])
        progress.update(stages[stage], completed=done, total=totals[stage])

    with progress:
        try:
            yield step
        except BaseException:  # leave the screen to what is said about it
            progress.live.transient = True
            raise
        finish()


def _plain() -> Iterator[Step]:
    last = [""]

    def step(stage: str, done: int, total: int) -> None:
        if last[0] and last[0] != stage:
            sys.stderr.write("\n")
        last[0] = stage
        full = _WIDTH * done // max(total, 1)
        sys.stderr.write(f"\r{stage:<24} [{'#' * full}{'.' * (_WIDTH - full)}] {done}/{total}")
        sys.stderr.flush()

    yield step
    if last[0]:
        sys.stderr.write("\n")
