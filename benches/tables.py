"""Tables of benches/README.md: each stands between two markers and is written by a script, never by hand."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

README = Path(__file__).with_name("README.md")


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table; numbers stand to the right."""
    lines = [list(header), *([cell if isinstance(cell, str) else f"{cell:.3g}" for cell in row] for row in rows)]
    lines.insert(1, ["---"] + ["---:"] * (len(header) - 1))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def write(name: str, text: str, readme: Path = README) -> None:
    """Replace what stands between the markers of `name` in the README.

    Raises
    ------
    ValueError
        If the README has no such markers.
    """
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    old = readme.read_text(encoding="utf-8")
    if begin not in old or end not in old:
        raise ValueError(f"{readme} has no markers of {name!r}")
    head, tail = old.partition(begin)[0], old.partition(end)[2]
    readme.write_text(f"{head}{begin}\n{text.strip()}\n{end}{tail}", encoding="utf-8")
