"""Ports of PdController."""

from __future__ import annotations

from auv_fmu.pd import PdGains
from auv_fmu.quantities import VELOCITY, per_axis
from fmus.ports.controllers import (
    ADAPTATION,
    INPUTS,
    MEASURED_ANGLES,
    PRINTED_JACOBIAN,
    THETA_HAT,
    TRACKING_ERROR,
    command,
)
from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, POSITIVE, Port, inputs, parameter, parameters
from fmus.ports.vehicle import CONTROL_POINT, PAPER

DESCRIPTION = "Adaptive robust PD tracking controller with measured velocity"
ORIGIN = PAPER

_GAINS = PdGains()
_INPUTS = (*INPUTS, *inputs("dy", VELOCITY, "Measured velocity of the control point"))

PARAMETERS = ParameterSet(
    PdGains,
    K1=parameters("K1", _GAINS.K1, per_axis("kg/s"), "Diagonal of K_1", POSITIVE, tunable=True),
    lambda_=parameter("lambda", _GAINS.lambda_, "1/s", "Lambda = lambda I", POSITIVE, tunable=True),
    **ADAPTATION,
    ell=CONTROL_POINT,
    printed_jacobian=PRINTED_JACOBIAN,
)

#: Fields of its inputs that bear another name than their group of ports.
GROUP_OF = MEASURED_ANGLES

PORTS: tuple[Port, ...] = (
    *_INPUTS,
    *command("(57)", _INPUTS),
    *THETA_HAT,
    *TRACKING_ERROR,
    *PARAMETERS.ports,
    H_MAX,
)
