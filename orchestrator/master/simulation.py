"""A run from the first exchange of values to the last step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from time import monotonic

import numpy as np

from orchestrator.errors import InputError, StartError, reason
from orchestrator.master.attendant import Attendance, Attendant, Run
from orchestrator.master.experiment import Experiment
from orchestrator.master.instance import ComponentFailed, Ended, Instance
from orchestrator.master.interrupts import Interrupts, held_interrupts
from orchestrator.master.isolated import Isolation, isolated
from orchestrator.master.loaded import all_loaded
from orchestrator.master.log import Log
from orchestrator.master.loop import PYTHON_LOOP, Loop
from orchestrator.master.observer import Blocks, Ending, Header, NotKept, Observer
from orchestrator.master.row import Row
from orchestrator.master.schedule import schedule, stages
from orchestrator.master.signals import Signals
from orchestrator.system.names import PortName
from orchestrator.system.structure import System


def simulate(
    system: System,
    experiment: Experiment,
    observers: Sequence[Observer] = (),
    isolation: Isolation | None = None,
    loop: Loop = PYTHON_LOOP,
    attendants: Sequence[Attendant] = (),
) -> Ending:
    """Run a system from t = 0.

    Args:
        system: what to run.
        experiment: until when, in which steps and which order.
        observers: take the rows.
        isolation: run each FMU in a process of its own; None: all in this one.
        loop: makes the steps.
        attendants: act between them, in this order.

    Returns:
        How the run has ended: after a failure the observers have the rows before it.

    Raises:
        InputError: system or parameters are not usable; nothing was stepped.
        KeyboardInterrupt: somebody wants it to stop, and an FMU does not come to its first step.

    """
    system.check()
    plan = stages(system, experiment.order)
    log = Log()
    with held_interrupts() as interrupts, ExitStack() as stack:
        with _explained():
            components = system.components
            instances = stack.enter_context(
                isolated(components, log, isolation, interrupts)
                if isolation
                else all_loaded(components, log)
            )
            row = Row(system, instances)
            _initialise(system, instances, row, experiment, log)
            names = tuple(map(str, row.columns))
            header = Header(names, experiment, _parameters(instances), loop.name)
        scheduled = schedule(system, plan, instances, row)
        with _told(header, observers) as tell:
            blocks = Blocks(len(row.values), observers)
            interrupts.hand_over = blocks.hand_over
            blocks.append(0.0, row.values)
            signals = Signals(row, [stage.gather for stage in scheduled], system.connections)
            run = Run(system, experiment, instances, row, scheduled, signals, blocks)
            order = [name for names in plan for name in names]
            remark = None
            try:
                failure = _advance(run, loop, Attendance(run, attendants), order, interrupts)
            except NotKept as error:
                # Rows that cannot be kept need not be computed.
                failure = str(error)
            except Ended as end:
                failure, remark = None, str(end)
            if failure is None:
                _terminate(instances)
            ending = Ending(failure, remark, log.messages, tuple(interrupts.signals))
            tell(ending)
        return ending


def completed(system: System, experiment: Experiment, observers: Sequence[Observer] = ()) -> None:
    """Run a system of which nothing less than all rows will do.

    Raises:
        InputError: it cannot be run, or not to its end.
        KeyboardInterrupt: somebody wants it to stop.

    """
    ending = simulate(system, experiment, observers)
    if ending.signals:
        raise KeyboardInterrupt
    if ending.failure is not None:
        raise InputError(f"{system.name} {ending.failure}")


def _initialise(
    system: System,
    instances: Mapping[str, Instance],
    row: Row,
    experiment: Experiment,
    log: Log,
) -> None:
    """Set parameters, exchange values in initialisation mode until they rest, leave that mode.

    Raises:
        InputError: the values do not come to rest, or an FMU refused a value.
        StartError: a value is not finite.

    """
    for name, instance in instances.items():
        instance.enter_initialization(system.parameters_of(name), experiment.stop_time)
    values = row.values
    targets, sources = row.places(system.connections)
    # Through a chain of all, once more for what its end feeds, and once to see it at rest.
    for _ in range(len(instances) + 2):
        before = values.copy()
        values[targets] = values[sources]
        _exchange(instances, row)
        if np.array_equal(before, values):
            break
    else:
        raise InputError("initial values do not come to rest: an algebraic loop")
    for instance in instances.values():
        instance.exit_initialization()
    values[targets] = values[sources]
    _exchange(instances, row)
    if log.refusals:
        raise InputError("; ".join(log.refusals))


def _exchange(instances: Mapping[str, Instance], row: Row) -> None:
    for instance in instances.values():
        instance.exchange()
    if not_finite := row.not_finite(instances):
        raise StartError(f"stopped at t = 0 s: {not_finite}")


def _parameters(instances: Mapping[str, Instance]) -> dict[PortName, object]:
    return {
        PortName(name, parameter): value
        for name, instance in instances.items()
        for parameter, value in instance.parameters().items()
    }


def _terminate(instances: Mapping[str, Instance]) -> None:
    """Let FMUs end what they have begun; the rows are there whether they can or not."""
    for instance in instances.values():
        with suppress(ComponentFailed):
            instance.terminate()


def _advance(
    run: Run,
    loop: Loop,
    attendance: Attendance,
    order: Sequence[str],
    interrupts: Interrupts,
) -> str | None:
    """Step to the end, or to the first failure, and say what it was."""
    blocks, failure = run.blocks, None
    try:
        attendance.attend()
        for _ in loop.steps(run):
            if run.made >= run.due:
                attendance.attend()
            if monotonic() > blocks.due:
                blocks.hand_over()
            if interrupts.signals:
                failure = f"interrupted at t = {run.time:.12g} s"
                break
    except ComponentFailed as error:
        failure = f"stopped at t = {run.time:.12g} s: {error}"
    except KeyboardInterrupt:
        failure = f"interrupted at t = {run.time:.12g} s"
    except Ended as end:
        blocks.hand_over()
        raise Ended(f"ended at t = {run.time:.12g} s: {end}") from None
    # Also where another component has refused it in the same step.
    if not_finite := run.row.not_finite(order):
        failure = f"stopped at t = {run.experiment.time(run.made + 1):.12g} s: {not_finite}"
    blocks.hand_over()
    return failure


@contextmanager
def _explained() -> Iterator[None]:
    """A component that fails before the first step."""
    try:
        yield
    except ComponentFailed as error:
        raise (StartError if error.fatal else InputError)(str(error)) from error


@contextmanager
def _told(header: Header, observers: Sequence[Observer]) -> Iterator[Callable[[Ending], None]]:
    """Tell observers of the beginning, and of the end even where one of them fails."""
    begun: list[Observer] = []

    def tell(ending: Ending) -> None:
        while begun:
            begun.pop(0).end(ending)

    try:
        for observer in observers:
            observer.begin(header)
            begun.append(observer)
        yield tell
    except BaseException as error:
        with suppress(Exception):
            tell(Ending(f"stopped: {reason(error)}"))
        raise
