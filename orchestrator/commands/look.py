"""`auv-fmu plot`, `view` and `animate`: looking at runs."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from orchestrator.commands.options import (
    add_options,
    add_set,
    add_system,
    read_system,
    request,
    status,
)
from orchestrator.commands.streams import OK, describe, say, show
from orchestrator.cosim import Observer
from orchestrator.figures.drawing import one_figure, plot, save, told_apart, wanted_columns
from orchestrator.figures.film import FILMS, Film, animate, default_ending
from orchestrator.figures.run_figures import FIGURES, main_figure
from orchestrator.figures.style import FIGURE_WIDTH, Drawn, Look
from orchestrator.figures.visible import VisibleRows
from orchestrator.machine.errors import InputError
from orchestrator.runs.folder import VIEW, replace_files
from orchestrator.runs.preparation import prepare
from orchestrator.runs.progress import Progress
from orchestrator.runs.request import Files, Request
from orchestrator.runs.result import (
    METRICS,
    companion_tables,
    read_metrics,
    read_record,
    read_result,
    table_in,
)
from orchestrator.vehicle.signals import Loop

#: Default scenario of a live page.
_OPENED = "fig4"

#: Formats of a plot.
_PLOTS = (".png", ".svg", ".pdf")


def add_plot(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu plot`."""
    describe(
        parser,
        "Plot signals of stored results over time, or with --figure draw the figure of a scenario "
        "again, for example for a paper. Several results share the axes.",
        "plot results/fig5 --figure --width 3.5 --size 8 --out fig5.pdf",
    )
    parser.add_argument(
        "what",
        nargs="+",
        metavar="RESULT|PATTERN",
        help="result folders or tables, and patterns of signals such as plant.y.*; default "
        "patterns: errors, commands and estimates",
    )
    parser.add_argument(
        "--figure", nargs="?", const="", metavar="NAME",
        help="after the results: draw, instead of signals, the figure of the scenario with the run "
        f"that it is compared with, or another: {', '.join(FIGURES)}",
    )  # fmt: skip
    parser.add_argument("--title", default="", metavar="TEXT", help="heading; default: none")
    parser.add_argument(
        "--label", action="append", default=[], metavar="NAME",
        help="name of a run in the legend; repeat it for each run, in their order",
    )  # fmt: skip
    parser.add_argument(
        "--width", type=float, metavar="IN",
        help=f"width in inches, such as 3.5 for a column; default: {FIGURE_WIDTH:g}",
    )  # fmt: skip
    parser.add_argument(
        "--font", default="", metavar="NAME",
        help="font, such as serif or 'Times New Roman'; default: DejaVu Sans",
    )  # fmt: skip
    parser.add_argument("--size", type=float, metavar="PT", help="size of texts; default: 10")
    parser.add_argument(
        "--style", default="", metavar="FILE.mplstyle",
        help="style of matplotlib, or the name of one, applied over auv_fmu.figures; default: none",
    )  # fmt: skip
    _add_file(parser, "image to write: .png, .svg or .pdf; default: plot.png", Path("plot.png"))
    parser.set_defaults(action=_plot)


def add_view(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu view`."""
    describe(
        parser,
        "Write one self-contained page that plays a stored result: the paths of its vehicles in "
        "3D, and signals over time.",
        "view results/fig4",
    )
    parser.add_argument("result", type=Path, metavar="RESULT", help="result folder or table")
    _add_file(parser, f"page to write: .html; default: {VIEW} next to the table")
    parser.set_defaults(action=_view)


def add_live(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu live`."""
    describe(
        parser,
        "Write one self-contained page in which the closed loop runs in the browser: change gains, "
        "limits, noise or the start, and the figures follow.",
        "live fig5 --out live.html",
    )
    parser.add_argument(
        "scenario",
        nargs="?",
        default=_OPENED,
        metavar="SCENARIO|FILE.toml",
        help="scenario that the page opens with, made of components in the language; the page also "
        f"offers every scenario of `auv-fmu list`; default: {_OPENED}",
    )
    _add_file(parser, "page to write: .html; default: SCENARIO-live.html")
    parser.set_defaults(action=_live)


def add_animate(parser: argparse.ArgumentParser) -> None:
    """Add the options of `auv-fmu animate`."""
    describe(
        parser,
        "Run a scenario and write a film of the vehicle with its errors and commands; for several "
        "vehicles: error norms and smallest distance.",
        "animate fig4 --out fig4.gif",
    )
    add_system(parser)
    add_options(parser, Request, "strict", "stop_time", "step", "order", "kind")
    add_set(parser)
    video, picture = FILMS[".mp4"], FILMS[".gif"]
    sizes = " and ".join("{}x{} of {}".format(*film.size, ending) for ending, film in FILMS.items())
    parser.add_argument(
        "--fps", type=int, metavar="N",
        help=f"number of frames per second; default: {video.fps} of .mp4 and {picture.fps} of .gif",
    )  # fmt: skip
    parser.add_argument(
        "--size", type=_size, metavar="WIDTHxHEIGHT",
        help=f"size of the picture in pixels; default: {sizes}",
    )  # fmt: skip
    parser.add_argument(
        "--speed", type=float, metavar="X",
        help="seconds of the run in a second of the film; default: 1 of .mp4, which is real time; "
        "a .gif lasts 10 s",
    )  # fmt: skip
    _add_file(
        parser,
        "film to write: .mp4 or .gif; default: results/SCENARIO.mp4, or .gif where ffmpeg is not "
        "installed",
    )
    parser.set_defaults(action=_animate)


def _size(text: str) -> tuple[int, int]:
    """Read a width and a height with an x between them."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT")
    return int(width), int(height)


def _add_file(parser: argparse.ArgumentParser, text: str, default: Path | None = None) -> None:
    parser.add_argument("--out", type=Path, metavar="FILE", default=default, help=text)
    add_options(parser, Files, "force")


def _plot(options: argparse.Namespace) -> int:
    if options.out.suffix not in _PLOTS:
        raise InputError(f"{options.out}: must end with {', '.join(_PLOTS[:-1])} or {_PLOTS[-1]}")
    paths = [Path(text) for text in options.what if _is_there(text)]
    patterns = [text for text in options.what if not _is_there(text)]
    if not paths:
        raise InputError(f"{patterns[0]}: no such result; give the folder or the table of a run")
    look = Look(options.width, options.font, options.size, options.style)
    if options.figure is None:
        columns = partial(wanted_columns, patterns=patterns)
        runs = [read_result(path, columns) for path in paths]
        runs = told_apart(runs, paths, options.label)
        figure = plot(runs, patterns, options.title, look)
    else:
        if patterns:
            raise InputError(f"{patterns[0]}: no such result; with --figure there are no patterns")
        figure = _figure_of(paths, options, look)
    with _written(options.out, options.force) as folder:
        save(figure, folder / options.out.name)
    return OK


def _figure_of(paths: Sequence[Path], options: argparse.Namespace, look: Look) -> Figure:
    """Draw the figure of a scenario, with the runs that a single result is compared with."""
    files = [table_in(path) for path in paths]
    if len(files) == 1:
        files += companion_tables(files[0])
    runs = told_apart([read_result(file) for file in files], files, options.label)
    record = read_record(files[0])
    name = options.figure or main_figure(str(record.get("figure", "tracking")), runs[0].loops)
    return one_figure(name, options.title, runs, look=look)


def _is_there(text: str) -> bool:
    """Tell whether there is such a file or folder."""
    with suppress(OSError):
        return Path(text).exists()
    return False


def _view(options: argparse.Namespace) -> int:
    # Only this command needs it.
    from orchestrator.live.view import Stored, view_page  # noqa: PLC0415

    file = table_in(options.result)
    out = options.out or file.with_name(VIEW)
    if out.suffix != ".html":
        raise InputError(f"{out}: must end with .html")
    files = [file, *companion_tables(file)[:1]]
    runs = told_apart([read_result(table, _viewed) for table in files], files)
    record = read_record(file)
    title = str(record.get("title") or runs[0].label)
    # A title may name all runs that a scenario compares.
    if (label := record.get("label")) and len(files) == 1:
        title += f" (shown: {label})"
    indices = [table.with_name(METRICS) for table in files]
    stored = [
        Stored(run, read_metrics(path) if path.is_file() else {})
        for run, path in zip(runs, indices, strict=True)
    ]
    try:
        text = view_page(title, stored, say)
    except InputError as error:
        raise InputError(f"{options.result}: {error}") from error
    with _written(out, options.force) as folder:
        (folder / out.name).write_text(text, encoding="utf-8")
    return OK


def _viewed(columns: Sequence[str], loops: Sequence[Loop]) -> Collection[str]:
    """Choose the columns whose extremes are kept: the drawn ones of vehicles, or all."""
    drawn = {name for loop in loops for name in loop.drawn()}
    return drawn if drawn.intersection(columns) else columns


def _live(options: argparse.Namespace) -> int:
    # Only this command needs them.
    from orchestrator.live.presets import live_page  # noqa: PLC0415

    out = options.out or Path(f"{Path(options.scenario).stem}-live.html")
    if out.suffix != ".html":
        raise InputError(f"{out}: must end with .html")
    text = live_page(options.scenario, say)
    with _written(out, options.force) as folder:
        (folder / out.name).write_text(text, encoding="utf-8")
    return OK


def _animate(options: argparse.Namespace) -> int:
    scenario, system = read_system(options)
    out = options.out or Path("results", f"{scenario.stem}{default_ending()}")
    given = {name: vars(options)[name] for name in Film._fields}
    film = FILMS.get(out.suffix, Film())._replace(
        **{name: value for name, value in given.items() if value is not None}
    )
    film.check(out)
    prepared = prepare(scenario, system, request(options))
    loops = prepared.loops
    seen = VisibleRows({name for loop in loops for name in loop.drawn()})
    observers: list[Observer] = [seen, Progress(scenario.name)]
    run = Drawn(scenario.name, seen, scenario.z_up, loops)
    with _written(out, options.force) as folder:
        ending = prepared.run(observers)
        for loop in loops:
            if missing := seen.missing(*loop.for_control_point()):
                raise InputError(f"{options.scenario}: has no vehicle to show: no {missing[0]}")
        # A title may name both runs of a comparison.
        shown = f" (shown: {scenario.label})" if scenario.compare and scenario.label else ""
        animate(f"{scenario.title or scenario.name}{shown}", run, folder / out.name, film)
    return status(scenario.name, ending)


@contextmanager
def _written(file: Path, force: bool) -> Iterator[Path]:
    """Provide a folder to write a file into, move the file to its own folder, and show its path."""
    with replace_files(file.parent, [file.name], force=force) as staging:
        yield staging
    show(file)
