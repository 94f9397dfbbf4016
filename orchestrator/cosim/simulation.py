"""A run, from the first exchange of values to the last step."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from time import monotonic

import numpy as np

from orchestrator.cosim.connection import PortName
from orchestrator.cosim.coupling import Coupling
from orchestrator.cosim.experiment import OURS, Exchange
from orchestrator.cosim.fmi.instance import ComponentFailed, Ended, Instance, Log
from orchestrator.cosim.fmi.isolated import place_instances
from orchestrator.cosim.fmi.surroundings import Surroundings, default_mode
from orchestrator.cosim.hooks import Hook, Run
from orchestrator.cosim.loop import PYTHON_LOOP, Stepping, choose_loop
from orchestrator.cosim.observers import Blocks, Ending, Header, NotKept, Observer
from orchestrator.cosim.plan import Plan
from orchestrator.cosim.row import Overrides, Row
from orchestrator.cosim.system import System
from orchestrator.cosim.variables import same
from orchestrator.machine.errors import InputError, StartError, reason, unforeseen
from orchestrator.machine.interrupts import held_interrupts
from orchestrator.machine.texts import literal


# Overflowing values are reported as the value of a port, not by numpy.
@np.errstate(all="ignore")
@default_mode()
def simulate_plan(
    plan: Plan,
    observers: Sequence[Observer] = (),
    hooks: Sequence[Hook] = (),
    exchange: Exchange = OURS,
) -> Ending:
    """Run a system.

    Args:
        plan: made by :func:`.plan.make_plan`.
        observers: take the rows.
        hooks: act between the steps, in this order.
        exchange: of values between components.

    Returns:
        How the run ended; after a failure the observers have the rows before it.

    Raises:
        InputError: an FMU or a parameter is not usable; nothing was stepped.
        KeyboardInterrupt: a signal arrived, and an FMU does not come to its first step.

    """
    system, experiment = plan.system, plan.experiment
    stepping = choose_loop(plan.loop, experiment, plan.isolation)
    slow = {name for name, n in plan.decimations.items() if n > 1}
    log = Log()
    for line in plan.remarks:
        log.remark(line)
    with held_interrupts() as interrupts, Surroundings() as surroundings, ExitStack() as stack:
        with _explained():
            instances = stack.enter_context(
                place_instances(system.components, log, plan.isolation, interrupts)
            )
            # Entered after the instances, so that it is left before their processes are ended: a
            # forked copy of this process must not end them.
            stack.enter_context(surroundings)
            stepping = _possible_stepping(stepping, instances, log)
            row = Row(system, instances, slow)
            coupling = Coupling(plan, instances, row, log, exchange)
            coupling.initialise()
            experiment = coupling.plan.experiment
            header = Header(
                tuple(map(str, row.columns)),
                experiment,
                _parameters(system, instances, log),
                stepping.name,
                {str(port): standing.fmi_type for port, standing in row.standing.items()},
                _units(system, row.columns),
                row.strings,
            )
        (stages, passing), gatherings = coupling.stages()
        with _observed(header, observers, surroundings) as tell:
            blocks = Blocks(len(row.shown), observers, surroundings.ours, row.inputs_of("Float32"))
            interrupts.hand_over = blocks.hand_over
            if passing is None:
                blocks.append(experiment.start_time, row.shown)
            overrides = Overrides(row, gatherings, system.connections)
            run = Run(
                system, experiment, instances, row, stages, passing,
                overrides, blocks, log, interrupts, hooks,
            )  # fmt: skip
            order = [name for names in coupling.plan.arrangement.stages for name in names]
            remark = None
            try:
                failure = _advance(run, stepping, order, surroundings)
            except NotKept as error:
                # A run whose rows cannot be kept stops.
                failure = str(error)
            except Ended as end:
                failure, remark = None, str(end)
            if failure is None:
                for instance in instances.values():
                    # The rows are complete even if the FMU fails to terminate.
                    with suppress(ComponentFailed):
                        instance.terminate()
            ending = Ending(
                failure, remark, log.messages, tuple(interrupts.numbers), tuple(run.happened)
            )
            tell(ending)
        return ending


def _possible_stepping(stepping: Stepping, instances: Mapping[str, Instance], log: Log) -> Stepping:
    """Return the stepping, or the Python loop where an FMU runs in another process."""
    apart = [name for name, instance in instances.items() if not instance.is_here]
    if not apart or stepping == PYTHON_LOOP:
        return stepping
    log.remark(
        f"{', '.join(apart)}: runs in a separate process, since the FMU allows one instance "
        "per process; the Python loop takes the steps"
    )
    return PYTHON_LOOP


def _parameters(
    system: System, instances: Mapping[str, Instance], log: Log
) -> dict[PortName, object]:
    """Return the values of all parameters as the FMUs hold them, and log those that were not kept.

    Some FMUs overwrite values silently.
    """
    parameters: dict[PortName, object] = {}
    for name, instance in instances.items():
        component, values = system.components[name], system.parameters_of(name)
        own = [variable.name for variable in component.having("parameter")]
        lasting = [port for port in values if component.variables[port].initial == "exact"]
        held = instance.read(list(dict.fromkeys((*own, *lasting))))
        for port in lasting:
            if not same(values[port], held[port]):
                log.remark(
                    f"{name}.{port} was set to {literal(values[port])}, but the FMU holds "
                    f"{literal(held[port])}"
                )
        parameters |= {
            PortName(name, port): component.variables[port].shown(held[port]) for port in own
        }
    return parameters


def _units(system: System, columns: Iterable[PortName]) -> dict[str, str]:
    """Return the units of the columns that have one."""
    units = {
        str(name): system.components[name.component].variables[name.port].unit for name in columns
    }
    return {name: unit for name, unit in units.items() if unit is not None}


def _advance(
    run: Run,
    stepping: Stepping,
    order: Sequence[str],
    surroundings: Surroundings,
) -> str | None:
    """Step to the end or to the first failure, and return the failure."""
    blocks, failure = run.blocks, None
    try:
        run.call_hooks()
        for _ in stepping.steps(run):
            if run.made >= run.due:
                run.call_hooks()
            if monotonic() > blocks.due:
                blocks.hand_over()
            if run.interrupts.numbers:
                failure = f"interrupted at t = {run.time:.12g} s{run.interrupts}"
                break
        run.show()
    except ComponentFailed as error:
        failure = f"stopped at t = {run.time:.12g} s: {error}"
    except KeyboardInterrupt:
        failure = f"interrupted at t = {run.time:.12g} s{run.interrupts}"
    except Ended as end:
        with suppress(ComponentFailed):
            run.show()
        blocks.hand_over()
        raise Ended(f"ended at t = {run.time:.12g} s: {end}") from None
    except (InputError, NotKept):
        raise
    except Exception as error:
        failure = f"stopped at t = {run.time:.12g} s: {unforeseen(error)}"
    surroundings.put_back()
    # Checked even if another component has refused the value in the same step.
    if wrong := run.row.wrong(order, run.passing is not None):
        failure = f"stopped at t = {run.experiment.time(blocks.count):.12g} s: {wrong}"
    blocks.hand_over()
    return failure


@contextmanager
def _explained() -> Iterator[None]:
    """Raise an InputError for a component that fails before the first step."""
    try:
        yield
    except ComponentFailed as error:
        raise (StartError if error.fatal else InputError)(str(error)) from error


@contextmanager
def _observed(
    header: Header, observers: Sequence[Observer], surroundings: Surroundings
) -> Iterator[Callable[[Ending], None]]:
    """Begin and end observers; all of them are ended, even if one fails."""
    begun: list[Observer] = []

    def tell(ending: Ending) -> None:
        surroundings.put_back()
        while begun:
            begun.pop(0).end(ending)

    try:
        with surroundings.ours():
            for observer in observers:
                observer.begin(header)
                begun.append(observer)
        yield tell
    except BaseException as error:
        with suppress(Exception):
            tell(Ending(f"stopped: {reason(error)}"))
        raise
