"""What the command line says and shows: tables, progress bars, one line for an error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from .progress import progress_bar
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
    Console(stderr=True, soft_wrap=True, highlight=False).print(Text.assemble(("coarsen: ", "bold red"), line))


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
def bars() -> Iterator[Callable[[str, int, int], None] | None]:
    """Give a function that draws a bar a stage on a terminal, and None in a pipe."""
    if not sys.stderr.isatty():
        yield None
        return
    with progress_bar() as step:
        yield step
