"""A study: what varies from run to run, in a TOML file."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.machine.errors import Findings, InputError, did_you_mean
from orchestrator.machine.user_files import explained, names_in, path_of, text_of
from orchestrator.runs.loading import is_path
from orchestrator.studies.study_file import (
    FMU,
    LINEAR,
    LOG,
    METHODS,
    GridTable,
    RangeTable,
    StudyFile,
)
from orchestrator.system.names import file_name, flattened, port_name
from orchestrator.system.values import is_finite

#: Studies that come with the program.
FOLDER = Path(__file__).parent / "ready"

#: What may vary beside parameters.
STEP = "step"

#: Entries that tell a study from a scenario.
_OWN = {"scenario", "vary", "sample"}

#: What a message calls a file that cannot be read.
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
        """Names of the values, the ones in a norm one by one."""
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
    """What varies, and what is run; :mod:`.study_file` says what each entry means.

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


def is_study(path: str) -> bool:
    """Whether a file holds a study: a TOML file with a table or entry that no scenario has."""
    if not path.endswith(".toml"):
        return False
    with suppress(InputError, ValueError, RecursionError):
        return bool(_OWN & tomllib.loads(text_of(Path(path), _WHAT)).keys())
    return False


def study_of(name: str, content: Mapping[str, Any], path: Path | None = None) -> Study:
    """A study from what its file holds.

    Args:
        name: of the study.
        content: of the file.
        path: of the file; None: there is none.

    Raises:
        Refused: there is a mistake in it.

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
    entries["parameters"] = dict(flattened(content.get("parameters", {})))
    entries["vary"] = {}
    for key, value in flattened(content.get("vary", {}), _is_range):
        with findings.collecting():
            entries["vary"][key] = _values(f"{where}: vary: {key}", value)
    if "sample" in content:
        with findings.collecting():
            entries["sample"] = _sample(f"{where}: sample", content["sample"])
    if "stop_time" in content:
        entries["stop_time"] = _stop_time(content["stop_time"])
    findings.refuse()
    study = Study(name, **entries)
    _check_names(where, study)
    return study


def _is_range(value: Any) -> bool:
    return isinstance(value, Mapping) and bool({"from", "to"} & value.keys())


def _values(where: str, value: Any) -> tuple[Any, ...]:
    """The values of a list, or of a range under `vary`."""
    if isinstance(value, list) and value:
        return tuple(value)
    if not _is_range(value):
        raise InputError(f"{where}: write [values], or {{ from = 1.0, to = 10.0, n = 7 }}")
    GridTable.check(where, value)
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
    findings, ranges = Findings(), {}
    for key, value in flattened(content["range"], _is_range):
        with findings.collecting():
            if _is_range(value):
                RangeTable.check(f"{where}: {key}", value)
            ranges[key] = _range(f"{where}: {key}", value)
            if key.startswith("|") and not _is_norm(key, ranges[key]):
                raise InputError(
                    f"{where}: {key}: a norm is of two or three numbers, and not negative"
                )
    findings.refuse()
    if not ranges:
        raise InputError(f"{where}: draws nothing; name values under [sample.range]")
    return Sample(content["n"], ranges, content.get("method", METHODS[0]), content.get("seed", 0))


def _is_norm(key: str, limits: Range) -> bool:
    return len(members(key)) in (2, 3) and key.endswith("|") and min(limits[:2]) >= 0.0


def _stop_time(value: Any) -> StopTime:
    if isinstance(value, Mapping):
        return StopTime(value["base"], dict(flattened(value["per"])))
    return StopTime(value, {})


def _check_names(where: str, study: Study) -> None:
    """Check that names are names, that none is given twice, and that what is summed varies."""
    findings = Findings()
    stated = [*study.parameters, *([STEP] * (study.step is not None)), *study.varied]
    for name in stated:
        if name != STEP or name in study.parameters:
            try:
                port_name(name)
            except InputError as error:
                findings.problem(f"{where}: {error}")
        if stated.count(name) > 1:
            findings.problem(f"{where}: {name} is stated twice")
    for name in study.stop_time.per if study.stop_time else ():
        if name not in study.varied:
            hint = did_you_mean(name, study.varied)
            findings.problem(f"{where}: stop_time: {name} does not vary{hint}")
    findings.refuse()
