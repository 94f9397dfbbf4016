"""A combustion engine whose torque is looked up in a map.

    J dw/dt = torque(throttle, w) - load

The map has a row for each throttle and a column for each speed. Between them the torque is
interpolated in both directions: `interpolate` in each row at the speed, then between the rows at
the throttle. Outside the map the torque of its edge holds. A closed throttle brakes. This is how
engines are modelled from measurements on a test bench; see L. Guzzella and C. H. Onder,
Introduction to Modeling and Control of Internal Combustion Engine Systems. The numbers of this map
are invented. Both speed and outputs need the torque, so `derive` computes it once.

A load above the torque slows the engine down to a standstill, where it stays until the torque is
above the load.

With the default values it accelerates from idle until torque and load are equal. Look at `speed`,
and at `stalled` with a load of 150 N.m.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Matrix, Variable, Vector, interpolate

SPEEDS = Vector((0.0, 100.0, 200.0, 300.0, 400.0, 500.0, 600.0))  #: [rad/s]
THROTTLES = Vector((0.0, 0.25, 0.5, 1.0))
TORQUES = Matrix(  #: [N.m]
    (
        (10.0, 0.0, -10.0, -18.0, -26.0, -36.0, -50.0),
        (60.0, 80.0, 62.0, 40.0, 22.0, 4.0, -20.0),
        (70.0, 110.0, 116.0, 104.0, 86.0, 60.0, 20.0),
        (80.0, 120.0, 142.0, 150.0, 144.0, 120.0, 60.0),
    )
)

H_MAX, STOP_TIME = 0.02, 10.0


class Parameters(NamedTuple):
    """Inertia, and speed at the start."""

    J: Annotated[float, Variable("kg.m2", "Moment of inertia", minimum=POSITIVE)] = 0.2
    speed0: Annotated[float, Variable("rad/s", "Speed at the start", minimum=0.0)] = 80.0


class Inputs(NamedTuple):
    """Pedal and load."""

    throttle: Annotated[float, Variable("1", "Opening of the throttle", 0.0, 1.0)] = 0.4
    load: Annotated[float, Variable("N.m", "Torque of the load", minimum=0.0)] = 60.0


class State(NamedTuple):
    """Speed of the shaft."""

    speed: float  #: [rad/s]


class Outputs(NamedTuple):
    """Outputs of the engine."""

    speed: Annotated[float, Variable("rad/s", "Speed of the shaft", feedthrough=())]
    torque: Annotated[float, Variable("N.m", "Torque of the engine", feedthrough=("throttle",))]
    power: Annotated[float, Variable("W", "Power of the engine", feedthrough=("throttle",))]
    stalled: Annotated[bool, Variable("1", "It stands still", feedthrough=())]


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(parameters.speed0)


def derive(state: State, inputs: Inputs) -> float:
    """The torque of the engine [N.m]."""
    rows = Vector(interpolate(state.speed, SPEEDS, TORQUES[k]) for k in range(len(THROTTLES)))
    return interpolate(inputs.throttle, THROTTLES, rows)


def update(parameters: Parameters, state: State, derived: float, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds with held inputs."""
    return State(max(state.speed + h * (derived - inputs.load) / parameters.J, 0.0))


def outputs(state: State, derived: float) -> Outputs:
    """Outputs of the engine."""
    return Outputs(state.speed, derived, state.speed * derived, state.speed == 0)
