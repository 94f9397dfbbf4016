"""The control point, ell ahead of the centre of mass: equations (9) to (13).

The columns of (11) are R e1, -ell R e3 and ell R e2, with R the rotation from body to earth
at zero roll. With the full R the same three lines hold for a vehicle that rolls (reading 3), so
every function here takes R, and the caller chooses.
"""

from __future__ import annotations

from typing import Annotated

from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Rotation, Vector3, Vector6, add_scaled
from auv_fmu.paper.attitude import rotate, rotate_back

#: Distance of the control point ahead of the centre of mass, and its value in section 4.1 [m].
Distance = Annotated[
    float, Variable("m", "Distance of the control point from the centre of mass (ell)", POSITIVE)
]
ELL = 0.35

#: True if controllers assume zero roll (reading 3).
WithoutRoll = Annotated[
    bool, Variable("1", "Use (11) as printed, for zero roll, instead of the full attitude")
]


def control_point(position: Vector3, rotation: Rotation, ell: float) -> Vector3:
    """Equation (9), y = h(eta): the control point.

    Args:
        position: centre of mass (x, y, z) [m], earth frame.
        rotation: body to earth.
        ell: distance of the control point [m].

    Returns:
        Control point (x, y, z) [m], earth frame.

    """
    return add_scaled(position, ell, rotation[0])


def control_point_velocity(rotation: Rotation, nu: Vector6, ell: float) -> Vector3:
    """Equation (10), dy/dt = J v + J_delta: the sum of (11) and (12) in terms of R.

    Args:
        rotation: body to earth.
        nu: (u, v, w, p, q, r) [m/s, rad/s]; p has no effect, because its axis passes through the
            control point.
        ell: distance of the control point [m].

    Returns:
        Velocity of the control point [m/s], earth frame.

    """
    u, v, w, _, q, r = nu
    return rotate(rotation, (u, v + ell * r, w - ell * q))


def actuator_command(rotation: Rotation, force: Vector3, ell: float) -> Vector3:
    """Force-torque transformation tau_a = J^T F before (15), as used by (21) and (57).

    Args:
        rotation: body to earth; for (11) as printed, without roll.
        force: F [N] at the control point, earth frame.
        ell: distance of the control point [m].

    Returns:
        (tau_u [N], tau_q [N.m], tau_r [N.m]).

    """
    f_1, f_2, f_3 = rotate_back(rotation, force)  # J has the columns of R
    return f_1, -ell * f_3, ell * f_2


def actuated_velocity(
    rotation: Rotation, dy: Vector3, w: tuple[float, float], ell: float
) -> Vector3:
    """Equation (13), v = J^-1 (dy/dt - J_delta).

    J^-1 takes no elimination: the columns of J are multiples of the columns of R.

    Args:
        rotation: body to earth.
        dy: velocity of the control point [m/s], earth frame.
        w: sway and heave (v, w) [m/s].
        ell: distance of the control point [m], not zero.

    Returns:
        (u [m/s], q [rad/s], r [rad/s]).

    """
    d_1, d_2, d_3 = rotate_back(rotation, dy)
    return d_1, (w[1] - d_3) / ell, (d_2 - w[0]) / ell
