"""MotionPlanner: the reference trajectory."""

from __future__ import annotations

from typing import TypedDict

from auv_fmu import motion_planner
from auv_fmu.motion_planner import Motion, PlannerState
from auv_fmu.types import Vector3, Vector5
from fmus.motion_planner.ports import PARAMETERS, PORTS, Parameters
from fmus.ports.port import Refusal
from fmus.slave.component import Component, Nothing
from fmus.slave.state import nearly_equal


class Outputs(TypedDict):
    """The reference, and the posture of the vehicle that makes it."""

    y_d: Vector3
    dy_d: Vector3
    ddy_d: Vector3
    eta_d: Vector5


class MotionPlanner(Component[PlannerState, Nothing, Outputs, Parameters]):
    """Open-loop planner of Definition 1: an undisturbed vehicle under constant torques."""

    description = "Motion planner: helical reference with velocity and acceleration"
    ports = PORTS
    parameter_set = PARAMETERS

    #: The state of the latest reference and its motion, which the next step needs again.
    _moved: PlannerState | None = None
    _moving: Motion

    def begin(self, inputs: Nothing, t: float) -> tuple[PlannerState, Outputs]:
        return self._planned(motion_planner.initial_state(self.parameters.eta0))

    def advance(
        self, state: PlannerState, inputs: Nothing, t: float, h: float, n: int
    ) -> tuple[PlannerState, Outputs]:
        moving = self._moving if state is self._moved else _motion(self.parameters, state)
        while n > 1:
            state = motion_planner.step(state, moving, h)
            moving = _motion(self.parameters, state)
            n -= 1
        return self._planned(motion_planner.step(state, moving, h))

    def check_state(
        self, parameters: Parameters, state: PlannerState, outputs: list[float]
    ) -> None:
        if not nearly_equal(
            self._pack(_seen(parameters, state, _motion(parameters, state))), outputs
        ):
            raise Refusal("its outputs are not those of its state")

    def _planned(self, state: PlannerState) -> tuple[PlannerState, Outputs]:
        moving = _motion(self.parameters, state)
        self._moved, self._moving = state, moving
        return state, _seen(self.parameters, state, moving)


def _motion(chosen: Parameters, state: PlannerState) -> Motion:
    return motion_planner.motion(chosen.vehicle, state, chosen.tau_d)


def _seen(chosen: Parameters, state: PlannerState, moving: Motion) -> Outputs:
    y_d, dy_d, ddy_d = motion_planner.reference(state, moving, chosen.ell)
    eta_d = (*state.position, state.theta, state.psi)
    return {"y_d": y_d, "dy_d": dy_d, "ddy_d": ddy_d, "eta_d": eta_d}
