"""PdController as a slave."""

from __future__ import annotations

from auv_fmu.pd import PdGains, PdMeasurement
from fmus.pd_controller import behaviour
from fmus.pd_controller.behaviour import Outputs, PdState
from fmus.pd_controller.ports import DESCRIPTION, PARAMETERS, PORTS
from fmus.ports.controllers import GROUP_OF
from fmus.python.component import Component


class PdController(Component[PdState, PdMeasurement, Outputs, PdGains]):
    """(57) and (58), in place of the ObserverController, which knows no velocity."""

    description = DESCRIPTION
    ports = PORTS
    parameter_set = PARAMETERS
    group_of = GROUP_OF

    def begin(self, inputs: PdMeasurement, t: float) -> tuple[PdState, Outputs]:
        return behaviour.begin(self.parameters, inputs)

    def advance(
        self, state: PdState, inputs: PdMeasurement, t: float, h: float, n: int
    ) -> tuple[PdState, Outputs]:
        return behaviour.advance(self.parameters, state, inputs, h, n)
