"""Why a run ends early, in the words of the FMUs.

The compiled loop tells which step cannot be taken, and what it would begin with. Python takes it
once more, component by component, in the order in which they are stepped.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import isfinite
from typing import Any

from auv_fmu import motion_planner, plant
from auv_fmu.closed_loop import LAWS, Setting, Splits, begin, scene
from auv_fmu.disturbance import disturbance
from auv_fmu.euler import LARGEST_STATE, MOST_INTERNAL_STEPS
from orchestrator.studies.batch.kernel import Moment, Plan, is_bounded
from orchestrator.vehicle.signals import ACTUATORS, AXES, DIRECTIONS

#: The state that a component comes to, and outputs of its that may not be finite, by name.
_Result = tuple[Any, dict[str, float]]


#: No force is too large to begin with.
_NO_FORCE = (0.0, 0.0, 0.0)


def refused_at_start(setting: Setting) -> str:
    """Why a run has no start: what the first FMU says that has none; empty: all have one."""
    starts: tuple[tuple[str, Callable[[], str]], ...] = (
        ("plant", lambda: misfit(setting) or _why(lambda: _plant_at_start(setting))),
        ("planner", lambda: _why(lambda: _planner_at_start(setting))),
        ("controller", lambda: _why(lambda: _controller_at_start(setting))),
    )
    for name, start in starts:
        if why := start():
            return f"{name}: initialisation refused: {why}"
    return ""


def misfit(setting: Setting) -> str:
    """Which parameters of the plant do not fit together; empty: all do."""
    parameters = setting.plant
    for k, lower, upper in zip(ACTUATORS, *parameters.limits, strict=True):
        if not lower < upper:
            return f"tau_min.{k} = {lower:g} must be below tau_max.{k} = {upper:g}"
    if not parameters.roll.rolls:
        for name, value in (("eta0.phi", parameters.eta0[3]), ("nu0.p", parameters.nu0[3])):
            if value:
                return f"{name} = {value:g} must be 0 where roll is false"
    return ""


def _plant_at_start(setting: Setting) -> _Result:
    return _plant(setting, *plant.begin(setting.plant, _NO_FORCE, setting.plant.current))


def _planner_at_start(setting: Setting) -> _Result:
    return _planner(setting, *motion_planner.begin(setting.planner))


def _controller_at_start(setting: Setting) -> _Result:
    law, gains = LAWS[type(setting.controller)], setting.controller
    vehicles = begin(setting)
    # Noise is too small to make a difference.
    seen = scene(setting, vehicles, 0.0, (0.0, 0.0, 0.0))
    measured = law.measurement(seen)
    state, signals = law.command(gains, law.start(gains, measured), measured)
    return state, _named("tau", ACTUATORS, signals.tau)


def refused_at_once(setting: Setting, parts: Splits, names: Sequence[str]) -> str:
    """Which component makes too many internal steps of the first step, whatever it begins with.

    Args:
        setting: of the loop.
        parts: that its step would be split into, some of them too many.
        names: of the components in the order in which they are stepped.

    """
    counts = parts._asdict()
    name = next(name for name in names if counts.get(name, 1) > MOST_INTERNAL_STEPS)
    why = f"step {setting.h:g} s needs {counts[name]} internal steps; raise h_max"
    return _stopped(name, 0.0, why)


def refused(setting: Setting, plan: Plan, k: int, moment: Moment, names: Sequence[str]) -> str:
    """Why a step is refused.

    Args:
        setting: of the loop.
        plan: the steps of the run.
        k: number of the step, from 0.
        moment: that it begins with.
        names: of the components in the order in which they are stepped.

    """
    step = _Step(setting, plan, k, moment)
    for name in names:
        if why := _why(getattr(step, name)):
            return _stopped(name, step.t, why)
    raise AssertionError(f"step {k} can be taken")


class _Step:
    """One step, component by component."""

    def __init__(self, setting: Setting, plan: Plan, k: int, moment: Moment) -> None:
        self.t = k * plan.h
        self._h = plan.h if k < plan.full else plan.stop - self.t
        self._parts = plan.parts if k < plan.full else plan.last_parts
        self._setting, self._moment, self._delayed = setting, moment, plan.delayed
        self._law = LAWS[type(setting.controller)]
        self._gains = self._law.sampled(setting.controller, self._h / self._parts.controller)
        self._measured = self._law.measurement(moment.scene)

    def _signals(self) -> tuple[Any, Any]:
        return self._law.command(self._gains, self._moment.control, self._measured)

    def controller(self) -> _Result:
        state, signals = self._signals()
        n = self._parts.controller
        after = self._law.steps(self._gains, state, signals, self._measured, self._h / n, n)
        return after, _named("tau", ACTUATORS, signals.tau)

    def disturbance(self) -> _Result:
        nu_r = self._moment.scene.plant.nu_r
        tau_w = disturbance(self._setting.disturbance, nu_r, self.t)
        return (), _named("tau_w", DIRECTIONS, tau_w)

    def plant(self) -> _Result:
        parameters, vehicles, n = self._setting.plant, self._moment.vehicles, self._parts.plant
        told, tau_w = self._moment.before
        if not self._delayed:
            told, tau_w = self._signals()[1].tau, self._moment.scene.tau_w
        tau, state = plant.applied(parameters, told), vehicles.plant
        moved = plant.steps(
            parameters, state, vehicles.rotation, tau, tau_w, parameters.current, self._h / n, n
        )
        return _plant(self._setting, *moved)

    def planner(self) -> _Result:
        parameters, vehicles, n = self._setting.planner, self._moment.vehicles, self._parts.planner
        return _planner(
            self._setting,
            *motion_planner.steps(parameters, vehicles.planner, vehicles.moving, self._h / n, n),
        )


def _plant(setting: Setting, state: Any, rotation: Any) -> _Result:
    known = setting.plant
    seen = plant.outputs(state, rotation, known.ell, known.roll.rolls)
    return state, {**_named("y", AXES, seen.y), **_named("dy", AXES, seen.dy)}


def _planner(setting: Setting, state: Any, moving: Any) -> _Result:
    reference = motion_planner.reference(state, moving, setting.planner.ell)
    named: dict[str, float] = {}
    for name, values in reference._asdict().items():
        named |= _named(name, AXES, values)
    return state, named


def _named(group: str, members: Iterable[str], values: Iterable[float]) -> dict[str, float]:
    return {f"{group}.{m}": value for m, value in zip(members, values, strict=True)}


def _why(step: Callable[[], _Result]) -> str:
    """Why a component refuses what it comes to; empty: it does not."""
    try:
        state, outputs = step()
    except (ArithmeticError, ValueError) as error:
        return f"{type(error).__name__}: {error}"
    if not is_bounded(state):
        return f"the state is not finite, or beyond {LARGEST_STATE:g}"
    for name, value in outputs.items():
        if not isfinite(value):
            return f"{name} = {value!r}: must be finite"
    return ""


def _stopped(name: str, t: float, why: str) -> str:
    return f"stopped at t = {t:.12g} s: {name}: step refused at t = {t:g} s: {why}"
