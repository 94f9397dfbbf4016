"""Runs of the report: each made once, and kept from one report to the next."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fmus.kinds import AUTO, KindName
from orchestrator.cosim.observers.table import Table
from orchestrator.cosim.plan import code_of, digest_of
from orchestrator.figures.visible import VisibleRows
from orchestrator.machine.errors import InputError
from orchestrator.machine.workers import Workers
from orchestrator.runs.folder import Ledger, open_ledger
from orchestrator.runs.preparation import Prepared, prepare_request
from orchestrator.runs.record import content_of, ending_in, header_in, loops_in
from orchestrator.runs.request import Request
from orchestrator.vehicle.indices import Metrics
from orchestrator.vehicle.signals import STANDARD, Loop


@dataclass(frozen=True)
class KeptRun:
    """What is kept of a run.

    Attributes:
        metrics: as in metrics.json; only `failure` for a run that could not be made.
        table: the rows that can be seen, which are all rows of a run of the paper.
        loops: of its vehicles.

    """

    metrics: Mapping[str, Any]
    table: Table
    loops: Sequence[Loop] = (STANDARD,)

    @property
    def failure(self) -> str | None:
        """Why the run ended early, or was not made."""
        return self.metrics.get("failure")


class KeptRuns:
    """What is kept of runs; equal ones, of whatever name, are made once."""

    def __init__(
        self,
        folder: Path,
        stop_time: float | None = None,
        kind: KindName = AUTO,
        force: bool = False,
    ) -> None:
        """Start without any.

        Args:
            folder: in which they are kept.
            stop_time: of all runs [s]; None: their own.
            kind: of the bundle's FMUs in all runs.
            force: move aside what was changed there.

        """
        self._folder, self._stop_time, self._kind = folder, stop_time, kind
        self._force = force
        self._keys: dict[Request, str] = {}
        self._labels: dict[str, str] = {}
        self._kept_runs: dict[str, KeptRun] = {}

    def __getitem__(self, request: Request) -> KeptRun:
        """What is kept of a run that was made."""
        return self._kept_runs[self._keys[request]]

    def label(self, request: Request) -> str:
        """The shortest of the labels that equal runs have."""
        return self._labels[self._keys[request]]

    @property
    def labels(self) -> list[str]:
        """Of all runs."""
        return list(self._labels.values())

    def make(self, requests: Iterable[Request], workers: Workers) -> None:
        """Make what is not kept in the folder, the longest first.

        Raises:
            InputError: what is kept was changed.
            KeyboardInterrupt: the user does not want to wait; runs that are finished are kept.

        """
        with open_ledger(self._folder, self._force) as ledger:
            self._make(requests, workers, ledger)

    def _make(self, requests: Iterable[Request], workers: Workers, ledger: Ledger) -> None:
        missing: dict[str, tuple[int, Request]] = {}
        for request in dict.fromkeys(requests):
            stop_time = self._stop_time or request.stop_time
            wanted = replace(request, stop_time=stop_time, kind=self._kind)
            try:
                prepared = prepare_request(wanted)
            except InputError as error:
                self._keys[request] = key = repr(request)
                self._labels[key] = request.label
                self._kept_runs[key] = KeptRun({"failure": str(error)}, Table())
                continue
            self._keys[request] = key = key_of(prepared)
            label = wanted.label
            self._labels[key] = min(label, self._labels.get(key, label), key=len)
            ledger.check([_file(key)])
            if ledger.owns(_file(key)):
                self._kept_runs[key] = _read(self._folder / _file(key))
            else:
                missing.setdefault(key, (prepared.experiment.rows, wanted))
        longest_first = sorted(missing.items(), key=lambda item: -item[1][0])
        tasks = {key: partial(_make, request, key) for key, (_, request) in longest_first}
        for key, kept_run in workers.results(tasks, "run"):
            self._kept_runs[key] = kept_run
            if kept_run.failure is None:
                with ledger.changing() as unfinished:
                    _write(unfinished / _file(key), kept_run)

    def forget_others(self) -> None:
        """Remove from the folder what belongs to no run of this report."""
        with open_ledger(self._folder) as ledger:
            ledger.remove(set(ledger.files) - set(map(_file, self._keys.values())))


def _file(key: str) -> str:
    """The name of the file of a kept run."""
    return f"{key}.npz"


def key_of(prepared: Prepared) -> str:
    """Digest of all that a kept run depends on."""
    kept = {
        "what is kept": code_of("orchestrator.vehicle", "orchestrator.figures", "orchestrator.runs")
    }
    return digest_of(prepared.identity, kept)[:32]


def _make(request: Request, key: str) -> KeptRun:
    """Make a run; a task for a worker."""
    try:
        prepared = prepare_request(request)
        if key_of(prepared) != key:
            raise InputError("FMUs have changed while the report was made; run the command again")
        metrics = Metrics(prepared.loops)
        seen = VisibleRows({name for loop in prepared.loops for name in loop.drawn()})
        prepared.run([metrics, seen])
    except InputError as error:
        return KeptRun({"failure": str(error)}, Table())
    values = metrics.content(prepared.scenario.name, prepared.system)
    return KeptRun(values, Table.of(seen.header, seen.rows, seen.ending), prepared.loops)


def _write(file: Path, kept_run: KeptRun) -> None:
    table = kept_run.table
    text = {
        "metrics": kept_run.metrics,
        "columns": table.columns,
        **content_of(table.header, table.ending, kept_run.loops),
    }
    # A column together: one that is constant then takes no room.
    np.savez_compressed(file, text=json.dumps(text), columns=table.rows.T)


def _read(file: Path) -> KeptRun:
    with np.load(file) as content:
        text, rows = json.loads(str(content["text"])), content["columns"].T
    table = Table.of(header_in(text, tuple(text["columns"])), rows, ending_in(text))
    return KeptRun(text["metrics"], table, loops_in(text))
