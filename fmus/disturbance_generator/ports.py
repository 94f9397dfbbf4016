"""Ports of DisturbanceGenerator."""

from __future__ import annotations

from auv_fmu.disturbance import Disturbance
from auv_fmu.quantities import NU, TAU_W
from fmus.ports.groups import ParameterSet
from fmus.ports.port import TIME, Port, inputs, outputs, parameter
from fmus.ports.vehicle import PAPER

DESCRIPTION = "Disturbance by friction, waves and ocean currents in six degrees of freedom"
ORIGIN = PAPER

_WAVES = Disturbance()
_INPUTS = inputs("nu", NU, "Velocity in the body frame")

PARAMETERS = ParameterSet(
    Disturbance,
    A_f=parameter(
        "A_f", _WAVES.A_f, "N", "Amplitude of the friction, in N.m for moments", tunable=True
    ),
    A_d=parameter(
        "A_d", _WAVES.A_d, "N", "Amplitude of waves and currents, in N.m for moments", tunable=True
    ),
    omega_d=parameter(
        "omega_d", _WAVES.omega_d, "rad/s", "Angular frequency of the waves", tunable=True
    ),
)

PORTS: tuple[Port, ...] = (
    *_INPUTS,
    # Each direction depends on the velocity in it, and on the time.
    *(
        port
        for (k, unit), velocity in zip(TAU_W.items(), _INPUTS)
        for port in outputs(
            "tau_w", {k: unit}, "Disturbance, with the sign of (2)", [velocity, TIME]
        )
    ),
    *PARAMETERS.ports,
)
