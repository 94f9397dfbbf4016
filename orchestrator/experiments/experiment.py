"""One experiment: a scenario or an SSP, run with the user's changes, and its files."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from orchestrator.analysis.certificates import (
    has_certificates,
    velocities_reaching,
    write_certificates,
)
from orchestrator.analysis.figures import FIGURES, Drawn, draw, is_drawable
from orchestrator.analysis.metrics import metrics
from orchestrator.errors import InputError
from orchestrator.experiments import bundle
from orchestrator.experiments.scenario import Scenario, read_scenario
from orchestrator.master.result import Result
from orchestrator.master.simulation import ORDERS, simulate
from orchestrator.system.ssp import read_ssp
from orchestrator.system.structure import PortName, System

#: Communication step of the paper [s], for systems that name none.
DEFAULT_STEP = 0.02


@dataclass(frozen=True)
class Request:
    """What the user asks for beyond the scenario.

    Attributes:
        stop_time, step: experiment [s]; None: the scenario's or the system's own.
        order: of evaluation.
        parameters: values that win over the scenario's.
        progress: show a bar on long runs.

    """

    stop_time: float | None = None
    step: float | None = None
    order: str = ORDERS[0]
    parameters: Mapping[PortName, Any] = field(default_factory=dict)
    progress: bool = False


@dataclass(frozen=True)
class Run:
    """A finished experiment."""

    scenario: Scenario
    system: System
    result: Result


def perform(name: str, request: Request, companions: bool = True) -> list[Run]:
    """Run a scenario, and the one it is compared with, or an SSP.

    Args:
        name: of a scenario of the bundle, or path of a .toml or .ssp file.
        request: the user's changes.
        companions: whether to run what it is compared with.

    Raises:
        InputError: something about the request cannot be done; nothing has run.

    """
    with ExitStack() as stack:
        scenario, system = stack.enter_context(loaded(name))
        prepared = [(scenario, system.with_parameters(request.parameters))]
        if companions and scenario.compare:
            other, system = stack.enter_context(loaded(scenario.compare))
            # What the scenario and the user set goes for both, as far as both have it.
            shared = {
                target: value
                for target, value in {**scenario.parameters, **request.parameters}.items()
                if target.component in system.components
                and target.port in system.components[target.component].variables
            }
            same = replace(other, stop_time=scenario.stop_time, step=scenario.step)
            prepared.append((same, system.with_parameters(shared)))
        for _, each in prepared:
            each.check()
        return [_run(chosen, each, request) for chosen, each in prepared]


@contextmanager
def loaded(name: str) -> Iterator[tuple[Scenario, System]]:
    """A scenario and its system; the FMUs are there as long as the context lasts.

    Args:
        name: of a scenario of the bundle, or path of a .toml or .ssp file.

    Raises:
        InputError: there is no such scenario, or its system cannot be put together.

    """
    if name.endswith(".ssp"):
        with TemporaryDirectory(prefix="auvfmu") as folder:
            system = read_ssp(Path(name), Path(folder))
            yield Scenario(Path(name).stem, title=Path(name).name), system
        return
    scenario = read_scenario(name)
    if scenario.figure not in FIGURES:
        raise InputError(f"{name}: no figure {scenario.figure!r}; use one of {', '.join(FIGURES)}")
    bundle.build(bundle.DEFAULT_FOLDER)
    yield scenario, bundle.closed_loop(bundle.DEFAULT_FOLDER, scenario)


def _run(scenario: Scenario, system: System, request: Request) -> Run:
    stop_time = _first_given(request.stop_time, scenario.stop_time, system.stop_time)
    if stop_time is None:
        raise InputError(f"{scenario.name}: names no stop time; give one with --stop-time")
    step = _first_given(request.step, scenario.step, system.step, DEFAULT_STEP)
    assert step is not None
    result = simulate(system, stop_time, step, request.order, request.progress)
    return Run(scenario, system, result)


def _first_given(*values: float | None) -> float | None:
    return next((value for value in values if value is not None), None)


def make_writable(folder: Path) -> None:
    """Find out before the run, not after it, that the results cannot be written.

    Raises:
        InputError: the folder cannot be made or written into.

    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot write into {folder}: {error}; choose --out DIR") from error
    if not os.access(folder, os.W_OK):
        raise InputError(f"cannot write into {folder}: no permission; choose --out DIR")


def write(runs: list[Run], folder: Path) -> list[dict[str, Any]]:
    """Write tables, metrics and figures; runs it was compared with go into folders below.

    Returns:
        The metrics of each run.

    Raises:
        InputError: a file cannot be written.

    """
    try:
        return _write(runs, folder)
    except OSError as error:
        raise InputError(f"cannot write into {folder}: {error}; choose --out DIR") from error


def _write(runs: list[Run], folder: Path) -> list[dict[str, Any]]:
    written = []
    for i, run in enumerate(runs):
        target = folder / run.scenario.name if i else folder
        target.mkdir(exist_ok=True)
        run.result.write_csv(target / "result.csv")
        values = metrics(run.system, run.result, run.scenario.name)
        if "controller" in run.system.components:
            values["velocities_reaching_controller"] = velocities_reaching(run.system)
        text = json.dumps(values, indent=2)
        (target / "metrics.json").write_text(text + "\n", encoding="utf-8")
        if run.result.computed > 1 and has_certificates(run.result):
            write_certificates(run.result, target / "certificates.csv")
        written.append(values)
    main = runs[0].scenario
    drawn = [Drawn(run.scenario.label or run.scenario.name, run.result) for run in runs]
    if all(is_drawable(main.figure, each.result) for each in drawn):
        draw(main.figure, main.title, drawn, folder, main.name)
    return written
