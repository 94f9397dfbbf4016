"""The REMUS 100, an underwater vehicle with fins and one propeller, whose numbers are published.

The model is that of the class `remus100` in PythonVehicleSimulator 1.0.1, by Fossen; the page of
the component says where each number comes from and what is odd in it. Not in the paper. The hull is
a spheroid with the added mass of Lamb's factors. Everything refers to the centre of buoyancy, and
the body frame lies in it: x forward, y to starboard, z down.
"""

from __future__ import annotations

from math import atan2, cos, exp, log, pi, sin, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.attitude import rotate, rotation_from_euler
from auv_fmu.control_point import ELL, control_point, control_point_velocity
from auv_fmu.linear_algebra import Matrix, Vector, solve
from auv_fmu.plant import Localisation
from auv_fmu.tail import FASTEST, FASTEST_TURN, Tail, forces, limit_tail
from auv_fmu.vectors import Vector3, Vector6, plus_scaled, total

#: Mass of the water that a spheroid of 1.6 m by 0.19 m displaces [kg].
DISPLACED = 4.0 / 3.0 * pi * 1026.0 * 0.8 * 0.095 * 0.095

#: Drag of a circular cylinder across the flow, per area: Hoerner's curve at B / (2 T) = 0.5, from
#: the points of it in PythonVehicleSimulator (lib/gnc.py) to either side.
ACROSS = 1.2108 + (0.5 - 0.4933) / (0.5585 - 0.4933) * (1.0836 - 1.2108)

#: Strips that the hull is cut into for the cross-flow drag.
_STRIPS = 20


class TooFast(ArithmeticError):
    """A motion through the water for which the model does not hold."""


class Hull(NamedTuple):
    """The hull, a spheroid that is as heavy as the water that it displaces."""

    length: float = 1.6  #: [m]
    diameter: float = 0.19  #: [m]
    mass: float = DISPLACED  #: without added mass [kg]
    gravity: float = 9.81  #: acceleration of gravity [m/s2]
    r_bg: Vector3 = (0.0, 0.0, 0.02)  #: centre of mass from the centre of buoyancy [m], body frame
    added_roll: float = 0.3  #: added moment of inertia in roll, per that of the hull


class Drag(NamedTuple):
    """What brakes the hull."""

    c_d: float = 0.42  #: drag along the hull, per frontal area
    c_d_across: float = ACROSS  #: drag across the hull, per area of its side
    wing: float = 0.7  #: area that lifts, per length times diameter
    oswald: float = 0.7  #: Oswald's efficiency number of it
    T_surge: float = 20.0  #: time constant of surge at low speed [s]
    T_sway: float = 20.0  #: time constant of sway at low speed [s]
    T_heave: float = 20.0  #: time constant of heave [s]
    T_yaw: float = 1.0  #: time constant of yaw [s]
    zeta_roll: float = 0.3  #: relative damping of roll
    zeta_pitch: float = 0.8  #: relative damping of pitch
    fading: float = 3.0  #: how fast the linear drag of surge and sway fades with speed [s/m]


class Parameters(NamedTuple):
    """All parameters of the vehicle."""

    hull: Hull = Hull()
    drag: Drag = Drag()
    tail: Tail = Tail()
    T_delta: float = 0.1  #: time constant of the fins [s]
    T_n: float = 1.0  #: time constant of the propeller [s]
    ell: float = ELL  #: distance of the control point [m]
    eta0: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  #: initial posture [m, rad]
    nu0: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  #: initial velocity [m/s, rad/s], body frame
    noise: Localisation = Localisation()
    current: Vector3 = (0.0, 0.0, 0.0)  #: velocity of the water [m/s], earth frame


class RemusState(NamedTuple):
    """Motion of the vehicle, its fins and its propeller."""

    position: Vector3  #: centre of buoyancy (x, y, z) [m], earth frame
    euler: Vector3  #: roll, pitch, yaw [rad]
    nu: Vector6  #: (u, v, w, p, q, r) over ground [m/s, rad/s], body frame
    actuator: Vector3  #: (delta_r, delta_s, n) [rad, rad, rad/s]
    water: Vector3  #: velocity of the water in the last step [m/s], earth frame


class Inertia(NamedTuple):
    """Masses and moments of inertia: what follows from the hull, and from nothing else."""

    i_x: float  #: of the hull about its centre of mass, roll [kg.m2]
    i_y: float  #: the same, pitch and yaw [kg.m2]
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
    x, y, z = hull.r_bg
    M = Matrix(
        (
            (m + a_11, 0.0, 0.0, 0.0, m * z, -m * y),
            (0.0, m + a_22, 0.0, -m * z, 0.0, m * x),
            (0.0, 0.0, m + a_22, m * y, -m * x, 0.0),
            (0.0, -m * z, m * y, i_x + m * (y * y + z * z) + a_44, -m * x * y, -m * x * z),
            (m * z, 0.0, -m * x, -m * x * y, i_y + m * (x * x + z * z) + a_55, -m * y * z),
            (-m * y, m * x, 0.0, -m * x * z, -m * y * z, i_y + m * (x * x + y * y) + a_55),
        )
    )
    return Inertia(i_x, i_y, a_11, a_22, a_44, a_55, M)


def cross(a: Vector3, b: Vector3) -> Vector3:
    """The vector product of a and b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def coriolis(hull: Hull, mass: Inertia, nu_r: Vector6) -> Vector6:
    """C(nu_r) nu_r: Coriolis and centripetal forces of hull and added mass.

    The terms of added mass that couple pitch and yaw rates with u, v and w are left out, among them
    the Munk moment: without quadratic damping of the rates they destabilise the model.

    Args:
        hull: parameters.
        mass: of it.
        nu_r: (u, v, w, p, q, r) through the water [m/s, rad/s], body frame.

    """
    u, v, w, p, q, r = nu_r
    velocity, rates = (u, v, w), (p, q, r)
    m = hull.mass
    x, y, z = cross(rates, hull.r_bg)
    momentum = m * (u + x), m * (v + y), m * (w + z)
    x, y, z = cross(hull.r_bg, momentum)
    turning = x + mass.i_x * p, y + mass.i_y * q, z + mass.i_y * r
    force = cross(rates, momentum)
    moment = total(cross(velocity, momentum), cross(rates, turning))
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
    """Drag of water that flows across the hull, by strips: sway force [N] and yaw moment [N.m].

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


def righting(hull: Hull, phi: float, theta: float) -> Vector3:
    """Moment (p, q, r) [N.m] of a centre of mass that is not the one of buoyancy."""
    weight = hull.mass * hull.gravity
    x, y, z = hull.r_bg
    across, down = cos(theta) * sin(phi), cos(theta) * cos(phi)
    return (
        weight * (y * down - z * across),
        -weight * (z * sin(theta) + x * down),
        weight * (x * across + y * sin(theta)),
    )


def water_in_body(psi: float, water: Vector3) -> Vector3:
    """Velocity of the water [m/s] in a frame that turns with the yaw psi [rad] only.

    In the model of PythonVehicleSimulator a current does not see roll and pitch.
    """
    x, y, z = water
    return x * cos(psi) + y * sin(psi), y * cos(psi) - x * sin(psi), z


def through_water(state: RemusState) -> Vector6:
    """(u, v, w, p, q, r) through the water [m/s, rad/s], body frame."""
    u, v, w, p, q, r = state.nu
    u_c, v_c, w_c = water_in_body(state.euler[2], state.water)
    return u - u_c, v - v_c, w - w_c, p, q, r


def tail_forces(tail: Tail, state: RemusState) -> Vector6:
    """What fins and propeller give [N, N.m]; the propeller advances as fast as over ground."""
    u, v, w, _, _, _ = through_water(state)
    over_ground = state.nu[0] * state.nu[0] + state.nu[1] * state.nu[1] + state.nu[2] * state.nu[2]
    return forces(tail, state.actuator, u, v, w, sqrt(over_ground))


def accelerations(parameters: Parameters, mass: Inertia, state: RemusState) -> Vector6:
    """M d nu_r/dt + C(nu_r) nu_r + D(nu_r) nu_r + g(eta) = tau, solved for d nu/dt.

    Args:
        parameters: of the vehicle.
        mass: of its hull.
        state: of the vehicle.

    Returns:
        d/dt (u, v, w, p, q, r) over ground [m/s2, rad/s2], body frame.

    """
    hull, drag, tail = parameters.hull, parameters.drag, parameters.tail
    nu_r = through_water(state)
    u, v, w, p, q, r = nu_r
    tau = tail_forces(tail, state)
    c = coriolis(hull, mass, nu_r)
    lift = lift_and_drag(hull, drag, tail.rho, u, v, w)
    across, turning = cross_flow(hull, drag, tail.rho, v, r)
    g = righting(hull, state.euler[0], state.euler[1])
    M = mass.M
    fade = exp(-drag.fading * sqrt(u * u + v * v + w * w))
    upright = hull.mass * hull.gravity * hull.r_bg[2]
    K_p = M[3, 3] * 2.0 * drag.zeta_roll * sqrt(upright / M[3, 3])
    M_q = M[4, 4] * 2.0 * drag.zeta_pitch * sqrt(upright / M[4, 4])
    force = Vector(
        (
            tau[0] + lift[0] - c[0] - M[0, 0] / drag.T_surge * fade * u,
            tau[1] + across - c[1] - M[1, 1] / drag.T_sway * fade * v,
            tau[2] + lift[2] - c[2] - M[2, 2] / drag.T_heave * w,
            tau[3] - c[3] - K_p * p + g[0],
            tau[4] - c[4] - M_q * q + g[1],
            tau[5] + turning - c[5] - M[5, 5] / drag.T_yaw * r + g[2],
        )
    )
    dnu = solve(M, force)
    u_c, v_c, _ = water_in_body(state.euler[2], state.water)
    return dnu[0] + r * v_c, dnu[1] - r * u_c, dnu[2], dnu[3], dnu[4], dnu[5]


def euler_rates(phi: float, theta: float, p: float, q: float, r: float) -> Vector3:
    """Rates of roll, pitch and yaw [rad/s]; those of roll and yaw have a pole at +-pi/2 of pitch.

    Args:
        phi, theta: roll and pitch [rad].
        p, q, r: rates in the body frame [rad/s].

    """
    turn = sin(phi) * q + cos(phi) * r
    return p + sin(theta) / cos(theta) * turn, cos(phi) * q - sin(phi) * r, turn / cos(theta)


def follow(before: float, command: float, T: float, h: float) -> float:
    """A fin or propeller of first order after an explicit step; it follows at once if T <= h.

    Args:
        before: angle [rad] or speed [rad/s] at the beginning of the step.
        command: for it, held during the step.
        T: time constant [s].
        h: step [s].

    """
    return before + h / T * (command - before) if h < T else command


def step(
    parameters: Parameters, mass: Inertia, state: RemusState, command: Vector3, h: float
) -> RemusState:
    """One step of Euler's scheme under a held command, with the order of PythonVehicleSimulator.

    The velocity advances with fins and propeller as they are at the beginning, the posture with the
    velocity at the end.

    Args:
        parameters: of the vehicle.
        mass: of its hull.
        state: at the beginning of the step.
        command: (delta_r, delta_s, n) [rad, rad, rad/s].
        h: step [s].

    """
    dnu = accelerations(parameters, mass, state)
    u, v, w = state.nu[0] + h * dnu[0], state.nu[1] + h * dnu[1], state.nu[2] + h * dnu[2]
    p, q, r = state.nu[3] + h * dnu[3], state.nu[4] + h * dnu[4], state.nu[5] + h * dnu[5]
    delta_r, delta_s, n = state.actuator
    T_delta, T_n = parameters.T_delta, parameters.T_n
    actuator = (
        follow(delta_r, command[0], T_delta, h),
        follow(delta_s, command[1], T_delta, h),
        follow(n, command[2], T_n, h),
    )
    phi, theta, psi = state.euler
    velocity = rotate(rotation_from_euler(phi, theta, psi), (u, v, w))
    turn = euler_rates(phi, theta, p, q, r)
    return RemusState(
        plus_scaled(state.position, h, velocity),
        plus_scaled(state.euler, h, turn),
        (u, v, w, p, q, r),
        limit_tail(parameters.tail, actuator),
        state.water,
    )


def check_speed(state: RemusState) -> None:
    """Refuse a motion for which the model does not hold.

    Raises:
        TooFast: it moves through the water faster than :data:`.tail.FASTEST`, or turns faster than
            :data:`.tail.FASTEST_TURN`.

    """
    u, v, w, p, q, r = through_water(state)
    speed = sqrt(u * u + v * v + w * w)
    turn = sqrt(p * p + q * q + r * r)
    if not (speed <= FASTEST and turn <= FASTEST_TURN):
        raise TooFast(
            f"the vehicle moves at {speed:.3g} m/s through the water and turns at {turn:.3g} "
            f"rad/s; the model ends at {FASTEST:g} m/s and {FASTEST_TURN:g} rad/s: mend water, nu0 "
            "or h_max"
        )


def begin(parameters: Parameters, water: Vector3) -> RemusState:
    """State at the start, with fins amidships and a propeller at rest.

    Args:
        parameters: of the vehicle.
        water: velocity of the water, beside `current` [m/s], earth frame.

    """
    x, y, z, phi, theta, psi = parameters.eta0
    flow = total(parameters.current, water)
    state = RemusState((x, y, z), (phi, theta, psi), parameters.nu0, (0.0, 0.0, 0.0), flow)
    check_speed(state)
    return state


def steps(
    parameters: Parameters, state: RemusState, command: Vector3, water: Vector3, h: float, n: int
) -> RemusState:
    """State after n steps of h seconds under held inputs.

    Args:
        parameters: of the vehicle.
        state: at the beginning.
        command: (delta_r, delta_s, n) [rad, rad, rad/s].
        water: velocity of the water, beside `current` [m/s], earth frame.
        h: step [s].
        n: how many.

    """
    mass = inertia(parameters.hull)
    flow = total(parameters.current, water)
    for _ in range(n):
        state = state._replace(water=flow)
        check_speed(state)
        state = step(parameters, mass, state, command, h)
        check_speed(state)
    return state


def control(state: RemusState, ell: float) -> tuple[Vector3, Vector3]:
    """The control point [m] and its velocity [m/s], earth frame: (9) and (10).

    Args:
        state: of the vehicle.
        ell: distance of the control point from the centre of buoyancy [m].

    """
    phi, theta, psi = state.euler
    rotation = rotation_from_euler(phi, theta, psi)
    return (
        control_point(state.position, rotation, ell),
        control_point_velocity(rotation, state.nu, ell),
    )
