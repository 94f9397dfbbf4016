"""Ports, parameters and state of all types.

Every step changes every part of the state, and some inputs make it overflow or fail. Its outputs
follow the inputs and the time.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, NamedTuple

from auv_fmu import Matrix, Refusal, Variable, Vector


class Mode(IntEnum):
    """Modes."""

    OFF = 0
    HEAT = 2
    COOL = -7


class Limits(NamedTuple):
    """A set in the set of parameters."""

    default: Annotated[float, Variable("1", "A word of C")] = 2.0
    most: Annotated[int, Variable(description="Most", minimum=0)] = 2_147_483_647
    kind: Annotated[Mode, Variable(description="Which")] = Mode.OFF


class Mixed(NamedTuple):
    """Numbers of several types."""

    n: Annotated[int, Variable(description="A number")] = 5
    x: Annotated[float, Variable("1", "Another")] = 0.25


class Parameters(NamedTuple):
    """Parameters."""

    gain: Annotated[float, Variable("1", "Gain", tunable=True)] = 0.5
    K: Annotated[Matrix, 2, 2, Variable("1", "Matrix")] = Matrix(((1.0, 0.5), (-0.5, 2.0)))
    offset: Annotated[Vector, 3, Variable("1", "Offset")] = Vector((0.5, 1.0, 1.5))
    step: Annotated[int, Variable(description="Added in each step")] = 1
    counts: Annotated[bool, Variable(description="Whether it counts")] = True
    mode: Annotated[Mode, Variable(description="How it begins")] = Mode.HEAT
    limits: Limits = Limits()
    mixed: Mixed = Mixed()


class Inputs(NamedTuple):
    """Inputs."""

    k: Annotated[int, Variable(minimum=-5, maximum=2_147_483_647)] = 3
    u: Annotated[float, Variable("1", "Value")] = 0.25
    go: Annotated[bool, Variable(description="Whether it counts now")] = True
    v: Annotated[Vector, 3, Variable("1", "Values")] = Vector((0.0, 0.0, 0.0))
    A: Annotated[Matrix, 2, 2, Variable("1", "Values")] = Matrix(((-1.5, -1.5), (-1.5, -1.5)))
    pair: Annotated[tuple[int, int], Variable(description="Numbers")] = (0, 0)
    want: Annotated[Mode, Variable(description="What it is to do")] = Mode.OFF


class Inner(NamedTuple):
    """A part of the state."""

    y: float
    count: int
    flags: tuple[bool, bool]
    then: Mode


class State(NamedTuple):
    """State."""

    n: int
    x: float
    on: bool
    mode: Mode
    line: Annotated[Vector, 4]
    M: Annotated[Matrix, 2, 2]
    inner: Inner
    mixed: tuple[int, float]
    counters: tuple[int, int, int]


class Derived(NamedTuple):
    """Values that follow from the state and the inputs."""

    place: int
    double: Annotated[Vector, 4]
    is_off: bool


class Outputs(NamedTuple):
    """Outputs."""

    n: Annotated[int, Variable()]
    x: Annotated[float, Variable()]
    on: Annotated[bool, Variable()]
    doing: Annotated[Mode, Variable()]
    line: Annotated[Vector, 4, Variable()]
    pairs: Annotated[tuple[int, int], Variable()]
    B: Annotated[Matrix, 2, 2, Variable()]
    noisy: Annotated[Vector, 2, Variable()]
    flags: Annotated[tuple[bool, bool, bool], Variable()]


RESTARTED = "x was wild at t = {t:g} s"
H_MAX = 0.02


def check(parameters: Parameters) -> None:
    """Refuse parameters that do not fit together."""
    if parameters.step > parameters.limits.most:
        raise Refusal(f"step = {parameters.step}: must be at most {parameters.limits.most}")


def check_state(state: State) -> None:
    """Refuse a state that no run leads to."""
    if state.inner.count < 0:
        raise Refusal(f"count = {state.inner.count}")


def start(parameters: Parameters, inputs: Inputs, t: float) -> State:
    """State at the start."""
    line = Vector((inputs.v[0], inputs.v[1], inputs.v[2], parameters.limits.default))
    inner = Inner(t, 0, (inputs.go, not inputs.go), parameters.limits.kind)
    return State(
        n=inputs.k,
        x=inputs.u,
        on=inputs.go,
        mode=parameters.mode,
        line=line,
        M=inputs.A,
        inner=inner,
        mixed=(parameters.mixed.n, parameters.mixed.x),
        counters=(inputs.pair[0], inputs.pair[1], 0),
    )


def derive(parameters: Parameters, state: State, inputs: Inputs, t: float) -> Derived:
    """Values that follow from the state and the inputs."""
    double = (1.5 + parameters.gain + t * inputs.v[0]) * state.line
    return Derived((state.n % 4 + inputs.k % 4) % 4, double, state.mode == Mode.OFF)


def credible(state: State) -> bool:
    """True if x is not wild."""
    return abs(state.x) < 1e6


def restarted(state: State, inputs: Inputs) -> State:
    """The state without a wild x."""
    return state._replace(x=0.0, n=inputs.k)


def update(
    parameters: Parameters, state: State, derived: Derived, inputs: Inputs, t: float, h: float
) -> State:
    """State after a step of h seconds."""
    number, mode, place = state.n, state.mode, derived.place
    x = state.x + h * parameters.gain * (inputs.u - state.x) + 0.125 * derived.double[place]
    if parameters.counts and inputs.go:
        number += parameters.step
    if inputs.k == 7:
        mode = Mode.COOL if mode == Mode.HEAT else Mode.HEAT
    if inputs.want == Mode.COOL:
        mode = inputs.want
    x += parameters.offset @ inputs.v / (100.0 + inputs.k)
    before = state.inner
    inner = before._replace(
        y=before.y + float(number),
        count=before.count + 1,
        flags=(before.flags[1], before.flags[0]),
        then=state.mode,
    )
    return State(
        n=number,
        x=x,
        on=x > 0.0,
        mode=mode,
        line=state.line.replaced(place, x),
        M=0.5 * (parameters.K @ state.M) + inputs.A,
        inner=inner,
        mixed=(state.mixed[0] + inputs.pair[0], state.mixed[1] + t),
        counters=(state.counters[1], state.counters[2], state.counters[0] + 1),
    )


def outputs(
    parameters: Parameters, state: State, derived: Derived, inputs: Inputs, t: float
) -> Outputs:
    """Outputs."""
    return Outputs(
        n=state.n,
        x=state.x + t * (inputs.u - 0.25) / parameters.limits.default,
        on=state.on,
        doing=state.mode,
        line=derived.double,
        pairs=(state.counters[0] + inputs.pair[1], state.inner.count),
        B=state.M.T,
        noisy=Vector((state.line[0], state.line[1])),
        flags=(state.inner.flags[0], inputs.go, derived.is_off),
    )


def seed(parameters: Parameters) -> int:
    """Seed of the noise."""
    if parameters.step == 13:
        raise Refusal("step = 13: no seed")
    return parameters.step


def measured(
    parameters: Parameters, noisy: Annotated[Vector, 2], n: Annotated[Vector, 2]
) -> Annotated[Vector, 2]:
    """The first two numbers of the line, with noise."""
    return noisy + parameters.gain * n / parameters.limits.default
