"""How AcousticLink runs in both kinds of FMU: the hooks of `fmus/ports/behaviour.py`."""

from __future__ import annotations

from typing import NamedTuple, TypedDict

from auv_fmu import acoustic_link
from auv_fmu.acoustic_link import LinkState, Parameters
from auv_fmu.vectors import Vector3


class Inputs(NamedTuple):
    """Where both vehicles are."""

    y: Vector3
    eta: Vector3
    receiver: Vector3


class Outputs(TypedDict):
    """What the receiver knows of the sender."""

    y_0: Vector3
    eta_0: Vector3
    age: float
    received: int
    lost: int


def check(parameters: Parameters) -> None:
    """Refuse modems that would always have too many messages under way."""
    acoustic_link.check(parameters)


def begin(parameters: Parameters, inputs: Inputs, t: float) -> tuple[LinkState, Outputs]:
    """State and outputs at the start."""
    state = acoustic_link.first_state(parameters, inputs.y, inputs.eta, t)
    return state, _seen(state, t)


def advance(
    parameters: Parameters, state: LinkState, inputs: Inputs, t: float, h: float
) -> tuple[LinkState, Outputs]:
    """State and outputs after a step of h seconds; positions are those at its beginning."""
    y, eta, receiver = inputs
    state = acoustic_link.advance(parameters, state, y, eta, receiver, t, h)
    return state, _seen(state, t + h)


def _seen(state: LinkState, t: float) -> Outputs:
    newest = state.newest
    return {
        "y_0": newest.y,
        "eta_0": newest.eta,
        "age": t - newest.sent,
        "received": state.received,
        "lost": state.lost,
    }
