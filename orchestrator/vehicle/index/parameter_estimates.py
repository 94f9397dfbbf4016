"""Parameter estimates of the controller, halfway and at the end."""

from __future__ import annotations

from math import isnan, nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.language.quantities import THETA
from auv_fmu.language.vectors import Vector4

_NONE = (nan, nan, nan, nan)


class Inputs(NamedTuple):
    """The estimates."""

    theta_hat: Annotated[Vector4, Variable(THETA, "Estimates", name="controller.theta_hat")]


class State(NamedTuple):
    """Estimates that the controller has used."""

    half: Vector4  #: in the first step that ends in the second half
    end: Vector4  #: in the last step


class Outputs(NamedTuple):
    """Estimates at two times."""

    theta_hat_half: Annotated[Vector4, Variable(THETA, "theta_hat halfway through the run")]
    theta_hat_end: Annotated[Vector4, Variable(THETA, "theta_hat at the end of the run")]


def start() -> State:
    """Begin without a step."""
    return State(_NONE, _NONE)


def update(state: State, acting: Inputs, t: float, begin: float, end: float) -> State:
    """Add a step."""
    is_half = isnan(state.half[0]) and t >= begin + 0.5 * (end - begin)
    return State(acting.theta_hat if is_half else state.half, acting.theta_hat)


def outputs(state: State) -> Outputs:
    """Return the estimates."""
    return Outputs(state.half, state.end)
