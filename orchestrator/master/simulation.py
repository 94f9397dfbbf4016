"""A run from the first exchange of values to the last step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress

import numpy as np
from fmpy.fmi1 import FMICallException

from orchestrator.errors import InputError, reason
from orchestrator.master.experiment import Experiment
from orchestrator.master.instance import Instance, Log, running
from orchestrator.master.interrupts import Interrupts, held_interrupts
from orchestrator.master.observer import Blocks, Ending, Header, NotKept, Observer
from orchestrator.master.row import Row
from orchestrator.master.schedule import Stage, schedule, stages
from orchestrator.system.names import PortName
from orchestrator.system.structure import System


def simulate(system: System, experiment: Experiment, observers: Sequence[Observer] = ()) -> Ending:
    """Run a system from t = 0.

    Args:
        system: what to run.
        experiment: until when, in which steps and which order.
        observers: take the rows.

    Returns:
        How the run has ended: after a failure the observers have the rows before it.

    Raises:
        InputError: system or parameters are not usable; nothing was stepped.

    """
    system.check()
    plan = stages(system, experiment.order)
    log = Log()
    with held_interrupts() as interrupts, ExitStack() as stack:
        with _explained(log):
            instances = {
                name: stack.enter_context(running(component, log))
                for name, component in system.components.items()
            }
            row = Row(system, instances)
            _initialise(system, instances, row, experiment, log)
            header = Header(tuple(map(str, row.columns)), experiment, _parameters(instances))
        steps = schedule(system, plan, instances, row)
        with _told(header, observers) as tell:
            blocks = Blocks(len(row.values), observers)
            interrupts.hand_over = blocks.hand_over
            try:
                failure = _advance(experiment, steps, row.values, blocks, interrupts, log)
            except NotKept as error:
                # Rows that cannot be kept need not be computed.
                failure = str(error)
            if failure is None:
                _terminate(instances)
            ending = Ending(failure, log.messages, tuple(interrupts.signals))
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

    """
    for target, value in system.parameters.items():
        instances[target.component].set(target.port, value)
    for instance in instances.values():
        instance.fmu.setupExperiment(startTime=0.0, stopTime=experiment.stop_time)
        instance.fmu.enterInitializationMode()
    values = row.values
    targets, sources = row.places(system.connections)
    for _ in range(len(instances) + 1):
        before = values.copy()
        values[targets] = values[sources]
        for instance in instances.values():
            instance.exchange()
        if np.array_equal(before, values):
            break
    else:
        raise InputError("initial values do not come to rest: an algebraic loop")
    for instance in instances.values():
        instance.fmu.exitInitializationMode()
    values[targets] = values[sources]
    for instance in instances.values():
        instance.exchange()
    if log.refusals:
        raise InputError("; ".join(log.refusals))


def _parameters(instances: Mapping[str, Instance]) -> dict[PortName, object]:
    return {
        PortName(name, parameter): value
        for name, instance in instances.items()
        for parameter, value in instance.parameters().items()
    }


def _terminate(instances: Mapping[str, Instance]) -> None:
    """Let FMUs end what they have begun; the rows are there whether they can or not."""
    for instance in instances.values():
        with suppress(FMICallException):
            instance.fmu.terminate()


def _advance(
    experiment: Experiment,
    plan: list[Stage],
    values: np.ndarray,
    blocks: Blocks,
    interrupts: Interrupts,
    log: Log,
) -> str | None:
    """Step to the end, or to the first failure, and say what it was."""
    t, failure = 0.0, None
    blocks.append(t, values)
    try:
        for t, h, end in experiment.steps():
            for targets, sources, members in plan:
                values[targets] = values[sources]
                for set_inputs, do_step, get_outputs in members:
                    for call in set_inputs:
                        call()
                    do_step(t, h, 1)
                    for call in get_outputs:
                        call()
            blocks.append(end, values)
            if interrupts:
                failure = f"interrupted at t = {end:g} s"
                break
    except FMICallException as error:
        failure = f"stopped at t = {t:g} s: {log.last or error}"
    blocks.hand_over()
    return failure


@contextmanager
def _explained(log: Log) -> Iterator[None]:
    """An FMI call that fails before the first step, in the words of the FMU."""
    try:
        yield
    except FMICallException as error:
        raise InputError(log.last or str(error)) from error


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
