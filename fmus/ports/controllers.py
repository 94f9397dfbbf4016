"""Ports that the controllers share, so that one can take the other's place."""

from __future__ import annotations

from collections.abc import Mapping

from auv_fmu.output_feedback import Gains
from fmus.ports.port import POSITIVE, Port, inputs, outputs, parameter, parameters
from fmus.ports.quantities import ACCELERATION, EULER, POSITION, TAU, THETA, VELOCITY, member_name

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

THETA_HAT: tuple[Port, ...] = tuple(
    Port(
        member_name("theta_hat", i),
        "output",
        "continuous",
        "Real",
        f"Estimated parameter [{i}]",
        unit,
    )
    for i, unit in THETA.items()
)

TRACKING_ERROR: tuple[Port, ...] = outputs("e", POSITION, "Tracking error y - y_d", (*Y, *_Y_D))

GAMMA = parameter("gamma", _GAINS.gamma, "1", "Gamma = gamma I, in SI units", 0.0, tunable=True)
SIGMA = parameter("sigma", _GAINS.sigma, "1/s", "Sigma = sigma I", minimum=0.0, tunable=True)
THETA_0 = parameters("theta_0", _GAINS.theta_0, THETA, "Prior of the parameters")
EPS_T = parameter(
    "eps_t", _GAINS.eps_t, "W", "Boundary layer of tanh(nu rho r)", POSITIVE, tunable=True
)

PRINTED_JACOBIAN = Port(
    "printed_jacobian",
    "parameter",
    "fixed",
    "Boolean",
    "Use (11) as printed, for zero roll, instead of the full attitude",
    start=_GAINS.printed_jacobian,
)


def command(equation: str, known: tuple[Port, ...]) -> tuple[Port, ...]:
    """The commanded force and moments of an equation, with the inputs it depends on."""
    return outputs("tau", TAU, f"Commanded force and moments {equation}, not limited", known)
