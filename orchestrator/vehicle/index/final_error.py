"""Tracking error at the end of a run: e_f of section 4.2."""

from __future__ import annotations

from math import nan
from typing import Annotated, NamedTuple

from auv_fmu import Variable
from auv_fmu.language.quantities import POSITION
from auv_fmu.language.vectors import Vector3
from orchestrator.vehicle.index.tracking import Inputs, error

#: T_L [s].
LAST = 5.0


class State(NamedTuple):
    """Largest errors of these rows so far."""

    largest: Vector3


class Outputs(NamedTuple):
    """e_f."""

    final_error: Annotated[
        Vector3,
        Variable(POSITION, f"e_f: largest absolute value of e in the last {LAST:g} s"),
    ]


def start(inputs: Inputs) -> State:
    """Begin with the first of these rows."""
    x, y, z = error(inputs)
    return State((abs(x), abs(y), abs(z)))


def update(state: State, inputs: Inputs) -> State:
    """Add a row."""
    l_x, l_y, l_z = state.largest
    x, y, z = error(inputs)
    return State((max(l_x, abs(x)), max(l_y, abs(y)), max(l_z, abs(z))))


def outputs(state: State, t: float, begin: float) -> Outputs:
    """Return the largest errors; there are none before the first step."""
    return Outputs(state.largest if t > begin else (nan, nan, nan))
