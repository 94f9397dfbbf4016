"""Ports of PdController."""

from __future__ import annotations

from auv_fmu.pd import PdGains
from fmus.ports.controllers import (
    ADAPTATION,
    INPUTS,
    PRINTED_JACOBIAN,
    THETA_HAT,
    TRACKING_ERROR,
    VELOCITY,
    command,
)
from fmus.ports.port import H_MAX, POSITIVE, Port, inputs, parameter, parameters
from fmus.ports.vehicle import CONTROL_POINT

_GAINS = PdGains()
_PER_AXIS = {"[1]": "kg/s", "[2]": "kg/s", "[3]": "kg/s"}
_INPUTS = (*INPUTS, *inputs("dy", VELOCITY, "Measured velocity of the control point"))

PORTS: tuple[Port, ...] = (
    *_INPUTS,
    *command("(57)", _INPUTS),
    *THETA_HAT,
    *TRACKING_ERROR,
    *parameters("K1", _GAINS.K1, _PER_AXIS, "Diagonal of K_1", POSITIVE, tunable=True),
    parameter("lambda", _GAINS.lambda_, "1/s", "Lambda = lambda I", POSITIVE, tunable=True),
    *ADAPTATION,
    CONTROL_POINT,
    PRINTED_JACOBIAN,
    H_MAX,
)
