"""BlueROV2 Heavy: underwater vehicle with eight thrusters, and noisy position sensor."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Refusal, Variable, Vector, __author__, __license__, __version__
from auv_fmu.bluerov2 import bluerov2, thrusters
from auv_fmu.bluerov2.bluerov2 import BlueRovState, Parameters
from auv_fmu.bluerov2.thrusters import COUNT, __citation__
from auv_fmu.language.quantities import ACCELERATION, ETA, NU, POSITION, TAU_W, VELOCITY
from auv_fmu.language.vectors import Rotation, Vector3, Vector6
from auv_fmu.paper import plant
from auv_fmu.paper.attitude import euler_from_rotation, rotation_from_quaternion
from auv_fmu.paper.control_point import control_point, control_point_velocity
from auv_fmu.paper.euler import STEP

H_MAX = STEP

#: Error of the squared length of a normalised quaternion, and the share by which a thrust may
#: exceed the largest one.
_ROUNDING = 2e-12


class Inputs(NamedTuple):
    """Commands of the thrusters, the disturbance, and the motion of the water."""

    command: Annotated[
        Annotated[Vector, COUNT], Variable("1", "Command of the thruster, limited to -1 .. 1")
    ]
    tau_w: Annotated[Vector6, Variable(TAU_W, "Disturbance, with the sign of (2)")]
    water: Annotated[
        Vector3, Variable(VELOCITY, "Velocity of the water in the earth frame, added to current")
    ]
    dwater: Annotated[
        Vector3, Variable(ACCELERATION, "Acceleration of the water in the earth frame")
    ]


class Margins(NamedTuple):
    """Distances of the commands from where the thrust switches."""

    limit: Annotated[Annotated[Vector, COUNT], Variable("1", "Distance of the command from 1")]
    dead_band: Annotated[
        Annotated[Vector, COUNT], Variable("1", "Distance of the command from the dead band")
    ]


class Outputs(NamedTuple):
    """Motion of the vehicle, and the thrust of its thrusters."""

    eta: Annotated[
        Vector6, Variable(ETA, "Position of the centre of mass and Euler angles", initially=())
    ]
    nu: Annotated[Vector6, Variable(NU, "Velocity in the body frame", initially=())]
    y: Annotated[Vector3, Variable(POSITION, "Measured control point, with noise", initially=())]
    dy: Annotated[Vector3, Variable(VELOCITY, "True velocity of the control point", initially=())]
    tau_applied: Annotated[
        Vector6, Variable(TAU_W, "Force and moment that the thrusters give", initially=())
    ]
    nu_r: Annotated[
        Vector6,
        Variable(NU, "Velocity through the water in the body frame", initially=("water",)),
    ]
    thrust: Annotated[
        Annotated[Vector, COUNT], Variable("N", "Thrust of the thruster", initially=())
    ]


def check(parameters: Parameters) -> None:
    """Refuse directions of thrusters that are not of length one."""
    thrusters.check(parameters.layout)


def start(parameters: Parameters, inputs: Inputs) -> BlueRovState:
    """Return the state at the start."""
    return bluerov2.begin(parameters, inputs.water)


def derive(state: BlueRovState) -> Rotation:
    """Return the rotation from body to earth."""
    return rotation_from_quaternion(state.quaternion)


def update(
    parameters: Parameters, state: BlueRovState, derived: Rotation, inputs: Inputs, h: float
) -> BlueRovState:
    """Return the state after a step."""
    command, tau_w, water, dwater = inputs
    return bluerov2.advance(parameters, state, derived, command, tau_w, water, dwater, h)


def outputs(parameters: Parameters, state: BlueRovState, derived: Rotation) -> Outputs:
    """Return the outputs; y has no noise yet."""
    nu = plant.over_ground(state.nu_r, derived, state.water)
    return Outputs(
        (*state.position, *euler_from_rotation(derived)),
        nu,
        control_point(state.position, derived, parameters.ell),
        control_point_velocity(derived, nu, parameters.ell),
        thrusters.forces(parameters.layout, state.thrust),
        state.nu_r,
        state.thrust,
    )


def seed(parameters: Parameters) -> int:
    """Return the seed of the noise."""
    return parameters.noise.seed


def measured(parameters: Parameters, y: Vector3, n: Vector3) -> Vector3:
    """Add noise to the output y, from three independent standard normal numbers."""
    return plant.measure(y, n, parameters.noise.std)


def rates(
    parameters: Parameters, state: BlueRovState, derived: Rotation, inputs: Inputs
) -> BlueRovState:
    """Return the rates of the state."""
    command, tau_w, water, dwater = inputs
    return bluerov2.rates(parameters, state, derived, command, tau_w, water, dwater)


def switches(parameters: Parameters, inputs: Inputs) -> Margins:
    """Return the distances of the commands from their limits and from the dead band."""
    dead_band = parameters.curve.dead_band
    return Margins(
        Vector(1.0 - abs(c) for c in inputs.command),
        Vector(abs(c) - dead_band for c in inputs.command),
    )


def event(
    parameters: Parameters, state: BlueRovState, derived: Rotation, inputs: Inputs
) -> BlueRovState:
    """Return the same motion over ground, in water whose velocity may have jumped."""
    return bluerov2.immersed(state, derived, bluerov2.flow(parameters, inputs.water))


def check_state(parameters: Parameters, state: BlueRovState) -> None:
    """Refuse an invalid quaternion, thrusts beyond the limits, and motions beyond the model."""
    a, b, c, d = state.quaternion
    if not abs(a * a + b * b + c * c + d * d - 1.0) <= _ROUNDING:
        raise Refusal("its quaternion is not of length one")
    ahead = thrusters.thrust(parameters.curve, 1.0) * (1.0 + _ROUNDING)
    astern = thrusters.thrust(parameters.curve, -1.0) * (1.0 + _ROUNDING)
    for f in state.thrust:
        if not astern <= f <= ahead:
            raise Refusal("its thrusters are beyond their limits")
    plant.check_speed(state.nu_r, bluerov2.FASTEST, bluerov2.FASTEST_TURN)
