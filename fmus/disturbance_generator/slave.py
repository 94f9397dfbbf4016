"""DisturbanceGenerator: friction, waves and ocean currents."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from auv_fmu.disturbance import Disturbance, disturbance
from fmus.disturbance_generator.ports import PORTS
from fmus.slave.component import Component


class NoState(NamedTuple):
    """(56) has no memory."""


class DisturbanceGenerator(Component):
    """(56), evaluated at the beginning of the step and held through it."""

    description = "Disturbance by friction, waves and ocean currents in six degrees of freedom"
    ports = PORTS
    state_type = NoState

    def configure(self, values: dict[str, Any]) -> None:
        self._disturbance = Disturbance(values["A_f"], values["A_d"], values["omega_d"])

    def begin(self, inputs: Sequence[float], t: float) -> tuple[NoState, list[float]]:
        return NoState(), self._seen(inputs, t)

    def advance(
        self, state: NoState, inputs: Sequence[float], t: float, h: float, n: int
    ) -> tuple[NoState, list[float]]:
        return state, self._seen(inputs, t)

    def _seen(self, inputs: Sequence[float], t: float) -> list[float]:
        u, v, w, p, q, r = inputs
        return [*disturbance(self._disturbance, (u, v, w, p, q, r), t)]
