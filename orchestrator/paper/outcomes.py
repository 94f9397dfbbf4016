"""Outcomes of runs: each made once, and kept from one report to the next."""

from __future__ import annotations

import hashlib
import json
import sys
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

import orchestrator
from orchestrator.analysis.metrics import Metrics
from orchestrator.analysis.visible import VisibleRows
from orchestrator.errors import InputError
from orchestrator.experiments.bundle import PYTHON
from orchestrator.experiments.preparation import Prepared
from orchestrator.experiments.record import PACKAGES
from orchestrator.experiments.run import metrics_json
from orchestrator.master.experiment import Experiment
from orchestrator.master.observer import Ending, Header, Occurrence
from orchestrator.master.simulation import simulate
from orchestrator.master.table import Table
from orchestrator.paper.runs import Run
from orchestrator.paper.workers import Workers
from orchestrator.system.atomic import whole
from orchestrator.system.names import port_name

#: Rooms whose code says what is kept of a run.
_ROOMS = ("system", "master", "analysis", "experiments")


@dataclass(frozen=True)
class Outcome:
    """What is kept of a run.

    Attributes:
        metrics: as in metrics.json; `failure` alone for a run that could not be made.
        table: the rows that can be seen, which are all rows of a run of the paper.

    """

    metrics: Mapping[str, Any]
    table: Table

    @property
    def failure(self) -> str | None:
        """Why the run ended early, or was not made."""
        return self.metrics.get("failure")


class Outcomes:
    """Outcomes of runs; equal ones, of whatever name, are made once."""

    def __init__(self, folder: Path, stop_time: float | None = None, kind: str = PYTHON) -> None:
        """Start without any.

        Args:
            folder: in which outcomes are kept.
            stop_time: of all runs [s]; None: their own.
            kind: of the bundle's FMUs in all runs.

        """
        self._folder, self._stop_time, self._kind = folder, stop_time, kind
        self._keys: dict[Run, str] = {}
        self._labels: dict[str, str] = {}
        self._outcomes: dict[str, Outcome] = {}

    def __getitem__(self, run: Run) -> Outcome:
        """The outcome of a run that was made."""
        return self._outcomes[self._keys[run]]

    def label(self, run: Run) -> str:
        """The shortest of the labels that equal runs have."""
        return self._labels[self._keys[run]]

    @property
    def labels(self) -> list[str]:
        """Of all runs."""
        return list(self._labels.values())

    def make(self, runs: Iterable[Run], workers: Workers) -> None:
        """Make what is not kept in the folder, the longest first.

        Raises:
            KeyboardInterrupt: the user does not want to wait; runs that are finished are kept.

        """
        missing: dict[str, tuple[int, Run]] = {}
        for run in runs:
            wanted = replace(run, stop_time=self._stop_time or run.stop_time, kind=self._kind)
            try:
                prepared = wanted.prepared()
            except InputError as error:
                self._keys[run] = self._labels[run.label] = key = run.label
                self._outcomes[key] = Outcome({"failure": str(error)}, Table())
                continue
            self._keys[run] = key = key_of(prepared)
            label = wanted.label
            self._labels[key] = min(label, self._labels.get(key, label), key=len)
            kept = _read(self._file(key))
            if kept is None:
                missing.setdefault(key, (prepared.experiment.rows, wanted))
            else:
                self._outcomes[key] = kept
        longest_first = sorted(missing.items(), key=lambda item: -item[1][0])
        tasks = {key: partial(_make, run, self._file(key)) for key, (_, run) in longest_first}
        self._outcomes |= dict(workers.results(tasks, "run"))

    def forget_others(self) -> None:
        """Remove from the folder what belongs to no run of this report."""
        known = {self._file(key) for key in self._keys.values()}
        for file in set(self._folder.glob("*.npz")) - known:
            file.unlink()

    def _file(self, key: str) -> Path:
        return self._folder / f"{key}.npz"


def key_of(prepared: Prepared) -> str:
    """Digest of all that an outcome depends on."""
    system = prepared.system
    content = {
        "components": {name: part.digest for name, part in system.components.items()},
        "connections": sorted(f"{wire.source} {wire.target}" for wire in system.connections),
        "parameters": sorted(
            (str(name), value)
            for name, value in system.parameters.items()
            if value != system.component(name.component).start(name.port)
        ),
        "experiment": asdict(prepared.experiment),
        "events": repr(prepared.events),
        "inputs": prepared.course.digest if prepared.course else "",
        "versions": [sys.version, *map(version, PACKAGES)],
        "code": _code(),
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


@cache
def _code() -> str:
    """Digest of the code that makes an outcome."""
    digest = hashlib.sha256()
    [root] = orchestrator.__path__
    for room in _ROOMS:
        for path in sorted(Path(root, room).rglob("*.py")):
            digest.update(f"{room}/{path.name}\0".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def _make(run: Run, file: Path) -> Outcome:
    """Make a run and keep its outcome; a task for a worker."""
    try:
        prepared = run.prepared()
        if key_of(prepared) != file.stem:
            raise InputError("FMUs have changed while the report was made; make it anew")
        metrics, seen = Metrics(), VisibleRows()
        simulate(
            prepared.system,
            prepared.experiment,
            [metrics, seen],
            loop=prepared.loop,
            attendants=prepared.attendants(),
        )
    except InputError as error:
        return Outcome({"failure": str(error)}, Table())
    outcome = Outcome(
        metrics_json(metrics, prepared), Table.of(seen.header, seen.rows, seen.ending)
    )
    if outcome.failure is None:
        _write(file, outcome)
    return outcome


def _write(file: Path, outcome: Outcome) -> None:
    header = outcome.table.header
    text = {
        "metrics": outcome.metrics,
        "columns": header.columns,
        "experiment": asdict(header.experiment),
        "parameters": {str(name): value for name, value in header.parameters.items()},
        "messages": outcome.table.ending.messages,
        "events": outcome.table.ending.events,
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    with whole(file) as partial:
        # A column together: one that is constant then takes no room.
        np.savez_compressed(partial, text=json.dumps(text), columns=outcome.table.rows.T)


def _read(file: Path) -> Outcome | None:
    try:
        with np.load(file) as content:
            text, rows = json.loads(str(content["text"])), content["columns"].T
        header = Header(
            tuple(text["columns"]),
            Experiment(**text["experiment"]),
            {port_name(name): value for name, value in text["parameters"].items()},
        )
    except (OSError, EOFError, ValueError, KeyError, BadZipFile, zlib.error):
        # Not there, or not whole.
        return None
    events = tuple(Occurrence(*event) for event in text["events"])
    ending = Ending(messages=tuple(text["messages"]), events=events)
    return Outcome(text["metrics"], Table.of(header, rows, ending))
