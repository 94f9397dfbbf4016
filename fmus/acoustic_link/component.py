"""Acoustic link: messages with a vehicle's position, late and sometimes lost."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, __author__, __citation__, __license__, __version__
from auv_fmu.guidance import acoustic_link
from auv_fmu.guidance.acoustic_link import LinkState, Parameters
from auv_fmu.language.quantities import EULER, POSITION
from auv_fmu.language.vectors import Vector3


class Inputs(NamedTuple):
    """Positions of both vehicles."""

    y: Annotated[Vector3, Variable(POSITION, "Measured control point of the sender")]
    eta: Annotated[Vector3, Variable(EULER, "Measured Euler angle of the sender")]
    receiver: Annotated[Vector3, Variable(POSITION, "Control point of the receiver")]


class Outputs(NamedTuple):
    """Last known state of the sender, and counts of messages."""

    y_0: Annotated[
        Vector3,
        Variable(
            POSITION, "Last known control point of the sender", feedthrough=(), initially=("y",)
        ),
    ]
    eta_0: Annotated[
        Vector3,
        Variable(EULER, "Last known Euler angle of the sender", feedthrough=(), initially=("eta",)),
    ]
    age: Annotated[float, Variable("s", "Time since the last known was sent", initially=())]
    received: Annotated[
        int,
        Variable("1", "Number of messages that have arrived", feedthrough=(), initially=()),
    ]
    lost: Annotated[
        int,
        Variable("1", "Number of messages that will not arrive", feedthrough=(), initially=()),
    ]


def check(parameters: Parameters) -> None:
    """Refuse modems that would always have too many messages in transit."""
    acoustic_link.check(parameters)


def start(parameters: Parameters, inputs: Inputs, t: float) -> LinkState:
    """Return the state at the start."""
    return acoustic_link.first_state(parameters, inputs.y, inputs.eta, t)


def update(
    parameters: Parameters, state: LinkState, inputs: Inputs, t: float, h: float
) -> LinkState:
    """Return the state after a step, from the positions at its beginning."""
    return acoustic_link.advance(parameters, state, inputs.y, inputs.eta, inputs.receiver, t, h)


def outputs(state: LinkState, t: float) -> Outputs:
    """Return the newest message that has arrived, and the counts."""
    newest = state.newest
    return Outputs(newest.y, newest.eta, t - newest.sent, state.received, state.lost)
