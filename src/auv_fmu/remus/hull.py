"""The hull of the REMUS 100: its mass with added mass, its drag and lift, its weight and buoyancy.

The hull is a spheroid with the added mass of Lamb's factors. The model is taken from the class
`remus100` in PythonVehicleSimulator 1.0.1 (vehicles/remus100.py, lib/gnc.py). Not in the paper.
Everything refers to the centre of buoyancy.
"""

from __future__ import annotations

from math import atan2, cos, log, pi, sin, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix
from auv_fmu.language.quantities import POSITION
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import Vector3, Vector6, add, cross

#: Mass of the water that a spheroid of 1.6 m by 0.19 m displaces [kg].
DISPLACED = round(4.0 / 3.0 * pi * 1026.0 * 0.8 * 0.095 * 0.095, 12)

#: Drag of a circular cylinder across the flow, per area: Hoerner's curve at B / (2 T) = 0.5,
#: between its neighbouring points in PythonVehicleSimulator (lib/gnc.py).
ACROSS = round(1.2108 + (0.5 - 0.4933) / (0.5585 - 0.4933) * (1.0836 - 1.2108), 12)

#: Number of strips of the hull for the cross-flow drag.
_STRIPS = 20


class Hull(NamedTuple):
    """The hull, a spheroid."""

    length: Annotated[float, Variable("m", "Length of the hull", POSITIVE)] = 1.6
    diameter: Annotated[float, Variable("m", "Diameter of the hull", POSITIVE)] = 0.19
    mass: Annotated[float, Variable("kg", "Mass", POSITIVE)] = DISPLACED
    gravity: Annotated[float, Variable("m/s2", "Acceleration of gravity", 0.0)] = 9.81
    r_bg: Annotated[
        Vector3,
        Variable(POSITION, "Centre of mass from the centre of buoyancy, body frame (r_bg)"),
    ] = (0.0, 0.0, 0.02)
    net_buoyancy: Annotated[
        float, Variable("N", "Buoyancy less weight (B - W); 0: neither floats nor sinks")
    ] = 0.0
    added_roll: Annotated[
        float, Variable("1", "Added moment of inertia in roll, per inertia of the hull", 0.0)
    ] = 0.3


class Drag(NamedTuple):
    """Drag and lift of the hull."""

    c_d: Annotated[
        float, Variable("1", "Drag along the hull, per frontal area", 0.0, name="drag.along")
    ] = 0.42
    c_d_across: Annotated[
        float,
        Variable("1", "Drag across the hull, per area of its side", 0.0, name="drag.across"),
    ] = ACROSS
    wing: Annotated[
        float,
        Variable("1", "Area that lifts, per length times diameter", POSITIVE, name="lift.area"),
    ] = 0.7
    oswald: Annotated[
        float, Variable("1", "Oswald's efficiency number", POSITIVE, name="lift.oswald")
    ] = 0.7
    T_surge: Annotated[
        float,
        Variable("s", "Time constant of surge at low speed", POSITIVE, name="drag.T.surge"),
    ] = 20.0
    T_sway: Annotated[
        float, Variable("s", "Time constant of sway at low speed", POSITIVE, name="drag.T.sway")
    ] = 20.0
    T_heave: Annotated[
        float, Variable("s", "Time constant of heave", POSITIVE, name="drag.T.heave")
    ] = 20.0
    T_yaw: Annotated[float, Variable("s", "Time constant of yaw", POSITIVE, name="drag.T.yaw")] = (
        1.0
    )
    zeta_roll: Annotated[
        float, Variable("1", "Damping ratio of roll", 0.0, name="drag.zeta.roll")
    ] = 0.3
    zeta_pitch: Annotated[
        float, Variable("1", "Damping ratio of pitch", 0.0, name="drag.zeta.pitch")
    ] = 0.8
    fading: Annotated[
        float,
        Variable(
            "s/m",
            "How fast the linear drag of surge and sway fades with speed",
            0.0,
            name="drag.fading",
        ),
    ] = 3.0


class Inertia(NamedTuple):
    """Masses and moments of inertia, which depend on parameters only."""

    i_x: float  #: inertia of the hull about its centre of mass, roll [kg.m2]
    i_y: float  #: the same, pitch [kg.m2]
    i_z: float  #: the same, yaw [kg.m2]
    a_11: float  #: added mass in surge [kg]
    a_22: float  #: added mass in sway and heave [kg]
    a_44: float  #: added moment of inertia in roll [kg.m2]
    a_55: float  #: added moment of inertia in pitch and yaw [kg.m2]
    M: Annotated[Matrix, 6, 6]  #: mass matrix with added mass


def inertia(hull: Hull) -> Inertia:
    """Mass, moments of inertia and added mass of a spheroid, by Lamb's factors.

    Args:
        hull: longer than thick.

    """
    m = hull.mass
    a, b = hull.length / 2.0, hull.diameter / 2.0
    i_x, i_y = 2.0 / 5.0 * m * b * b, m * (a * a + b * b) / 5.0
    e2 = 1.0 - b / a * (b / a)
    e = sqrt(e2)
    ratio = log((1.0 + e) / (1.0 - e))
    alpha_0 = 2.0 * (1.0 - e2) / (e2 * e) * (0.5 * ratio - e)
    beta_0 = 1.0 / e2 - (1.0 - e2) / (2.0 * e2 * e) * ratio
    gap = beta_0 - alpha_0
    k_1, k_2 = alpha_0 / (2.0 - alpha_0), beta_0 / (2.0 - beta_0)
    k_55 = e2 * e2 * gap / ((2.0 - e2) * (2.0 * e2 - (2.0 - e2) * gap))
    a_11, a_22 = m * k_1, m * k_2
    a_44, a_55 = hull.added_roll * i_x, k_55 * i_y
    M = mass_matrix(hull, (i_x, i_y, i_y), (a_11, a_22, a_22, a_44, a_55, a_55))
    return Inertia(i_x, i_y, i_y, a_11, a_22, a_44, a_55, M)


def mass_matrix(hull: Hull, i: Vector3, a: Vector6) -> Annotated[Matrix, 6, 6]:
    """Mass matrix of the hull, and of added mass that couples no axes.

    Args:
        hull: parameters.
        i: moments of inertia about the centre of mass [kg.m2].
        a: added masses and moments of inertia [kg, kg.m2].

    """
    m = hull.mass
    x, y, z = hull.r_bg
    return Matrix(
        (
            (m + a[0], 0.0, 0.0, 0.0, m * z, -m * y),
            (0.0, m + a[1], 0.0, -m * z, 0.0, m * x),
            (0.0, 0.0, m + a[2], m * y, -m * x, 0.0),
            (0.0, -m * z, m * y, i[0] + m * (y * y + z * z) + a[3], -m * x * y, -m * x * z),
            (m * z, 0.0, -m * x, -m * x * y, i[1] + m * (x * x + z * z) + a[4], -m * y * z),
            (-m * y, m * x, 0.0, -m * x * z, -m * y * z, i[2] + m * (x * x + y * y) + a[5]),
        )
    )


def coriolis(hull: Hull, mass: Inertia, nu_r: Vector6) -> Vector6:
    """C(nu_r) nu_r: Coriolis and centripetal forces of hull and added mass.

    Terms of added mass that couple pitch and yaw rates with u, v and w are neglected, among them
    the Munk moment: without quadratic damping of the rates they would destabilise the model.

    Args:
        hull: parameters.
        mass: of the hull.
        nu_r: (u, v, w, p, q, r) through the water [m/s, rad/s], body frame.

    """
    u, v, w, p, q, r = nu_r
    velocity, rates = (u, v, w), (p, q, r)
    m = hull.mass
    x, y, z = cross(rates, hull.r_bg)
    momentum = m * (u + x), m * (v + y), m * (w + z)
    x, y, z = cross(hull.r_bg, momentum)
    turning = x + mass.i_x * p, y + mass.i_y * q, z + mass.i_z * r
    force = cross(rates, momentum)
    moment = add(cross(velocity, momentum), cross(rates, turning))
    return (
        force[0],
        force[1] - mass.a_22 * w * p,
        force[2] + mass.a_22 * v * p,
        moment[0],
        moment[1] + (mass.a_44 - mass.a_55) * p * r,
        moment[2] + (mass.a_55 - mass.a_44) * p * q,
    )


def lift_and_drag(hull: Hull, drag: Drag, rho: float, u: float, v: float, w: float) -> Vector3:
    """Lift and drag of the hull as a wing at an angle of attack.

    Args:
        hull, drag: parameters.
        rho: density of the water [kg/m3].
        u, v, w: velocity through the water [m/s], body frame.

    Returns:
        Force (u, v, w) [N], body frame.

    """
    span = hull.diameter
    area = drag.wing * hull.length * span
    aspect = span * span / area
    c_d_0 = drag.c_d * pi * span * span / 4.0 / area
    alpha = atan2(w, u)
    c_l = pi * aspect / (1.0 + sqrt(1.0 + aspect * aspect / 4.0)) * alpha
    c_d = c_d_0 + c_l * c_l / (pi * drag.oswald * aspect)
    pressure = 0.5 * rho * (u * u + v * v + w * w) * area
    braking, lifting = pressure * c_d, pressure * c_l
    return (
        sin(alpha) * lifting - cos(alpha) * braking,
        0.0,
        -cos(alpha) * lifting - sin(alpha) * braking,
    )


def cross_flow(hull: Hull, drag: Drag, rho: float, v: float, r: float) -> tuple[float, float]:
    """Cross-flow drag, by strips: sway force [N] and yaw moment [N.m].

    Args:
        hull, drag: parameters.
        rho: density of the water [kg/m3].
        v: sway velocity through the water [m/s].
        r: rate of yaw [rad/s].

    """
    dx = hull.length / _STRIPS
    per_speed = 0.5 * rho * hull.diameter * drag.c_d_across * dx
    force, moment = 0.0, 0.0
    for k in range(_STRIPS + 1):
        x = k * dx - hull.length / 2.0
        across = v + x * r
        strip = per_speed * abs(across) * across
        force -= strip
        moment -= x * strip
    return force, moment


def restoring(hull: Hull, phi: float, theta: float) -> tuple[Vector3, Vector3]:
    """Weight and buoyancy, about the centre of buoyancy.

    Args:
        hull: of the vehicle.
        phi, theta: roll and pitch [rad].

    Returns:
        Force (u, v, w) [N] of a buoyancy that is not the weight, and righting moment (p, q, r)
        [N.m] of a centre of mass below the centre of buoyancy.

    """
    net, weight = hull.net_buoyancy, hull.mass * hull.gravity
    x, y, z = hull.r_bg
    sin_phi, cos_phi, sin_theta, cos_theta = sin(phi), cos(phi), sin(theta), cos(theta)
    across, down = cos_theta * sin_phi, cos_theta * cos_phi
    return (
        (net * sin_theta, -net * cos_theta * sin_phi, -net * cos_theta * cos_phi),
        (
            weight * (y * down - z * across),
            -weight * (z * sin_theta + x * down),
            weight * (x * across + y * sin_theta),
        ),
    )
