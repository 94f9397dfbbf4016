"""AuvPlant as a slave: the noise is Python's, and the attitude is kept from step to step."""

from __future__ import annotations

from math import isfinite
from random import Random
from typing import Any

from auv_fmu import plant
from auv_fmu.plant import Parameters, PlantState
from auv_fmu.types import Rotation, Vector3
from fmus.auv_plant import behaviour
from fmus.auv_plant.behaviour import Inputs, Outputs
from fmus.auv_plant.ports import DESCRIPTION, PARAMETERS, PORTS
from fmus.ports.groups import slices
from fmus.ports.port import Refusal
from fmus.python.component import Component

_Y = slices([port for port in PORTS if port.causality == "output"])["y"]


class AuvPlant(Component[PlantState, Inputs, Outputs, Parameters]):
    """Six-degree-of-freedom vehicle of section 4.1 with (3) and noisy localisation."""

    description = DESCRIPTION
    ports = PORTS
    parameter_set = PARAMETERS

    #: The state that was seen last and its attitude, which the next step needs again.
    _moved: PlantState | None = None
    _rotation: Rotation

    def check(self, parameters: Parameters) -> None:
        behaviour.check(parameters)

    def begin(self, inputs: Inputs, t: float) -> tuple[PlantState, Outputs]:
        self._random = plant.white_noise(behaviour.seed(self.parameters))
        state, _, outputs = behaviour.begin(self.parameters, inputs)
        return state, outputs

    def advance(
        self, state: PlantState, inputs: Inputs, t: float, h: float, n: int
    ) -> tuple[PlantState, Outputs]:
        rotation = self._rotation if state is self._moved else behaviour.derive(state)
        self._moved, self._rotation, outputs = behaviour.advance(
            self.parameters, state, rotation, inputs, h, n
        )
        return self._moved, outputs

    def sample(self, values: list[float]) -> Vector3:
        gauss = self._random.gauss
        n = gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)
        x, y, z = values[_Y]
        values[_Y] = measured = plant.measure((x, y, z), n, self.parameters.noise.std)
        return measured

    def expected(
        self, parameters: Parameters, state: PlantState, outputs: Outputs
    ) -> Outputs | None:
        return behaviour.expected(parameters, state, outputs)

    def hidden_state(self) -> Any:
        return self._random.getstate() if self._state is not None else None

    def restore_hidden_state(self, hidden: Any) -> None:
        generator = Random()
        generator.setstate(hidden)
        # Some of what setstate takes it changes in silence, or only gauss finds out about.
        *_, following = hidden
        if generator.getstate() != hidden or type(following) not in (float, type(None)):
            raise Refusal("its noise generator is in no state that it can be in")
        if not isfinite(following or 0.0):
            raise Refusal("its noise is not finite")
        self._random = generator
