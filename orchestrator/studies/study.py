"""A study: what varies from run to run, in a TOML file."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.machine.errors import InputError, did_you_mean, shortened
from orchestrator.machine.user_files import explained, text_of
from orchestrator.master.experiment import ORDERS
from orchestrator.runs.entries import (
    Entry,
    are_names,
    check_entries,
    flattened,
    is_finite,
    is_table,
    is_text,
)
from orchestrator.runs.named import names_in, path_of
from orchestrator.runs.preparation import is_path
from orchestrator.system.names import file_name, port_name

#: Studies that come with the program.
FOLDER = Path(__file__).parent / "ready"

#: What makes the runs; the first is the default.
ENGINES = FMU, BATCH = "fmu", "batch"

#: How values that nobody lists are spread between two ends.
SPACINGS = LINEAR, LOG = "linear", "log"

#: How samples are drawn; the first is the default.
METHODS = SOBOL, LATIN_HYPERCUBE, RANDOM = "sobol", "latin-hypercube", "random"

#: More runs than this are taken for a mistake, and so are more values of one parameter.
MOST_RUNS, _MOST_VALUES = 1_000_000_000, 1_000_000

#: What the generators of random numbers take.
_LARGEST_SEED = 2**63 - 1

#: What may vary beside parameters.
STEP = "step"

#: What a file is not that cannot be read.
_WHAT = "not a study"


class Range(NamedTuple):
    """Where the samples of a value lie."""

    low: float
    high: float
    spacing: str = LINEAR


class Sample(NamedTuple):
    """Points drawn at random.

    Attributes:
        n: how many.
        ranges: of the values, by name; of a norm `|a, b, c|` by all its names.
        method: one of :data:`METHODS`.
        seed: that makes the points what they are.

    """

    n: int
    ranges: Mapping[str, Range]
    method: str = METHODS[0]
    seed: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Of the values, those of a norm one by one."""
        return tuple(name for key in self.ranges for name in members(key))


def members(key: str) -> list[str]:
    """The names in a norm `|a, b, c|`, or the one name."""
    return [name.strip() for name in key.strip("|").split(",")] if key.startswith("|") else [key]


class StopTime(NamedTuple):
    """End of a run: a sum over values that vary [s].

    Attributes:
        base: of the sum.
        per: what it grows with, by name.

    """

    base: float
    per: Mapping[str, float]

    def of(self, point: Mapping[str, Any]) -> float:
        """The end of one run."""
        return self.base + sum(rate * float(point[name]) for name, rate in self.per.items())


@dataclass(frozen=True)
class Study:
    """What varies, and what is run; :data:`ENTRIES` says what each entry means.

    Attributes:
        name: of the file, without its ending.
        vary: values by `component.parameter`, in the order of the file.

    """

    name: str
    scenario: Sequence[str]
    title: str = ""
    remark: str = ""
    engine: str = FMU
    stop_time: StopTime | None = None
    step: float | None = None
    order: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    vary: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    sample: Sample | None = None
    figures: Mapping[str, Any] = field(default_factory=dict)

    @property
    def stem(self) -> str:
        """Name of its folder."""
        return file_name(self.name)

    @property
    def varied(self) -> tuple[str, ...]:
        """The names of all values that vary."""
        return (*self.vary, *(self.sample.names if self.sample else ()))


def _is_text_or_names(value: Any) -> bool:
    return is_text(value) or (are_names(value) and bool(value))


def _is_number_or_table(value: Any) -> bool:
    return is_finite(value) or is_table(value)


def _whole_number(least: int, most: int) -> Entry:
    def fits(value: Any) -> bool:
        return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most

    return Entry(f"whole number from {least} to {most:,}", fits, "", "")


def _one_of(names: Sequence[str]) -> Entry:
    kind = f"name out of {', '.join(names)}"
    return Entry(kind, lambda value: value in names, "", names[0])


#: What a study file may hold, in the order of the reference page.
ENTRIES: dict[str, Entry] = {
    "scenario": Entry(
        "name, or list of names",
        _is_text_or_names,
        "What is run: a scenario of `auv-fmu list`, or the path of a .toml, .ssp, .ssd or .fmu "
        "file, or of an OspSystemStructure.xml, relative to this one. Of several, each is run at "
        "every point, with the parameters that it has.",
        "",
    ),
    "title": Entry("text", is_text, "Heading of the figures.", "none"),
    "remark": Entry(
        "text", is_text, "What the report says below the figures, in Markdown.", "none"
    ),
    "engine": _one_of(ENGINES)._replace(
        meaning="What makes the runs: the FMUs, or the equations compiled, which know the standard "
        "closed loop alone and give the same numbers."
    ),
    "stop_time": Entry(
        "number or table",
        _is_number_or_table,
        "End of each run [s]. As a table, `{ base = 60.0, per = { plant.eta0.z = 1.2 } }`, a sum "
        "over values that vary.",
        "the scenario's",
    ),
    "step": Entry("number", is_finite, "Communication step [s].", "the scenario's"),
    "order": _one_of(ORDERS)._replace(
        meaning="In which components are stepped.", default="the scenario's"
    ),
    "parameters": Entry(
        "table of values", is_table, "Parameters of all runs, as in a scenario.", "the scenario's"
    ),
    "vary": Entry(
        "table of lists and ranges",
        is_table,
        "Every combination of these values is run: `component.parameter = [values]`, or "
        '`{ from = 1.0, to = 10.0, n = 7, spacing = "linear" }` (or `"log"`). `step` may vary, '
        "too.",
        "nothing",
    ),
    "sample": Entry(
        "table",
        is_table,
        "Points drawn at random, at every combination of `vary`: `n` of them, by a `method` out "
        f"of {', '.join(METHODS)}, with a `seed`, and under `[sample.range]` "
        '`component.parameter = [low, high]` or `{ from = 1.0, to = 10.0, spacing = "log" }`. '
        '`"|a, b, c|" = [low, high]` draws the norm of two or three numbers, and every direction '
        "with the same chance.",
        "none",
    ),
    "figures": Entry("table", is_table, "What is drawn: see below.", "what moves what"),
}

_RANGE = {
    "from": Entry("number", is_finite, "", ""),
    "to": Entry("number", is_finite, "", ""),
    "spacing": _one_of(SPACINGS),
}

#: What a range under `vary` holds, and one under `sample.range`.
_GRID = {**_RANGE, "n": _whole_number(1, _MOST_VALUES)}

#: What `sample` holds, and a stop time that grows.
_SAMPLE = {
    "method": _one_of(METHODS),
    "n": _whole_number(1, MOST_RUNS),
    "seed": _whole_number(0, _LARGEST_SEED),
    "range": Entry("table of ranges", is_table, "", ""),
}
_STOP_TIME = {
    "base": Entry("number", is_finite, "", ""),
    "per": Entry("table of numbers", is_table, "", ""),
}


def ready_studies() -> list[str]:
    """The studies that come with the program."""
    return names_in(FOLDER)


def read_study(name: str) -> Study:
    """A study that comes with the program by its name, or any by the path of its file.

    Raises:
        InputError: there is no such study, or its file has a mistake.

    """
    path = path_of(name, FOLDER, "study", "a .toml file")
    text = text_of(path, _WHAT)
    with explained(path, _WHAT):
        return study_of(path.stem, tomllib.loads(text), path)


def study_of(name: str, content: Mapping[str, Any], path: Path | None = None) -> Study:
    """A study from what its file holds.

    Args:
        name: of the study.
        content: of the file.
        path: of the file; None: there is none.

    Raises:
        InputError: there is a mistake in it.

    """
    where = str(path or name)
    check_entries(where, content, ENTRIES)
    if "scenario" not in content:
        raise InputError(f'{where}: names no scenario; write scenario = "fig5"')
    entries = dict(content)
    names = content["scenario"]
    entries["scenario"] = tuple(
        str(path.parent / scenario) if path and is_path(scenario) else scenario
        for scenario in ([names] if is_text(names) else names)
    )
    entries["parameters"] = dict(flattened(content.get("parameters", {})))
    entries["vary"] = {
        key: _values(f"{where}: vary: {key}", value)
        for key, value in flattened(content.get("vary", {}), _is_range)
    }
    if "sample" in content:
        entries["sample"] = _sample(f"{where}: sample", content["sample"])
    if "stop_time" in content:
        entries["stop_time"] = _stop_time(f"{where}: stop_time", content["stop_time"])
    study = Study(name, **entries)
    _check_names(where, study)
    return study


def _is_range(value: Any) -> bool:
    return is_table(value) and bool({"from", "to"} & value.keys())


def _values(where: str, value: Any) -> tuple[Any, ...]:
    """The values of a list, or of a range under `vary`."""
    if isinstance(value, list) and value:
        return tuple(value)
    if not _is_range(value):
        raise InputError(f"{where}: write [values], or {{ from = 1.0, to = 10.0, n = 7 }}")
    _check_whole(where, value, _GRID, ("from", "to", "n"))
    low, high, spacing = _range(where, value)
    between = np.geomspace if spacing == LOG else np.linspace
    return tuple(between(low, high, value["n"]).tolist())


def _range(where: str, value: Any) -> Range:
    if isinstance(value, list) and len(value) == 2 and all(map(is_finite, value)):
        found = Range(*value)
    elif _is_range(value):
        found = Range(value["from"], value["to"], value.get("spacing", LINEAR))
    else:
        raise InputError(f"{where}: write [low, high], or {{ from = 1.0, to = 10.0 }}")
    if found.spacing == LOG and not (found.low > 0.0 and found.high > 0.0):
        raise InputError(f"{where}: spacing = {LOG!r} needs two positive ends")
    return found


def _sample(where: str, content: Mapping[str, Any]) -> Sample:
    _check_whole(where, content, _SAMPLE, ("n", "range"))
    ranges = {}
    for key, value in flattened(content["range"], _is_range):
        if _is_range(value):
            _check_whole(f"{where}: {key}", value, _RANGE, ("from", "to"))
        ranges[key] = _range(f"{where}: {key}", value)
        if key.startswith("|") and (
            len(members(key)) not in (2, 3) or not key.endswith("|") or min(ranges[key][:2]) < 0.0
        ):
            raise InputError(f"{where}: {key}: a norm is of two or three numbers, and not negative")
    if not ranges:
        raise InputError(f"{where}: draws nothing; name values under [sample.range]")
    return Sample(content["n"], ranges, content.get("method", METHODS[0]), content.get("seed", 0))


def _stop_time(where: str, value: Any) -> StopTime:
    if is_finite(value):
        return StopTime(value, {})
    _check_whole(where, value, _STOP_TIME, ("base", "per"))
    rates = dict(flattened(value["per"]))
    for name, rate in rates.items():
        if not is_finite(rate):
            raise InputError(
                f"{where}: {name} = {shortened(repr(rate))}: not a number of seconds for each of it"
            )
    return StopTime(value["base"], rates)


def _check_whole(
    where: str, content: Mapping[str, Any], entries: Mapping[str, Entry], needed: Sequence[str]
) -> None:
    check_entries(where, content, entries)
    missing = [name for name in needed if name not in content]
    if missing:
        raise InputError(f"{where}: lacks {' and '.join(missing)}")


def _check_names(where: str, study: Study) -> None:
    """Check that names are names, that none stands twice, and that what is summed varies."""
    stated = [*study.parameters, *([STEP] * (study.step is not None)), *study.varied]
    for name in stated:
        if name != STEP or name in study.parameters:
            with _located(where):
                port_name(name)
        if stated.count(name) > 1:
            raise InputError(f"{where}: {name} is stated twice")
    for name in study.stop_time.per if study.stop_time else ():
        if name not in study.varied:
            raise InputError(
                f"{where}: stop_time: {name} does not vary{did_you_mean(name, study.varied)}"
            )


@contextmanager
def _located(where: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
