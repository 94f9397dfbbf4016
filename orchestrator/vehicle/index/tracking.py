"""Time until the control point reaches its reference, and its largest error later."""

from __future__ import annotations

from math import inf, isnan, nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.language.quantities import EULER, POSITION
from auv_fmu.language.vectors import Vector3, norm, sub
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.control_point import control_point

#: An error of tracking that counts as having reached the reference [m].
REACHED = 1.0


class Inputs(NamedTuple):
    """Posture and reference."""

    position: Annotated[Vector3, Variable(POSITION, "Centre of mass", name="plant.eta")]
    attitude: Annotated[Vector3, Variable(EULER, "Euler angles", name="plant.eta")]
    y_d: Annotated[Vector3, Variable(POSITION, "Reference", name="planner.y_d")]
    ell: Annotated[float, Variable("m", "Distance of the control point", name="plant.ell")]


class State(NamedTuple):
    """Results of all rows so far."""

    reached: float  #: time [s]; not a number before it
    late: float  #: largest error of the second half [m]


class Outputs(NamedTuple):
    """Time and error."""

    time_to_reach: Annotated[
        float,
        Variable("s", f"time from the start of the run until |e| is at most {REACHED:g} m"),
    ]
    late_error: Annotated[float, Variable("m", "largest |e| in the second half of the run")]


def error(inputs: Inputs) -> Vector3:
    """Return e = y - y_d with the true control point [m]."""
    phi, theta, psi = inputs.attitude
    y = control_point(inputs.position, rotation_from_euler(phi, theta, psi), inputs.ell)
    return sub(y, inputs.y_d)


def start(inputs: Inputs, t: float, begin: float, end: float) -> State:
    """Begin with the first row."""
    return update(State(nan, -inf), inputs, t, begin, end)


def update(state: State, inputs: Inputs, t: float, begin: float, end: float) -> State:
    """Add a row."""
    is_late = t >= begin + 0.5 * (end - begin)
    if not is_late and not isnan(state.reached):
        return state
    distance = norm(error(inputs))
    if isnan(state.reached) and distance <= REACHED:
        state = state._replace(reached=t - begin)
    if is_late and distance > state.late:
        state = state._replace(late=distance)
    return state


def outputs(state: State) -> Outputs:
    """Return the time and the error."""
    return Outputs(state.reached, state.late if state.late >= 0.0 else nan)
