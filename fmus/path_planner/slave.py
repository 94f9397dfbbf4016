"""PathPlanner as a slave: the corner ahead is kept from step to step."""

from __future__ import annotations

from auv_fmu.path_planner import Corner, Parameters, PathState
from fmus.path_planner import behaviour
from fmus.path_planner.behaviour import Outputs
from fmus.path_planner.ports import DESCRIPTION, PARAMETERS, PORTS
from fmus.ports.groups import Nothing
from fmus.python.component import Component


class PathPlanner(Component[PathState, Nothing, Outputs, Parameters]):
    """Reference through waypoints, which the vehicle can follow or the path is refused."""

    description = DESCRIPTION
    ports = PORTS
    parameter_set = PARAMETERS

    #: The state of the latest reference and the corner ahead of it, where the next step looks on.
    _moved: PathState | None = None
    _ahead: Corner

    def check(self, parameters: Parameters) -> None:
        behaviour.check(parameters)

    def begin(self, inputs: Nothing, t: float) -> tuple[PathState, Outputs]:
        self._moved, self._ahead, outputs = behaviour.begin(self.parameters, t)
        return self._moved, outputs

    def advance(
        self, state: PathState, inputs: Nothing, t: float, h: float, n: int
    ) -> tuple[PathState, Outputs]:
        ahead = self._ahead if state is self._moved else behaviour.derive(self.parameters, state)
        self._moved, self._ahead, outputs = behaviour.advance(self.parameters, state, ahead, t, h)
        return self._moved, outputs

    def expected(
        self, parameters: Parameters, state: PathState, outputs: Outputs
    ) -> Outputs | None:
        return behaviour.expected(parameters, state)
