"""Ports of Allocation."""

from __future__ import annotations

from auv_fmu.allocation import Parameters
from auv_fmu.quantities import NU, TAU
from auv_fmu.tail import FASTEST
from fmus.ports.groups import ParameterSet
from fmus.ports.port import POSITIVE, Port, inputs, outputs, parameter, setting
from fmus.ports.tail import REMUS, TAIL, TAIL_COMMAND

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
        "Whether nu_r gives the speed; if not, it is the nominal one",
    ),
)

PORTS: tuple[Port, ...] = (
    *_INPUTS,
    *outputs("command", TAIL_COMMAND, "Command of rudder, stern planes and propeller", _INPUTS),
    *outputs("tau_attained", TAU, "Force and moments that the command gives", _INPUTS),
    *PARAMETERS.ports,
)
