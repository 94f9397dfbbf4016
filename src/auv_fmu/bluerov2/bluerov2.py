"""The BlueROV2 Heavy, an underwater vehicle with eight thrusters, with published parameters.

The model and its numbers are from von Benzon et al. (2022), doi:10.3390/jmse10121898; the page of
the component has the source of each number. Not in the paper. Everything refers to the centre of
mass, the origin of the body frame: x forward, y to starboard, z down.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu.bluerov2.thrusters import COUNT, Curve, Layout, forces, thrust
from auv_fmu.language.arrays import Vector
from auv_fmu.language.quantities import ETA, NU, POSITION, VELOCITY, Members
from auv_fmu.language.variable import POSITIVE, Variable
from auv_fmu.language.vectors import (
    Rotation,
    Vector3,
    Vector4,
    Vector6,
    add,
    add_scaled,
    cross,
    scale,
    sub,
)
from auv_fmu.paper.actuators import mean_response, respond
from auv_fmu.paper.attitude import (
    normalised,
    quaternion_from_euler,
    quaternion_rates,
    rotate,
    rotate_back,
    rotation_from_quaternion,
)
from auv_fmu.paper.control_point import ELL, Distance
from auv_fmu.paper.plant import NORMALISING, Localisation, check_speed, over_ground

#: Largest speed through the water [m/s], six times the largest of the vehicle. Below it the drag
#: brakes in explicit steps of 20 ms.
FASTEST = 5.0

#: Largest rate of turn [rad/s].
FASTEST_TURN = 20.0

#: Masses and moments of inertia, and coefficients of a damping by the velocity and by its square.
MASS: Members = {
    **dict.fromkeys(("u", "v", "w"), "kg"),
    **dict.fromkeys(("p", "q", "r"), "kg.m2"),
}
LINEAR: Members = {
    **dict.fromkeys(("u", "v", "w"), "kg/s"),
    **dict.fromkeys(("p", "q", "r"), "kg.m2/s"),
}
QUADRATIC: Members = {
    **dict.fromkeys(("u", "v", "w"), "kg/m"),
    **dict.fromkeys(("p", "q", "r"), "kg.m2"),
}

#: At rest.
_STILL: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Body(NamedTuple):
    """Mass and buoyancy."""

    mass: Annotated[float, Variable("kg", "Mass", POSITIVE)] = 13.5
    inertia: Annotated[
        Vector3,
        Variable(
            {"x": "kg.m2", "y": "kg.m2", "z": "kg.m2"},
            "Moment of inertia about the centre of mass",
            POSITIVE,
        ),
    ] = (0.26, 0.23, 0.37)
    volume: Annotated[float, Variable("m3", "Volume of the displaced water", 0.0)] = 0.0134
    rho: Annotated[float, Variable("kg/m3", "Density of the water (rho)", 0.0)] = 1000.0
    gravity: Annotated[float, Variable("m/s2", "Acceleration of gravity", 0.0)] = 9.82
    r_b: Annotated[
        Vector3,
        Variable(POSITION, "Centre of buoyancy from the centre of mass, body frame (r_b)"),
    ] = (0.0, 0.0, -0.01)


class Hydrodynamics(NamedTuple):
    """Added mass and damping."""

    added: Annotated[Vector6, Variable(MASS, "Added mass and added moment of inertia", 0.0)] = (
        6.36,
        7.12,
        18.68,
        0.189,
        0.135,
        0.222,
    )
    linear: Annotated[
        Vector6, Variable(LINEAR, "Damping by the velocity", 0.0, name="drag.linear")
    ] = (13.7, 0.0, 33.0, 0.0, 0.8, 0.0)
    quadratic: Annotated[
        Vector6,
        Variable(QUADRATIC, "Damping by the square of the velocity", 0.0, name="drag.quadratic"),
    ] = (141.0, 217.0, 190.0, 1.19, 0.47, 1.5)


class Parameters(NamedTuple):
    """All parameters of the vehicle."""

    body: Annotated[Body, Variable(name="")] = Body()
    hydrodynamics: Annotated[Hydrodynamics, Variable(name="")] = Hydrodynamics()
    curve: Annotated[Curve, Variable(name="")] = Curve()
    layout: Annotated[Layout, Variable(name="")] = Layout()
    T: Annotated[
        float, Variable("s", "Time constant of the thrust", POSITIVE, name="actuator.T")
    ] = 0.029
    ell: Distance = ELL
    eta0: Annotated[Vector6, Variable(ETA, "Initial posture")] = _STILL
    nu0: Annotated[Vector6, Variable(NU, "Initial velocity in the body frame")] = _STILL
    noise: Localisation = Localisation()
    current: Annotated[
        Vector3, Variable(VELOCITY, "Ocean current in the earth frame", tunable=True)
    ] = (0.0, 0.0, 0.0)


class BlueRovState(NamedTuple):
    """Motion of the vehicle, and the thrust of its thrusters."""

    position: Annotated[Vector3, Variable(POSITION, "Centre of mass in the earth frame")]
    quaternion: Annotated[Vector4, Variable("1", "Attitude, body to earth, scalar first")]
    nu_r: Annotated[Vector6, Variable(NU, "Velocity through the water in the body frame")]
    thrust: Annotated[Annotated[Vector, COUNT], Variable("N", "Thrust of each thruster")]
    #: at the end of the last step
    water: Annotated[
        Vector3, Variable(VELOCITY, "Velocity of the water that nu_r is through, earth frame")
    ]


def accelerations(
    parameters: Parameters,
    nu_r: Vector6,
    rotation: Rotation,
    tau: Vector6,
    tau_w: Vector6,
    dwater: Vector3,
) -> Vector6:
    """Kirchhoff's equations of a body in water, with drag, weight and buoyancy.

    The momenta P, L are those of the body and of its added mass. Accelerating water acts like a
    gravity that is less by its acceleration: on the mass, and on the water that it displaces.

    Args:
        parameters: of the vehicle.
        nu_r: (u, v, w, p, q, r) through the water [m/s, rad/s], body frame.
        rotation: body to earth.
        tau: force and moment of the thrusters [N, N.m].
        tau_w: disturbance [N, N.m]; it enters with a minus.
        dwater: acceleration of the water [m/s2], earth frame.

    Returns:
        d/dt nu_r [m/s2, rad/s2].

    """
    body, (added, linear, quadratic) = parameters.body, parameters.hydrodynamics
    u, v, w, p, q, r = nu_r
    m_1, m_2, m_3 = body.mass + added[0], body.mass + added[1], body.mass + added[2]
    i_1, i_2, i_3 = (
        body.inertia[0] + added[3],
        body.inertia[1] + added[4],
        body.inertia[2] + added[5],
    )
    velocity, omega = (u, v, w), (p, q, r)
    P, L = (m_1 * u, m_2 * v, m_3 * w), (i_1 * p, i_2 * q, i_3 * r)
    turning = cross(omega, P)
    munk = add(cross(velocity, P), cross(omega, L))
    a_x, a_y, a_z = dwater
    fall = rotate_back(rotation, (-a_x, -a_y, body.gravity - a_z))
    displaced = body.rho * body.volume
    heavier = scale(body.mass - displaced, fall)
    righting = cross(fall, scale(displaced, body.r_b))
    return (
        (tau[0] - tau_w[0] - turning[0] - (linear[0] + quadratic[0] * abs(u)) * u + heavier[0])
        / m_1,
        (tau[1] - tau_w[1] - turning[1] - (linear[1] + quadratic[1] * abs(v)) * v + heavier[1])
        / m_2,
        (tau[2] - tau_w[2] - turning[2] - (linear[2] + quadratic[2] * abs(w)) * w + heavier[2])
        / m_3,
        (tau[3] - tau_w[3] - munk[0] - (linear[3] + quadratic[3] * abs(p)) * p + righting[0]) / i_1,
        (tau[4] - tau_w[4] - munk[1] - (linear[4] + quadratic[4] * abs(q)) * q + righting[1]) / i_2,
        (tau[5] - tau_w[5] - munk[2] - (linear[5] + quadratic[5] * abs(r)) * r + righting[2]) / i_3,
    )


def flow(parameters: Parameters, water: Vector3) -> Vector3:
    """Velocity of the water: the parameter `current` plus the input [m/s]."""
    return add(parameters.current, water)


def immersed(state: BlueRovState, rotation: Rotation, water: Vector3) -> BlueRovState:
    """The same motion over ground, in water that moves at another velocity.

    Args:
        state: of the vehicle, in water of another velocity.
        rotation: body to earth, of its quaternion.
        water: velocity of the water from now on [m/s], earth frame.

    """
    nu_r = over_ground(state.nu_r, rotation, sub(state.water, water))
    return state._replace(nu_r=nu_r, water=water)


def wanted(curve: Curve, command: Annotated[Vector, COUNT]) -> Annotated[Vector, COUNT]:
    """Steady thrusts of the commands [N]."""
    return Vector(thrust(curve, c) for c in command)


def begin(parameters: Parameters, water: Vector3) -> BlueRovState:
    """State at the start, with thrusters at rest.

    Args:
        parameters: of the vehicle.
        water: velocity of the water, beside `current` [m/s], earth frame.

    """
    x, y, z, phi, theta, psi = parameters.eta0
    quaternion = quaternion_from_euler(phi, theta, psi)
    rest = Vector(0.0 for _ in range(COUNT))
    state = BlueRovState((x, y, z), quaternion, parameters.nu0, rest, (0.0, 0.0, 0.0))
    state = immersed(state, rotation_from_quaternion(quaternion), flow(parameters, water))
    check_speed(state.nu_r, FASTEST, FASTEST_TURN)
    return state


def advance(
    parameters: Parameters,
    state: BlueRovState,
    rotation: Rotation,
    command: Annotated[Vector, COUNT],
    tau_w: Vector6,
    water: Vector3,
    dwater: Vector3,
    h: float,
) -> BlueRovState:
    """State after one step of Euler's scheme under held inputs.

    The thrust of the step is its mean over it, exactly. The water carries the vehicle along.

    Args:
        parameters: of the vehicle.
        state, rotation: at the beginning.
        command: of the thrusters.
        tau_w: disturbance [N, N.m].
        water: velocity of the water at the beginning, beside `current` [m/s], earth frame.
        dwater: its acceleration [m/s2], earth frame.
        h: step [s].

    """
    state = immersed(state, rotation, flow(parameters, water))
    check_speed(state.nu_r, FASTEST, FASTEST_TURN)
    aim = wanted(parameters.curve, command)
    lacking = state.thrust - aim
    mean = aim + mean_response(1.0, 0.0, parameters.T, h) * lacking
    last = aim + respond(1.0, 0.0, parameters.T, h) * lacking
    tau = forces(parameters.layout, mean)
    du, dv, dw, dp, dq, dr = accelerations(parameters, state.nu_r, rotation, tau, tau_w, dwater)
    u, v, w, p, q, r = state.nu_r
    velocity = add(rotate(rotation, (u, v, w)), state.water)
    a, b, c, d = state.quaternion
    da, db, dc, dd = quaternion_rates(state.quaternion, (p, q, r))
    nu_r = u + h * du, v + h * dv, w + h * dw, p + h * dp, q + h * dq, r + h * dr
    check_speed(nu_r, FASTEST, FASTEST_TURN)
    return BlueRovState(
        add_scaled(add_scaled(state.position, h, velocity), 0.5 * h * h, dwater),
        normalised((a + h * da, b + h * db, c + h * dc, d + h * dd)),
        nu_r,
        last,
        add_scaled(state.water, h, dwater),
    )


def rates(
    parameters: Parameters,
    state: BlueRovState,
    rotation: Rotation,
    command: Annotated[Vector, COUNT],
    tau_w: Vector6,
    water: Vector3,
    dwater: Vector3,
) -> BlueRovState:
    """Rates of the state, for a solver with steps of its own.

    As in :func:`auv_fmu.paper.plant.state_rates`, whose arguments these are, the velocity of the
    state is through water that has accelerated by dwater since the last jump.

    Args:
        parameters: of the vehicle.
        state, rotation: of the vehicle.
        command: of the thrusters.
        tau_w: disturbance [N, N.m].
        water: velocity of the water, beside `current` [m/s], earth frame.
        dwater: its acceleration [m/s2], earth frame.

    """
    now = immersed(state, rotation, flow(parameters, water))
    check_speed(now.nu_r, FASTEST, FASTEST_TURN)
    tau = forces(parameters.layout, state.thrust)
    du, dv, dw, dp, dq, dr = accelerations(parameters, now.nu_r, rotation, tau, tau_w, dwater)
    u, v, w, p, q, r = now.nu_r
    x, y, z = cross((p, q, r), rotate_back(rotation, sub(state.water, now.water)))
    a, b, c, d = state.quaternion
    da, db, dc, dd = quaternion_rates(state.quaternion, (p, q, r))
    k = NORMALISING * (1.0 - (a * a + b * b + c * c + d * d))
    return BlueRovState(
        add(rotate(rotation, (u, v, w)), now.water),
        (da + k * a, db + k * b, dc + k * c, dd + k * d),
        (du + x, dv + y, dw + z, dp, dq, dr),
        (wanted(parameters.curve, command) - state.thrust) / parameters.T,
        dwater,
    )
