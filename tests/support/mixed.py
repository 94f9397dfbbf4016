"""FMUs in C with ports of all kinds, and systems of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from hypothesis import strategies as st

from orchestrator.cosim import Alter, Connection, Event, Linear, Mapped, System
from support.small_fmus import (
    connected,
    constants,
    description,
    enumeration,
    unknown,
    variable,
    write,
)

_SOURCE = Path(__file__).with_name("mixed.c")

#: Kinds of ports; a component has up to four inputs and four outputs of each.
KINDS = ("Real", "Integer", "Enumeration", "Boolean")
_MOST = 4

_PLACES, CALLS, ACTS = (constants(_SOURCE, first) for first in ("PORTS", "SET", "BEHAVE"))
_PARAMETERS = {name: _PLACES[name.upper()] for name in ("at", "act", "call", "milliseconds")}


class Shape(NamedTuple):
    """Number of inputs and outputs of each kind of an FMU, and its claim of feedthrough."""

    inputs: tuple[int, ...]
    outputs: tuple[int, ...]
    feedthrough: bool = False

    def ports(self, causality: str) -> list[tuple[str, str, int]]:
        """Name, kind and value reference of each input or output."""
        counts = self.inputs if causality == "input" else self.outputs
        first = 0 if causality == "input" else _PLACES["OUTPUTS"]
        # Integers and Enumerations share their references, as FMI's functions do.
        return [
            (f"{causality}.{kind}{i}", kind, first + (kind == "Enumeration") * _MOST + i)
            for i in range(_MOST)
            for kind, n in zip(KINDS, counts, strict=True)
            if i < n
        ]

    def description(self) -> str:
        """Its modelDescription.xml."""
        variables = [
            _variable(name, kind, reference, causality)
            for causality in ("input", "output")
            for name, kind, reference in self.ports(causality)
        ]
        n = len(self.ports("input"))
        dependencies = " ".join(str(1 + i) for i in range(n)) if self.feedthrough else ""
        unknowns = [unknown(1 + i, dependencies) for i in range(n, len(variables))]
        variables += [
            variable(name, reference, "parameter", "Integer", -(name == "at"))
            for name, reference in _PARAMETERS.items()
        ]
        types = f"<TypeDefinitions>{enumeration('Mood', {'good': 1})}</TypeDefinitions>"
        return description("mixed", variables, unknowns, definitions=types)


def _variable(name: str, kind: str, reference: int, causality: str) -> str:
    more = {} if causality == "input" else {"initial": "calculated"}
    if kind == "Enumeration":
        start = 1 if causality == "input" else None
        return variable(name, reference, causality, kind, start, ' declaredType="Mood"', **more)
    return variable(name, reference, causality, kind, **more)


def build(folder: Path, shape: Shape) -> Path:
    """The FMU of a shape."""
    fmu = folder / f"{abs(hash(shape)):x}.fmu"
    if not fmu.exists():
        write(fmu, shape.description(), _SOURCE)
    return fmu


def system_of(
    folder: Path,
    shapes: Mapping[str, Shape],
    connections: Mapping[str, str] | None = None,
    parameters: Mapping[str, int] | None = None,
) -> System:
    """A system of such FMUs.

    Args:
        folder: for the FMUs.
        shapes: by the names of the components.
        connections: sources by targets.
        parameters: by `component.parameter`.

    """
    fmus = {name: build(folder, shape) for name, shape in shapes.items()}
    return connected("mixed", fmus, connections, parameters)


#: Factors and values up to the largest there are.
_SIZES = st.sampled_from([-1e308, -1e154, -1.0, 1e-300, 0.5, 1.0, 1e100, 1e250, 1e308])
_INTEGERS = st.integers(-(2**31), 2**31 - 1)


@st.composite
def altered(draw: st.DrawFn, system: System) -> tuple[System, list[Event]]:
    """A system with something on the ways of its values, and events that alter them further."""
    connections, events = [], []
    for connection in system.connections:
        target = connection.target
        kind = system.components[target.component].variables[target.port].type
        transformation, bias = None, 0
        if kind == "Real":
            transformation = draw(st.none() | st.builds(Linear, _SIZES, _SIZES))
            bias = draw(_SIZES)
        elif kind == "Integer":
            pairs = st.dictionaries(_INTEGERS, _INTEGERS, max_size=3)
            transformation = draw(st.none() | pairs.map(lambda some: Mapped(tuple(some.items()))))
            bias = draw(_INTEGERS)
        connections.append(Connection(connection.source, target, transformation))
        if bias and draw(st.booleans()):
            action = Alter("bias", ((target, float(bias)),))
            events.append(Event("bias", action, "bias", at=draw(st.floats(0.0, 10.0))))
    return replace(system, connections=tuple(connections)), events


_COUNTS = st.tuples(*[st.integers(0, _MOST)] * len(KINDS))


@st.composite
def systems(draw: st.DrawFn) -> dict[str, dict]:
    """Arguments of :func:`system_of`: up to four components; one may misbehave."""
    names = ["a", "b", "c", "d"][: draw(st.integers(1, 4))]
    # Feedthrough goes one way, so that it makes no loop.
    shapes = {
        name: Shape(draw(_COUNTS), draw(_COUNTS), feedthrough=draw(st.booleans())) for name in names
    }
    outputs = {
        kind: [
            f"{name}.{port}"
            for name, shape in shapes.items()
            for port, of_kind, _ in shape.ports("output")
            if of_kind == kind
        ]
        for kind in KINDS
    }
    connections = {}
    for name, shape in shapes.items():
        for port, kind, _ in shape.ports("input"):
            sources = [
                source
                for source in outputs[kind]
                if source.split(".")[0] < name or not shapes[source.split(".")[0]].feedthrough
            ]
            if sources and draw(st.booleans()):
                connections[f"{name}.{port}"] = draw(st.sampled_from(sources))
    bad = draw(st.sampled_from(names))
    acts = sorted(ACTS.keys() - {"FATAL", "INTERRUPT", "HANGS"})
    parameters = {
        f"{bad}.act": ACTS[draw(st.sampled_from(acts))],
        f"{bad}.call": draw(st.sampled_from(sorted(CALLS.values()))),
        f"{bad}.at": draw(st.integers(1, 60)),
    }
    return {"shapes": shapes, "connections": connections, "parameters": parameters}
