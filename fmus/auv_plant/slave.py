"""AuvPlant: the simulated vehicle, its actuators and its localisation system."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Any

from auv_fmu import plant
from auv_fmu.actuators import limit_all
from auv_fmu.plant import PlantState, RollAxis
from auv_fmu.types import Vector3
from fmus.auv_plant.ports import PORTS
from fmus.base.component import Component
from fmus.base.port import Refusal
from fmus.base.vehicle_ports import vehicle

_OUTPUTS = [port.name for port in PORTS if port.causality == "output"]
#: The measured control point among the outputs.
_Y = slice(_OUTPUTS.index("y.x"), _OUTPUTS.index("y.z") + 1)


class AuvPlant(Component):
    """Six-degree-of-freedom vehicle of section 4.1 with (3) and noisy localisation."""

    description = "Autonomous underwater vehicle with limited actuators and noisy position sensor"
    ports = PORTS
    state_type = PlantState

    def configure(self, values: dict[str, Any]) -> None:
        self._vehicle = vehicle(values)
        self._roll = RollAxis(values["m44"], values["d44"], values["righting.roll"])
        self._ell = values["ell"]
        self._tau_min = values["tau_min.u"], values["tau_min.q"], values["tau_min.r"]
        self._tau_max = values["tau_max.u"], values["tau_max.q"], values["tau_max.r"]
        for lower, upper, k in zip(self._tau_min, self._tau_max, "uqr"):
            if not lower < upper:
                raise Refusal(f"tau_min.{k} = {lower:g} must be below tau_max.{k} = {upper:g}")
        self._eta0 = tuple(values[f"eta0.{k}"] for k in ("x", "y", "z", "phi", "theta", "psi"))
        self._nu0 = tuple(values[f"nu0.{k}"] for k in "uvwpqr")
        self._noise_std = values["noise.std"]
        self._seed = values["noise.seed"]

    def begin(self, inputs: Sequence[float], t: float) -> tuple[PlantState, list[float]]:
        self._random = Random(self._seed)
        state = plant.initial_state(self._eta0[:3], self._eta0[3:], self._nu0)
        return state, self._seen(state, self._limited(inputs))

    def advance(
        self, state: PlantState, inputs: Sequence[float], t: float, h: float, n: int
    ) -> tuple[PlantState, list[float]]:
        tau = self._limited(inputs)
        tau_w: Any = inputs[3:]
        for _ in range(n):
            state = plant.step(self._vehicle, self._roll, state, tau, tau_w, h)
        return state, self._seen(state, tau)

    def _limited(self, inputs: Sequence[float]) -> Vector3:
        return limit_all((inputs[0], inputs[1], inputs[2]), self._tau_min, self._tau_max)

    def _seen(self, state: PlantState, tau: Vector3) -> list[float]:
        euler, y, dy = plant.outputs(state, self._ell)
        return [*state.position, *euler, *state.nu, *y, *dy, *tau]

    def sample(self, outputs: list[float]) -> None:
        gauss = self._random.gauss
        n = gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)
        x, y, z = outputs[_Y]
        outputs[_Y] = plant.measure((x, y, z), n, self._noise_std)

    def hidden_state(self) -> Any:
        return self._random.getstate() if self._state is not None else None

    def restore_hidden_state(self, hidden: Any) -> None:
        if hidden is not None:
            restored = Random()
            restored.setstate(hidden)
            self._random = restored
