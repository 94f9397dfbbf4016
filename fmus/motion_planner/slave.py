"""MotionPlanner as a slave: the motion is kept from step to step."""

from __future__ import annotations

from auv_fmu.motion_planner import Motion, Parameters, PlannerState
from fmus.motion_planner import behaviour
from fmus.motion_planner.behaviour import Outputs
from fmus.motion_planner.ports import DESCRIPTION, PARAMETERS, PORTS
from fmus.ports.groups import Nothing
from fmus.python.component import Component


class MotionPlanner(Component[PlannerState, Nothing, Outputs, Parameters]):
    """Open-loop planner of Definition 1: an undisturbed vehicle under constant torques."""

    description = DESCRIPTION
    ports = PORTS
    parameter_set = PARAMETERS

    #: The state of the latest reference and its motion, which the next step needs again.
    _moved: PlannerState | None = None
    _moving: Motion

    def begin(self, inputs: Nothing, t: float) -> tuple[PlannerState, Outputs]:
        self._moved, self._moving, outputs = behaviour.begin(self.parameters)
        return self._moved, outputs

    def advance(
        self, state: PlannerState, inputs: Nothing, t: float, h: float, n: int
    ) -> tuple[PlannerState, Outputs]:
        moving = self._moving if state is self._moved else behaviour.derive(self.parameters, state)
        self._moved, self._moving, outputs = behaviour.advance(self.parameters, state, moving, h, n)
        return self._moved, outputs

    def expected(
        self, parameters: Parameters, state: PlannerState, outputs: Outputs
    ) -> Outputs | None:
        return behaviour.expected(parameters, state)
