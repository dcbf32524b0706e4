"""Write aside, then rename: whoever looks finds the whole file or folder, or none."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def aside(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a path beside `path`, with the same endings; move what was written there to `path` when all went well.

    Raises
    ------
    FileNotFoundError
        If the folder of `path` does not exist.
    """
    path = Path(path)
    with _within(path.parent) as folder:
        yield folder / path.name
        for written in sorted(folder.iterdir()):  # a format may write more than one file
            os.replace(written, path.parent / written.name)


@contextmanager
def folder_aside(path: str | os.PathLike[str], owned: tuple[str, ...] = ()) -> Iterator[Path]:
    """Give a new folder beside or in `path`; when all went well, move what it holds into `path`.

    `path` is made where it is missing. Files of an old `path` of the same names are replaced, those that match a
    pattern of `owned` removed; others stay.

    Raises
    ------
    NotADirectoryError
        If `path` is a file.
    """
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise NotADirectoryError(f"'{path}' is a file, expected a folder")
    with _within(path if path.is_dir() else path.parent) as holder:
        folder = holder / "made"
        folder.mkdir()
        yield folder
        if not path.exists():
            os.replace(folder, path)
            return
        names = {written.name for written in folder.iterdir()}
        for name in sorted(names):
            os.replace(folder / name, path / name)
        for old in [old for pattern in owned for old in path.glob(pattern)]:
            if old.name not in names and old.is_file():
                old.unlink()


@contextmanager
def _within(parent: Path) -> Iterator[Path]:
    if not parent.is_dir():
        raise FileNotFoundError(f"the folder '{parent}' does not exist")
    folder = Path(tempfile.mkdtemp(prefix=".coarsen-", dir=parent))
    folder.chmod(0o777 & ~_umask())
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
