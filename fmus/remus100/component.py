"""REMUS 100: underwater vehicle with fins and a propeller, and noisy position sensor."""

from __future__ import annotations

from math import pi
from typing import Annotated, NamedTuple

from auv_fmu import Refusal, Variable, __author__, __license__, __version__
from auv_fmu.language.quantities import ACCELERATION, ETA, NU, POSITION, TAU, VELOCITY
from auv_fmu.language.vectors import Vector3, Vector6, add
from auv_fmu.paper import plant
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.control_point import control_point, control_point_velocity
from auv_fmu.paper.euler import STEP
from auv_fmu.remus import remus100
from auv_fmu.remus.remus100 import Parameters, RemusState
from auv_fmu.remus.tail import (
    ACTUATOR,
    FASTEST,
    FASTEST_TURN,
    __citation__,
    limit_tail,
    margins,
)

H_MAX = STEP

#: Largest ratio of diameter to length: near 1, Lamb's factors are differences of equal numbers.
_THICKEST = 0.9


class Inputs(NamedTuple):
    """Commands of fins and propeller, and the motion of the water."""

    command: Annotated[Vector3, Variable(ACTUATOR, "Command of rudder, stern planes and propeller")]
    water: Annotated[
        Vector3, Variable(VELOCITY, "Velocity of the water in the earth frame, added to current")
    ]
    dwater: Annotated[
        Vector3, Variable(ACCELERATION, "Acceleration of the water in the earth frame")
    ]


class Margins(NamedTuple):
    """Distances from the limits at which the equations switch."""

    command: Annotated[Vector3, Variable(ACTUATOR, "Distance of the command from the limits")]
    actuator: Annotated[
        Vector3, Variable(ACTUATOR, "Distance of fins and propeller from their limits")
    ]


class Outputs(NamedTuple):
    """Motion of the vehicle, and the state of its actuators."""

    eta: Annotated[
        Vector6,
        Variable(ETA, "Position of the centre of buoyancy and Euler angles", initially=()),
    ]
    nu: Annotated[Vector6, Variable(NU, "Velocity in the body frame", initially=())]
    y: Annotated[Vector3, Variable(POSITION, "Measured control point, with noise", initially=())]
    dy: Annotated[Vector3, Variable(VELOCITY, "True velocity of the control point", initially=())]
    tau_applied: Annotated[
        Vector3,
        Variable(TAU, "Force and moments that fins and propeller give", initially=("water",)),
    ]
    nu_r: Annotated[
        Vector6,
        Variable(NU, "Velocity through the water in the body frame", initially=("water",)),
    ]
    actuator: Annotated[
        Vector3, Variable(ACTUATOR, "What rudder, stern planes and propeller are", initially=())
    ]


def check(parameters: Parameters) -> None:
    """Refuse a hull that is not slender, capsizes, displaces too much or has no inertia."""
    hull = parameters.hull
    if not hull.diameter <= _THICKEST * hull.length:
        raise Refusal(
            f"diameter = {hull.diameter:g} must be at most {_THICKEST:g} times length = "
            f"{hull.length:g}: the added mass is for a slender hull"
        )
    if not hull.r_bg[2] > 0.0:
        raise Refusal(
            f"r_bg.z = {hull.r_bg[2]:g} must be above 0: a vehicle with its centre of mass on top "
            "capsizes"
        )
    if hull.net_buoyancy != 0.0:
        weight = hull.mass * hull.gravity
        cylinder = pi / 4.0 * hull.diameter * hull.diameter * hull.length
        largest = parameters.tail.rho * hull.gravity * cylinder
        if not 0.0 < weight + hull.net_buoyancy <= largest:
            raise Refusal(
                f"net_buoyancy = {hull.net_buoyancy:g} and a weight of {weight:g} N: the buoyancy "
                f"must be above 0 and at most {largest:g} N, which a cylinder around the hull has"
            )
    M = remus100.inertia_of(parameters).M
    for k in range(6):
        if not M[k, k] > 0.0:
            raise Refusal(
                f"a mass or moment of inertia, with its added mass, is {M[k, k]:g}; it must be "
                "above 0: mend X.du, Y.dv, Z.dw, K.dp, M.dq, N.dr or inertia"
            )


def start(parameters: Parameters, inputs: Inputs) -> RemusState:
    """Return the state at the start."""
    return remus100.begin(parameters, inputs.water)


def update(parameters: Parameters, state: RemusState, inputs: Inputs, h: float) -> RemusState:
    """Return the state after a step."""
    command, water, dwater = inputs
    return remus100.advance(parameters, state, command, water, dwater, h)


def outputs(parameters: Parameters, state: RemusState) -> Outputs:
    """Return the outputs; y has no noise yet."""
    rotation, ell = rotation_from_euler(*state.euler), parameters.ell
    tau = remus100.tail_forces(parameters.tail, state)
    return Outputs(
        (*state.position, *state.euler),
        state.nu,
        control_point(state.position, rotation, ell),
        control_point_velocity(rotation, state.nu, ell),
        (tau[0], tau[4], tau[5]),
        remus100.through_water(state),
        state.actuator,
    )


def seed(parameters: Parameters) -> int:
    """Return the seed of the noise."""
    return parameters.noise.seed


def measured(parameters: Parameters, y: Vector3, n: Vector3) -> Vector3:
    """Add noise to the output y, from three independent standard normal numbers."""
    return plant.measure(y, n, parameters.noise.std)


def rates(parameters: Parameters, state: RemusState, inputs: Inputs) -> RemusState:
    """Return the rates of the state."""
    command, water, dwater = inputs
    return remus100.rates(parameters, state, command, water, dwater)


def switches(parameters: Parameters, state: RemusState, inputs: Inputs) -> Margins:
    """Return the distances from the limits of fins and propeller."""
    return Margins(
        margins(parameters.tail, inputs.command), margins(parameters.tail, state.actuator)
    )


def event(parameters: Parameters, state: RemusState, inputs: Inputs) -> RemusState:
    """Return the same motion over ground, in water whose velocity may have jumped."""
    return state._replace(
        actuator=limit_tail(parameters.tail, state.actuator),
        water=add(parameters.current, inputs.water),
    )


def check_state(parameters: Parameters, state: RemusState) -> None:
    """Refuse fins and a propeller beyond their limits, and motions beyond the model."""
    delta_r, delta_s, n = state.actuator
    delta_max, n_max = parameters.tail.delta_max, parameters.tail.n_max
    if not (abs(delta_r) <= delta_max and abs(delta_s) <= delta_max and abs(n) <= n_max):
        raise Refusal("its fins or its propeller are beyond their limits")
    plant.check_speed(remus100.through_water(state), FASTEST, FASTEST_TURN)
