"""Values of an instance, and the state of its FMU: complete, exact, and checked on restoring.

The state of a component is a NamedTuple of numbers, truth values, members of enumerations, and of
tuples, vectors, matrices and NamedTuples of them.
"""

from __future__ import annotations

import json
import sys
from binascii import crc32
from collections.abc import Mapping, Sequence
from enum import IntEnum
from itertools import count
from math import inf
from types import GenericAlias
from typing import Any, Callable, TypedDict

from auv_fmu.language.variable import Refusal
from fmus.ports.behaviour import Behaviour
from fmus.ports.groups import class_of, compiled, is_class, parts_of, whole
from fmus.ports.port import FAULT, Port, Value, is_int32
from fmus.python.loading import MISSING
from fmus.python.noise import Noise, check_draws

#: Types of ports by the type in the name of FMI's functions; no port is a String.
_PASSED = {
    "Real": ("Real",),
    "Integer": ("Integer", "Enumeration"),
    "Boolean": ("Boolean",),
    "String": (),
}

#: Values of ports without a start value.
_NOTHING = {**MISSING, "Enumeration": 0}

#: Modes of an instance.
INSTANTIATED, INITIALISING, STEPPING, TERMINATED = MODES = (
    "instantiated",
    "initialising",
    "stepping",
    "terminated",
)

#: Key of the reason why a state is invalid. PythonFMU reads states in calls that cannot report
#: errors, so an invalid state is refused when it is set.
_UNUSABLE = "unusable"

#: Key of the checksum in the bytes of a state.
_CHECKSUM = "checksum"


class Store:
    """Values of all ports, and the rest of the state of a run.

    A port's value reference is its index among the ports. Inputs and outputs are kept in separate
    lists, Reals first and in order of reference, so that a call that passes all of them takes one
    comparison instead of a look-up for each value.

    Attributes:
        ports: ports of the component, `fault` last.
        inputs, outputs: values of all inputs, and of all outputs but `fault`.
        input_references, output_references: their value references, in the same order.
        places: indices of values in these lists, by value reference.
        all_outputs: references of all outputs but `fault`.
        real_outputs: references of the Real outputs.
        free_inputs: references of the Real inputs, if none of them has a range; else None.
        has_only_reals: True if all inputs are Reals.
        only_outputs: references of all outputs, if all are Reals; else None.
        parameters: values by name.
        fault: True if a value or a step was discarded.
        fresh: True if the outputs are up to date.
        held: True if the outputs belong to the beginning of the last step, so that the next step
            evaluates its own.
        groups: the inputs as groups of the equations.
        state: state of the component; None before the initialisation.
        derived: values derived from the state; None if they must be derived when needed.
        start_time, stop_time, time: start, end and present time of the run [s].
        noise, draws: generator of the noise of outputs, None without noise, and its last draw.

    """

    def __init__(self, ports: Sequence[Port]) -> None:
        self.ports = (*ports, FAULT)
        references = [*range(len(ports))]
        references.sort(key=lambda reference: ports[reference].type != "Real")
        self.input_references = [r for r in references if ports[r].causality == "input"]
        self.output_references = [r for r in references if ports[r].causality == "output"]
        self.all_outputs = frozenset(self.output_references)
        real_inputs = [r for r in self.input_references if ports[r].type == "Real"]
        limits = [limit for r in real_inputs for limit in (ports[r].minimum, ports[r].maximum)]
        self.free_inputs = real_inputs if all(limit is None for limit in limits) else None
        self.has_only_reals = real_inputs == self.input_references
        self.real_outputs = [r for r in self.output_references if ports[r].type == "Real"]
        has_others = self.real_outputs != self.output_references
        self.only_outputs = None if has_others else self.real_outputs
        self.fault_references = [len(ports)]
        self.inputs: list[Value] = [
            _NOTHING[ports[r].type] if ports[r].start is None else ports[r].start
            for r in self.input_references
        ]
        self.outputs = self.no_outputs()
        self.places = {
            reference: place
            for references in (self.input_references, self.output_references)
            for place, reference in enumerate(references)
        }
        self.parameters: dict[str, Value] = {
            port.name: port.start
            for port in ports
            if port.causality == "parameter" and port.start is not None
        }
        self.fault = False
        self.fresh = True
        self.held = False
        self.groups: Any = None
        self.state: Any = None
        self.derived: Any = None
        self.start_time = self.time = 0.0
        self.stop_time = inf  # there is none
        self.noise: Noise | None = None
        self.draws: tuple[float, ...] = ()

    def no_outputs(self) -> list[Value]:
        """Return the outputs before there is a state."""
        return [_NOTHING[self.ports[reference].type] for reference in self.output_references]

    def check_outputs(self, values: Sequence[Value]) -> None:
        """Refuse outputs that are not finite.

        Raises:
            Refusal: an output is not finite.

        """
        for reference, value in zip(self.output_references, values):
            self.ports[reference].check_type(value)

    def port(self, reference: int, fmi_type: str) -> Port:
        """Return the port with a value reference, if functions for a type pass its values.

        Raises:
            Refusal: there is none.

        """
        if 0 <= reference < len(self.ports):
            port = self.ports[reference]
            if port.type in _PASSED[fmi_type]:
                return port
        # PythonFMU passes references from 2^31 as negative numbers.
        raise Refusal(f"no {fmi_type} has the value reference {reference % 2**32}")

    def get(self, reference: int, fmi_type: str) -> Value:
        """Return the value of a port; fmi2GetReal returns all types, since some hosts use only it.

        Raises:
            Refusal: no port with the reference has a value of this type.

        """
        as_real = fmi_type == "Real" and 0 <= reference < len(self.ports)
        port = self.ports[reference] if as_real else self.port(reference, fmi_type)
        if port is FAULT:
            value: Value = self.fault
        elif port.causality == "parameter":
            value = self.parameters[port.name]
        else:
            values = self.inputs if port.causality == "input" else self.outputs
            value = values[self.places[reference]]
        return float(value) if as_real else value


def measuring(hint: type) -> Callable[[Any], float]:
    """Compile a function that adds the squares of all floats of a state, in the order of the C.

    It runs once a step, and takes a third of the time of a loop. It raises OverflowError for an
    integer of more than 32 bits, and Refusal for one that its enumeration lacks.
    """
    names, floats, integers = (f"x{i}" for i in count()), [], []
    scope: dict[str, Any] = {"whole": whole, "member": _member}

    def target(hint: Any) -> str:
        hints = parts_of(hint)
        if hints is not None:
            return f"({''.join(f'{target(k)}, ' for k in hints)})"
        name, hint = next(names), class_of(hint)
        if hint is float:
            floats.append(name)
        elif hint is int:
            integers.append(f"whole({name}); ")
        elif is_class(hint, IntEnum):
            kind = f"kind{len(scope)}"
            scope[kind] = hint
            integers.append(f"member({name}, {kind}); ")
        return name

    pattern = target(hint)
    total = " + ".join(f"{x} * {x}" for x in floats) or "0.0"
    return compiled("state", f"{pattern} = state\n {''.join(integers)}return {total}", scope)


def _member(value: int, kind: type[IntEnum]) -> IntEnum:
    member = kind._value2member_map_.get(value)
    if member is None:
        raise Refusal(f"{_shown(int(value))} is not of type {kind.__name__}")
    return member  # type: ignore[return-value]


def restored(hint: Any, value: Any) -> Any:
    """Restore a state, or a part of one, from memory, or from JSON, which has lists for tuples.

    Raises:
        Refusal: it has another type or length, is not finite, has more than 32 bits, or is not a
            member of its enumeration.

    """
    hints, hint = parts_of(hint), class_of(hint)
    if hints is not None:
        if not isinstance(value, (list, tuple)) or len(value) != len(hints):
            raise Refusal(f"{_shown(value)} instead of {len(hints)} values")
        made = [*map(restored, hints, value)]
        return tuple.__new__(hint if is_class(hint, tuple) else tuple, made)
    if hint is float and type(value) in (float, int):
        if not abs(value) <= sys.float_info.max:
            raise Refusal("a value is not finite")
        return value
    if is_class(hint, IntEnum):
        if not isinstance(value, int):
            raise Refusal(f"{_shown(value)} is not of type {hint.__name__}")
        return _member(value, hint)
    if hint is int and isinstance(value, int):
        # A bool, or a member of an enumeration, is an int.
        value = int(value)
    if type(value) is not hint:
        raise Refusal(f"{_shown(value)} is not of type {hint.__name__}")
    if hint is int and not is_int32(value):
        raise Refusal("an integer exceeds 32 bits")
    return value


def _shown(value: Any) -> str:
    return f"{value!r:.40}"


class Snapshot(TypedDict):
    """Everything that the rest of a run depends on, suitable for JSON."""

    identity: str  #: class and version of the component
    mode: str
    start_time: float
    stop_time: float  #: infinite without a stop time
    time: float
    parameters: dict[str, Value]
    inputs: list[Value]
    outputs: list[Value]  #: outputs of a sampled component; other outputs follow from the rest
    fresh: bool  #: true if these are up to date
    held: bool  #: true if they belong to the last step
    state: Any  #: NamedTuple of the component, None before the initialisation
    draws: tuple[float, ...]  #: random numbers in the noise of the outputs
    generator: Any  #: state of the generator of the noise, None without noise
    fault: bool


def _unusable(why: str) -> dict[str, Any]:
    """Return a stand-in for an invalid state."""
    return {_UNUSABLE: why}


def to_bytes(snapshot: Mapping[str, Any]) -> bytes:
    """Write a state as JSON, which keeps all bits of floats, with a checksum."""
    try:
        return _text({**snapshot, _CHECKSUM: _checksum(snapshot)})
    except (TypeError, ValueError, RecursionError) as error:
        return _text(_unusable(f"it is not fit for JSON: {error}"))


def from_bytes(content: bytes) -> dict[str, Any]:
    """Read a state from bytes; invalid bytes are refused when the state is set."""
    try:
        saved = json.loads(content)
        if not isinstance(saved, dict):
            return _unusable("the bytes are not a state")
        checksum = saved.pop(_CHECKSUM, None)
        if _UNUSABLE not in saved and checksum != _checksum(saved):
            return _unusable("the bytes were changed since they were written")
    except (ValueError, RecursionError):
        return _unusable("the bytes are not a state")
    return saved


def _text(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value).encode("utf-8")


def _checksum(snapshot: Mapping[str, Any]) -> int:
    return crc32(_text(snapshot))


def checked(
    saved: Mapping[str, Any], identity: str, store: Store, behaviour: Behaviour
) -> dict[str, Any]:
    """Return a copy of a saved state, if it is a possible state of a component.

    Raises:
        Refusal: it belongs to another component or version, or no run can have led to it.

    """
    if _UNUSABLE in saved:
        raise Refusal(str(saved[_UNUSABLE]))
    if saved.get("identity") != identity:
        raise Refusal(f"not a state of {identity}")
    if saved.keys() != Snapshot.__annotations__.keys():
        raise Refusal("it has missing or unknown parts")
    mode, state = saved["mode"], saved["state"]
    start_time, stop_time = restored(float, saved["start_time"]), _time(saved["stop_time"])
    time = _time(saved["time"])  # a step from a finite time may lead to an infinite one
    if mode not in MODES:
        raise Refusal(f"{mode!r:.40} is not a mode")
    if not start_time < stop_time:
        raise Refusal("its stop time is not after its start time")
    if mode in (INSTANTIATED, INITIALISING) and time != start_time:
        raise Refusal("its time is not its start time")
    if not isinstance(saved["fault"], bool):
        raise Refusal("its fault is neither true nor false")
    if not (isinstance(saved["fresh"], bool) and isinstance(saved["held"], bool)):
        raise Refusal("its outputs are neither fresh nor not")
    if mode == INSTANTIATED and state is not None:
        raise Refusal("it has a state before the initialisation")
    if state is None and mode == STEPPING:
        raise Refusal("it has steps without a state")
    sampled = store.output_references if behaviour.is_sampled and state is not None else []
    draws = restored(
        GenericAlias(tuple, (float,) * (state is not None) * behaviour.draws), saved["draws"]
    )
    check_draws(*draws)
    parameters = saved["parameters"]
    declared = [port for port in store.ports if port.causality == "parameter"]
    if not isinstance(parameters, dict) or parameters.keys() != store.parameters.keys():
        raise Refusal("it has missing or unknown parameters")
    return {
        **saved,
        "parameters": {port.name: port.checked(parameters[port.name]) for port in declared},
        "inputs": _values(store, store.input_references, saved["inputs"]),
        "outputs": _values(store, sampled, saved["outputs"]),
        "fresh": bool(sampled) and saved["fresh"],
        "held": bool(sampled) and saved["held"],
        "state": None if state is None else restored(behaviour.state, state),
        "draws": draws,
        "generator": _frozen(saved["generator"]),
    }


def _time(value: Any) -> Any:
    """Restore a time, which may be infinite."""
    return value if value in (inf, -inf) else restored(float, value)


def _frozen(value: Any) -> Any:
    """Turn lists from JSON back into the tuples of a generator's state."""
    return tuple(map(_frozen, value)) if isinstance(value, (list, tuple)) else value


def _values(store: Store, references: Sequence[int], values: Any) -> list[Value]:
    if not isinstance(values, (list, tuple)) or len(values) != len(references):
        raise Refusal("its values do not match the ports")
    for reference, value in zip(references, values):
        port = store.ports[reference]
        # Ranges of outputs are not checked, since no step depends on an output.
        port.check_type(value) if port.causality == "output" else port.checked(value)
    return [*values]
