"""Ports of ObserverController."""

from __future__ import annotations

from auv_fmu.observer import FORMS
from auv_fmu.output_feedback import Gains
from auv_fmu.quantities import POSITION, VELOCITY, per_axis
from auv_fmu.saturation import SATURATIONS
from fmus.ports.controllers import (
    ADAPTATION,
    INPUTS,
    MEASURED_ANGLES,
    PRINTED_JACOBIAN,
    THETA_HAT,
    TRACKING_ERROR,
    Y,
    command,
)
from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, POSITIVE, Port, outputs, parameter, parameters, setting
from fmus.ports.vehicle import CONTROL_POINT, PAPER

DESCRIPTION = "Saturated output-feedback tracking controller with velocity observer"
ORIGIN = PAPER

_GAINS = Gains()

_OBSERVER = setting(
    "observer",
    "euler",
    "Form of the observer: (51) by Euler's scheme (euler), with k_d exact over a step (exact), or "
    "(24) as printed (integral)",
    FORMS,
)

PARAMETERS = ParameterSet(
    Gains,
    K1=parameters("K1", _GAINS.K1, per_axis("N"), "Diagonal of K_1", POSITIVE, tunable=True),
    K2=parameters("K2", _GAINS.K2, per_axis("N"), "Diagonal of K_2", POSITIVE, tunable=True),
    lambda_=parameter("lambda", _GAINS.lambda_, "m/s", "Lambda = lambda I", POSITIVE, tunable=True),
    k_d=parameter("k_d", _GAINS.k_d, "1/s", "Gain of the observer", POSITIVE, tunable=True),
    **ADAPTATION,
    ell=CONTROL_POINT,
    s=setting(
        "saturation",
        "tanh",
        "Saturation function of Definition 2: tanh, algebraic or arctan",
        SATURATIONS,
    ),
    printed_jacobian=PRINTED_JACOBIAN,
    innovation_gate=parameter(
        "innovation_gate",
        _GAINS.innovation_gate,
        "m",
        "Restart the observer when |y - y_hat| exceeds this; 0: never. Not in the paper",
        minimum=0.0,
        tunable=True,
    ),
    form=_OBSERVER,
)

#: Fields of its inputs that bear another name than their group of ports.
GROUP_OF = MEASURED_ANGLES

PORTS: tuple[Port, ...] = (
    *INPUTS,
    *command("(21)", INPUTS),
    *outputs("y_hat", POSITION, "Estimated control point", Y),
    *outputs("dy_hat", VELOCITY, "Estimated velocity of the control point (23)", Y),
    *THETA_HAT,
    *TRACKING_ERROR,
    *outputs("z", POSITION, "Estimation error y - y_hat", Y),
    *PARAMETERS.before(_OBSERVER),
    H_MAX,
    _OBSERVER,
)
