"""DisturbanceGenerator: friction, waves and ocean currents."""

from __future__ import annotations

from typing import NamedTuple, TypedDict

from auv_fmu.disturbance import Disturbance, disturbance
from auv_fmu.types import Vector6
from fmus.disturbance_generator.ports import PARAMETERS, PORTS
from fmus.slave.component import Component, Nothing


class Inputs(NamedTuple):
    """Velocity of the vehicle."""

    nu: Vector6


class Outputs(TypedDict):
    """The disturbance."""

    tau_w: Vector6


class DisturbanceGenerator(Component[Nothing, Inputs, Outputs, Disturbance]):
    """(56), evaluated at the beginning of the step and held through it."""

    description = "Disturbance by friction, waves and ocean currents in six degrees of freedom"
    ports = PORTS
    parameter_set = PARAMETERS

    def begin(self, inputs: Inputs, t: float) -> tuple[Nothing, Outputs]:
        return self.advance(Nothing(), inputs, t, 0.0, 0)

    def advance(
        self, state: Nothing, inputs: Inputs, t: float, h: float, n: int
    ) -> tuple[Nothing, Outputs]:
        return state, {"tau_w": disturbance(self.parameters, inputs.nu, t)}
