"""A notch filter that removes one frequency from a sampled signal.

    H(s) = (s^2 + w0^2) / (s^2 + w0/Q s + w0^2),  w0 = 2 pi f0

The bilinear transformation, with its frequency scale corrected at `f0`, makes it a discrete filter;
see Oppenheim and Schafer, Discrete-Time Signal Processing. With t = tan(w0 h / 2):

    b0 = b2 = (1 + t^2) / n,  b1 = a1 = 2 (t^2 - 1) / n,  a2 = (1 - t/Q + t^2) / n
    n = 1 + t/Q + t^2

It runs in the transposed direct form II, which needs two numbers of memory. `Q` is the frequency
divided by the width of the notch: a larger one is narrower, and takes longer to settle.

With the default values a step goes through it: the filter rings, and then passes the constant
unchanged. Connect a sine of `f0` to see it vanish.
"""

from __future__ import annotations

from math import pi, tan
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Refusal, Variable


class Parameters(NamedTuple):
    """The notch."""

    f0: Annotated[float, Variable("Hz", "Frequency of the notch", POSITIVE, tunable=True)] = 2.0
    Q: Annotated[float, Variable("1", "Quality factor", POSITIVE, tunable=True)] = 5.0


class Inputs(NamedTuple):
    """What it filters."""

    u: Annotated[float, Variable("1", "Signal")] = 1.0


class State(NamedTuple):
    """Its memory."""

    s1: Annotated[float, Variable("1", "First delayed sum")]
    s2: Annotated[float, Variable("1", "Second delayed sum")]


class Outputs(NamedTuple):
    """What is left."""

    y: Annotated[float, Variable("1", "Signal without the frequency")]


def begin() -> tuple[State, Outputs]:
    """State and outputs at the start."""
    return State(0.0, 0.0), Outputs(0.0)


def advance(
    parameters: Parameters, state: State, inputs: Inputs, h: float
) -> tuple[State, Outputs]:
    """State and outputs after a sample, which is taken every h seconds."""
    f0, u = parameters.f0, inputs.u
    if 2 * f0 * h >= 1:
        raise Refusal(f"f0 = {f0:g} Hz needs more than two samples a period: h = {h:g} s")
    t = tan(pi * f0 * h)
    n = 1 + t / parameters.Q + t * t
    b0, b1, a2 = (1 + t * t) / n, 2 * (t * t - 1) / n, (1 - t / parameters.Q + t * t) / n
    y = b0 * u + state.s1
    s1 = b1 * (u - y) + state.s2
    s2 = b0 * u - a2 * y
    return State(s1, s2), Outputs(y)
