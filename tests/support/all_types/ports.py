"""Ports of AllTypes."""

from __future__ import annotations

from typing import Any

from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, Port, parameter, parameters, setting

from .behaviour import Limits, Mode, Parameters

DESCRIPTION = "Ports, parameters and state of all types"

_START = Parameters()


def _names(name: str, *sizes: int) -> list[str]:
    """The ports of a vector or a matrix."""
    if not sizes:
        return [name]
    if len(sizes) == 1:
        return [f"{name}[{i + 1}]" for i in range(sizes[0])]
    return [f"{name}[{i + 1},{k + 1}]" for i in range(sizes[0]) for k in range(sizes[1])]


def _input(name: str, *sizes: int, kind: str = "Real", **more: Any) -> tuple[Port, ...]:
    about = ("input", "continuous" if kind == "Real" else "discrete", kind, "Set from outside")
    start = {"Real": 0.0, "Integer": 0, "Boolean": False}[kind]
    return tuple(Port(it, *about, **{"start": start, **more}) for it in _names(name, *sizes))


INPUTS = (
    *_input("k", kind="Integer", start=3, minimum=-5, maximum=2**31 - 1),
    *_input("u", start=0.25),
    *_input("go", kind="Boolean", start=True),
    *_input("v", 3),
    *_input("A", 2, 2, start=-1.5),
    *_input("pair", 2, kind="Integer"),
    *_input("want", kind="Integer", choices={mode.name: int(mode) for mode in Mode}),
)


def _output(name: str, *sizes: int, kind: str = "Real") -> tuple[Port, ...]:
    about = ("output", "continuous" if kind == "Real" else "discrete", kind, "Seen from outside")
    depends = tuple(port.name for port in INPUTS)
    return tuple(Port(it, *about, feedthrough=depends) for it in _names(name, *sizes))


PARAMETERS = ParameterSet(
    Parameters,
    gain=parameter("gain", _START.gain, "1", "Gain", tunable=True),
    K=tuple(
        parameter(name, value, "1", "Matrix")
        for name, value in zip(_names("K", 2, 2), (1.0, 0.5, -0.5, 2.0), strict=True)
    ),
    offset=parameters("offset", _START.offset, {1: "1", 2: "1", 3: "1"}, "Offset"),
    step=setting("step", _START.step, "Added in each step", minimum=-(2**31), maximum=2**31 - 1),
    counts=setting("counts", _START.counts, "Whether it counts"),
    mode=setting("mode", "HEAT", "How it begins", {mode.name: mode for mode in Mode}),
    limits=ParameterSet(
        Limits,
        default=parameter("limits.default", _START.limits.default, "1", "A word of C"),
        most=setting("limits.most", _START.limits.most, "Most", minimum=0),
        kind=setting("limits.kind", "OFF", "Which", {mode.name: mode for mode in Mode}),
    ),
    mixed=(
        setting("mixed.n", _START.mixed[0], "A number of a tuple of several types"),
        parameter("mixed.x", _START.mixed[1], "1", "Another"),
    ),
)
PORTS: tuple[Port, ...] = (
    *INPUTS,
    *_output("n", kind="Integer"),
    *_output("x"),
    *_output("on", kind="Boolean"),
    *_output("doing", kind="Integer"),
    *_output("line", 4),
    *_output("pairs", 2, kind="Integer"),
    *_output("B", 2, 2),
    *_output("noisy", 2),
    *_output("flags", 3, kind="Boolean"),
    *PARAMETERS.ports,
    H_MAX,
)
