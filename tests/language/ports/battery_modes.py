"""A battery of four cells with a charger that has modes."""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable, Vector

CELLS = 4
OCV = (3.0, 1.9, -2.9, 2.1)  # of a cell, by powers of the state of charge [V]
STEP_SIZE, STOP_TIME = 1.0, 600.0


class Mode(IntEnum):
    REST = 0
    CHARGE = 1
    BALANCE = 2
    DISCHARGE = 3


LIMITS = {Mode.REST: 0.0, Mode.CHARGE: 2.0, Mode.BALANCE: 0.1, Mode.DISCHARGE: 5.0}


class Parameters(NamedTuple):
    capacity: Annotated[float, Variable("Ah", "Of a cell", POSITIVE)] = 0.05
    resistance: Annotated[float, Variable("Ohm", "Of a cell", POSITIVE, tunable=True)] = 0.02
    soc0: Annotated[Vector, CELLS, Variable("1", "At the start", 0.0, 1.0)] = Vector(
        [0.2, 0.25, 0.3, 0.22]
    )


class Inputs(NamedTuple):
    command: Annotated[Mode, Variable(description="Wanted mode")] = Mode.CHARGE
    load: Annotated[float, Variable("A", "Current of the load")] = 1.0


class State(NamedTuple):
    soc: Annotated[Vector, CELLS]
    mode: Mode = Mode.REST
    heat: float = 0.0


class Outputs(NamedTuple):
    voltage: Annotated[float, Variable("V", "Of all cells")]
    soc: Annotated[float, Variable("1", "Of the emptiest cell")]
    mode: Annotated[Mode, Variable(description="What it does")]
    heat: Annotated[float, Variable("J", "Lost in the cells")]


def voltage(soc: float) -> float:
    return sum(c * soc**i for i, c in enumerate(OCV))


def next_mode(state: State, command: Mode) -> Mode:
    spread = max(state.soc) - min(state.soc)
    match command:
        case Mode.CHARGE | Mode.BALANCE if spread > 0.05:
            return Mode.BALANCE
        case Mode.CHARGE:
            return Mode.REST if any(soc >= 1.0 for soc in state.soc) else Mode.CHARGE
        case Mode.DISCHARGE if all(soc > 0.02 for soc in state.soc):
            return Mode.DISCHARGE
        case _:
            return Mode.REST


def currents(state: State, load: float) -> Annotated[Vector, CELLS]:
    limit, mean = LIMITS[state.mode], sum(state.soc) / CELLS
    match state.mode:
        case Mode.CHARGE:
            return Vector([limit] * CELLS)
        case Mode.BALANCE:
            return Vector(limit if soc < mean else -limit for soc in state.soc)
        case Mode.DISCHARGE:
            return Vector([-min(max(load, 0), limit)] * CELLS)
    return Vector([0.0] * CELLS)


def start(parameters: Parameters) -> State:
    return State(parameters.soc0)


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    i = currents(state, load=inputs.load)
    soc = state.soc + i * (h / 3600 / parameters.capacity)
    assert all(-0.1 < x < 1.1 for x in soc), f"a step of {h:g} s is too long"
    heat = state.heat + parameters.resistance * h * sum(x**2 for x in i)
    return State(Vector(max(0.0, min(1.0, x)) for x in soc), next_mode(state, inputs.command), heat)


def outputs(parameters: Parameters, state: State, inputs: Inputs) -> Outputs:
    i = currents(state, inputs.load)
    total = 0.0
    for soc, amperes in zip(state.soc, i):
        total += voltage(soc) + parameters.resistance * amperes
    return Outputs(total, min(state.soc), state.mode, state.heat)
