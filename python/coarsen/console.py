"""What the command line says and shows: tables, progress bars, one line for an error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from .tables import headings, rows

if TYPE_CHECKING:
    from .multilevel import Hierarchy


def say(text: str) -> None:
    """Print a line for the user, as it is."""
    Console(soft_wrap=True, highlight=False, markup=False).print(text)


def note(text: str) -> None:
    """Print a line beside the result, on stderr."""
    Console(stderr=True, soft_wrap=True, highlight=False, markup=False).print(text, style="dim")


def complain(text: str) -> None:
    """Print one line about an error on stderr."""
    line = " ".join(text.split())
    Console(stderr=True, soft_wrap=True, highlight=False).print(Text("coarsen: ", style="bold red") + Text(line))


def levels_table(h: Hierarchy, title: str) -> Table:
    """Return the levels as a table like Table 1 of the paper."""
    table = Table(title=title, title_justify="left", title_style="bold", caption=f"ended: {h.stopped}")
    table.caption_justify = "left"
    for name in headings(h):
        table.add_column(name, justify="right", no_wrap=True)
    for row in rows(h):
        table.add_row(*row.texts())
    return table


def facts_table(facts: list[tuple[str, str]], title: str) -> Table:
    """Return names and values as a table without a head."""
    table = Table(title=title, title_justify="left", title_style="bold", show_header=False)
    table.add_column(style="dim")
    table.add_column()
    for name, value in facts:
        table.add_row(name, Text(value))
    return table


def show(table: Table) -> None:
    """Print a table, as wide as it needs to be."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, console.measure(table).maximum)
    console.print(table)


@contextmanager
def bars() -> Iterator[Callable[[str, int, int], None]]:
    """Give a function (stage, done, total) that draws a bar a stage on a terminal, and nothing in a pipe."""
    if not sys.stderr.isatty():
        yield lambda stage, done, total: None
        return
    progress = Progress(
        SpinnerColumn(finished_text="[green]✓"),
        TextColumn("{task.description}"),
        BarColumn(bar_width=36),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
    )
    tasks: dict[str, Any] = {}

    def step(stage: str, done: int, total: int) -> None:
        if stage not in tasks:
            for task in tasks.values():  # stages follow each other
                progress.update(task, completed=progress.tasks[task].total)
            tasks[stage] = progress.add_task(stage, total=max(total, 1))
        progress.update(tasks[stage], completed=done, total=max(total, 1))

    with progress:
        yield step
        for task in tasks.values():
            progress.update(task, completed=progress.tasks[task].total)
