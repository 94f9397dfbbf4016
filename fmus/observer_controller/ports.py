"""Ports of ObserverController."""

from __future__ import annotations

from auv_fmu.output_feedback import Gains
from auv_fmu.saturation import SATURATIONS
from fmus.ports.controllers import (
    ADAPTATION,
    INPUTS,
    POSITION,
    PRINTED_JACOBIAN,
    THETA_HAT,
    TRACKING_ERROR,
    VELOCITY,
    Y,
    command,
)
from fmus.ports.port import H_MAX, POSITIVE, Port, outputs, parameter, parameters
from fmus.ports.vehicle import CONTROL_POINT

_GAINS = Gains()
_PER_AXIS = {"[1]": "N", "[2]": "N", "[3]": "N"}

PORTS: tuple[Port, ...] = (
    *INPUTS,
    *command("(21)", INPUTS),
    *outputs("y_hat", POSITION, "Estimated control point", Y),
    *outputs("dy_hat", VELOCITY, "Estimated velocity of the control point (23)", Y),
    *THETA_HAT,
    *TRACKING_ERROR,
    *outputs("z", POSITION, "Estimation error y - y_hat", Y),
    *parameters("K1", _GAINS.K1, _PER_AXIS, "Diagonal of K_1", POSITIVE, tunable=True),
    *parameters("K2", _GAINS.K2, _PER_AXIS, "Diagonal of K_2", POSITIVE, tunable=True),
    parameter("lambda", _GAINS.lambda_, "m/s", "Lambda = lambda I", POSITIVE, tunable=True),
    parameter("k_d", _GAINS.k_d, "1/s", "Gain of the observer", POSITIVE, tunable=True),
    *ADAPTATION,
    CONTROL_POINT,
    Port(
        "saturation",
        "parameter",
        "fixed",
        "String",
        "Saturation function of Definition 2: tanh or algebraic",
        start="tanh",
        choices=tuple(SATURATIONS),
    ),
    PRINTED_JACOBIAN,
    parameter(
        "innovation_gate",
        _GAINS.innovation_gate,
        "m",
        "Restart the observer when |y - y_hat| exceeds this; 0: never. Not in the paper",
        minimum=0.0,
        tunable=True,
    ),
    H_MAX,
)
