"""What an FMU carries to be verified with: experiments and their results, in the draft FMI-LS-REF.

A manifest names the files. Experiments are in the draft MA-HS-Experiments. Where the drafts leave
something open, it is decided here: how close results must come, and what an input does between two
rows.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element

import numpy as np

from fmus.discovery import RELATED, RELATED_MANIFEST
from orchestrator.cosim import (
    Experiment,
    Hook,
    PortName,
    System,
    Table,
    make_plan,
    read_parameter_set,
    simulate_plan,
)
from orchestrator.exchange.series import Series, comparison, read_series
from orchestrator.exchange.verify import TOLERANCE, check_tolerance, enumerated
from orchestrator.machine.documents import read_document
from orchestrator.machine.errors import Findings, InputError, listed
from orchestrator.machine.texts import finite
from orchestrator.machine.user_files import explain_errors
from orchestrator.runs.preparation import first_given, read_fmu
from orchestrator.runs.scenario import with_input_table

#: The name of the standard, in a manifest.
_STANDARD = "org.fmi-standard.fmi-ls-ref"

#: The attributes with the times of an experiment.
_TIMES = ("startTime", "stopTime", "stepSize")

#: The only kind of experiment that is made.
_TRANSIENT = "TransientSimulation"

#: The elements of an experiment that name files, and the types of files that are read.
_PARAMETERS, _STIMULI, _REFERENCES = "Parameters", "Stimuli", "References"
_TYPES = {
    _PARAMETERS: "application/x-ssp-parameter-set",
    _STIMULI: "text/csv",
    _REFERENCES: "text/csv",
}

#: What else it may hold besides its kind.
_ANNOTATIONS = "Annotations"


class Judgement(NamedTuple):
    """What came of an experiment.

    Attributes:
        name: of the experiment.
        text: what was compared, or why not.
        agrees: whether the results are those that the FMU carries; None: it carries none.
        notes: what is not as it should be, and changes nothing.

    """

    name: str
    text: str
    agrees: bool | None
    notes: Sequence[str] = ()


class _Trial(NamedTuple):
    """An experiment that an FMU carries, as its file has it.

    Attributes:
        name: of it.
        element: its element.
        folders: to which addresses in it may be relative.

    """

    name: str
    element: Element
    folders: Sequence[Path]


class Carried:
    """The experiments that an FMU carries."""

    def __init__(self, fmu: Path, verbose: bool = False) -> None:
        """Read the manifest.

        Args:
            fmu: the file.
            verbose: whether all outputs without a result are named.

        Raises:
            InputError: there is no FMU, or nothing in it that it could be verified with.

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
        """Of the standard, as the manifest says."""
        return self._manifest.get("fmi-ls-version", "without a version")

    @property
    def notes(self) -> Sequence[str]:
        """What is not as it should be, and changes nothing."""
        return self._findings.notes

    def _read(self, path: Path, root: str) -> Element:
        """The root element of a file of the FMU.

        Raises:
            InputError: it is another one, or there is none.

        """
        name = path.relative_to(self._folder)
        with explain_errors(self._fmu, f"{name} is not readable"):
            element = read_document(path.read_bytes())
            if element.tag != root:
                raise ValueError(f"its root element is <{element.tag}>, not <{root}>")
            return element

    def judgements(self, tolerance: float | None = None) -> Iterator[Judgement]:
        """Make the experiments one by one, and compare their results.

        Args:
            tolerance: how far values may differ; None: what the experiment says, else
                :data:`.verify.TOLERANCE`.

        """
        if tolerance is not None:
            check_tolerance(tolerance)
        results = []
        found = False
        for related in self._manifest.iter("Related"):
            role, source = related.get("role", ""), related.get("source", "")
            if role == "result":
                results.append(source)
            if role.partition("/")[0] != "experiment":
                continue
            found = True
            try:
                path = self._file(source, [self._place])
                experiments = self._read(path, "Experiments").findall("Experiment")
                if not experiments:
                    raise InputError("holds no experiment")
            except InputError as error:
                yield Judgement(source, self._said(str(error)), False)
                continue
            for number, element in enumerate(experiments, start=1):
                name = element.get("name") or f"{source}, experiment {number}"
                # Drafts differ in what addresses are relative to.
                yield self._judged(_Trial(name, element, (path.parent, self._place)), tolerance)
        if found:
            return
        for source in results:
            # Then the only experiment that there is is the one in the FMU's description.
            element = Element("Experiment")
            element.append(Element(_REFERENCES, source=source))
            yield self._judged(_Trial(source, element, [self._place]), tolerance)

    def _judged(self, trial: _Trial, tolerance: float | None) -> Judgement:
        """Make an experiment, if there are results to compare with."""
        if trial.element.find(_REFERENCES) is None:
            return Judgement(trial.name, "not run: it names no results to compare with", None)
        findings = Findings()
        try:
            text = self._compared(trial, tolerance, findings)
            agrees = True
        except InputError as error:
            text, agrees = self._said(str(error)), False
        return Judgement(trial.name, text, agrees, [*map(self._said, findings.notes)])

    def _said(self, text: str) -> str:
        """A message without the folders in which the FMU is for now."""
        for known in (f"{self._place}{os.sep}", f"{self._place}: ", f"{self._folder}{os.sep}"):
            text = text.replace(known, "")
        return text.removeprefix(f"{self._fmu}: ")

    def _compared(self, trial: _Trial, tolerance: float | None, findings: Findings) -> str:
        """Make an experiment, and say how its results agree.

        Raises:
            InputError: it cannot be made, or they do not.

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
        # Tools record results after a step, before they set the inputs of its end.
        plan = make_plan(system, Experiment(stop, step, "gauss-seidel", start))
        simulate_plan(plan, [table], hooks).require_success(system.name)
        _note_unknown(expected, "the table of results", findings)
        said = f"{comparison(table, self._component, expected, tolerance, stop)} ({whose})"
        outputs = (variable.name for variable in self._component.having("output"))
        absent = [name for name in outputs if name not in expected.columns]
        lacking = f"; no reference result: {enumerated(absent, self._verbose)}" if absent else ""
        return f"{said}{lacking}"

    @staticmethod
    def _settings(element: Element) -> Element:
        """The element that has the times of an experiment: itself, or the kind that it is of.

        Raises:
            InputError: it is of another kind than a simulation over time.

        """
        for child in element:
            if child.tag == _TRANSIENT:
                return child
            if child.tag not in (*_TYPES, _ANNOTATIONS):
                raise InputError(f"asks for {child.tag}; only simulations over time are supported")
        return element

    def _parametrised(self, trial: _Trial, findings: Findings) -> System:
        """The FMU with the parameters of an experiment."""
        path = self._named(trial, _PARAMETERS)
        if path is None:
            return self._system
        values = read_parameter_set(path, self._component, findings)
        return self._system.with_parameters(values)

    def _series(self, trial: _Trial, part: str) -> Series | None:
        """A table that an experiment names; None: it names none."""
        path = self._named(trial, part)
        if path is None:
            return None
        variables = self._component.having("input" if part == _STIMULI else "output")
        return read_series(path, variables)

    def _named(self, trial: _Trial, part: str) -> Path | None:
        """A file that an experiment names; None: it names none.

        Raises:
            InputError: the FMU does not hold it, or it is of a type that is not read.

        """
        element = trial.element.find(part)
        if element is None:
            return None
        if (stated := element.get("type", _TYPES[part])) != _TYPES[part]:
            raise InputError(f"{part} of type {stated!r}; only {_TYPES[part]} is supported")
        return self._file(element.get("source", ""), trial.folders)

    def _file(self, source: str, folders: Sequence[Path]) -> Path:
        """A file of the FMU, by its address.

        Args:
            source: a relative URI.
            folders: that it may be relative to.

        Raises:
            InputError: there is none.

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
    """An attribute that is a number; None: it is not stated."""
    text = element.get(name)
    try:
        return None if text is None else finite(text, name)
    except ValueError as error:
        raise InputError(str(error)) from None


def _interval(times: np.ndarray) -> float:
    """The shortest interval between two rows, for an FMU that names no step [s]."""
    intervals = np.diff(times)
    intervals = intervals[intervals > 0.0]
    if not len(intervals):
        raise InputError("neither the experiment nor the FMU specifies a step")
    return float(intervals.min())


def _note_unknown(series: Series, what: str, findings: Findings) -> None:
    if series.others:
        findings.note(
            f"{what} has columns that match no variable and are skipped: {listed(series.others)}"
        )
