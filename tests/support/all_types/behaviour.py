"""How AllTypes runs: every step moves all that it has, and overflows or fails where it is told."""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, NamedTuple

from auv_fmu.linear_algebra import Matrix, Vector
from fmus.ports.port import Refusal


class Mode(IntEnum):
    """What it does."""

    OFF = 0
    HEAT = 2
    COOL = -7


class Limits(NamedTuple):
    """A set in the set of parameters."""

    default: float = 2.0
    most: int = 2_147_483_647
    kind: Mode = Mode.OFF


class Parameters(NamedTuple):
    """What may be set."""

    gain: float = 0.5
    K: Annotated[Matrix, 2, 2] = Matrix(((1.0, 0.5), (-0.5, 2.0)))
    offset: Annotated[Vector, 3] = Vector((0.5, 1.0, 1.5))
    step: int = 1
    counts: bool = True
    mode: Mode = Mode.HEAT
    limits: Limits = Limits()
    mixed: tuple[int, float] = (5, 0.25)


class Inputs(NamedTuple):
    """What it follows."""

    k: int
    u: float
    go: bool
    v: Annotated[Vector, 3]
    A: Annotated[Matrix, 2, 2]
    pair: tuple[int, int]
    want: Mode


class Inner(NamedTuple):
    """A part of the state."""

    y: float
    count: int
    flags: tuple[bool, bool]
    then: Mode


class State(NamedTuple):
    """What a step depends on."""

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
    """What follows from the state."""

    place: int
    double: Annotated[Vector, 4]
    is_off: bool


class Outputs(NamedTuple):
    """What is seen of it."""

    n: int
    x: float
    on: bool
    doing: Mode
    line: Annotated[Vector, 4]
    pairs: tuple[int, int]
    B: Annotated[Matrix, 2, 2]
    noisy: Annotated[Vector, 2]
    flags: tuple[bool, bool, bool]


RESTARTED = "x was wild at t = {t:g} s"


def check(parameters: Parameters) -> None:
    """Whether parameters fit together."""
    if parameters.step > parameters.limits.most:
        raise Refusal(f"step = {parameters.step}: must be at most {parameters.limits.most}")


def begin(parameters: Parameters, inputs: Inputs, t: float) -> tuple[State, Derived, Outputs]:
    """State and outputs at the start."""
    line = Vector((inputs.v[0], inputs.v[1], inputs.v[2], parameters.limits.default))
    inner = Inner(t, 0, (inputs.go, not inputs.go), parameters.limits.kind)
    state = State(
        n=inputs.k,
        x=inputs.u,
        on=inputs.go,
        mode=parameters.mode,
        line=line,
        M=inputs.A,
        inner=inner,
        mixed=parameters.mixed,
        counters=(inputs.pair[0], inputs.pair[1], 0),
    )
    derived = derive(parameters, state)
    return state, derived, _seen(state, derived)


def derive(parameters: Parameters, state: State) -> Derived:
    """What follows from the state."""
    double = (1.5 + parameters.gain) * state.line
    return Derived(state.n % 4, double, state.mode == Mode.OFF)


def credible(state: State) -> bool:
    """Whether x is not wild."""
    return abs(state.x) < 1e6


def restarted(state: State, inputs: Inputs) -> State:
    """The state without a wild x."""
    return state._replace(x=0.0, n=inputs.k)


def advance(
    parameters: Parameters,
    state: State,
    derived: Derived,
    inputs: Inputs,
    t: float,
    h: float,
    n: int,
) -> tuple[State, Derived, Outputs]:
    """State and outputs after n steps of h seconds."""
    x, number, line, M, mode = state.x, state.n, state.line, state.M, state.mode
    for i in range(n):
        x += h * parameters.gain * (inputs.u - x) + 0.125 * derived.double[derived.place]
        line = line.replaced((derived.place + i) % 4, x)
        M = 0.5 * (parameters.K @ M) + inputs.A
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
        count=before.count + n,
        flags=(before.flags[1], before.flags[0]),
        then=state.mode,
    )
    after = State(
        n=number,
        x=x,
        on=x > 0.0,
        mode=mode,
        line=line,
        M=M,
        inner=inner,
        mixed=(state.mixed[0] + inputs.pair[0], state.mixed[1] + t),
        counters=(state.counters[1], state.counters[2], state.counters[0] + 1),
    )
    again = derive(parameters, after)
    return after, again, _seen(after, again)


def seed(parameters: Parameters) -> int:
    """Of the noise."""
    if parameters.step == 13:
        raise Refusal("step = 13: no seed")
    return parameters.step


def measured(
    parameters: Parameters, noisy: Annotated[Vector, 2], n: Annotated[Vector, 2]
) -> Annotated[Vector, 2]:
    """The first two numbers of the line, with noise."""
    return noisy + parameters.gain * n / parameters.limits.default


def expected(parameters: Parameters, state: State, outputs: Outputs) -> Outputs:
    """The outputs that belong to a state."""
    seen = _seen(state, derive(parameters, state))
    return seen._replace(noisy=outputs.noisy)


def _seen(state: State, derived: Derived) -> Outputs:
    return Outputs(
        n=state.n,
        x=state.x,
        on=state.on,
        doing=state.mode,
        line=state.line,
        pairs=(state.counters[0], state.inner.count),
        B=state.M.T,
        noisy=Vector((state.line[0], state.line[1])),
        flags=(state.inner.flags[0], state.on, derived.is_off),
    )
