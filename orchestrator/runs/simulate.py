"""Runs from Python: `simulate`."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from fmus.kinds import AUTO, KindName
from orchestrator.cosim.experiment import CouplingName, Order
from orchestrator.cosim.hooks.checkpoint import Checkpoints
from orchestrator.cosim.loop import LOOPS, PYTHON_LOOP, LoopName
from orchestrator.cosim.observers.observer import Observer, Progress
from orchestrator.cosim.system.structure import System
from orchestrator.machine.errors import InputError
from orchestrator.runs.folder import locked_folder
from orchestrator.runs.loading import check_brings_its_own, load_scenario, notes_as_warnings
from orchestrator.runs.preparation import Prepared, prepare
from orchestrator.runs.record import (
    Stopwatch,
    checkpoints_of,
    leave_checkpoints,
    write_metrics,
    write_record,
)
from orchestrator.runs.request import Request
from orchestrator.runs.result import Result
from orchestrator.runs.scenario import Scenario
from orchestrator.vehicle.indices import metrics_of
from orchestrator.vehicle.signals import Loop


class _Made:
    """Where a result comes from that was computed in this process."""

    def __init__(self, prepared: Prepared) -> None:
        # The loop is not needed any more, and another process could not have its library.
        self._prepared, self._clock = replace(prepared, stepping=PYTHON_LOOP), Stopwatch()

    @property
    def scenario(self) -> Scenario:
        """What was run."""
        return self._prepared.scenario

    @property
    def loops(self) -> Sequence[Loop]:
        """Of its vehicles."""
        return self._prepared.loops

    @property
    def system(self) -> System:
        """What was run."""
        return self._prepared.system

    def metrics(self, result: Result) -> dict[str, Any]:
        """The indices of its rows."""
        return metrics_of(result, self.loops).content(self.scenario.name, self.system)

    def write_ends(self, folder: Path, result: Result) -> None:
        """Write metrics.json and run.json."""
        write_metrics(folder, self.metrics(result))
        write_record(folder, self._prepared, result.header, result.ending, sys.argv, self._clock)


def simulate(
    system: str | Path | Mapping[str, Any] | System,
    parameters: Mapping[str, object] | None = None,
    *,
    stop_time: float | None = None,
    step: float | None = None,
    order: Order | None = None,
    kind: KindName = AUTO,
    progress: bool = False,
    isolate: bool = False,
    step_timeout: float | None = None,
    loop: LoopName = LOOPS[0],
    variant: str | None = None,
    strict: bool = False,
    steps: Mapping[str, float] | None = None,
    events: Sequence[Mapping[str, Any]] | None = None,
    inputs: str | Path | None = None,
    coupling: CouplingName | None = None,
    checkpoint: str | Path | None = None,
    checkpoint_every: float | None = None,
    resume: bool = False,
) -> Result:
    """Run a scenario, an SSP or a system.

        result = simulate("fig4", {"controller.eps_t": 10.0}, stop_time=50.0)
        result["plant.eta.x"], result.metrics(), result.plot("plant.tau.*")

    Args:
        system: name of a scenario, path of a .toml or .ssp file, a dictionary with the entries of
            a scenario file, or a system from :func:`load`.
        parameters: values that replace the scenario's, by `component.parameter`: numbers,
            Booleans, names, or text as on the command line; for a group, such as `plant.eta0`, a
            list with a value for each member.
        stop_time: end of the run [s]; None: the scenario's own.
        step: communication step [s]; None: the scenario's own, else the longest that divides the
            default steps of the FMUs, else 0.02.
        order: `feedthrough`, values of one time pass before all are stepped, `gauss-seidel`, the
            paper's scheme, `jacobi`, the scheme of most tools, or the names of all components,
            stepped one after the other; None: the scenario's own, else `feedthrough` where the
            outputs of the FMUs follow their inputs between steps, else `gauss-seidel`.
        kind: kind of the bundle's FMUs: `python`, `native`, translated to C with the same numbers,
            or `auto`, native where available.
        progress: show a bar on runs that take longer than some seconds.
        isolate: run each FMU in a separate process. If that process crashes, hangs or exits, only
            the run fails.
        step_timeout: how long an isolated FMU may take for one call [s]; None: 60.
        loop: the loop that makes the steps: `python`, `compiled`, or `auto`, compiled where
            available; the rows are the same.
        variant: name of a system description in an SSP; None: the default.
        strict: treat warnings as errors.
        steps: longer steps of single components [s], multiples of the communication step; they
            replace the scenario's.
        events: events of the run, instead of the scenario's own: tables as in a scenario file,
            such as `{"at": 20.0, "lose": "controller.tau.r"}`.
        inputs: a table of inputs over time, instead of the scenario's own: a .csv or .parquet
            file.
        coupling: how rings of direct feedthroughs are closed: `solve`, at every communication
            point, `delay`, by a delay of one step, or `linear`, solved, with inputs that change
            linearly during a step; None: the scenario's own, else `solve` where the FMUs allow it.
        checkpoint: folder for checkpoints, from which another process can continue the run; it is
            removed when the run is complete.
        checkpoint_every: time between two checkpoints [simulated s]; None: as before, if the run
            is resumed.
        resume: continue from the last checkpoint. The result has all rows, as if the run had not
            been interrupted. `resumed_at` has the time at which it continued.

    Returns:
        The computed rows: all of them, or the rows before a failure, which `Result.failure` then
        describes.

    Raises:
        ValueError: a name, a value or a file is not usable; the message says what to change.
        KeyboardInterrupt: Ctrl-C, after the current step.

    """
    is_named = not isinstance(system, System)
    if isinstance(system, System):
        check_brings_its_own(str(system), kind)
        if variant is not None:
            raise InputError(f"{system}: has no variants; give it to load")
        scenario = Scenario(system.name)
    else:
        with notes_as_warnings(strict) as findings:
            scenario, system = load_scenario(system, kind, variant=variant, findings=findings)
            findings.refuse()
    if not isinstance(parameters, Mapping | None):
        raise InputError(f"parameters: a mapping by component.parameter, not {parameters!r}")
    request = Request(
        parameters=parameters or {},
        stop_time=stop_time,
        step=step,
        order=order,
        coupling=coupling,
        kind=kind,
        events=events,
        inputs=inputs,
        loop=loop,
        isolate=isolate,
        step_timeout=step_timeout,
        strict=strict,
        steps=steps or {},
    )
    prepared = prepare(scenario, system, request)
    if is_named:
        with notes_as_warnings(strict) as findings:
            for doubt in prepared.doubts():
                findings.note(doubt)
            findings.refuse()
    result = Result(_Made(prepared))
    observers: list[Observer] = [result, *([Progress(scenario.name)] * progress)]
    with _checkpoints(prepared, checkpoint, checkpoint_every, resume) as kept:
        result.resumed_at = next((checkpoints.time for checkpoints in kept), None)
        ending = prepared.run([*observers, *kept], kept)
        leave_checkpoints(kept, ending.failure is None)
    for number in ending.interrupts:
        # Held back while the FMUs computed; now it acts as usual.
        signal.raise_signal(number)
    return result


@contextmanager
def _checkpoints(
    prepared: Prepared, folder: str | Path | None, every: float | None, resume: bool
) -> Iterator[Sequence[Checkpoints]]:
    """The checkpoints of a run in a folder that is kept from others; none, if none are wanted."""
    if folder is None and every is None and not resume:
        yield ()
        return
    if folder is None or (every is None and not resume):
        raise InputError("checkpoints need checkpoint=, and checkpoint_every= or resume=")
    place = Path(folder)
    with locked_folder(place):
        yield checkpoints_of([prepared], [place], every, resume)
    with suppress(OSError):
        # Fails if it is not empty. The lock was in it when the checkpoint was removed.
        place.rmdir()
