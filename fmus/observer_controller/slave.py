"""ObserverController as a slave."""

from __future__ import annotations

from pythonfmu.enums import Fmi2Status

from auv_fmu.output_feedback import ControllerState, Gains, Measurement
from fmus.observer_controller import behaviour
from fmus.observer_controller.behaviour import RESTARTED, Outputs
from fmus.observer_controller.ports import DESCRIPTION, PARAMETERS, PORTS
from fmus.ports.controllers import GROUP_OF
from fmus.python.component import Component


class ObserverController(Component[ControllerState, Measurement, Outputs, Gains]):
    """(16) to (24), or (48) to (51): position and attitude in, force and moments out."""

    description = DESCRIPTION
    ports = PORTS
    parameter_set = PARAMETERS
    group_of = GROUP_OF

    def begin(self, inputs: Measurement, t: float) -> tuple[ControllerState, Outputs]:
        return behaviour.begin(self.parameters, inputs)

    def advance(
        self, state: ControllerState, inputs: Measurement, t: float, h: float, n: int
    ) -> tuple[ControllerState, Outputs]:
        gains = self.parameters
        if not behaviour.credible(gains, state, inputs):
            self.say(RESTARTED.format(t=t), Fmi2Status.warning, key="observer restarted")
            state = behaviour.restarted(gains, state, inputs)
        return behaviour.advance(gains, state, inputs, h, n)
