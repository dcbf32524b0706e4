"""The command line: ``build``, ``info``, ``plot``, ``demo``, ``convert``.

Commands raise what the library raises; :mod:`coarsen.__main__` turns it into one line on stderr and exit status 2.
"""

# no `from __future__ import annotations`: typer reads the annotations as they are

import dataclasses
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from . import options
from .console import bars, facts_table, levels_table, note, say, show
from .errors import MeshError
from .mesh import Mesh
from .multilevel import Hierarchy, hierarchy
from .options import Options
from .tables import facts_of, rows, short

EXAMPLES = """
\b
Examples:
  coarsen demo
  coarsen info coast.msh
  coarsen build coast.msh -o levels --plot
  coarsen build fort.14 -o levels --features drop --coarsest 50 --format msh
  coarsen build wing.su2 -o levels --split-quads --json > levels.json
  coarsen plot levels -o levels.png --zoom 0.5,0.5,0.1
  coarsen convert hgrid.gr3 mesh.vtu
"""

ARCHIVE = "hierarchy.npz"
PICTURE = "levels.png"
REPORT = "report.html"
KINDS = ("levels", "angles", "quality", "similarity")

app = typer.Typer(
    name="coarsen",
    help="Coarser, well-shaped triangle meshes from one fine unstructured mesh (Miller, Talmor, Teng 1997).",
    epilog="Run 'coarsen COMMAND --help' for the options of a command.",
    rich_markup_mode=None,
    no_args_is_help=False,
    pretty_exceptions_enable=False,
)


def _help(name: str) -> str:
    text = str(next(field.metadata["help"] for field in dataclasses.fields(Options) if field.name == name))
    return (text[0].upper() if text[0].isascii() else text[0]) + text[1:] + "."


def _default(name: str) -> Any:
    return next(field.default for field in dataclasses.fields(Options) if field.name == name)


def _choose(name: str, choices: tuple[str, ...]) -> Any:
    return typer.Option(
        help=_help(name), metavar="|".join(choices), autocompletion=lambda incomplete="": _start(choices, incomplete)
    )


def _start(choices: tuple[str, ...], incomplete: str) -> list[str]:
    return [choice for choice in choices if choice.startswith(incomplete)]


MeshFile = Annotated[Path, typer.Argument(metavar="MESH", help="The mesh: any format coarsen.read knows.")]
SplitQuads = Annotated[bool, typer.Option("--split-quads", help="Cut quadrilaterals along their shorter diagonals.")]
Repair = Annotated[bool, typer.Option("--repair", help="Drop orphans, doubles and empty cells, and say so.")]
Tags = Annotated[
    str | None,
    typer.Option("--tags", metavar="NAME", help="Cell data (of VTK, XDMF, …) that are the tags of the cells."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]


@app.callback(invoke_without_command=True)
def _top(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.", is_eager=True)] = False,
) -> None:
    if version:
        from . import __version__

        say(f"coarsen {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        say(context.get_help())
        raise typer.Exit


def _read(path: Path, split_quads: bool, repair: bool, tags: str | None) -> Mesh:
    from .io.files import read_and_tell

    mesh, told = read_and_tell(path, split_quads=split_quads, repair=repair, tags=tags)
    if told:
        note(f"repaired {path.name}: {' '.join(told.split())}")
    return mesh


@app.command(epilog=EXAMPLES)
def build(
    mesh: MeshFile,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the levels.")],
    factor: Annotated[float, typer.Option(help=_help("factor"))] = _default("factor"),
    levels: Annotated[int | None, typer.Option(help=_help("levels"))] = _default("levels"),
    coarsest: Annotated[int, typer.Option(help=_help("coarsest"))] = _default("coarsest"),
    nested: Annotated[bool, typer.Option("--nested/--no-nested", help=_help("nested"))] = _default("nested"),
    method: Annotated[str, _choose("method", options.METHODS)] = _default("method"),
    spacing: Annotated[str, _choose("spacing", options.SPACINGS)] = _default("spacing"),
    beta: Annotated[float, typer.Option(help=_help("beta"))] = _default("beta"),
    delta: Annotated[float, typer.Option(help=_help("delta"))] = _default("delta"),
    gradation: Annotated[float, typer.Option(help=_help("gradation"))] = _default("gradation"),
    features: Annotated[str, _choose("features", options.FEATURES)] = _default("features"),
    candidates: Annotated[str, _choose("candidates", options.CANDIDATES)] = _default("candidates"),
    min_angle: Annotated[float | None, typer.Option(help=_help("min_angle"))] = _default("min_angle"),
    feature_angle: Annotated[float, typer.Option(help=_help("feature_angle"))] = _default("feature_angle"),
    backend: Annotated[str, _choose("backend", options.BACKENDS)] = _default("backend"),
    threads: Annotated[int | None, typer.Option(help=_help("threads"))] = _default("threads"),
    format: Annotated[str, typer.Option("--format", help="Format of the levels: vtu, vtk, msh, npz, …")] = "vtu",
    operators: Annotated[bool, typer.Option("--operators", help=f"Keep the prolongations in {ARCHIVE}.")] = False,
    plot: Annotated[bool, typer.Option("--plot", help=f"Draw the levels into {PICTURE}.")] = False,
    report: Annotated[bool, typer.Option("--report", help=f"Write a page about the hierarchy, {REPORT}.")] = False,
    split_quads: SplitQuads = False,
    repair: Repair = False,
    tags: Tags = None,
    json_: Json = False,
) -> None:
    """Build coarser and coarser meshes from a file.

    The folder gets one file a level, a series that ParaView opens, and the whole hierarchy in one archive.
    """
    names = [field.name for field in dataclasses.fields(Options)]
    given = {name: value for name, value in locals().items() if name in names}
    Options.from_kwargs(**given)  # before anything is read
    from .io import save_hierarchy, write_hierarchy
    from .io.aside import folder_aside
    from .io.hierarchies import family_of_format

    family_of_format(format)
    if plot or report:
        _need_matplotlib()
    with folder_aside(output, (f"level_*.{format.lstrip('.')}",)) as folder, bars() as progress:
        step = progress or (lambda *_: None)
        began = time.perf_counter()
        step("reading", 0, 1)
        read = _read(mesh, split_quads, repair, tags)
        loaded = time.perf_counter()
        h = hierarchy(read, progress=progress or False, **given)
        built = time.perf_counter()
        step("measuring", 0, 1)
        rows(h)  # before anything stands in its place, so that an interrupt leaves nothing
        measured = time.perf_counter()
        files = []
        parts = 2 + plot + report
        step("writing", 0, parts)
        files += [file.name for file in write_hierarchy(h, folder, format)]
        step("writing", 1, parts)
        save_hierarchy(h, folder / ARCHIVE, operators=operators)
        files.append(ARCHIVE)
        if plot:
            step("writing", 2, parts)
            _save_picture(lambda: _levels_picture(h, None), folder / PICTURE)
            files.append(PICTURE)
        if report:
            from .page import report as write_report

            step("writing", parts - 1, parts)
            write_report(h, folder / REPORT, title=mesh.name)
            files.append(REPORT)
        step("writing", parts, parts)
    if json_:
        seconds = {"read": loaded - began, "build": built - loaded}
        seconds |= {"measure": measured - built, "write": time.perf_counter() - measured}
        _print_json({"mesh": str(mesh), "folder": str(output), "files": files, **_as_json(h), "seconds": seconds})
        return
    show(levels_table(h, f"{mesh.name} → {output}"))
    say(f"{len(files)} files in {output}: {', '.join(files[:2])}, …, {files[-1]}; built in {built - loaded:.2f} s")


@app.command(epilog=EXAMPLES)
def info(
    mesh: Annotated[Path, typer.Argument(metavar="MESH_OR_FOLDER", help="A mesh, or what 'coarsen build' made.")],
    split_quads: SplitQuads = False,
    repair: Repair = False,
    tags: Tags = None,
    json_: Json = False,
) -> None:
    """Say what a mesh or a hierarchy is.

    Of a mesh: counts, angles, edges, area, boundary, tags and fields. Of a hierarchy: the table of its levels.
    """
    h = _hierarchy_at(mesh)
    if h is not None:
        _print_json({"mesh": str(mesh), **_as_json(h)}) if json_ else show(levels_table(h, str(mesh)))
        return
    facts = facts_of(_read(mesh, split_quads, repair, tags))
    if json_:
        _print_json({"mesh": str(mesh), **facts})
        return
    for which in ("facet", "cell"):  # in the table a name stands with its tag
        names = facts.pop(f"{which}_names", {})
        if f"{which}_tags" in facts:
            counts = facts[f"{which}_tags"].items()
            facts[f"{which}_tags"] = {f"{tag} {names[tag]}" if tag in names else tag: count for tag, count in counts}
    show(facts_table([(name.replace("_", " "), short(value)) for name, value in facts.items()], mesh.name))


@app.command(epilog=EXAMPLES)
def plot(
    mesh: Annotated[Path, typer.Argument(metavar="MESH_OR_FOLDER", help="A mesh, or what 'coarsen build' made.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="PNG", help="The picture: .png, .pdf or .svg.")],
    kind: Annotated[str, typer.Option(metavar="|".join(KINDS), help="What to draw of a hierarchy.")] = "levels",
    level: Annotated[int | None, typer.Option(help="Draw this level alone: kept nodes, spacing as colour.")] = None,
    zoom: Annotated[str | None, typer.Option(metavar="X,Y,HALF", help="Show the square about X, Y too.")] = None,
    split_quads: SplitQuads = False,
    repair: Repair = False,
    tags: Tags = None,
) -> None:
    """Draw a mesh, or the levels of a hierarchy side by side."""
    if kind not in KINDS:
        raise ValueError(f"'kind' is {kind!r}, expected one of {', '.join(map(repr, KINDS))}")
    window = _window(zoom)
    _need_matplotlib()
    from .plot import plot_angles, plot_level, plot_mesh, plot_quality, plot_similarity

    if mesh.is_dir() or _holds_hierarchy(mesh):
        h: Any = _hierarchy_at(mesh) or _read_levels(mesh)
        if level is not None:
            if not 0 <= level < len(h):
                raise ValueError(f"'level' is {level}, expected 0 to {len(h) - 1}")
            over = h[level - 1].mesh if level else None
            _save_picture(lambda: plot_level(h[level], over=over, window=window).figure, output)
            say(f"picture: {output}")
            return
        draw = {
            "levels": lambda: _levels_picture(h, window),
            "angles": lambda: plot_angles(h),
            "quality": lambda: plot_quality(h),
            "similarity": lambda: plot_similarity(h),
        }
        _save_picture(draw[kind], output)
    else:
        drawn = _read(mesh, split_quads, repair, tags)
        _save_picture(lambda: plot_mesh(drawn, window=window).figure, output)
    say(f"picture: {output}")


def _window(zoom: str | None) -> tuple[float, float, float] | None:
    if zoom is None:
        return None
    try:
        x, y, half = (float(word) for word in zoom.split(","))
    except ValueError:
        raise ValueError(f"'zoom' is {zoom!r}, expected three numbers X,Y,HALF") from None
    if not half > 0:
        raise ValueError(f"'zoom' has the half width {half:g}, expected a positive one")
    return x, y, half


@app.command(epilog=EXAMPLES)
def convert(
    mesh: MeshFile,
    output: Annotated[Path, typer.Argument(metavar="OUT", help="The new file; the end of its name tells the format.")],
    split_quads: SplitQuads = False,
    repair: Repair = False,
    tags: Tags = None,
) -> None:
    """Write a mesh in another format.

    Tags, boundaries and nodal fields go along where the format has them, and so do the names of tags.
    """
    from .io.files import convert as convert_file

    read, told = convert_file(mesh, output, split_quads=split_quads, repair=repair, tags=tags)
    if told:
        note(f"repaired {mesh.name}: {' '.join(told.split())}")
    say(f"{output}: {read.n_points} nodes, {read.n_cells} cells")


@app.command(epilog=EXAMPLES)
def demo(
    nodes: Annotated[int, typer.Option("--nodes", "-n", help="Nodes of the crack plate.")] = 5120,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="PNG", help="The picture.")] = Path(
        "coarsen-demo.png"
    ),
    paper: Annotated[bool, typer.Option("--paper", help="The paper's settings: β 3, gradation 1, plain, all.")] = False,
    json_: Json = False,
) -> None:
    """Coarsen a plate with a crack, the paper's example.

    Prints a table like the paper's Table 1 and draws the levels as in its Figure 5.
    """
    from .gallery import crack_plate

    if nodes < 12:
        raise ValueError(f"'nodes' is {nodes}, expected at least 12")
    plate = crack_plate(nodes)
    began = time.perf_counter()
    settings: dict[str, Any] = (
        {"beta": 3.0, "gradation": 1.0, "features": "plain", "candidates": "all"} if paper else {}
    )
    with bars() as progress:
        h = hierarchy(plate, progress=progress or False, **settings)
    seconds = time.perf_counter() - began
    title = f"A plate with a crack, {plate.n_points} nodes, coarsened in {seconds:.2f} s"
    drawn = _have_matplotlib()
    if drawn:
        _save_picture(lambda: _levels_picture(h, (0.5, 0.5, 0.06)), output)
    if json_:
        _print_json(
            {"mesh": "crack_plate", "picture": str(output) if drawn else None, **_as_json(h), "seconds": seconds}
        )
        return
    show(levels_table(h, title))
    say(f"picture: {output}" if drawn else "no picture: that needs matplotlib (pip install 'coarsen-mesh[plot]')")


# --- parts -----------------------------------------------------------------------------------------------------------


def _holds_hierarchy(path: Path) -> bool:
    from .io.hierarchies import holds_hierarchy

    return path.suffix.lower() == ".npz" and path.is_file() and holds_hierarchy(path)


def _hierarchy_at(path: Path) -> Hierarchy | None:
    """Return the hierarchy of a folder or an archive, or None for a mesh or a folder with levels alone."""
    from .io import load_hierarchy

    if path.is_dir():
        return load_hierarchy(path / ARCHIVE) if (path / ARCHIVE).is_file() else None
    return load_hierarchy(path) if _holds_hierarchy(path) else None


def _read_levels(folder: Path) -> Any:
    from .io.hierarchies import read_levels

    return read_levels(folder)


def _have_matplotlib() -> bool:
    try:
        _need_matplotlib()
    except ImportError:
        return False
    return True


def _need_matplotlib() -> None:
    try:
        import matplotlib
    except ImportError:
        raise ImportError("pictures need matplotlib: pip install 'coarsen-mesh[plot]'") from None
    matplotlib.use("Agg")


def _levels_picture(h: Any, window: tuple[float, float, float] | None) -> Any:
    from .plot import plot_hierarchy

    return plot_hierarchy(h, zoom=window)


def _save_picture(draw: Callable[[], Any], path: Path) -> None:
    from matplotlib import pyplot

    from .io.aside import aside

    kinds = pyplot.figure().canvas.get_supported_filetypes()
    pyplot.close("all")
    if path.suffix.lower().lstrip(".") not in kinds:
        raise MeshError(f"'{path.name}': no picture format is known by this ending, expected .png, .pdf or .svg")
    with aside(path) as place:
        figure = draw()
        figure.savefig(place, dpi=160)
        pyplot.close(figure)


def _as_json(h: Hierarchy) -> dict[str, Any]:
    return {"stopped": h.stopped, "levels": [dataclasses.asdict(row) for row in rows(h)]}


def _print_json(value: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(value, indent=2, ensure_ascii=False) + "\n")
