"""Runs of the report: equal ones, of whatever name, are made once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from fmus.kinds import AUTO, KindName
from orchestrator.cosim import Table
from orchestrator.figures.visible import VisibleRows
from orchestrator.machine.errors import InputError
from orchestrator.machine.identity import digest_of
from orchestrator.machine.workers import Workers
from orchestrator.runs.preparation import Prepared, prepare_request, with_companion
from orchestrator.runs.request import Request
from orchestrator.vehicle.indices import Metrics
from orchestrator.vehicle.signals import STANDARD, Loop


@dataclass(frozen=True)
class Companion(Request):
    """The run that a scenario is compared with, by the request of the scenario."""

    @property
    def label(self) -> str:
        """The command that makes both runs."""
        return f"{super().label} (its companion)"


@dataclass(frozen=True)
class KeptRun:
    """The part of a run that the report needs.

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
    """Runs by their requests."""

    def __init__(
        self,
        requests: Iterable[Request],
        workers: Workers,
        stop_time: float | None = None,
        kind: KindName = AUTO,
    ) -> None:
        """Make the runs, the longest first.

        Args:
            requests: of the runs.
            workers: that make them.
            stop_time: of all runs [s]; None: their own.
            kind: of the bundle's FMUs in all runs.

        Raises:
            KeyboardInterrupt: the user does not want to wait.

        """
        self._keys: dict[Request, str] = {}
        self._labels: dict[str, str] = {}
        self._kept_runs: dict[str, KeptRun] = {}
        wanted: dict[str, tuple[int, Request]] = {}
        for request in dict.fromkeys(requests):
            asked = replace(request, stop_time=stop_time or request.stop_time, kind=kind)
            try:
                prepared = _prepared(asked)
            except InputError as error:
                key, label = repr(request), request.label
                self._kept_runs[key] = KeptRun({"failure": str(error)}, Table())
            else:
                key, label = digest_of(prepared.identity), asked.label
                wanted.setdefault(key, (prepared.experiment.rows, asked))
            self._keys[request] = key
            self._labels[key] = min(label, self._labels.get(key, label), key=len)
        longest_first = sorted(wanted.items(), key=lambda item: -item[1][0])
        tasks = {key: partial(_make, asked) for key, (_, asked) in longest_first}
        self._kept_runs.update(workers.results(tasks, "run"))

    def __getitem__(self, request: Request) -> KeptRun:
        """The run of a request."""
        return self._kept_runs[self._keys[request]]

    def label(self, request: Request) -> str:
        """The shortest of the labels that equal runs have."""
        return self._labels[self._keys[request]]

    @property
    def labels(self) -> list[str]:
        """The labels of all runs."""
        return list(self._labels.values())


def _prepared(request: Request) -> Prepared:
    own = prepare_request(request)
    return with_companion(own, request)[1] if isinstance(request, Companion) else own


def _make(request: Request) -> KeptRun:
    """Make a run; a task for a worker."""
    try:
        prepared = _prepared(request)
        metrics = Metrics(prepared.loops)
        seen = VisibleRows({name for loop in prepared.loops for name in loop.drawn()})
        prepared.run([metrics, seen])
    except InputError as error:
        return KeptRun({"failure": str(error)}, Table())
    values = metrics.content(prepared.scenario.name, prepared.system)
    return KeptRun(values, Table.of(seen.header, seen.rows, seen.ending), prepared.loops)
