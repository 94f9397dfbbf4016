"""A notch filter that removes one frequency from a sampled signal.

    H(s) = (s^2 + w0^2) / (s^2 + w0/Q s + w0^2),  w0 = 2 pi f0

The bilinear transformation, with its frequency scale corrected at `f0`, makes it a discrete filter;
see Oppenheim and Schafer, Discrete-Time Signal Processing. With t = tan(w0 T / 2):

    b0 = b2 = (1 + t^2) / n,  b1 = a1 = 2 (t^2 - 1) / n,  a2 = (1 - t/Q + t^2) / n
    n = 1 + t/Q + t^2

It runs in the transposed direct form II, which needs two numbers of memory:

    y = b0 u + s1,  s1 <- b1 (u - y) + s2,  s2 <- b0 u - a2 y

It is sampled: step it every `T` seconds. `Q` is the frequency divided by the width of the notch: a
larger one is narrower, and takes longer to settle.

With the default values a step goes through it: the filter rings, and then passes the constant
unchanged. Connect a sine of `f0` to see it vanish.
"""

from __future__ import annotations

from math import pi, tan
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Refusal, Variable

SAMPLED = True
STEP_SIZE, STOP_TIME = 0.02, 2.0


class Parameters(NamedTuple):
    """The notch."""

    f0: Annotated[float, Variable("Hz", "Frequency of the notch", POSITIVE, tunable=True)] = 2.0
    Q: Annotated[float, Variable("1", "Quality factor", POSITIVE, tunable=True)] = 5.0
    T: Annotated[float, Variable("s", "Sampling period", POSITIVE)] = 0.02


class Inputs(NamedTuple):
    """Signal to filter."""

    u: Annotated[float, Variable("1", "Signal")] = 1.0


class State(NamedTuple):
    """Memory of the filter."""

    s1: float  #: first delayed sum
    s2: float  #: second delayed sum


class Coefficients(NamedTuple):
    """Values that depend on parameters only."""

    b0: float
    b1: float
    a2: float


class Outputs(NamedTuple):
    """Filtered signal."""

    y: Annotated[float, Variable("1", "Signal without the frequency")]


def check(parameters: Parameters) -> None:
    """Refuse a frequency with fewer than two samples a period."""
    f0, T = parameters.f0, parameters.T
    if 2 * f0 * T >= 1:
        raise Refusal(f"f0 = {f0:g} Hz needs more than two samples a period: T = {T:g} s")


def start() -> State:
    """State at the start."""
    return State(0.0, 0.0)


def derive(parameters: Parameters) -> Coefficients:
    """The coefficients, which only a change of a parameter changes."""
    t = tan(pi * parameters.f0 * parameters.T)
    n = 1 + t / parameters.Q + t * t
    return Coefficients((1 + t * t) / n, 2 * (t * t - 1) / n, (1 - t / parameters.Q + t * t) / n)


def update(state: State, derived: Coefficients, inputs: Inputs) -> State:
    """State after a sample."""
    u, y = inputs.u, derived.b0 * inputs.u + state.s1
    return State(derived.b1 * (u - y) + state.s2, derived.b0 * u - derived.a2 * y)


def outputs(state: State, derived: Coefficients, inputs: Inputs) -> Outputs:
    """Output for a sample."""
    return Outputs(derived.b0 * inputs.u + state.s1)
