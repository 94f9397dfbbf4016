"""The REMUS 100, an underwater vehicle with fins and one propeller, with published parameters.

The model is taken from the class `remus100` in PythonVehicleSimulator 1.0.1, by Fossen; the page of
the component has the source of each number and the oddities. The hull may have the coefficients of
Prestero instead. Not in the paper. Everything refers to the centre of buoyancy, the origin of the
body frame: x forward, y to starboard, z down.
"""

from __future__ import annotations

from enum import IntEnum
from math import cos, exp, sin, sqrt
from typing import Annotated, NamedTuple

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.linear_algebra import solve
from auv_fmu.language.quantities import ETA, EULER, NU, POSITION, VELOCITY
from auv_fmu.language.variable import Refusal, Variable
from auv_fmu.language.vectors import Vector3, Vector6, add, add_scaled
from auv_fmu.paper.attitude import rotate, rotation_from_euler
from auv_fmu.paper.control_point import ELL, Distance
from auv_fmu.paper.plant import Localisation, check_speed
from auv_fmu.remus import prestero
from auv_fmu.remus.hull import (
    Drag,
    Hull,
    Inertia,
    coriolis,
    cross_flow,
    inertia,
    lift_and_drag,
    restoring,
)
from auv_fmu.remus.prestero import Coefficients
from auv_fmu.remus.tail import ACTUATOR, FASTEST, FASTEST_TURN, Tail, forces, limit_tail


class Form(IntEnum):
    """Form of the inertia and the forces of the hull."""

    SPHEROID = 0  #: Lamb's factors, lift, drag and cross-flow, as in PythonVehicleSimulator
    COEFFICIENTS = 1  #: products of velocities, as in Prestero's thesis


#: Module-level name, which Python looks up faster than a member of the class.
COEFFICIENTS = Form.COEFFICIENTS

_ZERO: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Parameters(NamedTuple):
    """All parameters of the vehicle."""

    hull: Annotated[Hull, Variable(name="")] = Hull()
    drag: Annotated[Drag, Variable(name="")] = Drag()
    tail: Annotated[Tail, Variable(name="")] = Tail()
    T_delta: Annotated[float, Variable("s", "Time constant of the fins", 0.0, name="fin.T")] = 0.1
    T_n: Annotated[
        float, Variable("s", "Time constant of the propeller", 0.0, name="propeller.T")
    ] = 1.0
    ell: Distance = ELL
    eta0: Annotated[Vector6, Variable(ETA, "Initial posture")] = _ZERO
    nu0: Annotated[Vector6, Variable(NU, "Initial velocity in the body frame")] = _ZERO
    noise: Localisation = Localisation()
    current: Annotated[
        Vector3, Variable(VELOCITY, "Ocean current in the earth frame", tunable=True)
    ] = (0.0, 0.0, 0.0)
    form: Annotated[
        Form,
        Variable(
            "1",
            "Form of the hull: spheroid, or with the coefficients inertia, X, Y, Z, K, M, N",
            name="hull",
        ),
    ] = Form.SPHEROID
    coefficients: Annotated[Coefficients, Variable(name="")] = Coefficients()


class RemusState(NamedTuple):
    """Motion of the vehicle, its fins and its propeller."""

    position: Annotated[Vector3, Variable(POSITION, "Centre of buoyancy in the earth frame")]
    euler: Annotated[Vector3, Variable(EULER, "Roll, pitch and yaw")]
    nu: Annotated[Vector6, Variable(NU, "Velocity over ground in the body frame")]
    actuator: Annotated[Vector3, Variable(ACTUATOR, "What rudder, stern planes and propeller are")]
    #: at the end of the last step
    water: Annotated[Vector3, Variable(VELOCITY, "Velocity of the water in the earth frame")]


def water_in_body(psi: float, water: Vector3) -> Vector3:
    """Velocity of the water [m/s] in a frame that turns with the yaw psi [rad] only.

    The model of PythonVehicleSimulator neglects roll and pitch here.
    """
    x, y, z = water
    return x * cos(psi) + y * sin(psi), y * cos(psi) - x * sin(psi), z


def through_water(state: RemusState) -> Vector6:
    """Velocity (u, v, w, p, q, r) through the water [m/s, rad/s], body frame."""
    u, v, w, p, q, r = state.nu
    u_c, v_c, w_c = water_in_body(state.euler[2], state.water)
    return u - u_c, v - v_c, w - w_c, p, q, r


def tail_forces(tail: Tail, state: RemusState) -> Vector6:
    """Forces of fins and propeller [N, N.m]; the propeller advances at the speed over ground."""
    u, v, w, _, _, _ = through_water(state)
    over_ground = state.nu[0] * state.nu[0] + state.nu[1] * state.nu[1] + state.nu[2] * state.nu[2]
    return forces(tail, state.actuator, u, v, w, sqrt(over_ground))


def inertia_of(parameters: Parameters) -> Inertia:
    """Masses and moments of inertia of the hull, in its form."""
    if parameters.form == COEFFICIENTS:
        return prestero.inertia(parameters.coefficients, parameters.hull)
    return inertia(parameters.hull)


def accelerations(parameters: Parameters, mass: Inertia, state: RemusState) -> Vector6:
    """Accelerations by M d nu_r/dt + C(nu_r) nu_r + D(nu_r) nu_r + g(eta) = tau.

    Args:
        parameters: of the vehicle.
        mass: of its hull.
        state: of the vehicle.

    Returns:
        d/dt (u, v, w, p, q, r) over ground [m/s2, rad/s2], body frame.

    """
    hull = parameters.hull
    nu_r = through_water(state)
    tau = tail_forces(parameters.tail, state)
    c = coriolis(hull, mass, nu_r)
    rise, g = restoring(hull, state.euler[0], state.euler[1])
    if parameters.form == COEFFICIENTS:
        water = prestero.forces(parameters.coefficients, nu_r)
        force = Vector(
            (
                tau[0] + water[0] - c[0],
                tau[1] + water[1] - c[1],
                tau[2] + water[2] - c[2],
                tau[3] + water[3] - c[3] + g[0],
                tau[4] + water[4] - c[4] + g[1],
                tau[5] + water[5] - c[5] + g[2],
            )
        )
    else:
        force = on_spheroid(parameters, mass.M, nu_r, tau, c, g)
    dnu = solve(mass.M, force + Vector((*rise, -0.0, -0.0, -0.0)))
    r = nu_r[5]
    u_c, v_c, _ = water_in_body(state.euler[2], state.water)
    return dnu[0] + r * v_c, dnu[1] - r * u_c, dnu[2], dnu[3], dnu[4], dnu[5]


def on_spheroid(
    parameters: Parameters,
    M: Annotated[Matrix, 6, 6],
    nu_r: Vector6,
    tau: Vector6,
    c: Vector6,
    g: Vector3,
) -> Annotated[Vector, 6]:
    """Force and moment on a hull that is a spheroid [N, N.m].

    Args:
        parameters: of the vehicle.
        M: its mass matrix.
        nu_r: (u, v, w, p, q, r) through the water [m/s, rad/s].
        tau: of fins and propeller.
        c: Coriolis forces.
        g: righting moment.

    """
    hull, drag, tail = parameters.hull, parameters.drag, parameters.tail
    u, v, w, p, q, r = nu_r
    lift = lift_and_drag(hull, drag, tail.rho, u, v, w)
    across, turning = cross_flow(hull, drag, tail.rho, v, r)
    fade = exp(-drag.fading * sqrt(u * u + v * v + w * w))
    upright = hull.mass * hull.gravity * hull.r_bg[2]
    K_p = M[3, 3] * 2.0 * drag.zeta_roll * sqrt(upright / M[3, 3])
    M_q = M[4, 4] * 2.0 * drag.zeta_pitch * sqrt(upright / M[4, 4])
    return Vector(
        (
            tau[0] + lift[0] - c[0] - M[0, 0] / drag.T_surge * fade * u,
            tau[1] + across - c[1] - M[1, 1] / drag.T_sway * fade * v,
            tau[2] + lift[2] - c[2] - M[2, 2] / drag.T_heave * w,
            tau[3] - c[3] - K_p * p + g[0],
            tau[4] - c[4] - M_q * q + g[1],
            tau[5] + turning - c[5] - M[5, 5] / drag.T_yaw * r + g[2],
        )
    )


def euler_rates(phi: float, theta: float, p: float, q: float, r: float) -> Vector3:
    """Rates of roll, pitch and yaw [rad/s], with a pole at a pitch of +-pi/2.

    Args:
        phi, theta: roll and pitch [rad].
        p, q, r: rates in the body frame [rad/s].

    """
    turn = sin(phi) * q + cos(phi) * r
    return p + sin(theta) / cos(theta) * turn, cos(phi) * q - sin(phi) * r, turn / cos(theta)


def follow(before: float, command: float, T: float, h: float) -> float:
    """State of a first-order fin or propeller after an Euler step; the command if T <= h.

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
    """One step of Euler's scheme under a held command, in the order of PythonVehicleSimulator.

    The velocity advances with fins and propeller at the beginning of the step, the posture with the
    velocity at its end.

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
        add_scaled(state.position, h, velocity),
        add_scaled(state.euler, h, turn),
        (u, v, w, p, q, r),
        limit_tail(parameters.tail, actuator),
        state.water,
    )


def carried(state: RemusState, dwater: Vector3, h: float) -> RemusState:
    """State after a step with accelerating water, from the state after a step without.

    As in :func:`auv_fmu.paper.plant.carried`: a neutrally buoyant vehicle's velocity over ground
    changes with the water, and its velocity through the water does not. A net buoyancy is neglected
    here: of 7 N, it is 1 % of the mass with added mass that the water accelerates.

    Args:
        state: of the vehicle after the step, with the water as it was at the beginning.
        dwater: acceleration of the water [m/s2], earth frame.
        h: step [s].

    """
    if not (dwater[0] or dwater[1] or dwater[2]):
        return state
    x, y, z = water_in_body(state.euler[2], dwater)
    u, v, w, p, q, r = state.nu
    return RemusState(
        add_scaled(state.position, 0.5 * h * h, dwater),
        state.euler,
        (u + h * x, v + h * y, w + h * z, p, q, r),
        state.actuator,
        add_scaled(state.water, h, dwater),
    )


def pull(now: float, command: float, T: float, limit: float) -> float:
    """Rate of a first-order fin or propeller, which stops at its limit.

    Args:
        now: angle [rad] or speed [rad/s].
        command: for it.
        T: time constant [s].
        limit: of its size, in the unit of `now`.

    """
    rate = (command - now) / T
    stops = (now >= limit and rate > 0.0) or (now <= -limit and rate < 0.0)
    return 0.0 if stops else rate


def rates(
    parameters: Parameters, state: RemusState, command: Vector3, water: Vector3, dwater: Vector3
) -> RemusState:
    """Rates of the state, for a solver with steps of its own.

    Args:
        parameters: of the vehicle.
        state: of the vehicle.
        command: (delta_r, delta_s, n) [rad, rad, rad/s].
        water: velocity of the water, beside `current` [m/s], earth frame.
        dwater: its acceleration [m/s2], earth frame.

    Raises:
        Refusal: fins or propeller have no time constant, so no rate.

    """
    T_delta, T_n, tail = parameters.T_delta, parameters.T_n, parameters.tail
    if not (T_delta > 0.0 and T_n > 0.0):
        raise Refusal("model exchange needs a fin.T and a propeller.T above 0")
    delta_r, delta_s, n = state.actuator
    state = state._replace(
        actuator=limit_tail(tail, state.actuator), water=add(parameters.current, water)
    )
    check_speed(through_water(state), FASTEST, FASTEST_TURN)
    du, dv, dw, dp, dq, dr = accelerations(parameters, inertia_of(parameters), state)
    phi, theta, psi = state.euler
    u, v, w, p, q, r = state.nu
    x, y, z = water_in_body(psi, dwater)
    return RemusState(
        rotate(rotation_from_euler(phi, theta, psi), (u, v, w)),
        euler_rates(phi, theta, p, q, r),
        (du + x, dv + y, dw + z, dp, dq, dr),
        (
            pull(delta_r, command[0], T_delta, tail.delta_max),
            pull(delta_s, command[1], T_delta, tail.delta_max),
            pull(n, command[2], T_n, tail.n_max),
        ),
        dwater,
    )


def begin(parameters: Parameters, water: Vector3) -> RemusState:
    """State at the start, with fins amidships and a propeller at rest.

    Args:
        parameters: of the vehicle.
        water: velocity of the water, beside `current` [m/s], earth frame.

    """
    x, y, z, phi, theta, psi = parameters.eta0
    flow = add(parameters.current, water)
    state = RemusState((x, y, z), (phi, theta, psi), parameters.nu0, (0.0, 0.0, 0.0), flow)
    check_speed(through_water(state), FASTEST, FASTEST_TURN)
    return state


def advance(
    parameters: Parameters,
    state: RemusState,
    command: Vector3,
    water: Vector3,
    dwater: Vector3,
    h: float,
) -> RemusState:
    """State after a step under held inputs.

    Args:
        parameters: of the vehicle.
        state: at the beginning.
        command: (delta_r, delta_s, n) [rad, rad, rad/s].
        water: velocity of the water at the beginning, beside `current` [m/s], earth frame.
        dwater: its acceleration [m/s2], earth frame.
        h: step [s].

    """
    state = state._replace(water=add(parameters.current, water))
    check_speed(through_water(state), FASTEST, FASTEST_TURN)
    state = carried(step(parameters, inertia_of(parameters), state, command, h), dwater, h)
    check_speed(through_water(state), FASTEST, FASTEST_TURN)
    return state
