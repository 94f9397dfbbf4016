"""Run a component as plain Python, for its tests and for a debugger.

The component runs in the class that its FMU of the Python kind holds, with the same checks, so its
numbers are those of the FMU:

    import pid
    from fmus.trial import run

    result = run(pid, {"k_p": 2.0}, lambda t: {"measured": 0.1 * t}, stop_time=10.0, step=0.1)
    assert result["command"][-1] < 1.0

Breakpoints in its file work, and what it raises goes on to the caller.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from math import isfinite
from types import ModuleType
from typing import Any, Union

from auv_fmu.language.quantities import group_name
from fmus.discovery import name_of
from fmus.ports.port import Port
from fmus.python.slave import slave_of

#: Inputs by the names of their ports, or a function of the time that gives them.
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
        module: of the component.
        parameters: by the names of their ports; others have their default values.
        inputs: of each time; those that are not named keep their values.
        stop_time: end of the run [s], or the nearest end of a step.
        step: length of a communication step [s].
        start_time: begin of the run [s].

    Returns:
        The time, and each output by the name of its port: values at the start, with these inputs,
        and after each step, with those of its end.

    Raises:
        ValueError: there is no such port, or the times make no run.
        Refusal: the component does not take a value or a step; the text says why.
        Exception: whatever the component raises.

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
    """The ports of a causality, and their value references."""
    ports = enumerate(slave._store.ports)
    return [(reference, port) for reference, port in ports if port.causality == causality]


def _set(slave: Any, causality: str, values: Mapping[str, Any]) -> None:
    """Set ports of a causality, one by one or all of a vector."""
    known = _ports(slave, causality)
    for name, value in values.items():
        found = [one for one in known if name in (one[1].name, group_name(one[1].name))]
        if not found:
            names = ", ".join(port.name for _, port in known) or "none"
            raise ValueError(f"no {causality} {name!r}; there are: {names}")
        given = [value] if found[0][1].name == name else _flat(value)
        if len(given) != len(found):
            raise ValueError(f"{name}: {len(given)} values for {len(found)} ports")
        for (reference, port), one in zip(found, given):
            getattr(slave, f"set_{_passed_as(port)}")([reference], [_meant(port, one)])
    if causality == "input":
        # Those that stay as they are belong to a new time.
        slave._forget("inputs")


def _raised(slave: object, error: BaseException) -> str:
    """Raise what a slave would tell its host."""
    raise error


def _passed_as(port: Port) -> str:
    """The type of the calls that pass a port's values, in small letters."""
    return "integer" if port.type == "Enumeration" else port.type.lower()


def _meant(port: Port, value: Any) -> Any:
    """A value of the type that a port takes; choices have names."""
    if port.type == "Real" and not isinstance(value, str):
        return float(value)
    if port.type == "Enumeration":
        value = port.choices.get(value, value)
    return int(value) if isinstance(value, IntEnum) else value


def _flat(value: Any) -> list[Any]:
    """The numbers of a vector or a matrix, row by row."""
    is_group = isinstance(value, (tuple, list))
    return [x for part in value for x in _flat(part)] if is_group else [value]
