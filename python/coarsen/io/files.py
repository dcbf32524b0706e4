"""``read`` and ``write``: which family a file belongs to, by the end of its name."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from ..errors import MeshError
from ..mesh import Mesh
from . import adcirc, bridge, npz, selafin, su2, triangle, ugrid, vtu
from .aside import aside
from .draft import Draft, drafted

log = logging.getLogger("coarsen")


@dataclass(frozen=True)
class Family:
    """A family of file formats: what it is called, its reader and its writer."""

    name: str
    endings: tuple[str, ...]
    read: Callable[[Path], Draft]
    write: Callable[[Draft, Path], None]


FAMILIES = (
    Family("NumPy archive", (".npz",), npz.read_npz, npz.write_npz),
    Family("ADCIRC grid", (".14", ".grd"), adcirc.read_grid, adcirc.write_grid),
    Family("SCHISM grid", (".gr3", ".ll"), adcirc.read_grid, adcirc.write_grid),
    Family("TELEMAC Selafin", (".slf", ".srf"), selafin.read_selafin, selafin.write_selafin),
    Family("UGRID NetCDF", (".nc",), ugrid.read_ugrid, ugrid.write_ugrid),
    Family(
        "Triangle",
        (".node", ".ele", ".poly"),
        triangle.read_triangle,
        triangle.write_triangle,
    ),
    Family("SU2", (".su2",), su2.read_su2, su2.write_su2),
    Family("VTK XML", (".vtu",), bridge.read_through_meshio, vtu.write_vtu),
)


_USUAL = (".msh", ".vtu", ".vtk", ".xdmf", ".su2", ".med", ".nc", ".14", ".grd", ".gr3", ".slf", ".node", ".npz")
_LISTS = {True: "writable", False: "readable"}


def family_of(path: Path, *, write: bool) -> Family:
    """Return the family that the end of a file's name tells.

    Raises
    ------
    MeshError
        If no format is known by it.
    """
    name = path.name.lower()
    for family in FAMILIES:
        if name.endswith(family.endings) or name == "fort.14":
            if name != "fort.14" or ".14" in family.endings:
                return family
    endings = bridge.extensions(write=write)
    if not endings:
        bridge.meshio()  # says how to install it
    if any(name.endswith(ending) for ending in endings):
        return Family(
            "meshio",
            tuple(endings),
            bridge.read_through_meshio,
            bridge.write_through_meshio,
        )
    known = writable() if write else readable()
    usual = [ending for ending in _USUAL if ending in known]
    close = get_close_matches(path.suffix.lower(), known, 1)
    raise MeshError(
        f"'{path.name}': no format is known by this ending{f' (did you mean {close[0]}?)' if close else ''}, expected "
        f"{', '.join(usual)} or one of {len(known) - len(usual)} more, which coarsen.io.{_LISTS[write]}() lists"
    )


def readable() -> list[str]:
    """Return endings of the files :func:`read` takes, sorted."""
    own = {ending for family in FAMILIES for ending in family.endings}
    return sorted(own | set(bridge.extensions()))


def writable() -> list[str]:
    """Return endings of the files :func:`write` makes, sorted."""
    own = {ending for family in FAMILIES for ending in family.endings}
    return sorted(own | set(bridge.extensions(write=True)))


def read_draft(path: str | os.PathLike[str], tags: str | None = None) -> Draft:
    """Read what a file says without judging it, with the cell data `tags` as tags.

    Raises
    ------
    MeshError
        If the file is not of the format its name says.
    FileNotFoundError
        If there is none.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"'{path}' does not exist")
    if path.is_dir():
        raise IsADirectoryError(
            f"'{path}' is a folder, expected a mesh file (coarsen.load takes a hierarchy's archive)"
        )
    family = family_of(path, write=False)
    try:
        if tags is None:
            return family.read(path)
        if family.read is not bridge.read_through_meshio:
            raise MeshError(f"'tags' is {tags!r}, but a file of this kind ({family.name}) has no cell data by name")
        return bridge.read_through_meshio(path, tags)
    except (ImportError, MemoryError):
        raise
    except MeshError as error:
        if path.stem in str(error):  # a format of several files names the one that is wrong
            raise
        raise MeshError(f"'{path.name}': {error}") from None
    except OSError as error:
        raise MeshError(f"'{path.name}': cannot be read as {family.name}: {error}") from None
    except (
        ValueError,
        KeyError,
        IndexError,
        TypeError,
        EOFError,
        OverflowError,
        AttributeError,
    ) as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise MeshError(f"'{path.name}': not a readable {family.name} file: {reason}") from None


def read(
    path: str | os.PathLike[str], *, split_quads: bool = False, repair: bool = False, tags: str | None = None
) -> Mesh:
    """Read a mesh from a file; the end of its name tells the format.

    Parameters
    ----------
    path : path
        Anything meshio reads (``.msh``, ``.vtu``, ``.vtk``, ``.xdmf``, ``.obj``, ``.med``, …), ADCIRC ``fort.14`` and
        ``.grd``, SCHISM ``.gr3``, TELEMAC ``.slf``, UGRID ``.nc``, Triangle's ``.node``/``.ele``/``.poly``, SU2, and
        ``.npz``. Tags, boundaries and nodal fields come along; a constant height is dropped.
    split_quads : bool
        Cut quadrilaterals along their shorter diagonals; without it they raise.
    repair : bool
        Mend what :meth:`coarsen.Mesh.repaired` can; what it did is logged at level INFO of the logger ``coarsen``.
    tags : str, optional
        Name of the cell data (of VTK, XDMF, …) that are the tags, where it is none of the usual ones.

    Raises
    ------
    MeshError
        If the file cannot be understood or breaks a rule of a legal mesh; the message starts with the file's name.
    FileNotFoundError
        If there is no such file.
    """
    return read_and_tell(path, split_quads=split_quads, repair=repair, tags=tags)[0]


def read_and_tell(
    path: str | os.PathLike[str], *, split_quads: bool = False, repair: bool = False, tags: str | None = None
) -> tuple[Mesh, str]:
    """Do as :func:`read` does, and tell what a repair did."""
    mesh, told = _judged(read_draft(path, tags), path, split_quads=split_quads, repair=repair)
    log.info("read %s: %r", path, mesh)
    return mesh, told


def _judged(draft: Draft, path: str | os.PathLike[str], *, split_quads: bool, repair: bool) -> tuple[Mesh, str]:
    try:
        return draft.mesh(split_quads=split_quads, repair=repair)
    except MeshError as error:
        text = str(error)
        if not repair and "Mesh.repaired" in text:
            text += ": read(path, repair=True) or --repair"
        named = MeshError(f"'{Path(path).name}': {text}")
        named.__dict__.update(error.__dict__)  # rule, array, index
        raise named from None


def write(mesh: Mesh, path: str | os.PathLike[str]) -> None:
    """Write a mesh to a file; the end of its name tells the format.

    The file is written aside and renamed: it is there whole or not at all.

    Raises
    ------
    MeshError
        If no format is known by this ending, or the format cannot hold the mesh.
    FileNotFoundError
        If the folder does not exist.
    """
    write_draft(drafted(mesh), path)


def convert(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    split_quads: bool = False,
    repair: bool = False,
    tags: str | None = None,
) -> tuple[Mesh, str]:
    """Read one file and write another.

    Returns
    -------
    mesh, told : Mesh, str
        What was written, and what a repair did.
    """
    family_of(Path(target), write=True)
    mesh, told = read_and_tell(source, split_quads=split_quads, repair=repair, tags=tags)
    write(mesh, target)
    return mesh, told


def write_draft(draft: Draft, path: str | os.PathLike[str]) -> None:
    """Do as :func:`write` does, from a draft."""
    path = Path(path)
    family = family_of(path, write=True)
    if path.is_dir():
        raise IsADirectoryError(f"'{path}' is a folder, expected a file name")
    with aside(path) as place:
        family.write(draft, place)
    log.info("wrote %s: %r", path, draft)
