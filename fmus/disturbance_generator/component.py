"""Disturbance by friction, waves and ocean currents in six degrees of freedom."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, __author__, __citation__, __license__, __version__
from auv_fmu.language.quantities import NU, TAU_W
from auv_fmu.language.vectors import Vector6
from auv_fmu.paper.disturbance import Disturbance, disturbance


class Inputs(NamedTuple):
    """Velocity of the vehicle."""

    #: Friction depends on the velocity through the water.
    nu: Annotated[Vector6, Variable(NU, "Velocity in the body frame", terminal="nu_r")]


class Outputs(NamedTuple):
    """The disturbance."""

    tau_w: Annotated[
        Vector6,
        Variable(TAU_W, "Disturbance, with the sign of (2)", feedthrough=("nu.{}", "time")),
    ]


def outputs(parameters: Disturbance, inputs: Inputs, t: float) -> Outputs:
    """Return the disturbance at a time."""
    return Outputs(disturbance(parameters, inputs.nu, t))
