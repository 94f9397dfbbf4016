"""Runs that the report needs: scenarios with changes."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from orchestrator.master.experiment import Order, written_order
from orchestrator.runs.bundle import PYTHON
from orchestrator.runs.inputs import inputs_of
from orchestrator.runs.preparation import (
    Prepared,
    Request,
    loaded,
    prepare,
    with_companion,
)
from orchestrator.runs.scenario import read_scenario
from orchestrator.system.names import port_name
from orchestrator.system.values import Value, literal


@dataclass(frozen=True)
class Variation:
    """A scenario with changes.

    Attributes:
        scenario: its name, or the path of its file.
        parameters: values that win over the scenario's, by `component.parameter`.
        order: of evaluation; None: the scenario's own.
        stop_time, step: experiment [s]; None: the scenario's own.
        kind: of the bundle's FMUs.
        events: the scenario whose events happen; empty: its own.
        inputs: the table that inputs follow; empty: the scenario's own.
        steps: of components that take longer ones [s]; they win over the scenario's.
        coupling: how rings are closed; None: as the scenario has it.

    """

    scenario: str
    parameters: Mapping[str, Any] = field(default_factory=dict, hash=False)
    order: Order | None = None
    stop_time: float | None = None
    step: float | None = None
    kind: str = PYTHON
    events: str = ""
    inputs: str = ""
    steps: Mapping[str, float] = field(default_factory=dict, hash=False)
    coupling: str | None = None

    @property
    def label(self) -> str:
        """What a user types behind `auv-fmu run`."""
        options = [
            *(("--stop-time", _text(self.stop_time)) if self.stop_time is not None else ()),
            *(("--step", _text(self.step)) if self.step is not None else ()),
            *(("--order", written_order(self.order)) if self.order is not None else ()),
            *(("--coupling", self.coupling) if self.coupling is not None else ()),
            *(("--kind", self.kind) if self.kind != PYTHON else ()),
            *(("--events", self.events) if self.events else ()),
            *(("--inputs", self.inputs) if self.inputs else ()),
        ]
        for name, value in self.parameters.items():
            options += ["--set", f"{name}={_text(value)}"]
        # For these there is no option.
        steps = ", ".join(f"{name} = {_text(step)} s" for name, step in self.steps.items())
        return shlex.join((self.scenario, *options)) + f" (steps: {steps})" * bool(steps)

    @property
    def request(self) -> Request:
        """The changes."""
        parameters = {port_name(name): value for name, value in self.parameters.items()}
        return Request(
            self.stop_time,
            self.step,
            self.order,
            parameters,
            kind=self.kind,
            steps=self.steps,
            events=read_scenario(self.events).events if self.events else None,
            inputs=inputs_of(self.inputs or None),
            coupling=self.coupling,
        )

    def prepared(self) -> Prepared:
        """What is run.

        Raises:
            InputError: scenario or changes are not usable.

        """
        return prepare(*loaded(self.scenario, self.kind), self.request)

    def companions(self) -> list[Variation]:
        """Runs that are drawn together with this one.

        Raises:
            InputError: scenario or changes are not usable.

        """
        prepared = self.prepared()
        return [
            self._as_run(prepared.scenario.compare, companion)
            for companion in with_companion(prepared, self.request)[1:]
        ]

    def _as_run(self, scenario: str, prepared: Prepared) -> Variation:
        """What was prepared from a scenario as its companion, by the least changes to it."""
        own = Variation(scenario, kind=self.kind).prepared()
        experiment, input_table = prepared.experiment, prepared.input_table
        played = input_table.targets if input_table else ()
        inputs = prepared.scenario.inputs
        return Variation(
            scenario,
            {
                str(name): value
                for name, value in prepared.system.parameters.items()
                if own.system.value(name) != value and name not in played
            },
            None if experiment.order == own.experiment.order else experiment.order,
            None if experiment.stop_time == own.experiment.stop_time else experiment.stop_time,
            None if experiment.step == own.experiment.step else experiment.step,
            self.kind,
            "" if prepared.events == own.events else self.events or self.scenario,
            str(inputs.file) if inputs and inputs != own.scenario.inputs else "",
            {
                name: step
                for name, step in prepared.system.steps.items()
                if own.system.steps.get(name) != step
            },
            None if experiment.coupling == own.experiment.coupling else experiment.coupling,
        )


def _text(value: Value) -> str:
    """A value that is read back as the same, and no longer than it must be."""
    return literal(value).removesuffix(".0") if isinstance(value, float) else literal(value)
