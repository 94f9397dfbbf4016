"""A study: what varies from run to run, and the TOML file that declares it.

docs/reference/study-files.md and the JSON schema of these files are made from this module.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeAlias, get_args

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, model_validator

from orchestrator.cosim import Experiment, Order, PortName, System
from orchestrator.figures.study_values import (
    CHARTS,
    INFLUENCE,
    SCENARIO,
    FigureEntry,
    is_known,
)
from orchestrator.machine.disk import file_name
from orchestrator.machine.errors import Findings, InputError, did_you_mean
from orchestrator.machine.schema import Name, Names, OneOf, TomlTable, entry, needed
from orchestrator.machine.texts import flatten, is_finite
from orchestrator.machine.user_files import explain_errors, read_text
from orchestrator.runs import find_toml, names_in
from orchestrator.runs.preparation import is_path
from orchestrator.vehicle.indices import index_columns

#: Engines that make runs; the first is the default.
EngineName: TypeAlias = Literal["fmu", "batch", "gpu"]
ENGINES: tuple[EngineName, ...] = get_args(EngineName)
FMU, BATCH, GPU = ENGINES

#: Spacings of values between two ends.
SPACINGS = LINEAR_SPACING, LOG_SPACING = "linear", "log"

#: Methods of sampling; the first is the default.
METHODS = SOBOL, LATIN_HYPERCUBE, RANDOM = "sobol", "latin-hypercube", "random"

#: More runs, or more values of one parameter, are taken for a mistake.
MOST_RUNS, _MOST_VALUES = 1_000_000_000, 1_000_000

#: The largest seed that generators of random numbers take.
_LARGEST_SEED = 2**63 - 1

#: Studies that come with the program.
STUDIES_FOLDER = Path(__file__).parent / "ready"

#: Name of the step among the values that vary.
STEP = "step"

#: Entries that distinguish a study from a scenario.
_OWN = {"scenario", "vary", "sample"}

#: Words for a file that is not a study.
_NOT_A_STUDY = "not a study"

#: The only table under `[figures]` that is not a figure.
LABELS = "labels"

#: Names of figures, which are names of files.
_FIGURE_NAME = re.compile(r"[\w-]+")

#: Values of each vehicle, and of all together, that a study shows if its file declares no figure.
_USUAL, _ALL = ("late_error", "peak_command"), "lost"


class Range(NamedTuple):
    """A range of a sampled value, or of the values of a grid."""

    low: float
    high: float
    spacing: str = LINEAR_SPACING

    def grid(self, n: int) -> tuple[float, ...]:
        """Return n values from one end to the other."""
        between = np.geomspace if self.spacing == LOG_SPACING else np.linspace
        return tuple(between(self.low, self.high, n).tolist())


class Sample(NamedTuple):
    """Points drawn at random.

    Attributes:
        n: number of points.
        ranges: of values by name; the name of a norm is `|a, b, c|`.
        method: one of :data:`METHODS`.
        seed: fixes the points.

    """

    n: int
    ranges: Mapping[str, Range]
    method: str = METHODS[0]
    seed: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the values, including the members of norms."""
        return tuple(name for key in self.ranges for name in norm_members(key))

    @property
    def remark(self) -> str | None:
        """Remark for the user, if the points are less even than they could be."""
        if self.method != SOBOL or not self.n & (self.n - 1):
            return None
        return (
            f"sample: {SOBOL} spreads its samples evenly only if n is a power of two, such as "
            f"{1 << self.n.bit_length()} instead of {self.n}"
        )


def norm_members(key: str) -> list[str]:
    """Return the names in a norm `|a, b, c|`, or any other name itself."""
    return [name.strip() for name in key.strip("|").split(",")] if key.startswith("|") else [key]


class StopTime(NamedTuple):
    """Stop time of a run as a sum [s]: `base`, and for each name its rate times its value."""

    base: float
    per: Mapping[str, float]

    def at(self, values: Mapping[str, np.ndarray], n: int) -> np.ndarray:
        """Return the stop times of n runs with some values."""
        terms = [(rate * values[name].astype(float)).tolist() for name, rate in self.per.items()]
        # By Python, which may round sums otherwise than numpy.
        sums = [*map(sum, zip(*terms, strict=True))] if terms else [0.0] * n
        return self.base + np.array(sums, dtype=float)


@dataclass(frozen=True)
class Study:
    """The content of a study file; :class:`StudyFile` explains the entries.

    Attributes:
        name: stem of the file.
        vary: values by `component.parameter`, in the order of the file.
        ranges: of the values in `vary` that lie between two ends, by name.
        folder: of the file; None without a file.
        indices: files of indices that no figure need show.
        draws: False if it draws no figures.
        explains: False if runs that a program refuses are not repeated by FMUs for the reason.

    """

    name: str
    scenario: Sequence[str]
    title: str = ""
    remark: str = ""
    engine: str = FMU
    stop_time: StopTime | None = None
    step: float | None = None
    order: Order | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    vary: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    ranges: Mapping[str, Range] = field(default_factory=dict)
    sample: Sample | None = None
    figures: Mapping[str, Any] = field(default_factory=dict)
    folder: Path | None = None
    indices: Sequence[Path] = ()
    draws: bool = True
    explains: bool = True

    @property
    def stem(self) -> str:
        """Name of the study's folder."""
        return file_name(self.name)

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of all values that vary."""
        return (*self.vary, *(self.sample.names if self.sample else ()))

    def with_points(self, n: int) -> Study:
        """Return the study with n points in its sample, or in each range if it has no sample.

        Raises:
            InputError: it has neither, or n is too large.

        """
        if not (self.sample or self.ranges):
            raise InputError(
                f"--points {n}: {self.name} has neither a sample nor a range "
                "{ from, to, n } under [vary]"
            )
        if n > (most := MOST_RUNS if self.sample else _MOST_VALUES):
            raise InputError(f"--points {n}: must be at most {most:,}")
        if self.sample:
            return replace(self, sample=self.sample._replace(n=n))
        grids = {name: limits.grid(n) for name, limits in self.ranges.items()}
        return replace(self, vary={**self.vary, **grids})


# The file


def _each(fits: Callable[[Any], bool]) -> AfterValidator:
    def check(table: Mapping[str, Any]) -> Mapping[str, Any]:
        if not all(fits(value) for _, value in flatten(table)):
            raise ValueError
        return table

    return AfterValidator(check)


#: Tables whose keys may be dotted.
_Numbers = Annotated[dict[str, Any], _each(is_finite), "table of numbers"]
_Texts = Annotated[dict[str, Any], _each(lambda text: isinstance(text, str)), "table of texts"]


class RangeTable(TomlTable):
    """A range under `[sample.range]`."""

    low: float = needed("Start of the range.", "1.0", key="from")
    high: float = needed("End of the range; it may be below the start.", "10.0", key="to")
    spacing: Annotated[str, OneOf(SPACINGS)] = entry(
        "Spacing of the values between the ends.", f"`{SPACINGS[0]}`"
    )


class GridTable(RangeTable):
    """A range under `[vary]`."""

    n: Annotated[int, Field(ge=1, le=_MOST_VALUES)] = needed("Number of values.", "7")


class SampleTable(TomlTable):
    """Points drawn at random: `[sample]`."""

    method: Annotated[str, OneOf(METHODS)] = entry("How to draw points.", f"`{METHODS[0]}`")
    n: Annotated[int, Field(ge=1, le=MOST_RUNS)] = needed("Number of points.", "64")
    seed: Annotated[int, Field(ge=0, le=_LARGEST_SEED)] = entry("Fixes the points.", "`0`")
    range: dict[str, Any] = needed(
        "What is drawn: `component.parameter = [low, high]` or `{ from = 1.0, to = 10.0, spacing = "
        '"log" }`.',
        "{ component.parameter = [low, high] }",
    )


class StopTimeTable(TomlTable):
    """`stop_time` as a sum."""

    base: float = needed("Constant part [s].", "60.0")
    per: _Numbers = needed("Seconds per unit of a value that varies.", "{ plant.eta0.z = 1.2 }")


class FigureTable(TomlTable):
    """A figure: `[figures.NAME]`."""

    kind: Annotated[str, OneOf(tuple(CHARTS))] = needed(
        "Kind of figure.", " or ".join(f'"{chart}"' for chart in CHARTS)
    )
    x: Names = entry(
        "Value along the horizontal axis; for `bands` also several, a column of panels each; for "
        "`influence` the values that move the others.",
        "for `influence` all numbers that vary",
    )
    y: Name = entry("Value along the vertical axis.")
    show: Names = entry(
        "Values to show, a row each; also an index of your own, the name of its file beside this "
        "one, without `.py`."
    )
    by: Names = entry(
        "Columns that distinguish runs, by colours or in separate panels; `[]` for none.",
        "the scenario, if there are several",
    )
    where: dict[str, Any] = entry("Only runs in which these columns have these values.", "none")
    limits: _Numbers = entry("Lines at these values of the columns shown.", "none")

    @model_validator(mode="after")
    def _has_what_its_chart_needs(self) -> Self:
        needs, may = CHARTS[self.kind]
        if missing := [key for key in needs if not getattr(self, key)]:
            raise ValueError(f"lacks {' and '.join(missing)}")
        if more := self.model_fields_set - {"kind", *needs, *may}:
            raise ValueError(f"a figure of kind {self.kind!r} has no {min(more)}")
        if self.kind in ("maps", "front") and not isinstance(self.x, str):
            raise ValueError(f"x is a list; a figure of kind {self.kind!r} has one x")
        return self


class FiguresTable(TomlTable):
    """Figures: `[figures]`."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, FigureTable]
    named: ClassVar = FigureTable

    labels: _Texts = entry("Names of columns in figures.", "their names")


class StudyFile(TomlTable):
    """A study of auv-fmu."""

    scenario: Name | Annotated[list[Name], Field(min_length=1)] = needed(
        "What is run: a scenario of `auv-fmu list`, or the path of a .toml, .ssp, .ssd or .fmu "
        "file, or of an OspSystemStructure.xml, relative to this one. If there are several, "
        "each is run at every point, with the parameters that it has.",
        '"fig5"',
    )
    title: str = entry("Heading of the figures.", "none")
    remark: str = entry(
        "What the report says below the figures, in Markdown without pictures.", "none"
    )
    engine: Annotated[str, OneOf(ENGINES)] = entry(
        "What makes the runs: the FMUs, or one compiled program of the system, which takes "
        "components in the language of equations and gives the same numbers, or that program on "
        "graphics cards.",
        f"`{ENGINES[0]}`",
    )
    stop_time: float | StopTimeTable = entry(
        "End of each run [s]. As a table, `{ base = 60.0, per = { plant.eta0.z = 1.2 } }`, a sum "
        "over values that vary.",
        "the scenario's",
    )
    step: float = entry("Communication step [s].", "the scenario's")
    order: Annotated[str, OneOf(Experiment.ORDERS)] = entry("Order of the steps.", "the scenario's")
    parameters: dict[str, Any] = entry(
        "Parameters of all runs, as in a scenario.", "the scenario's"
    )
    vary: dict[str, Any] = entry(
        "Every combination of these values is run: `component.parameter = [values]`, or "
        '`{ from = 1.0, to = 10.0, n = 7, spacing = "linear" }` (or `"log"`). `step` may vary, '
        "too.",
        "nothing",
    )
    sample: SampleTable = entry(
        "Points drawn at random, at every combination of `vary`: `n` of them, by a `method`, "
        f"one of {', '.join(METHODS)}, with a `seed`, and under `[sample.range]` "
        '`component.parameter = [low, high]` or `{ from = 1.0, to = 10.0, spacing = "log" }`. '
        '`"|a, b, c|" = [low, high]` draws the norm of two or three numbers, and every direction '
        "with equal probability.",
        "none",
    )
    figures: FiguresTable = entry("What is drawn: see below.", "a figure of kind `influence`")


def ready_studies() -> list[str]:
    """Return the names of the studies that come with the program."""
    return names_in(STUDIES_FOLDER)


def is_study(path: Path) -> bool:
    """Return true for a TOML file with a table or entry that only studies have."""
    with suppress(InputError, ValueError, RecursionError):
        return bool(_OWN & tomllib.loads(read_text(path, _NOT_A_STUDY)).keys())
    return False


def read_study(name: str) -> Study:
    """Read a ready study by its name, or any study by the path of its file.

    Raises:
        InputError: there is no such study, or its file has a mistake.

    """
    path = find_toml(name, STUDIES_FOLDER, "study", "a .toml file")
    text = read_text(path, _NOT_A_STUDY)
    with explain_errors(path, _NOT_A_STUDY):
        return study_of(path.stem, tomllib.loads(text), path)


def study_of(name: str, content: Mapping[str, Any], path: Path | None = None) -> Study:
    """Return a study from the content of its file.

    Args:
        name: of the study.
        content: of the file.
        path: of the file, if there is one.

    Raises:
        Refused: there are mistakes in it.

    """
    where = str(path or name)
    StudyFile.check(where, content)
    findings = Findings()
    entries = dict(content)
    names = content["scenario"]
    entries["scenario"] = tuple(
        str(path.parent / scenario) if path and is_path(scenario) else scenario
        for scenario in ([names] if isinstance(names, str) else names)
    )
    entries["parameters"] = dict(flatten(content.get("parameters", {}), System.is_spread))
    entries["vary"], entries["ranges"] = {}, {}
    for key, value in flatten(content.get("vary", {}), _is_range):
        with findings.collecting():
            if isinstance(value, list) and value:
                entries["vary"][key] = tuple(value)
            else:
                entries["ranges"][key] = limits = _grid_range(f"{where}: vary: {key}", value)
                entries["vary"][key] = limits.grid(value["n"])
    if "sample" in content:
        with findings.collecting():
            entries["sample"] = _sample(f"{where}: sample", content["sample"])
    if (end := content.get("stop_time")) is not None:
        per = dict(flatten(end["per"])) if isinstance(end, Mapping) else {}
        entries["stop_time"] = StopTime(end["base"] if isinstance(end, Mapping) else end, per)
    findings.refuse()
    study = Study(name, folder=path and path.parent, **entries)
    _check_names(where, study)
    return study


def _is_range(value: Any) -> bool:
    return isinstance(value, Mapping) and bool({"from", "to"} & value.keys())


def _grid_range(where: str, value: Any) -> Range:
    """Return a range under `vary`."""
    if not _is_range(value):
        raise InputError(f"{where}: write [values], or {{ from = 1.0, to = 10.0, n = 7 }}")
    GridTable.check(where, value)
    return _range(where, value)


def _range(where: str, value: Any) -> Range:
    if isinstance(value, list) and len(value) == 2 and all(map(is_finite, value)):
        limits = Range(*value)
    elif _is_range(value):
        limits = Range(value["from"], value["to"], value.get("spacing", LINEAR_SPACING))
    else:
        raise InputError(f"{where}: write [low, high], or {{ from = 1.0, to = 10.0 }}")
    if limits.spacing == LOG_SPACING and not (limits.low > 0.0 and limits.high > 0.0):
        raise InputError(f"{where}: spacing = {LOG_SPACING!r} needs two positive ends")
    return limits


def _sample(where: str, content: Mapping[str, Any]) -> Sample:
    findings, ranges = Findings(), {}
    for key, value in flatten(content["range"], _is_range):
        with findings.collecting():
            if _is_range(value):
                RangeTable.check(f"{where}: {key}", value)
            ranges[key] = limits = _range(f"{where}: {key}", value)
            is_norm = key.endswith("|") and len(norm_members(key)) in (2, 3)
            if key.startswith("|") and not (is_norm and min(limits.low, limits.high) >= 0.0):
                raise InputError(
                    f"{where}: {key}: a norm takes two or three values and cannot be negative"
                )
    findings.refuse()
    if not ranges:
        raise InputError(f"{where}: draws no values; name them under [sample.range]")
    return Sample(content["n"], ranges, content.get("method", METHODS[0]), content.get("seed", 0))


def _check_names(where: str, study: Study) -> None:
    """Check the syntax of names, that none is stated twice, and that names of stop_time vary."""
    findings = Findings()
    for scenario in dict.fromkeys(study.scenario):
        if study.scenario.count(scenario) > 1:
            findings.problem(f"{where}: scenario: {scenario} is stated twice")
    stated = [*study.parameters, *([STEP] * (study.step is not None)), *study.varied]
    for name in stated:
        if name != STEP or name in study.parameters:
            try:
                PortName.read(name)
            except InputError as error:
                findings.problem(f"{where}: {error}")
        if stated.count(name) > 1:
            findings.problem(f"{where}: {name} is stated twice")
    for name in study.stop_time.per if study.stop_time else ():
        if name not in study.varied:
            hint = did_you_mean(name, study.varied)
            findings.problem(f"{where}: stop_time: {name} does not vary{hint}")
    findings.refuse()


# Figures


def read_figures(
    where: str,
    figures: Mapping[str, Any],
    varied: Mapping[str, type],
    is_compared: bool,
    indices: Sequence[str] | None = None,
) -> tuple[FigureEntry, ...]:
    """Return the figures of a study.

    Args:
        where: the study, for messages.
        figures: of the study file; without any, the usual figure is drawn.
        varied: types of the values that vary, by name.
        is_compared: True if there are several scenarios.
        indices: columns of indices; None: those of one vehicle.

    Raises:
        Refused: a figure uses a name that the runs do not have.

    """
    tables, indices = dict(figures), indices or index_columns()
    labels = dict(flatten(tables.pop(LABELS, {})))
    numbers = [name for name, kind in varied.items() if kind is not str]
    if not tables and numbers:
        prefixes = [name.removesuffix(_USUAL[0]) for name in indices if name.endswith(_USUAL[0])]
        usual = [f"{vehicle}{name}" for name in _USUAL for vehicle in prefixes]
        tables[INFLUENCE] = {"kind": INFLUENCE, "show": [*usual, _ALL]}
    by = (SCENARIO,) if is_compared else ()
    findings, entries = Findings(), []
    for name, table in tables.items():
        x = listed(table.get("x", ())) or (numbers if table["kind"] == INFLUENCE else [])
        with findings.collecting():
            if not _FIGURE_NAME.fullmatch(name):
                raise InputError(
                    f"{where}: figures: {name!r} cannot be the name of a file: letters, digits, -"
                )
            if not x:
                raise InputError(f"{where}: figures: {name}: lacks x: no number varies")
            _check_figure(f"{where}: figures: {name}", table, (*numbers, *indices), (*varied, *by))
        entries.append(
            FigureEntry(
                name,
                table["kind"],
                x,
                table.get("y", ""),
                listed(table.get("show", ())),
                listed(table.get("by", by)),
                dict(flatten(table.get("where", {}))),
                dict(flatten(table.get("limits", {}))),
                labels,
            )
        )
    findings.refuse()
    return tuple(entries)


def _check_figure(
    where: str, table: Mapping[str, Any], numbers: Sequence[str], columns: Sequence[str]
) -> None:
    """Check that a figure uses `numbers` as values, and `columns` to distinguish runs."""
    for key in ("x", "y", "show", "limits"):
        for value in listed(table.get(key, ())):
            if not is_known(value, numbers):
                hint = did_you_mean(value, numbers)
                if value.isidentifier():
                    hint = hint or f", and there is no {value}.py beside the study"
                raise InputError(f"{where}: {key}: the runs have no number {value!r}{hint}")
    for key in ("by", "where"):
        for column in listed(table.get(key, ())):
            if column not in columns:
                raise InputError(
                    f"{where}: {key}: the runs have no column "
                    f"{column!r}{did_you_mean(column, columns)}"
                )


def listed(value: Any) -> list[str]:
    """Return the names in an entry of a figure: one, several, or the keys of a table."""
    if isinstance(value, Mapping):
        return [name for name, _ in flatten(value)]
    return [value] if isinstance(value, str) else list(value)
