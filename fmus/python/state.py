"""The values of an instance, and the state of its FMU: complete, exact, and checked when taken.

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

#: Types of ports, by those of the calls that pass their values; no port is a text.
_PASSED = {
    "Real": ("Real",),
    "Integer": ("Integer", "Enumeration"),
    "Boolean": ("Boolean",),
    "String": (),
}

#: Values of ports that have none.
_NOTHING = {**MISSING, "Enumeration": 0}

#: Modes of an instance.
INSTANTIATED, INITIALISING, STEPPING, TERMINATED = MODES = (
    "instantiated",
    "initialising",
    "stepping",
    "terminated",
)

#: Key of what speaks against bytes or a snapshot: PythonFMU asks for them where nothing can be
#: reported, so they are refused when they are set.
_UNUSABLE = "unusable"

#: Key of the checksum in the bytes of a state.
_CHECKSUM = "checksum"


class Store:
    """Values of all ports, and what else a run is made of.

    A port's value reference is its place among the ports. All inputs and all outputs lie in lists
    of their own, Reals first and in their order, so that a host that passes these all in one call
    costs one comparison instead of one look-up a value.

    Attributes:
        ports: of the component, `fault` last.
        inputs, outputs: values of all but `fault`.
        input_references, output_references: of them, in the order of their values.
        places: where the values lie, by their references.
        all_outputs: the references of all outputs but `fault`.
        real_outputs: the references of the Reals among them.
        free_inputs: the references of the Real inputs, if none of them has a range; else None.
        has_only_reals: whether all inputs are Reals.
        only_outputs: the references of all outputs, if these are Reals; else None.
        parameters: by name.
        fault: whether a value or a step was discarded.
        fresh: whether the outputs are up to date: nothing has changed that they depend on.
        held: whether they are those of the beginning of the last step; the next evaluates its own.
        groups: the inputs as the equations take them.
        state: of the component; None before the initialisation.
        derived: what was derived of it; None: it is to be derived when it is needed.
        start_time, stop_time, time: where the run begins, where it ends, and where it is [s].
        noise, draws: the generator of the noise of outputs, None without it, and what it has given.

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
            for found in (self.input_references, self.output_references)
            for place, reference in enumerate(found)
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
        """The outputs where there is no state."""
        return [_NOTHING[self.ports[reference].type] for reference in self.output_references]

    def check_outputs(self, values: Sequence[Value]) -> None:
        """Refuse outputs that are not finite.

        Raises:
            Refusal: one of them is not.

        """
        for reference, value in zip(self.output_references, values):
            self.ports[reference].sound(value)

    def port(self, reference: int, fmi_type: str) -> Port:
        """The port that has a value reference, if its values are passed by the calls for a type.

        Raises:
            Refusal: there is none.

        """
        if 0 <= reference < len(self.ports):
            port = self.ports[reference]
            if port.type in _PASSED[fmi_type]:
                return port
        # PythonFMU hands references from 2^31 over as negative numbers.
        raise Refusal(f"no {fmi_type} has the value reference {reference % 2**32}")

    def get(self, reference: int, fmi_type: str) -> Value:
        """The value of a port. Hosts read all outputs with fmi2GetReal.

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
    """A function that gives the sum of the squares of all floats of a state, as C adds them.

    It runs once a step, and written out it costs a third of a loop. It raises OverflowError for an
    integer that an FMU in C has no room for, and Refusal for one that its enumeration lacks.
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
    """A state, or a part of one, as it was before memory or JSON took it.

    Args:
        hint: of its type.
        value: the state or part, perhaps with lists instead of tuples.

    Raises:
        Refusal: it is of another type or length, not finite, of more than 32 bits, or not a member
            of its enumeration.

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
    """Everything that the rest of a run depends on, fit for JSON."""

    identity: str  #: class and version that it is a state of
    mode: str
    start_time: float
    stop_time: float  #: infinite: there is none
    time: float
    parameters: dict[str, Value]
    inputs: list[Value]
    outputs: list[Value]  #: of a sampled component; others follow from what is here
    fresh: bool  #: whether these are up to date
    held: bool  #: whether they are those of the last step
    state: Any  #: NamedTuple of the component, None before the initialisation
    draws: tuple[float, ...]  #: what the noise of the outputs is made of
    generator: Any  #: state of the generator of the noise, None without one
    fault: bool


def _unusable(why: str) -> dict[str, Any]:
    """A stand-in for a state that cannot be had."""
    return {_UNUSABLE: why}


def to_bytes(snapshot: Mapping[str, Any]) -> bytes:
    """JSON, which gives every float back bit for bit, with a checksum."""
    try:
        return _text({**snapshot, _CHECKSUM: _checksum(snapshot)})
    except (TypeError, ValueError, RecursionError) as error:
        return _text(_unusable(f"it is not fit for JSON: {error}"))


def from_bytes(content: bytes) -> dict[str, Any]:
    """The snapshot in the bytes; anything that is not a state is refused when it is set."""
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
    saved: Mapping[str, Any], identity: str, store: Store, said: Behaviour
) -> dict[str, Any]:
    """A copy of a saved state, if it can be one of this component.

    Args:
        saved: in memory, or from bytes.
        identity: of the component.
        store: of an instance of it.
        said: how it runs.

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
    time = _time(saved["time"])  # one that is finite may have a step to one that is not
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
    sampled = store.output_references if said.is_sampled and state is not None else []
    draws = restored(
        GenericAlias(tuple, (float,) * (state is not None) * said.draws), saved["draws"]
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
        "state": None if state is None else restored(said.state, state),
        "draws": draws,
        "generator": _frozen(saved["generator"]),
    }


def _time(value: Any) -> Any:
    """A time, which may be infinite."""
    return value if value in (inf, -inf) else restored(float, value)


def _frozen(value: Any) -> Any:
    """Lists, as JSON gives them, back to the tuples that a generator's state is made of."""
    return tuple(map(_frozen, value)) if isinstance(value, (list, tuple)) else value


def _values(store: Store, references: Sequence[int], values: Any) -> list[Value]:
    if not isinstance(values, (list, tuple)) or len(values) != len(references):
        raise Refusal("its values do not match the ports")
    for reference, value in zip(references, values):
        port = store.ports[reference]
        # An output is in no range: no step looks at one.
        port.sound(value) if port.causality == "output" else port.checked(value)
    return [*values]
