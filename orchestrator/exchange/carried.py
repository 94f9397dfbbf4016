"""Verification of an FMU by the reference results that it carries, in the draft FMI-LS-REF.

A manifest names the files; experiments are in the draft MA-HS-Experiments. The drafts leave two
things open, which are decided here: how close results must be, and the value of an input between
two rows.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element

import numpy as np

from fmus.discovery import RELATED, RELATED_MANIFEST
from orchestrator.cosim import (
    Component,
    Experiment,
    Hook,
    PortName,
    System,
    Table,
    Value,
    Variable,
    make_plan,
    read_parameter_set,
    simulate_plan,
)
from orchestrator.exchange.verify import TOLERANCE, check_tolerance, enumerated
from orchestrator.machine.documents import read_document
from orchestrator.machine.errors import Findings, InputError, listed
from orchestrator.machine.texts import finite
from orchestrator.machine.user_files import explain_errors
from orchestrator.runs.preparation import first_given, read_fmu
from orchestrator.runs.scenario import with_input_table
from orchestrator.runs.tables import places_of_time, port_of, records, time_of

#: Name of the standard in a manifest.
_STANDARD = "org.fmi-standard.fmi-ls-ref"

#: Attributes with the times of an experiment.
_TIMES = ("startTime", "stopTime", "stepSize")

#: The only supported kind of experiment.
_TRANSIENT = "TransientSimulation"

#: Elements of an experiment that name files, and the supported types of these files.
_PARAMETERS, _STIMULI, _REFERENCES = "Parameters", "Stimuli", "References"
_TYPES = {
    _PARAMETERS: "application/x-ssp-parameter-set",
    _STIMULI: "text/csv",
    _REFERENCES: "text/csv",
}

#: Another element that an experiment may have.
_ANNOTATIONS = "Annotations"


class Verdict(NamedTuple):
    """Result of an experiment.

    Attributes:
        name: name of the experiment.
        text: what was compared, or why nothing was.
        agrees: true if the results agree with the carried ones; None: it carries none.
        notes: flaws that do not affect the result.

    """

    name: str
    text: str
    agrees: bool | None
    notes: Sequence[str] = ()


class _Trial(NamedTuple):
    """An experiment that an FMU carries.

    Attributes:
        name: its name.
        element: its XML element.
        folders: folders that its URIs may be relative to.

    """

    name: str
    element: Element
    folders: Sequence[Path]


class Carried:
    """The experiments that an FMU carries."""

    def __init__(self, fmu: Path, verbose: bool = False) -> None:
        """Read the manifest.

        Args:
            fmu: path of the FMU.
            verbose: if set, name all outputs without a result.

        Raises:
            InputError: there is no such FMU, or it carries no reference results.

        """
        self._fmu, self._verbose = fmu, verbose
        self._findings = Findings()
        self._system = read_fmu(fmu, self._findings)
        [self._component] = self._system.components.values()
        self._folder = self._component.folder
        self._place = self._folder / RELATED
        manifest = self._place / RELATED_MANIFEST
        if not manifest.is_file():
            raise InputError(
                f"{fmu}: carries no reference results: it holds no {RELATED}/{manifest.name}"
            )
        self._manifest = self._read(manifest, "fmiReferences")
        if (name := self._manifest.get("fmi-ls-name")) != _STANDARD:
            self._findings.note(f"{manifest.name} is for {name!r}, not {_STANDARD!r}")

    @property
    def version(self) -> str:
        """Version of the standard, from the manifest."""
        return self._manifest.get("fmi-ls-version", "without a version")

    @property
    def notes(self) -> Sequence[str]:
        """Flaws of the FMU that do not affect the results."""
        return self._findings.notes

    def _read(self, path: Path, root: str) -> Element:
        """Read the root element of a file of the FMU.

        Raises:
            InputError: the file is not readable, or has another root element.

        """
        name = path.relative_to(self._folder)
        with explain_errors(self._fmu, f"{name} is not readable"):
            element = read_document(path.read_bytes())
            if element.tag != root:
                raise ValueError(f"its root element is <{element.tag}>, not <{root}>")
            return element

    def verdicts(self, tolerance: float | None = None) -> Iterator[Verdict]:
        """Run the experiments one by one and compare their results.

        Args:
            tolerance: largest accepted difference; None: the experiment's, else
                :data:`.verify.TOLERANCE`.

        """
        if tolerance is not None:
            check_tolerance(tolerance)
        results = []
        has_experiments = False
        for related in self._manifest.iter("Related"):
            role, source = related.get("role", ""), related.get("source", "")
            if role == "result":
                results.append(source)
            if role.partition("/")[0] != "experiment":
                continue
            has_experiments = True
            try:
                path = self._file(source, [self._place])
                experiments = self._read(path, "Experiments").findall("Experiment")
                if not experiments:
                    raise InputError("holds no experiment")
            except InputError as error:
                yield Verdict(source, self._without_folders(str(error)), False)
                continue
            for number, element in enumerate(experiments, start=1):
                name = element.get("name") or f"{source}, experiment {number}"
                # URIs are relative to different folders in different drafts.
                yield self._verdict(_Trial(name, element, (path.parent, self._place)), tolerance)
        if has_experiments:
            return
        for source in results:
            # Without experiments, the results are from the FMU's default experiment.
            element = Element("Experiment")
            element.append(Element(_REFERENCES, source=source))
            yield self._verdict(_Trial(source, element, [self._place]), tolerance)

    def _verdict(self, trial: _Trial, tolerance: float | None) -> Verdict:
        """Run an experiment if it has results to compare with."""
        if trial.element.find(_REFERENCES) is None:
            return Verdict(trial.name, "not run: it names no results to compare with", None)
        findings = Findings()
        try:
            text = self._compare(trial, tolerance, findings)
            agrees = True
        except InputError as error:
            text, agrees = self._without_folders(str(error)), False
        return Verdict(trial.name, text, agrees, [*map(self._without_folders, findings.notes)])

    def _without_folders(self, text: str) -> str:
        """Remove the temporary folders of the unpacked FMU from a message."""
        for known in (f"{self._place}{os.sep}", f"{self._place}: ", f"{self._folder}{os.sep}"):
            text = text.replace(known, "")
        return text.removeprefix(f"{self._fmu}: ")

    def _compare(self, trial: _Trial, tolerance: float | None, findings: Findings) -> str:
        """Run an experiment, and describe how its results agree.

        Raises:
            InputError: it cannot be run, or its results do not agree.

        """
        settings = self._settings(trial.element)
        whose = "--tolerance"
        if tolerance is None:
            stated = _number(trial.element, "tolerance")
            whose = "our default" if stated is None else "the experiment's"
            tolerance = TOLERANCE if stated is None else stated
            check_tolerance(tolerance)
        expected = self._series(trial, _REFERENCES)
        if expected is None or not len(expected.times):
            raise InputError("its results have no rows")
        system = self._parametrised(trial, findings)
        start, stop, step = (_number(settings, name) for name in _TIMES)
        start = first_given(start, system.start_time) or 0.0
        stop = first_given(stop, system.stop_time) or float(expected.times[-1])
        step = first_given(step, system.step) or _interval(expected.times)
        hooks: list[Hook] = []
        if (stimuli := self._series(trial, _STIMULI)) is not None:
            names = [PortName(self._component.name, name) for name in stimuli.columns]
            columns = list(stimuli.columns.values())
            system, input_table = with_input_table(system, names, stimuli.times, columns)
            hooks.append(input_table.playback())
            _note_unknown(stimuli, "the table of inputs", findings)
        table = Table()
        # Tools record the results of a step before they set the inputs of its end.
        plan = make_plan(system, Experiment(stop, step, "gauss-seidel", start))
        simulate_plan(plan, [table], hooks).require_success(system.name)
        _note_unknown(expected, "the table of results", findings)
        agreement = _compare_results(table, self._component, expected, tolerance, stop)
        outputs = (variable.name for variable in self._component.having("output"))
        absent = [name for name in outputs if name not in expected.columns]
        lacking = f"; no reference result: {enumerated(absent, self._verbose)}" if absent else ""
        return f"{agreement} ({whose}){lacking}"

    @staticmethod
    def _settings(element: Element) -> Element:
        """Return the element with the times of an experiment: itself, or its child for its kind.

        Raises:
            InputError: it is not a simulation over time.

        """
        for child in element:
            if child.tag == _TRANSIENT:
                return child
            if child.tag not in (*_TYPES, _ANNOTATIONS):
                raise InputError(f"asks for {child.tag}; only simulations over time are supported")
        return element

    def _parametrised(self, trial: _Trial, findings: Findings) -> System:
        """Return the FMU with the parameters of an experiment."""
        path = self._named(trial, _PARAMETERS)
        if path is None:
            return self._system
        values = read_parameter_set(path, self._component, findings)
        return self._system.with_parameters(values)

    def _series(self, trial: _Trial, part: str) -> _Series | None:
        """Read a table that an experiment names; None: it names none."""
        path = self._named(trial, part)
        if path is None:
            return None
        variables = self._component.having("input" if part == _STIMULI else "output")
        return _read_series(path, variables)

    def _named(self, trial: _Trial, part: str) -> Path | None:
        """Return a file that an experiment names; None: it names none.

        Raises:
            InputError: the FMU does not contain it, or its type is not supported.

        """
        element = trial.element.find(part)
        if element is None:
            return None
        if (stated := element.get("type", _TYPES[part])) != _TYPES[part]:
            raise InputError(f"{part} of type {stated!r}; only {_TYPES[part]} is supported")
        return self._file(element.get("source", ""), trial.folders)

    def _file(self, source: str, folders: Sequence[Path]) -> Path:
        """Find a file of the FMU.

        Args:
            source: a relative URI.
            folders: folders that it may be relative to.

        Raises:
            InputError: there is no such file.

        """
        try:
            parts = urlsplit(source)
        except ValueError:
            raise InputError(f"{source!r} is not a URI") from None
        if parts.scheme or parts.netloc:
            raise InputError(f"{source!r} is not in the FMU; only files in the FMU are read")
        for folder in folders:
            path = Path(os.path.normpath(folder / unquote(parts.path)))
            if path.is_relative_to(self._folder) and path.is_file():
                return path
        raise InputError(f"the FMU holds no {source!r}")


def _number(element: Element, name: str) -> float | None:
    """Read an attribute that is a number; None: the element does not have it."""
    text = element.get(name)
    try:
        return None if text is None else finite(text, name)
    except ValueError as error:
        raise InputError(str(error)) from None


def _interval(times: np.ndarray) -> float:
    """Return the shortest interval between two rows [s], for an FMU that specifies no step."""
    intervals = np.diff(times)
    intervals = intervals[intervals > 0.0]
    if not len(intervals):
        raise InputError("neither the experiment nor the FMU specifies a step")
    return float(intervals.min())


def _note_unknown(series: _Series, what: str, findings: Findings) -> None:
    if series.others:
        findings.note(
            f"{what} has columns that match no variable and are skipped: {listed(series.others)}"
        )


class _Series(NamedTuple):
    """A table of values over time.

    Attributes:
        times: times of the rows [s].
        columns: values by variable: texts of a String, else numbers.
        others: names of other columns.

    """

    times: np.ndarray
    columns: Mapping[str, np.ndarray]
    others: Sequence[str]


def _read_series(path: Path, variables: Sequence[Variable]) -> _Series:
    """Read a table of variables over time; a cell of an array holds all its elements.

    Raises:
        InputError: the table has an error.

    """
    known: dict[str, list[Variable]] = {}
    for variable in variables:
        known.setdefault(variable.name, []).append(variable)
        if variable.shape and variable.family != "String":
            known.setdefault(variable.array, []).append(variable)
    with records(path, "not a table of values over time", places_of_time) as (names, rows):
        clocks = places_of_time(names)
        if not clocks:
            raise ValueError("no column of its first line is named time")
        longest = max(map(len, known), default=0)
        ports = {
            place: known[name]
            for place, text in enumerate(names)
            if place not in clocks and (name := port_of(text, known, longest)) is not None
        }
        port_names = [variable.name for group in ports.values() for variable in group]
        if len({*port_names}) < len(port_names):
            raise ValueError("two columns belong to the same variable")
        times: list[float] = []
        columns: dict[str, list[Value]] = {name: [] for name in port_names}
        for line, row in rows:
            times.append(time_of(row, clocks, f"line {line}"))
            if len(times) > 1 and times[-1] < times[-2]:
                raise ValueError(f"line {line}: times must not decrease")
            for place, group in ports.items():
                cells = [row[place]] if len(group) == 1 else row[place].split()
                if len(cells) != len(group):
                    raise ValueError(
                        f"line {line}, {names[place]}: {len(cells)} values of an array of "
                        f"{len(group)}"
                    )
                for variable, text in zip(group, cells, strict=True):
                    where = f"line {line}, {variable.name}:"
                    columns[variable.name].append(variable.cell(text, where))
    others = [text for place, text in enumerate(names) if place not in (*clocks, *ports)]
    arrays = {name: np.array(values) for name, values in columns.items()}
    return _Series(np.array(times), arrays, others)


def _compare_results(
    table: Table, component: Component, expected: _Series, tolerance: float, stop_time: float
) -> str:
    """Compare results with the expected ones, and describe how they agree.

    A Real may differ by the tolerance times the larger of one and its largest magnitude; it is
    interpolated between two rows of the run. All other types must be equal, and hold their value
    until the next row. Of several rows with the same time only the first is compared.

    Raises:
        InputError: they do not agree, there is nothing to compare, or the run ended before both the
            stop time and the end of the expected results.

    """
    if not expected.columns:
        raise InputError("none of the columns of its results is an output")
    times, ours = expected.times, table.time
    slack = Experiment.ROUNDING * max(1.0, float(np.abs(ours).max()))
    new = np.diff(times, prepend=-np.inf) > slack
    chosen = new & (times >= ours[0] - slack) & (times <= ours[-1] + slack)
    if not chosen.any():
        raise InputError(
            f"its results have no row from t = {ours[0]:g} to {ours[-1]:g} s, the time of the run"
        )
    if (new & (times > ours[-1] + slack) & (times <= stop_time + slack)).any():
        raise InputError(f"ended at t = {ours[-1]:g} s, before its results end")
    times = times[chosen]
    rows = np.searchsorted(ours, times + slack, side="right") - 1
    # Most times are the time of a row, apart from rounding.
    exact = np.where(np.abs(ours[rows] - times) <= slack, ours[rows], times)
    worst, first = 0.0, None
    for name, column in expected.columns.items():
        references, values = column[chosen], table[f"{component.name}.{name}"]
        if component.variables[name].family == "Real":
            values = np.interp(exact, ours, values)
            deviations = np.abs(values - references) / max(1.0, float(np.abs(references).max()))
            wrong, worst = deviations > tolerance, max(worst, float(deviations.max()))
        else:
            values = values[rows]
            wrong = values != references
        if wrong.any() and (first is None or times[wrong][0] < first[0]):
            first = times[wrong][0], name, values[wrong][0], references[wrong][0]
    if first is not None:
        time, name, value, reference = first
        raise InputError(
            f"{name} differs first, at t = {time:g} s: {_shown(value)} instead of "
            f"{_shown(reference)}, with a tolerance of {tolerance:g}"
        )
    left = int((new & ~chosen).sum())
    n = len(expected.columns)
    outputs = f"{n} outputs agree" if n > 1 else f"{n} output agrees"
    others = f", {left} rows are outside the run" * bool(left)
    return (
        f"{outputs} in {len(times)} rows from t = {times[0]:g} to {times[-1]:g} s{others}; "
        f"they differ by at most {worst:.2g}, with a tolerance of {tolerance:g}"
    )


def _shown(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.9g}"
    return repr(str(value)) if isinstance(value, str) else str(value)
