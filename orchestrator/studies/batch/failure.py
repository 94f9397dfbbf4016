"""Why a run ends early: what fails is taken again, in plain Python.

The compiled loop tells only which step cannot be taken, and the moment that it begins with.
"""

from __future__ import annotations

from collections.abc import Callable

from auv_fmu import closed_loop
from auv_fmu.closed_loop import LAWS, Moment, Setting
from auv_fmu.euler import LARGEST_STATE
from orchestrator.studies.batch.kernel import RunSteps, is_bounded, part_of


def start_failure(setting: Setting, plan: RunSteps) -> str:
    """Why a run has no start."""
    law = LAWS[type(setting.controller)]

    def start() -> Moment:
        # Noise is too small to make a difference.
        moment = closed_loop.begin(setting, law, (0.0, 0.0, 0.0))
        closed_loop.act(setting, law, moment, plan.h, plan.parts, plan.delayed)
        return moment

    return f"initialisation refused: {_why(start)}"


def step_failure(setting: Setting, plan: RunSteps, k: int, moment: Moment) -> str:
    """Why step k of a run, from 0, cannot be taken from a moment."""
    law = LAWS[type(setting.controller)]
    h, parts, end = part_of(plan, k)

    def step() -> Moment:
        instant = closed_loop.act(setting, law, moment, h, parts, plan.delayed)
        return closed_loop.step(setting, law, instant, h, parts, end, (0.0, 0.0, 0.0))

    return f"stopped at t = {moment.t:.12g} s: {_why(step)}"


def _why(take: Callable[[], Moment]) -> str:
    """What an equation raises on the way to a moment, or else what is wrong with the moment."""
    try:
        moment = take()
    except (ArithmeticError, ValueError) as error:
        return f"{type(error).__name__}: {error}"
    states = {
        "plant": moment.vehicles.plant,
        "planner": moment.vehicles.planner,
        "controller": moment.controller_state,
    }
    for name, state in states.items():
        if not is_bounded(state):
            return f"{name}: the state is not finite, or beyond {LARGEST_STATE:g}"
    return "an output is not finite"
