"""The co-simulation master: steps the FMUs of a system through fmpy's low-level API.

Every communication step has stages. Before a stage is stepped its inputs are gathered; the
outputs of a component are read as soon as it was stepped.

- `jacobi`: one stage. All inputs are outputs of t_k.
- `gauss-seidel`: a component whose output has direct feedthrough is stepped in an earlier
  stage than those it feeds, so they receive without delay what follows from t_k. Outputs
  without feedthrough are states: everybody takes them at t_k (reading 5).
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from graphlib import CycleError, TopologicalSorter
from math import floor, isfinite
from typing import Any

import numpy as np
from fmpy.fmi1 import FMICallException
from tqdm import tqdm

from orchestrator.errors import InputError
from orchestrator.master.instance import KINDS, Block, Instance, Log, initialise, running
from orchestrator.master.result import Result
from orchestrator.system.structure import Connection, PortName, System

ORDERS = ("gauss-seidel", "jacobi")

#: A rest of the stop time shorter than this share of a step is a rounding error.
ROUNDING = 1e-9

#: More steps than this are taken for a mistake: their table would not fit into any memory.
MOST_STEPS = 10_000_000

#: Seconds before a progress bar appears, and steps between its updates.
_PATIENCE, _CHUNK = 2.0, 100


def simulate(
    system: System, stop_time: float, step: float, order: str = ORDERS[0], progress: bool = False
) -> Result:
    """Run a system from t = 0.

    Args:
        system: what to run.
        stop_time: end [s]; the last step is shorter if it is no multiple of the step.
        step: communication step [s].
        order: one of :data:`ORDERS`.
        progress: show a bar on runs that take longer than some seconds.

    Returns:
        The rows that were computed: all of them, or those before a failure, which
        `Result.failure` then describes.

    Raises:
        InputError: system, parameters or experiment are not usable; nothing was stepped.

    """
    if not (isfinite(stop_time) and stop_time > 0.0 and isfinite(step) and step > 0.0):
        raise InputError(f"stop time {stop_time:g} s and step {step:g} s must be positive")
    system.check()
    plan = stages(system, order)
    log = Log()
    with _held_interrupts() as interrupts, _explained(log), ExitStack() as stack:
        instances = {
            name: stack.enter_context(running(component, log))
            for name, component in system.components.items()
        }
        columns, values = _row_of_all_values(system, instances)
        for target, value in system.parameters.items():
            instances[target.component].set(target.port, value)
            if target in columns:
                values[columns[target]] = float(value)
        initialise(instances, stop_time)
        _initial_exchange(system, instances, columns, values, log)
        result = Result(
            columns=tuple(map(str, columns)),
            times=_times(stop_time, step),
            order=order,
            step=step,
            parameters={
                PortName(name, parameter): value
                for name, instance in instances.items()
                for parameter, value in instance.parameters().items()
            },
            messages=log.messages,
        )
        _advance(system, plan, instances, columns, values, result, progress, interrupts)
        return result


def stages(system: System, order: str) -> list[list[str]]:
    """Components in the order in which they are stepped; those of one stage are independent.

    Raises:
        InputError: the order is unknown, or direct feedthroughs form a loop.

    """
    if order not in ORDERS:
        raise InputError(f"order {order!r}: use one of {', '.join(ORDERS)}")
    if order == "jacobi":
        return [list(system.components)]
    sorter: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(system.components, ()))
    for connection in system.connections:
        if _has_feedthrough(system, connection):
            sorter.add(connection.target.component, connection.source.component)
    try:
        sorter.prepare()
    except CycleError as error:
        loop = " -> ".join(error.args[1])
        raise InputError(
            f"direct feedthrough in a loop, {loop}; --order jacobi breaks it with a delay"
        ) from error
    found = []
    while sorter.is_active():
        ready = sorter.get_ready()
        found.append([name for name in system.components if name in ready])
        sorter.done(*ready)
    return found


def _has_feedthrough(system: System, connection: Connection) -> bool:
    source = connection.source
    return system.components[source.component].has_feedthrough(source.port)


def _times(stop_time: float, step: float) -> np.ndarray:
    """t_k = k h, never accumulated; the stop time is the last."""
    if stop_time / step > MOST_STEPS:
        raise InputError(
            f"{stop_time:g} s in steps of {step:g} s are more than {MOST_STEPS:,} steps"
        )
    full_steps = floor(stop_time / step * (1.0 + ROUNDING))
    times = np.arange(full_steps + 1) * step
    if stop_time - times[-1] > ROUNDING * step:
        return np.append(times, stop_time)
    return times


def _row_of_all_values(
    system: System, instances: dict[str, Instance]
) -> tuple[dict[PortName, int], np.ndarray]:
    """Where every input and output stands in a row of floats, and that row.

    The ports of a component that have the same causality and kind are neighbours, in the order
    of its description, so that one FMI call moves them all.
    """
    groups = [
        (name, causality, kind, ports)
        for name, component in system.components.items()
        for causality in ("input", "output")
        for kind in KINDS
        if (
            ports := [
                variable
                for variable in component.description.modelVariables
                if variable.causality == causality and variable.type == kind
            ]
        )
    ]
    values = np.zeros(sum(len(ports) for *_, ports in groups))
    columns: dict[PortName, int] = {}
    blocks: dict[tuple[str, str], list[Block]] = {}
    for name, causality, kind, ports in groups:
        row = values[len(columns) : len(columns) + len(ports)]
        references = [variable.valueReference for variable in ports]
        blocks.setdefault((name, causality), []).append(Block(kind, references, row))
        for variable in ports:
            columns[PortName(name, variable.name)] = len(columns)
    for name, instance in instances.items():
        instance.attach(blocks.get((name, "input"), []), blocks.get((name, "output"), []))
    return columns, values


def _indices(
    connections: Sequence[Connection], columns: dict[PortName, int]
) -> tuple[np.ndarray, np.ndarray]:
    return (
        np.array([columns[connection.target] for connection in connections], dtype=np.intp),
        np.array([columns[connection.source] for connection in connections], dtype=np.intp),
    )


def _initial_exchange(
    system: System,
    instances: dict[str, Instance],
    columns: dict[PortName, int],
    values: np.ndarray,
    log: Log,
) -> None:
    """Exchange values in initialisation mode until they rest, then leave that mode.

    Raises:
        InputError: the values do not come to rest, or an FMU refused a value.

    """
    targets, sources = _indices(system.connections, columns)
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
    if any(instance.is_faulty() for instance in instances.values()):
        raise InputError("; ".join(log.messages) or "an FMU raised its fault output")


def _advance(
    system: System,
    plan: list[list[str]],
    instances: dict[str, Instance],
    columns: dict[PortName, int],
    values: np.ndarray,
    result: Result,
    progress: bool,
    interrupts: list[int],
) -> None:
    """Step to the end and fill the rows of the result; stop at the first failure."""
    stage_of = {name: i for i, names in enumerate(plan) for name in names}
    gathered: list[list[Connection]] = [[] for _ in plan]
    for connection in system.connections:
        late = len(plan) > 1 and _has_feedthrough(system, connection)
        gathered[stage_of[connection.target.component] if late else 0].append(connection)
    schedule: list[tuple[np.ndarray, np.ndarray, list[_Calls]]] = [
        (*_indices(connections, columns), [_calls(instances[name]) for name in names])
        for names, connections in zip(plan, gathered, strict=True)
    ]
    times = result.times.tolist()
    result.append(values)
    with tqdm(
        total=times[-1],
        unit="s",
        delay=_PATIENCE,
        disable=None if progress else True,
        bar_format="{l_bar}{bar}| {n:.0f}/{total:.0f} s [{elapsed}<{remaining}]",
    ) as bar:
        try:
            for k in range(len(times) - 1):
                t = times[k]
                # The last step may be a shorter one; all others are the same number.
                h = result.step if k < len(times) - 2 else _last_step(times, result.step)
                for targets, sources, members in schedule:
                    values[targets] = values[sources]
                    for set_inputs, do_step, get_outputs in members:
                        for call in set_inputs:
                            call()
                        do_step(t, h, 1)
                        for call in get_outputs:
                            call()
                result.append(values)
                if k % _CHUNK == 0:
                    bar.update(t - bar.n)
                if interrupts:
                    result.failure = f"interrupted at t = {times[k + 1]:g} s"
                    return
            bar.update(times[-1] - bar.n)
        except FMICallException as error:
            reason = "; ".join(result.messages[-1:]) or str(error)
            result.failure = f"stopped at t = {t:g} s: {reason}"


@contextmanager
def _held_interrupts() -> Iterator[list[int]]:
    """The signals to stop that have come (Ctrl-C among them), collected instead of raised.

    Python raises KeyboardInterrupt wherever it is, which may be inside an FMU: PythonFMU would
    then release its objects twice and crash the process.
    """
    interrupts: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield interrupts
        return
    stops = [
        getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
    ]
    before = {
        number: signal.signal(number, lambda number, _: interrupts.append(number))
        for number in stops
    }
    try:
        yield interrupts
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _explained(log: Log) -> Iterator[None]:
    """An FMI call that fails before the first step, in the words of the FMU."""
    try:
        yield
    except FMICallException as error:
        raise InputError("; ".join(log.messages[-1:]) or str(error)) from error


_Calls = tuple[list[Callable[[], Any]], Callable[[float, float, int], Any], list[Callable[[], Any]]]


def _calls(instance: Instance) -> _Calls:
    return instance.set_inputs, instance.do_step, instance.get_outputs


def _last_step(times: list[float], step: float) -> float:
    rest = times[-1] - times[-2]
    return step if abs(rest - step) <= ROUNDING * step else rest
