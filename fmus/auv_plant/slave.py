"""AuvPlant: the simulated vehicle, its actuators and its localisation system."""

from __future__ import annotations

from math import hypot, isclose, isfinite
from random import Random
from typing import Any, NamedTuple, TypedDict

from auv_fmu import plant
from auv_fmu.actuators import limit_all
from auv_fmu.attitude import rotation_from_quaternion
from auv_fmu.plant import PlantState
from auv_fmu.types import Rotation, Vector3, Vector6
from fmus.auv_plant.ports import PARAMETERS, PORTS, Parameters
from fmus.ports.groups import slices
from fmus.ports.port import Refusal
from fmus.slave.component import Component
from fmus.slave.state import nearly_equal

_PLACES = slices([port for port in PORTS if port.causality == "output"])
_Y, _TAU_APPLIED = _PLACES["y"], _PLACES["tau_applied"]

#: Share of its length by which a normalised quaternion is off.
_ROUNDING = 1e-12

#: More standard deviations than any number of Random.gauss is off: sqrt(-2 log(2^-53)) is 8.6.
_MOST_DEVIATIONS = 9.0


class Inputs(NamedTuple):
    """Commanded force and moments, and the disturbance."""

    tau: Vector3
    tau_w: Vector6


class Outputs(TypedDict):
    """What is seen of the vehicle; y has no noise yet."""

    eta: Vector6
    nu: Vector6
    y: Vector3
    dy: Vector3
    tau_applied: Vector3


class AuvPlant(Component[PlantState, Inputs, Outputs, Parameters]):
    """Six-degree-of-freedom vehicle of section 4.1 with (3) and noisy localisation."""

    description = "Autonomous underwater vehicle with limited actuators and noisy position sensor"
    ports = PORTS
    parameter_set = PARAMETERS

    def check(self, parameters: Parameters) -> None:
        lower, upper = parameters.limits.tau_min, parameters.limits.tau_max
        for k, tau_min, tau_max in zip("uqr", lower, upper):
            if not tau_min < tau_max:
                raise Refusal(f"tau_min.{k} = {tau_min:g} must be below tau_max.{k} = {tau_max:g}")

    #: The state that was seen last and its attitude, which the next step needs again.
    _moved: PlantState | None = None
    _rotation: Rotation

    def begin(self, inputs: Inputs, t: float) -> tuple[PlantState, Outputs]:
        chosen = self.parameters
        self._random = plant.white_noise(chosen.noise.seed)
        x, y, z, phi, theta, psi = chosen.eta0
        state = plant.initial_state((x, y, z), (phi, theta, psi), chosen.nu0)
        rotation = rotation_from_quaternion(state.quaternion)
        return state, _seen(chosen, state, rotation, _limited(chosen, inputs.tau))

    def advance(
        self, state: PlantState, inputs: Inputs, t: float, h: float, n: int
    ) -> tuple[PlantState, Outputs]:
        chosen = self.parameters
        tau = _limited(chosen, inputs.tau)
        rotation = (
            self._rotation if state is self._moved else rotation_from_quaternion(state.quaternion)
        )
        while n:
            state = plant.step(chosen.vehicle, chosen.roll, state, rotation, tau, inputs.tau_w, h)
            rotation = rotation_from_quaternion(state.quaternion)
            n -= 1
        self._moved, self._rotation = state, rotation
        return state, _seen(chosen, state, rotation, tau)

    def sample(self, values: list[float]) -> Vector3:
        gauss = self._random.gauss
        n = gauss(0.0, 1.0), gauss(0.0, 1.0), gauss(0.0, 1.0)
        x, y, z = values[_Y]
        values[_Y] = measured = plant.measure((x, y, z), n, self.parameters.noise.std)
        return measured

    def check_state(self, parameters: Parameters, state: PlantState, outputs: list[float]) -> None:
        if not isclose(hypot(*state.quaternion), 1.0, rel_tol=_ROUNDING):
            raise Refusal("its quaternion is not of length one")
        u, q, r = outputs[_TAU_APPLIED]
        rotation = rotation_from_quaternion(state.quaternion)
        seen = self._pack(_seen(parameters, state, rotation, _limited(parameters, (u, q, r))))
        most = _MOST_DEVIATIONS * parameters.noise.std
        seen[_Y] = [b + min(max(a - b, -most), most) for a, b in zip(outputs[_Y], seen[_Y])]
        if not nearly_equal(seen, outputs):
            raise Refusal("its outputs are not those of its state")

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


def _limited(chosen: Parameters, tau: Vector3) -> Vector3:
    return limit_all(tau, chosen.limits.tau_min, chosen.limits.tau_max)


def _seen(chosen: Parameters, state: PlantState, rotation: Rotation, tau: Vector3) -> Outputs:
    euler, y, dy = plant.outputs(state, rotation, chosen.ell)
    return {
        "eta": (*state.position, *euler),
        "nu": state.nu,
        "y": y,
        "dy": dy,
        "tau_applied": tau,
    }
