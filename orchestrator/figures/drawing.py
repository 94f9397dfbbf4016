"""Figures of runs, drawn by matplotlib: those that scenarios name, and plots of any signals.

Settings are :data:`SETTINGS`, whatever a matplotlibrc contains, and files contain no date. Code
that only looks figures up imports :mod:`.run_figures`, which needs no matplotlib.
"""

from __future__ import annotations

import logging
import textwrap
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from io import BytesIO
from itertools import cycle
from math import lcm
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, fontManager
from matplotlib.lines import Line2D
from tqdm import tqdm

import auv_fmu
from orchestrator.cosim import Table
from orchestrator.figures.run_figures import (
    FIGURES,
    FLEET,
    MOST_DRAWN,
    Cell,
    Panel,
    Rows,
    figures_of,
    list_events,
    over_time,
    run_line,
)
from orchestrator.figures.style import (
    COLOURS,
    FIGURE_FORMATS,
    FIGURE_WIDTH,
    STYLES,
    Drawn,
    Look,
    escape_math,
    heading,
    printed_unit,
    text_scale,
    widths_of_text,
)
from orchestrator.figures.visible import draw_signal
from orchestrator.machine.errors import InputError, did_you_mean, reason
from orchestrator.machine.texts import matches, matching
from orchestrator.vehicle.signals import Loop

#: The project's style, which a user may take too: `plt.style.use("auv_fmu.figures")`.
SETTINGS: Any = mpl.rc_params_from_file(
    Path(auv_fmu.__file__).with_name("figures.mplstyle"), use_default_template=False
)

#: Settings with which matplotlib does not lay out a figure again.
_LAID_OUT: Any = {"figure.constrained_layout.use": False}

#: Least and largest width of a figure [in], and size of its texts [pt].
_WIDTHS, _TEXT_SIZES = (2.0, 40.0), (4.0, 40.0)

#: Metadata that would name the time or the tool, by the ending of the file.
_NO_DATE: dict[str, Any] = {
    ".png": {"Software": None},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}

#: Heights of a row of a heading and of a legend, of a panel of a plot, and of the margins of a plot
#: above and below its panels, with texts of 10 pt [in].
_HEADING, _ROW, _PANEL, _MARGIN = 0.3, 0.2, 1.9, 0.6

#: Characters in a row of a heading and of a legend, per size of text of its width; characters that
#: are as wide as the line of an entry.
_HEADING_LETTERS, _LETTERS, _LINE = 1.42, 1.93, 7

#: Least width of panels that are side by side, as a multiple of the size of their texts, and their
#: height below each other as a share of the usual one, so that a column of a page holds them.
_ABREAST, _FLATTER = 24.0, 0.72

#: Largest number of panels of a plot without patterns.
_MOST_PANELS = 12

#: Characters of a name as long as a panel is high.
_LONG_NAME = 20

#: Largest number of parameters, or of events, in the labels of runs.
_FEW = 2

#: Styles of lines of a plot: so many that few runs look alike.
_STYLES = (*STYLES, (0, (7, 2)), (0, (3, 1, 1, 1, 1, 1)))


class Plot(Figure):
    """A figure that keeps its look, and that a notebook shows by itself."""

    look = Look()

    def savefig(self, fname: Any, **options: Any) -> None:
        """Write the figure, without time and tool: equal runs give equal files."""
        suffix = Path(fname).suffix if isinstance(fname, str | Path) else ""
        options.setdefault("metadata", _NO_DATE.get(suffix))
        with styled(self.look), mpl.rc_context(_LAID_OUT):
            super().savefig(fname, **options)

    def _repr_png_(self) -> bytes:
        image = BytesIO()
        self.savefig(image, format="png")
        return image.getvalue()


@contextmanager
def styled(look: Look = Look()) -> Iterator[None]:  # noqa: B008
    """Draw with :data:`SETTINGS` and a look only, and without matplotlib's warnings.

    Raises:
        InputError: there is no such font or style, or a size is out of range.

    """
    log = logging.getLogger("matplotlib")
    level = log.level
    try:
        with mpl.rc_context(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mpl.rcdefaults()
            mpl.rcParams.update(SETTINGS)
            mpl.rcParams["figure.figsize"] = (FIGURE_WIDTH, FIGURE_WIDTH)
            log.setLevel(logging.WARNING)
            _apply(look, log)
            log.setLevel(logging.ERROR)
            yield
    finally:
        log.setLevel(level)


def _apply(look: Look, log: logging.Logger) -> None:
    """Change the settings of matplotlib to a look."""
    if look.style:
        _apply_style(look, log)
    if look.width is not None:
        _check_range("width", look.width, _WIDTHS, "in")
        mpl.rcParams["figure.figsize"] = (look.width, look.width)
    if look.size is not None:
        _check_range("size", look.size, _TEXT_SIZES, "pt")
        mpl.rcParams["font.size"] = look.size
    if look.font:
        _check_font(look.font)
        mpl.rcParams.update(
            {
                "font.family": look.font,
                "mathtext.fontset": "custom",
                "mathtext.rm": look.font,
                "mathtext.it": f"{look.font}:italic",
                "mathtext.bf": f"{look.font}:bold",
            }
        )


def _apply_style(look: Look, log: logging.Logger) -> None:
    """Apply a style of matplotlib, whose problems are only in its log."""
    # It reads all styles.
    from matplotlib import style  # noqa: PLC0415

    problems = _Problems()
    log.addHandler(problems)
    log.propagate = False
    try:
        style.use(look.style)  # type: ignore[arg-type]
    except OSError as error:
        raise InputError(f"style {look.style}: no such file, and no style of matplotlib") from error
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"style: {reason(error)}") from error
    finally:
        log.removeHandler(problems)
        log.propagate = True
    if problems.lines:
        raise InputError(f"style: {problems.lines[0]}")


class _Problems(logging.Handler):
    """The first line of each warning."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage().strip().splitlines()[0])


def _check_range(name: str, value: float, ends: tuple[float, float], unit: str) -> None:
    least, most = ends
    if not least <= value <= most:
        raise InputError(f"{name} {value:g}: must be from {least:g} to {most:g} {unit}")


def _check_font(font: str) -> None:
    try:
        findfont(FontProperties(family=font), fallback_to_default=False)
    except ValueError as error:
        hint = did_you_mean(font, fontManager.get_font_names())
        raise InputError(
            f"font {font!r} is not installed"
            + (hint or "; DejaVu Sans and DejaVu Serif always are")
        ) from error


def save(figure: Figure, *paths: Path) -> None:
    """Write a figure without time and tool, so that equal runs give equal files.

    Raises:
        InputError: values are too large for the axes, or the figure's style asks for LaTeX, which
            is not there.

    """
    look = figure.look if isinstance(figure, Plot) else Look()
    with styled(look), mpl.rc_context(_LAID_OUT):
        # One layout for all files.
        if (engine := figure.get_layout_engine()) is not None:
            try:
                engine.execute(figure)
            except (ValueError, OverflowError) as error:
                raise InputError("values are too far apart to draw") from error
            except RuntimeError as error:
                raise InputError(f"no figure: {reason(error)}") from error
        figure.set_layout_engine(None)
        for path in paths:
            figure.savefig(path, metadata=_NO_DATE[path.suffix])


# Legends


def _legend_columns(figure: Figure, lines: Sequence[Line2D]) -> int:
    longest = max(len(str(line.get_label())) for line in lines)
    return max(1, int(_LETTERS * widths_of_text(figure)) // (longest + _LINE))


def _heading_lines(figure: Figure, title: str) -> str:
    """Break a heading into lines."""
    return textwrap.fill(title, int(_HEADING_LETTERS * widths_of_text(figure)))


def _name_lines(figure: Figure, lines: Sequence[Line2D], title: str = "") -> None:
    """Add a legend above all panels, with the heading in it, and make the figure higher for it."""
    columns = _legend_columns(figure, lines)
    text = _heading_lines(figure, title)
    rows = -(-len(lines) // columns) * _ROW + (_HEADING * (1 + text.count("\n")) if text else 0.0)
    figure.set_figheight(figure.get_figheight() + rows * text_scale())
    # A separate heading would overlap the legend.
    legend = figure.legend(
        handles=lines, loc="outside upper center", ncols=columns, title_fontsize="large",
        title=heading(text),
    )  # fmt: skip
    legend.get_title().set_multialignment("center")


def _head(figure: Figure, title: str) -> None:
    """Add a heading, and make the figure higher for it."""
    text = _heading_lines(figure, title)
    figure.set_figheight(figure.get_figheight() + _HEADING * (1 + text.count("\n")) * text_scale())
    figure.suptitle(heading(text))


def name_runs(figure: Figure, runs: Sequence[Drawn], title: str = "") -> None:
    """Add a legend of runs, with the lines that they have in panels, and a heading."""
    colours = enumerate(zip(runs, cycle(COLOURS), strict=False))
    lines = [
        Line2D([], [], **run_line(i, colour), label=escape_math(run.label))
        for i, (run, colour) in colours
    ]
    _name_lines(figure, lines, title)


# Figures that scenarios name


def compose(
    title: str,
    rows: Rows,
    runs: Sequence[Drawn],
    look: Look = Look(),  # noqa: B008
) -> tuple[Figure | None, list[str]]:
    """Draw the panels of a figure for which there are signals.

    Args:
        title: heading; empty for none.
        rows: of the figure; of a narrow one, the panels of a row are below each other.
        runs: the subject of the figure first.
        look: of the figure.

    Returns:
        The figure, and a note on each panel that was left out; or None, and what is missing.

    """
    runs = [run for run in runs if len(run.result) > 1]
    if not runs:
        return None, ["step"]
    panels = [panel for row in rows for panel in row]
    shown = [panel for panel in panels if any(not run.lacks(panel.needs) for run in runs)]
    drawn = [kept for row in rows if (kept := [panel for panel in row if panel in shown])]
    if not drawn:
        return None, runs[0].lacks(panels[0].needs)
    with styled(look):
        figure = _new_figure(look)
        abreast = max(1, int(widths_of_text(figure) / _ABREAST))
        is_narrow = any(len(row) > abreast for row in drawn)
        drawn = [row[i : i + abreast] for row in drawn for i in range(0, len(row), abreast)]
        scale = text_scale() * (_FLATTER if is_narrow else 1.0)
        heights = [scale * max(panel.height for panel in row) for row in drawn]
        figure.set_figheight(sum(heights))
        if len(runs) > 1 and not all(panel.of_one for panel in shown):
            name_runs(figure, runs, title)
        elif title:
            _head(figure, title)
        columns = lcm(*map(len, drawn))
        grid = figure.add_gridspec(len(drawn), columns, height_ratios=heights)
        for i, row in enumerate(drawn):
            width = columns // len(row)
            for j, panel in enumerate(row):
                panel.draw(Cell(figure, grid[i, j * width : (j + 1) * width]), runs)
        list_events(figure, runs)
    return figure, [note for panel in panels for note in _left_out(panel, runs)]


def _new_figure(look: Look) -> Plot:
    """Return a figure without panels, in a look that is in force."""
    figure = Plot()
    figure.look = look
    return figure


def _left_out(panel: Panel, runs: Sequence[Drawn]) -> list[str]:
    """Return notes on the runs that a panel does not show."""
    missing = {run.label: run.lacks(panel.needs) for run in runs}
    note = f"panel {panel.name!r} left out"
    if all(missing.values()):
        return [f"{note}: the run has no {missing[runs[0].label][0]}"]
    return [
        f"{note} for {label}, which has no {names[0]}" for label, names in missing.items() if names
    ]


def one_figure(
    name: str,
    title: str,
    runs: Sequence[Drawn],
    vehicle: str = "",
    look: Look = Look(),  # noqa: B008
) -> Figure:
    """Draw one figure.

    Args:
        name: key of :data:`FIGURES`, with the suffix of the figure's file.
        title: heading; empty for none.
        runs: the subject of the figure first, with labels that differ.
        vehicle: to show; empty for the first, or for all in the figure of several.
        look: of the figure.

    Raises:
        InputError: there is no such figure, vehicle, font or style, or the runs have nothing that
            the figure shows.

    """
    known = {f"{key}{end}": rows for key, files in FIGURES.items() for end, rows in files.items()}
    if name not in known:
        hint = did_you_mean(name, known) or f"; there are {', '.join(known)}"
        raise InputError(f"no figure {name!r}{hint}")
    loops = {loop.name: loop for loop in runs[0].loops}
    if vehicle and vehicle not in loops:
        raise InputError(f"no vehicle {vehicle!r}; there are {', '.join(loops)}")
    loop = loops[vehicle] if vehicle else runs[0].loop
    shown = runs if name == FLEET and not vehicle else _with_vehicle(runs, loop)
    figure, missing = compose(title, known[name], shown, look)
    if figure is None:
        raise InputError(f"no figure: the run has no {missing[0]}")
    return figure


def _with_vehicle(runs: Sequence[Drawn], loop: Loop) -> list[Drawn]:
    """Return runs with one loop each, which has the name of `loop`, else its number."""
    i = runs[0].loops.index(loop)
    return [
        run._replace(
            loops=[
                *(own for own in run.loops if own.name == loop.name),
                *run.loops[i : i + 1],
                *run.loops,
            ][:1]
        )
        for run in runs
    ]


def draw(
    kind: str,
    title: str,
    runs: Sequence[Drawn],
    folder: Path,
    stem: str,
    stop: Callable[[], bool] = lambda: False,
) -> list[str]:
    """Draw the figures of a scenario as PNG and SVG, with the panels for which there are signals.

    Several vehicles have one figure together. Each of up to :data:`.MOST_DRAWN` also has its own,
    with the vehicle of the same name in the other runs. Without a vehicle, there is one figure of
    all signals.

    Args:
        kind: key of :data:`FIGURES`.
        title: heading; empty if there is one next to the figure.
        runs: the run of the scenario, and those it is compared with.
        folder: to write into.
        stem: of the file names.
        stop: called before each figure; true to leave out the rest.

    Returns:
        Notes on what was left out.

    """
    notes: list[str] = []
    loops = runs[0].loops
    if not loops:
        try:
            save(plot(runs), *(folder / f"{stem}.{ending}" for ending in FIGURE_FORMATS))
        except InputError as error:
            return [f"no figure: {error}"]
        return []
    for key, vehicle, drawn in figures_of(kind, loops):
        shown, text = list(runs), title
        if len(drawn) < len(loops):
            [loop] = drawn
            shown = _with_vehicle(runs, loop)
            text = f"{title}, {loop.name}" if title and loop.name else title
        files = FIGURES[key].items()
        for suffix, rows in tqdm(files, "drawing", disable=None, leave=False):
            if stop():
                break
            name = f"{stem}{vehicle}{suffix}"
            figure, left_out = compose(text, rows, shown)
            if figure is None:
                missing = f"the run has no {left_out[0]}"
                notes.append(
                    f"figure {name} left out: {missing}" if suffix else f"no figure: {missing}"
                )
                if not suffix:
                    break
                continue
            try:
                save(figure, *(folder / f"{name}.{ending}" for ending in FIGURE_FORMATS))
                notes += left_out
            except InputError as error:
                notes.append(f"figure {name} left out: {error}")
    if len(loops) > MOST_DRAWN:
        notes.append(f"no figure of each of {len(loops)} vehicles, only of all together")
    return notes


# Plots of any signals


def wanted_columns(
    columns: Sequence[str], loops: Sequence[Loop], patterns: Sequence[str]
) -> list[str]:
    """Return the columns that match some patterns; without any, the usual ones of each loop.

    A run without these has no usual ones, and all count.

    """
    patterns = patterns or [
        group
        for loop in loops
        for group in (
            f"{loop.controller}.e",
            f"{loop.vehicle}.tau",
            f"{loop.controller}.theta_hat",
        )
    ]
    wanted = [name for name in columns if any(matches(name, pattern) for pattern in patterns)]
    return wanted or list(columns)


def _first_signals(runs: Sequence[Drawn], names: Sequence[str]) -> list[str]:
    """Return the columns that change in a run, or all columns, of the first groups."""
    held = [(run.result, name) for run in runs for name in names if name in run.result]
    changing = {name for rows, name in held if rows[name].min() != rows[name].max()}
    shown = [name for name in names if name in changing] or list(names)
    groups = list(dict.fromkeys(map(_group_of, shown)))
    if len(groups) > _MOST_PANELS:
        warnings.warn(
            f"drawn are the first {_MOST_PANELS} of {len(groups)} groups of signals; `auv-fmu plot "
            f"RESULT PATTERN` draws others, such as {groups[_MOST_PANELS]}",
            stacklevel=3,
        )
    return [name for name in shown if _group_of(name) in groups[:_MOST_PANELS]]


def plot(
    runs: Sequence[Drawn],
    patterns: Sequence[str] = (),
    title: str = "",
    look: Look = Look(),  # noqa: B008
) -> Figure:
    """Draw columns over time: a panel for each group such as plant.y, with all runs in it.

    Args:
        runs: with labels that differ.
        patterns: such as `plant.y.*`, or the name of a group or column; none: errors, commands
            and estimates of the loops of all vehicles, or of other systems all that changes, in
            the first panels.
        title: heading; empty for none.
        look: of the figure.

    Raises:
        InputError: a pattern matches no column, or there is no such font or style.

    """
    if not all(isinstance(pattern, str) for pattern in patterns):
        raise InputError(f"patterns are texts such as plant.y.*, not {list(patterns)!r}")
    names = list(dict.fromkeys(name for run in runs for name in run.result.header.numeric_columns))
    if not patterns:
        patterns = wanted_columns(names, [loop for run in runs for loop in run.loops], ())
        if patterns == names:
            patterns = _first_signals(runs, names)
    units = {name: unit for run in runs for name, unit in run.result.header.units.items()}
    panels: dict[tuple[str, str], list[str]] = {}
    for name in matching(names, patterns):
        # The members of a vector share a panel, whatever their units.
        unit = "" if name.endswith("]") else printed_unit(units.get(name, ""))
        panels.setdefault((_group_of(name), unit), []).append(name)
    with styled(look):
        figure = _new_figure(look)
        figure.set_figheight((_MARGIN + _PANEL * len(panels)) * text_scale())
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        has_means = [
            _draw_group(figure, place, group, unit, members, runs)
            for place, ((group, unit), members) in zip(axes, panels.items(), strict=True)
        ]
        over_time(list(axes), runs, any(has_means))
        list_events(figure, runs)
        if len(runs) > 1:
            in_colour = all(len(members) == 1 for members in panels.values())
            lines = [
                _legend_line(run.label, COLOURS[i % len(COLOURS)] if in_colour else "black", i)
                for i, run in enumerate(runs)
            ]
            _name_lines(figure, lines, title)
        elif title:
            _head(figure, title)
    return figure


def _draw_group(
    figure: Figure,
    axes: Axes,
    group: str,
    unit: str,
    members: Sequence[str],
    runs: Sequence[Drawn],
) -> bool:
    """Draw the members of a group; return true if there are means among the lines.

    Members differ in colour, runs in style; runs of a single member in both. A title says which
    runs have none of the members.
    """
    has_means = False
    parts = [member.removeprefix(group).strip(".[]") for member in members]
    for i, run in enumerate(runs):
        for j, member in enumerate(members):
            if member not in run.result:
                continue
            colour = (j if len(members) > 1 else i) % len(COLOURS)
            has_means |= draw_signal(
                axes,
                run.result,
                partial(_column, member),
                color=COLOURS[colour],
                linestyle=_style(i if len(runs) > 1 else j),
                label=", ".join(
                    [parts[j]] * (len(members) > 1) + [escape_math(run.label)] * (len(runs) > 1)
                ),
            )
    lacking = [run.label for run in runs if not any(name in run.result for name in members)]
    if lacking:
        whose = escape_math(lacking[0]) if len(lacking) == 1 else f"{len(lacking)} of the runs"
        axes.set_title(f"not in {whose}", loc="right", fontsize="small")
    name = group if len(members) > 1 else members[0]
    if len(name) > _LONG_NAME:
        name = ".\n".join(name.rsplit(".", 1))
    axes.set_ylabel(f"{name}\n[{unit}]" if unit else name)
    if len(members) > 1:
        lines = [
            _legend_line(part, COLOURS[j % len(COLOURS)], 0 if len(runs) > 1 else j)
            for j, part in enumerate(parts)
        ]
        axes.legend(
            handles=lines, loc="lower left", bbox_to_anchor=(0.0, 1.0),
            ncols=_legend_columns(figure, lines),
        )  # fmt: skip
    return has_means


def _group_of(column: str) -> str:
    """Return the group of a column, such as plant.y of plant.y.x, or a column without a group."""
    for separator in ("[", "."):
        group, _, member = column.rpartition(separator)
        if "." in group and member:
            return group
    return column


def _column(name: str, table: Table) -> tuple[np.ndarray, np.ndarray]:
    time, values = table.time, table[name].astype(float, copy=False)
    if table.header.units.get(name) == "rad":
        # An angle that wraps gets a gap: a line across the panel would look like motion.
        wraps = 1 + np.flatnonzero(np.abs(np.diff(values)) > np.pi)
        time, values = np.insert(time, wraps, np.nan), np.insert(values, wraps, np.nan)
    return time, values


def _legend_line(label: str, colour: str, style: int) -> Line2D:
    return Line2D([], [], color=colour, linestyle=_style(style), label=escape_math(label))


def _style(i: int) -> Any:
    return _STYLES[i % len(_STYLES)]


def told_apart(
    runs: Sequence[Drawn], paths: Sequence[Path] = (), labels: Sequence[str] = ()
) -> list[Drawn]:
    """Return runs with labels that differ.

    Without given labels, these are the first that differ: their own, if all have one, the names of
    their scenarios, a few parameters, a few events, ends of paths, numbers.

    Args:
        runs: to draw together.
        paths: that they were read from.
        labels: given ones; empty for none.

    Raises:
        InputError: not every run has a label of its own.

    """
    if labels:
        if isinstance(labels, str) or not all(isinstance(label, str) for label in labels):
            raise InputError(f"labels are texts in a list, not {labels!r}")
        if len(labels) != len(runs):
            raise InputError(f"{len(labels)} labels for {len(runs)} runs: give one for each")
        if len(set(labels)) != len(labels):
            raise InputError(f"labels must differ: {', '.join(labels)}")
        return [run._replace(label=label) for run, label in zip(runs, labels, strict=True)]
    names = [run.label for run in runs]
    if len(set(names)) < len(names) or any(run.label == run.name for run in runs):
        names = [run.name or run.label for run in runs]
    prefixes = [[name] * (len(set(names)) > 1) for name in names]
    # As texts: a record does not tell where the component ends in the name of a parameter.
    parameters = [
        {str(name): value for name, value in run.result.header.parameters.items()} for run in runs
    ]
    differing = [
        name
        for name in dict.fromkeys(name for values in parameters for name in values)
        if len({str(values.get(name)) for values in parameters}) > 1
    ]
    changes = [
        ", ".join([*prefix, *(f"{name} = {_value_text(values, name)}" for name in differing)])
        for prefix, values in zip(prefixes, parameters, strict=True)
    ]
    happened = [
        [
            f"{event.label} at {event.time:.5g} s"
            for event in run.result.ending.events
            if event.label
        ]
        for run in runs
    ]
    events = [
        ", ".join([*prefix, *(of_run or ["no event"])])
        for prefix, of_run in zip(prefixes, happened, strict=True)
    ]
    parts = [path.resolve().parts for path in paths]
    longest = max(map(len, parts), default=1)
    candidates = [
        names,
        *([changes] * (len(differing) <= _FEW)),
        *([events] * (max(map(len, happened)) <= _FEW)),
        *(["/".join(part[-n:]) for part in parts] for n in range(1, longest)),
        [f"{name} ({number})" for number, name in enumerate(names, start=1)],
    ]
    chosen = next(labels for labels in candidates if len(set(labels)) == len(labels))
    return [run._replace(label=label) for run, label in zip(runs, chosen, strict=True)]


def _value_text(values: Mapping[str, Any], name: str) -> str:
    value = values.get(name, "none")
    return f"{value:g}" if isinstance(value, float) else str(value)
