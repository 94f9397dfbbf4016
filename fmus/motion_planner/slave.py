"""MotionPlanner: the reference trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from auv_fmu import motion_planner
from auv_fmu.motion_planner import Motion, PlannerState
from fmus.motion_planner.ports import PORTS
from fmus.ports.vehicle import vehicle
from fmus.slave.component import Component


class Planned(NamedTuple):
    """The state and its motion, which the next step needs again."""

    state: PlannerState
    motion: Motion


class MotionPlanner(Component):
    """Open-loop planner of Definition 1: an undisturbed vehicle under constant torques."""

    description = "Motion planner: helical reference with velocity and acceleration"
    ports = PORTS
    state_type = Planned

    def configure(self, values: dict[str, Any]) -> None:
        self._vehicle = vehicle(values)
        self._ell = values["ell"]
        self._tau_d = values["tau_d.u"], values["tau_d.q"], values["tau_d.r"]
        self._rest = PlannerState(
            (values["eta0.x"], values["eta0.y"], values["eta0.z"]),
            values["eta0.theta"],
            values["eta0.psi"],
            (0.0, 0.0, 0.0, 0.0, 0.0),
        )

    def begin(self, inputs: Sequence[float], t: float) -> tuple[Planned, list[float]]:
        return self._planned(self._rest)

    def advance(
        self, state: Planned, inputs: Sequence[float], t: float, h: float, n: int
    ) -> tuple[Planned, list[float]]:
        moved, moving = state
        for _ in range(n - 1):
            moved = motion_planner.step(moved, moving, h)
            moving = motion_planner.motion(self._vehicle, moved, self._tau_d)
        return self._planned(motion_planner.step(moved, moving, h))

    def _planned(self, state: PlannerState) -> tuple[Planned, list[float]]:
        moving = motion_planner.motion(self._vehicle, state, self._tau_d)
        y_d, dy_d, ddy_d = motion_planner.reference(state, moving, self._ell)
        seen = [*y_d, *dy_d, *ddy_d, *state.position, state.theta, state.psi]
        return Planned(state, moving), seen
