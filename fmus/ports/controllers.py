"""Ports that the controllers share, so that one can take the other's place."""

from __future__ import annotations

from collections.abc import Mapping

from auv_fmu.output_feedback import Gains
from auv_fmu.quantities import ACCELERATION, EULER, POSITION, TAU, THETA, VELOCITY, member_name
from fmus.ports.groups import Field
from fmus.ports.port import POSITIVE, Port, inputs, outputs, parameter, parameters, setting

_GAINS = Gains()

Y = inputs("y", POSITION, "Measured control point")
_Y_D = inputs("y_d", POSITION, "Desired control point")

INPUTS: tuple[Port, ...] = (
    *Y,
    *inputs("eta", EULER, "Measured Euler angle"),
    *_Y_D,
    *inputs("dy_d", VELOCITY, "Desired velocity"),
    *inputs("ddy_d", ACCELERATION, "Desired acceleration"),
)

#: The equations call the measured angles by another name than the ports, whose eta is the posture.
MEASURED_ANGLES: Mapping[str, str] = {"euler": "eta"}

_OUTPUT = ("output", "continuous", "Real")

THETA_HAT: tuple[Port, ...] = tuple(
    Port(member_name("theta_hat", i), *_OUTPUT, f"Estimated parameter [{i}]", unit)
    for i, unit in THETA.items()
)

TRACKING_ERROR: tuple[Port, ...] = outputs("e", POSITION, "Tracking error y - y_d", (*Y, *_Y_D))

#: Fields of the gains that belong to the adaptive law.
ADAPTATION: Mapping[str, Field] = {
    "gamma": parameter(
        "gamma", _GAINS.gamma, "1", "Gamma = gamma I, in SI units", 0.0, tunable=True
    ),
    "sigma": parameter("sigma", _GAINS.sigma, "1/s", "Sigma = sigma I", 0.0, tunable=True),
    "theta_0": parameters("theta_0", _GAINS.theta_0, THETA, "Prior estimate of the parameters"),
    "eps_t": parameter(
        "eps_t", _GAINS.eps_t, "W", "Boundary layer of tanh(nu rho r)", POSITIVE, tunable=True
    ),
}

PRINTED_JACOBIAN = setting(
    "printed_jacobian",
    _GAINS.printed_jacobian,
    "Use (11) as printed, for zero roll, instead of the full attitude",
)


def command(equation: str, known: tuple[Port, ...]) -> tuple[Port, ...]:
    """The commanded force and moments of an equation, with the inputs it depends on."""
    return outputs("tau", TAU, f"Commanded force and moments {equation}, not limited", known)
