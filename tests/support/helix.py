"""The reference vehicle of the paper, step by step."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from auv_fmu.paper import motion_planner
from auv_fmu.paper.euler import STEP
from auv_fmu.paper.motion_planner import Motion, Parameters, PlannerState

#: Values of section 4.1.
_HELIX = Parameters()


def helix(parameters: Parameters = _HELIX) -> Iterator[tuple[PlannerState, Motion]]:
    """State and motion, every 20 ms from the start on."""
    state = motion_planner.initial_state(parameters.eta0, parameters.nu0)
    while True:
        moving = motion_planner.motion(parameters.vehicle, state, parameters.tau_d)
        yield state, moving
        state = motion_planner.step(state, moving, STEP)


def helix_after(steps: int) -> tuple[PlannerState, Motion]:
    """State and motion of section 4.1 after some steps."""
    return next(islice(helix(), steps, None))
