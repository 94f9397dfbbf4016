"""Ports that the controllers share, so that one can take the other's place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auv_fmu.output_feedback import Gains
from fmus.ports.port import POSITIVE, Port, inputs, outputs, parameter, parameters

AXES = ("x", "y", "z")
POSITION = dict.fromkeys(AXES, "m")
VELOCITY = dict.fromkeys(AXES, "m/s")
_TAU = {"u": "N", "q": "N.m", "r": "N.m"}
_THETA = {"[1]": "N", "[2]": "kg/s", "[3]": "kg/m", "[4]": "kg"}

_GAINS = Gains()

INPUTS: tuple[Port, ...] = (
    *inputs("y", POSITION, "Measured control point"),
    *inputs("eta", {"phi": "rad", "theta": "rad", "psi": "rad"}, "Measured Euler angle"),
    *inputs("y_d", POSITION, "Desired control point"),
    *inputs("dy_d", VELOCITY, "Desired velocity"),
    *inputs("ddy_d", dict.fromkeys(AXES, "m/s2"), "Desired acceleration"),
)
Y, _Y_D = INPUTS[0:3], INPUTS[6:9]

THETA_HAT: tuple[Port, ...] = tuple(
    Port(f"theta_hat{i}", "output", "continuous", "Real", f"Estimated parameter {i}", unit)
    for i, unit in _THETA.items()
)

TRACKING_ERROR: tuple[Port, ...] = outputs("e", POSITION, "Tracking error y - y_d", (*Y, *_Y_D))

ADAPTATION: tuple[Port, ...] = (
    parameter("gamma", _GAINS.gamma, "1", "Gamma = gamma I, in SI units", 0.0, tunable=True),
    parameter("sigma", _GAINS.sigma, "1/s", "Sigma = sigma I", minimum=0.0, tunable=True),
    *parameters("theta_0", _GAINS.theta_0, _THETA, "Prior of the parameters"),
    parameter(
        "eps_t", _GAINS.eps_t, "W", "Boundary layer of tanh(nu rho r)", POSITIVE, tunable=True
    ),
)

PRINTED_JACOBIAN = Port(
    "printed_jacobian",
    "parameter",
    "fixed",
    "Boolean",
    "Use (11) as printed, for zero roll, instead of the full attitude",
    start=_GAINS.printed_jacobian,
)


def vector(values: Mapping[str, Any], group: str, n: int) -> Any:
    """The values of `group[1]` to `group[n]` as a tuple."""
    return tuple(values[f"{group}[{i}]"] for i in range(1, n + 1))


def command(equation: str, known: tuple[Port, ...]) -> tuple[Port, ...]:
    """The commanded force and moments of an equation, with the inputs it depends on."""
    return outputs("tau", _TAU, f"Commanded force and moments {equation}, not limited", known)
