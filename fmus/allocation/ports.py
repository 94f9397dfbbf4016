"""Ports of Allocation."""

from __future__ import annotations

from auv_fmu.allocation import Parameters
from auv_fmu.tail import FASTEST
from fmus.ports.groups import ParameterSet
from fmus.ports.port import POSITIVE, Port, inputs, outputs, parameter, setting
from fmus.ports.quantities import NU, TAU
from fmus.ports.tail import FINS, REMUS, TAIL

DESCRIPTION = "Allocation of a force and two moments to the fins and the propeller of Remus100"
ORIGIN = REMUS

_DEFAULTS = Parameters()

_INPUTS = (
    *inputs("tau", TAU, "Wanted force and moments"),
    *inputs(
        "nu_r",
        {member: NU[member] for member in ("u", "v", "w")},
        "Velocity through the water in the body frame; used if `measured`",
    ),
)

PARAMETERS = ParameterSet(
    Parameters,
    tail=TAIL,
    speed=parameter(
        "speed",
        _DEFAULTS.speed,
        "m/s",
        "Nominal speed through the water; used if not `measured`",
        POSITIVE,
        FASTEST,
        tunable=True,
    ),
    measured=setting(
        "measured",
        _DEFAULTS.measured,
        "Whether the speed is that of nu_r; if not, it is the nominal one",
    ),
)

PORTS: tuple[Port, ...] = (
    *_INPUTS,
    *(
        Port(
            name,
            "output",
            "continuous",
            "Real",
            f"Command: {about}",
            unit,
            feedthrough=tuple(port.name for port in _INPUTS),
        )
        for name, unit, about in FINS
    ),
    *outputs("tau_attained", TAU, "Force and moments that the command gives", _INPUTS),
    *PARAMETERS.ports,
)
