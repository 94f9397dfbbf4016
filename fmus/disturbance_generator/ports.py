"""Ports of DisturbanceGenerator."""

from auv_fmu.disturbance import Disturbance
from fmus.ports.port import Port, inputs, outputs, parameter

_NU = {"u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "q": "rad/s", "r": "rad/s"}
_TAU_W = {"u": "N", "v": "N", "w": "N", "p": "N.m", "q": "N.m", "r": "N.m"}

_DISTURBANCE = Disturbance()
_INPUTS = inputs("nu", _NU, "Velocity in the body frame")

PORTS: tuple[Port, ...] = (
    *_INPUTS,
    *(
        port
        for k, velocity in zip(_TAU_W, _INPUTS)
        for port in outputs(
            "tau_w", {k: _TAU_W[k]}, "Disturbance, with the sign of (2)", [velocity]
        )
    ),
    parameter("A_f", _DISTURBANCE.A_f, "N", "Friction; in moments, N.m", tunable=True),
    parameter("A_d", _DISTURBANCE.A_d, "N", "Waves and currents; in moments, N.m", tunable=True),
    parameter("omega_d", _DISTURBANCE.omega_d, "rad/s", "Frequency of the waves", tunable=True),
)
