"""MotionPlanner: the reference trajectory."""

from __future__ import annotations

from typing import NamedTuple, TypedDict

from auv_fmu import motion_planner
from auv_fmu.motion_planner import Motion, PlannerState
from auv_fmu.types import Vector3, Vector5
from fmus.motion_planner.ports import PARAMETERS, PORTS, Parameters
from fmus.slave.component import Component, Nothing


class Planned(NamedTuple):
    """The state and its motion, which the next step needs again."""

    state: PlannerState
    motion: Motion


class Outputs(TypedDict):
    """The reference, and the posture of the vehicle that makes it."""

    y_d: Vector3
    dy_d: Vector3
    ddy_d: Vector3
    eta_d: Vector5


class MotionPlanner(Component[Planned, Nothing, Outputs, Parameters]):
    """Open-loop planner of Definition 1: an undisturbed vehicle under constant torques."""

    description = "Motion planner: helical reference with velocity and acceleration"
    ports = PORTS
    parameter_set = PARAMETERS

    def begin(self, inputs: Nothing, t: float) -> tuple[Planned, Outputs]:
        x, y, z, theta, psi = self.parameters.eta0
        return self._planned(PlannerState((x, y, z), theta, psi, (0.0, 0.0, 0.0, 0.0, 0.0)))

    def advance(
        self, state: Planned, inputs: Nothing, t: float, h: float, n: int
    ) -> tuple[Planned, Outputs]:
        moved, moving = state
        for _ in range(n - 1):
            moved = motion_planner.step(moved, moving, h)
            moving = self._motion(moved)
        return self._planned(motion_planner.step(moved, moving, h))

    def _motion(self, state: PlannerState) -> Motion:
        return motion_planner.motion(self.parameters.vehicle, state, self.parameters.tau_d)

    def _planned(self, state: PlannerState) -> tuple[Planned, Outputs]:
        moving = self._motion(state)
        y_d, dy_d, ddy_d = motion_planner.reference(state, moving, self.parameters.ell)
        eta_d = (*state.position, state.theta, state.psi)
        return Planned(state, moving), {"y_d": y_d, "dy_d": dy_d, "ddy_d": ddy_d, "eta_d": eta_d}
