"""MotionPlanner: the reference trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from auv_fmu import motion_planner
from auv_fmu.motion_planner import PlannerState
from fmus.base.component import Component
from fmus.base.vehicle_ports import vehicle
from fmus.motion_planner.ports import PORTS


class MotionPlanner(Component):
    """Open-loop planner of Definition 1: an undisturbed vehicle under constant torques."""

    description = "Motion planner: helical reference with velocity and acceleration"
    ports = PORTS
    state_type = PlannerState

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

    def begin(self, inputs: Sequence[float], t: float) -> tuple[PlannerState, list[float]]:
        return self._rest, self._seen(self._rest)

    def advance(
        self, state: PlannerState, inputs: Sequence[float], t: float, h: float, n: int
    ) -> tuple[PlannerState, list[float]]:
        for _ in range(n):
            state = motion_planner.step(self._vehicle, state, self._tau_d, h)
        return state, self._seen(state)

    def _seen(self, state: PlannerState) -> list[float]:
        y_d, dy_d, ddy_d = motion_planner.reference(self._vehicle, state, self._tau_d, self._ell)
        return [*y_d, *dy_d, *ddy_d, *state.position, state.theta, state.psi]
