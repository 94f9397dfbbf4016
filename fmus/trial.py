"""Run a component as plain Python, for its tests and for a debugger.

The component runs in the class that its FMU of the Python kind contains, with the same checks, so
it gives the same numbers as the FMU:

    import pid
    from fmus.trial import run

    result = run(pid, {"k_p": 2.0}, lambda t: {"measured": 0.1 * t}, stop_time=10.0, step=0.1)
    assert result["command"][-1] < 1.0

Breakpoints in its file work, and its exceptions reach the caller.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from math import isfinite
from types import ModuleType
from typing import Any, Union

from auv_fmu.language.quantities import group_name
from fmus.discovery import name_of
from fmus.ports.groups import flat
from fmus.ports.port import Port
from fmus.python.slave import slave_of

#: Inputs by the names of their ports, or a function of the time that returns them.
Inputs = Union[Mapping[str, Any], Callable[[float], Mapping[str, Any]]]


def run(
    module: ModuleType,
    parameters: Mapping[str, Any] | None = None,
    inputs: Inputs | None = None,
    *,
    stop_time: float,
    step: float,
    start_time: float = 0.0,
) -> dict[str, list[Any]]:
    """Run a component on its own.

    Args:
        module: module of the component.
        parameters: values by the names of their ports; other parameters have their defaults.
        inputs: values at each time; inputs without a value keep the last one.
        stop_time: end of the run [s], rounded to the nearest end of a step.
        step: length of a communication step [s].
        start_time: start of the run [s].

    Returns:
        The time, and each output by the name of its port: at the start and after each step, with
        the inputs of that time.

    Raises:
        ValueError: there is no such port, or the times are invalid.
        Refusal: the component refuses a value or a step; the text gives the reason.
        Exception: raised by the component.

    """
    if not (step > 0.0 and isfinite(step) and stop_time >= start_time):
        raise ValueError(f"no run from {start_time:g} s to {stop_time:g} s by steps of {step:g} s")
    name = name_of(module.__name__.rpartition(".")[2])
    base: Any = slave_of(name, module)
    slave: Any = type(name, (base,), {"describe": _raised})(instance_name=name)
    given = inputs if callable(inputs) else lambda t: inputs or {}
    slave.setup_experiment(start_time)
    _set(slave, "parameter", parameters or {})
    _set(slave, "input", given(start_time))
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    outputs = _ports(slave, "output")
    result: dict[str, list[Any]] = {"time": [], **{port.name: [] for _, port in outputs}}
    count = round((stop_time - start_time) / step)
    for k in range(count + 1):
        t = start_time + k * step
        if k > 0:
            _set(slave, "input", given(t))
        result["time"].append(t)
        for reference, port in outputs:
            result[port.name] += getattr(slave, f"get_{_passed_as(port)}")([reference])
        if k < count:
            slave.do_step(t, step)
    return result


def _ports(slave: Any, causality: str) -> list[tuple[int, Port]]:
    """Return the ports of a causality with their value references."""
    ports = enumerate(slave._store.ports)
    return [(reference, port) for reference, port in ports if port.causality == causality]


def _set(slave: Any, causality: str, values: Mapping[str, Any]) -> None:
    """Set ports of a causality, singly or as whole vectors."""
    known = _ports(slave, causality)
    for name, value in values.items():
        pairs = [pair for pair in known if name in (pair[1].name, group_name(pair[1].name))]
        if not pairs:
            names = ", ".join(port.name for _, port in known) or "none"
            raise ValueError(f"no {causality} {name!r}; there are: {names}")
        given = [value] if pairs[0][1].name == name else [*flat(value)]
        if len(given) != len(pairs):
            raise ValueError(f"{name}: {len(given)} values for {len(pairs)} ports")
        for (reference, port), item in zip(pairs, given):
            getattr(slave, f"set_{_passed_as(port)}")([reference], [_converted(port, item)])
    if causality == "input":
        # Unchanged inputs are inputs of a new time, too.
        slave._forget("inputs")


def _raised(slave: object, error: BaseException) -> str:
    """Raise an error that a slave would report to its host."""
    raise error


def _passed_as(port: Port) -> str:
    """Return the type in the names of the functions that pass a port's values."""
    return "integer" if port.type == "Enumeration" else port.type.lower()


def _converted(port: Port, value: Any) -> Any:
    """Convert a value, or the name of a choice, to the type of a port."""
    if port.type == "Real" and not isinstance(value, str):
        return float(value)
    if port.type == "Enumeration":
        value = port.choices.get(value, value)
    return int(value) if isinstance(value, IntEnum) else value
