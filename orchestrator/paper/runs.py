"""Runs that the report needs: scenarios with changes."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from orchestrator.experiments.bundle import PYTHON
from orchestrator.experiments.preparation import (
    Prepared,
    Request,
    loaded,
    prepare,
    with_companion,
)
from orchestrator.master.experiment import ORDERS, Order, written_order
from orchestrator.system.names import port_name
from orchestrator.system.values import Value, literal


@dataclass(frozen=True)
class Run:
    """A scenario with changes.

    Attributes:
        scenario: its name, or the path of its file.
        parameters: values that win over the scenario's, by `component.parameter`.
        order: of evaluation.
        stop_time, step: experiment [s]; None: the scenario's own.
        kind: of the bundle's FMUs.

    """

    scenario: str
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)
    order: Order = ORDERS[0]
    stop_time: float | None = None
    step: float | None = None
    kind: str = PYTHON

    @property
    def label(self) -> str:
        """What a user types behind `auv-fmu run`."""
        options = [
            *(("--stop-time", _text(self.stop_time)) if self.stop_time is not None else ()),
            *(("--step", _text(self.step)) if self.step is not None else ()),
            *(("--order", written_order(self.order)) if self.order != ORDERS[0] else ()),
            *(("--kind", self.kind) if self.kind != PYTHON else ()),
        ]
        for name, value in self.parameters.items():
            options += ["--set", f"{name}={_text(value)}"]
        return shlex.join((self.scenario, *options))

    @property
    def request(self) -> Request:
        """The changes."""
        parameters = {port_name(name): value for name, value in self.parameters.items()}
        return Request(self.stop_time, self.step, self.order, parameters, kind=self.kind)

    def prepared(self) -> Prepared:
        """What is run.

        Raises:
            InputError: scenario or changes are not usable.

        """
        return prepare(*loaded(self.scenario, self.kind), self.request)

    def companions(self) -> list[Run]:
        """Runs that are drawn together with this one.

        Raises:
            InputError: scenario or changes are not usable.

        """
        prepared = self.prepared()
        return [
            _as_run(prepared.scenario.compare, companion, self.kind)
            for companion in with_companion(prepared, self.request)[1:]
        ]


def _text(value: Value) -> str:
    """A value that is read back as the same, and no longer than it must be."""
    return literal(value).removesuffix(".0") if isinstance(value, float) else literal(value)


def _as_run(scenario: str, prepared: Prepared, kind: str) -> Run:
    """What was prepared from a scenario, by the least changes to it."""
    own = Run(scenario, kind=kind).prepared()
    experiment = prepared.experiment
    return Run(
        scenario,
        {
            str(name): value
            for name, value in prepared.system.parameters.items()
            if own.system.value(name) != value
        },
        experiment.order,
        None if experiment.stop_time == own.experiment.stop_time else experiment.stop_time,
        None if experiment.step == own.experiment.step else experiment.step,
        kind,
    )
