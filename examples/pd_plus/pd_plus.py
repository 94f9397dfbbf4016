"""A PD+ law: feed-forward of the model along the reference, and PD feedback.

    F = M ddy_d + D dy_d - K_p e - K_d de,  e = y - y_d, limited to what tau_max allows

Paden and Panja (Globally asymptotically stable 'PD+' controller for robot manipulators,
International Journal of Control 47, 1988) feed the inertia and the Coriolis terms of a robot
forward. Here M and D are mass and drag at the control point (`auv_fmu.paper.point_mass`); there are
no Coriolis terms, for want of body rates. If the model is right, the error obeys

    M dde + (K_d + D) de + K_p e = 0

from any state, and V = (de' M de + e' K_p e) / 2 does not rise. The gains place its poles:

    K_p = omega^2 M,  K_d = 2 zeta omega M - D but not below 0

The law measures the velocity dy, and has no integral: a constant force leaves an error of its size
over K_p. With the default inputs the vehicle does not move, and the command is constant.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector
from auv_fmu.paper.point_mass import Inputs, Outputs, PointMass, axes, command, limited, times

SAMPLED = True
STOP_TIME = 10.0

#: Gains to tune, with their ranges.
GAINS = {"omega": (0.2, 8.0), "zeta": (0.5, 2.0)}


class Parameters(NamedTuple):
    """Gains and vehicle."""

    omega: Annotated[float, Variable("rad/s", "Frequency of the error", POSITIVE)] = 1.0
    zeta: Annotated[float, Variable("1", "Damping of the error", 0.0)] = 1.0
    point: Annotated[PointMass, Variable(name="")] = PointMass()


def outputs(parameters: Parameters, inputs: Inputs) -> Outputs:
    """Return the command."""
    omega, point = parameters.omega, parameters.point
    e, de, R_T = inputs.y - inputs.y_d, inputs.dy - inputs.dy_d, axes(inputs.eta)
    rate = 2.0 * parameters.zeta * omega
    K_d = Vector(max(rate * m - d, 0.0) for m, d in zip(point.mass, point.drag))
    forward = times(point.mass, R_T @ inputs.ddy_d) + times(point.drag, R_T @ inputs.dy_d)
    back = times(point.mass, omega * omega * (R_T @ e)) + times(K_d, R_T @ de)
    return Outputs(command(point, limited(point, forward - back)))
