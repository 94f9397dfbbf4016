"""A lithium-ion cell as an equivalent circuit: a source, a resistance and two RC pairs.

    d(charge)/dt  = -i / (3600 capacity)
    d(v[k])/dt    = (R[k] i - v[k]) / (R[k] C[k])
    voltage       = source(charge) - R0 i - v[1] - v[2]

The voltage of the source is a table over the charge, between whose points it is interpolated. `R0`
gives the jump at a change of current, the pairs a faster and a slower relaxation after it. See
G. L. Plett, Battery Management Systems. The table is typical of such a cell, but not measured.

The charge is counted exactly for a held current, and the pairs are solved exactly. A cell that is
empty gives no current, and a full one cannot be charged: `i` is 0 then. The voltage depends on the
current directly; the charge does not, hence its `feedthrough=()`.

With the default values 1.25 A empty it in two hours. Look at `voltage` and `charge`.
"""

from __future__ import annotations

from math import exp
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector, interpolate

CHARGES = Vector((0.0, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0))
SOURCE = Vector((2.9, 3.3, 3.45, 3.55, 3.65, 3.8, 3.98, 4.2))  #: [V]

STEP_SIZE, STOP_TIME = 10.0, 9000.0


class Parameters(NamedTuple):
    """The cell."""

    capacity: Annotated[float, Variable("A.h", "Capacity", minimum=POSITIVE)] = 2.5
    R0: Annotated[float, Variable("Ohm", "Resistance in series", minimum=0.0)] = 0.03
    R: Annotated[Vector, 2, Variable("Ohm", "Resistance of a pair", POSITIVE)] = Vector(
        (0.015, 0.01)
    )
    C: Annotated[Vector, 2, Variable("F", "Capacitance of a pair", POSITIVE)] = Vector((1e3, 2e4))
    charge0: Annotated[float, Variable("1", "Charge at the start", 0.0, 1.0)] = 1.0


class Inputs(NamedTuple):
    """Load of the cell."""

    demand: Annotated[float, Variable("A", "Current to deliver, negative to charge")] = 1.25


class State(NamedTuple):
    """Charge, and voltages of the pairs."""

    charge: Annotated[float, Variable("1", "Charge as a fraction of the capacity")]
    v: Annotated[Vector, 2, Variable("V", "Voltage of a pair")]


class Margins(NamedTuple):
    """Distance at which the current stops."""

    charge: Annotated[float, Variable("1", "From the charge to empty or full")]


class Outputs(NamedTuple):
    """Outputs of the cell."""

    voltage: Annotated[float, Variable("V", "Voltage of the terminals")]
    i: Annotated[float, Variable("A", "Current that it delivers")]
    charge: Annotated[float, Variable("1", "Charge as a fraction of the capacity", feedthrough=())]
    empty: Annotated[bool, Variable("1", "It cannot deliver", feedthrough=())]


def start(parameters: Parameters) -> State:
    """State at the start: nothing has flowed."""
    return State(parameters.charge0, Vector((0.0, 0.0)))


def derive(state: State, inputs: Inputs) -> float:
    """The current that it can deliver or take [A]."""
    blocked = (state.charge <= 0 and inputs.demand > 0) or (state.charge >= 1 and inputs.demand < 0)
    return 0.0 if blocked else inputs.demand


def update(parameters: Parameters, state: State, derived: float, h: float) -> State:
    """State after a step of h seconds with a held current."""
    charge = min(max(state.charge - derived * h / (3600 * parameters.capacity), 0.0), 1.0)
    v = Vector(
        R * derived + (v - R * derived) * exp(-h / (R * C))
        for v, R, C in zip(state.v, parameters.R, parameters.C)
    )
    return State(charge, v)


def rates(parameters: Parameters, state: State, derived: float) -> State:
    """Rates of the state."""
    v = Vector((R * derived - v) / (R * C) for v, R, C in zip(state.v, parameters.R, parameters.C))
    return State(-derived / (3600 * parameters.capacity), v)


def switches(state: State) -> Margins:
    """Distance from empty or full."""
    return Margins(min(state.charge, 1.0 - state.charge))


def outputs(parameters: Parameters, state: State, derived: float) -> Outputs:
    """Outputs of the cell."""
    source = interpolate(state.charge, CHARGES, SOURCE)
    voltage = source - parameters.R0 * derived - state.v.sum()
    return Outputs(voltage, derived, state.charge, state.charge <= 0)
