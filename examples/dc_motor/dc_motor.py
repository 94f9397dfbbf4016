"""A DC motor with permanent magnets, which drives a load.

    L di/dt = u - R i - k w                  voltage around the armature
    J dw/dt = k i - b w - load               torque on the shaft
    d(angle)/dt = w

In V.s/rad and in N.m/A, k is the same number: the electrical power k w i is the mechanical
power. Such a motor is in every textbook of control; see Franklin, Powell and Emami-Naeini, Feedback
Control of Dynamic Systems. The equations are stepped by the Runge-Kutta method of fourth order.

Without a load, `speed` settles at u k / (R b + k^2) within a few times J R / k^2, the mechanical
time constant. The current is largest while the motor starts: up to u / R.

With the default values 12 V are switched on at time 0. Look at `i` and `speed`, then connect a PID
controller to `u` and `speed`.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector

H_MAX, STOP_TIME = 0.02, 2.0


class Parameters(NamedTuple):
    """Motor and load."""

    R: Annotated[float, Variable("Ohm", "Resistance of the armature", minimum=POSITIVE)] = 1.5
    L: Annotated[float, Variable("H", "Inductance of the armature", minimum=POSITIVE)] = 0.12
    k: Annotated[float, Variable("N.m/A", "Torque constant", minimum=0.0)] = 0.1
    J: Annotated[float, Variable("kg.m2", "Moment of inertia", minimum=POSITIVE)] = 0.005
    b: Annotated[float, Variable("N.m.s/rad", "Friction of the bearings", minimum=0.0)] = 0.0005


class Inputs(NamedTuple):
    """Voltage and load."""

    u: Annotated[float, Variable("V", "Voltage of the armature")] = 12.0
    load: Annotated[float, Variable("N.m", "Torque that brakes the shaft")] = 0.0


class State(NamedTuple):
    """Current, speed and angle."""

    x: Annotated[
        Vector, 3, Variable({"i": "A", "speed": "rad/s", "angle": "rad"}, "Motion of the motor")
    ]


class Outputs(NamedTuple):
    """Outputs of the motor."""

    i: Annotated[float, Variable("A", "Current of the armature")]
    speed: Annotated[float, Variable("rad/s", "Speed of the shaft")]
    angle: Annotated[float, Variable("rad", "Angle of the shaft")]


def start() -> State:
    """State at the start: it stands still."""
    return State(Vector((0.0, 0.0, 0.0)))


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds with held inputs."""
    x = state.x
    k1 = _rate(parameters, inputs, x)
    k2 = _rate(parameters, inputs, x + h / 2 * k1)
    k3 = _rate(parameters, inputs, x + h / 2 * k2)
    k4 = _rate(parameters, inputs, x + h * k3)
    return State(x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))


def outputs(state: State) -> Outputs:
    """Outputs of the motor."""
    return Outputs(state.x[0], state.x[1], state.x[2])


def rates(parameters: Parameters, state: State, inputs: Inputs) -> State:
    """Rates of the state."""
    return State(_rate(parameters, inputs, state.x))


def _rate(parameters: Parameters, inputs: Inputs, x: Annotated[Vector, 3]) -> Annotated[Vector, 3]:
    """The derivative of current, speed and angle."""
    i, speed = x[0], x[1]
    voltage = inputs.u - parameters.R * i - parameters.k * speed
    torque = parameters.k * i - parameters.b * speed - inputs.load
    return Vector((voltage / parameters.L, torque / parameters.J, speed))
