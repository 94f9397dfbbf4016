"""DisturbanceGenerator as a slave."""

from __future__ import annotations

from auv_fmu.disturbance import Disturbance
from fmus.disturbance_generator import behaviour
from fmus.disturbance_generator.behaviour import Inputs, Outputs
from fmus.disturbance_generator.ports import DESCRIPTION, PARAMETERS, PORTS
from fmus.ports.groups import Nothing
from fmus.python.component import Component


class DisturbanceGenerator(Component[Nothing, Inputs, Outputs, Disturbance]):
    """(56), evaluated at the beginning of the step and held through it."""

    description = DESCRIPTION
    ports = PORTS
    parameter_set = PARAMETERS

    def begin(self, inputs: Inputs, t: float) -> tuple[Nothing, Outputs]:
        return behaviour.begin(self.parameters, inputs, t)

    def advance(
        self, state: Nothing, inputs: Inputs, t: float, h: float, n: int
    ) -> tuple[Nothing, Outputs]:
        return behaviour.advance(self.parameters, state, inputs, t)
