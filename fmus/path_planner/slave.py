"""PathPlanner as a slave."""

from __future__ import annotations

from auv_fmu.path_planner import Parameters, PathState
from fmus.path_planner import behaviour
from fmus.path_planner.behaviour import Outputs
from fmus.path_planner.ports import DESCRIPTION, PARAMETERS, PORTS
from fmus.ports.groups import Nothing
from fmus.slave.component import Component


class PathPlanner(Component[PathState, Nothing, Outputs, Parameters]):
    """Reference through waypoints, which the vehicle can follow or the path is refused."""

    description = DESCRIPTION
    ports = PORTS
    parameter_set = PARAMETERS

    def check(self, parameters: Parameters) -> None:
        behaviour.check(parameters)

    def begin(self, inputs: Nothing, t: float) -> tuple[PathState, Outputs]:
        return behaviour.begin(self.parameters, t)

    def advance(
        self, state: PathState, inputs: Nothing, t: float, h: float, n: int
    ) -> tuple[PathState, Outputs]:
        return behaviour.advance(self.parameters, state, t, h)

    def expected(
        self, parameters: Parameters, state: PathState, outputs: Outputs
    ) -> Outputs | None:
        return behaviour.expected(parameters, state)
