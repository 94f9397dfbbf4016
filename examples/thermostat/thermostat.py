"""A room that a thermostat keeps warm by switching a heater on and off.

    capacity dT/dt = heater - loss (T - outdoor)

The heater is switched on when the temperature falls below the set point by half the band, and off
when it exceeds it by as much. This hysteresis is what keeps a switch from chattering. Between two
switches the equation is solved exactly for held inputs. The switch acts at the end of a
communication step, so the temperature leaves the band by at most its change in one step.

The temperature cycles within the band, and the times of heating and cooling follow from the
solution: the room cools through the band in

    capacity / loss * log((upper - outdoor) / (lower - outdoor))

With the default values it heats up from 15 degC in 34 minutes, and then repeats itself every 18
minutes. Its default experiment takes three hours. Look at `temperature`, `heating` and `switched`.
"""

from __future__ import annotations

from enum import IntEnum
from math import exp
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable

STEP_SIZE, STOP_TIME = 10.0, 10800.0


class Mode(IntEnum):
    """Mode of the heater."""

    OFF = 0
    HEATING = 1


class Parameters(NamedTuple):
    """Room, heater and thermostat."""

    capacity: Annotated[float, Variable("J/K", "Heat capacity of the room", POSITIVE)] = 5e5
    loss: Annotated[float, Variable("W/K", "Heat loss of the room", POSITIVE)] = 50.0
    heater: Annotated[float, Variable("W", "Power of the heater", minimum=0.0)] = 2000.0
    setting: Annotated[float, Variable("degC", "Set point", tunable=True)] = 20.0
    band: Annotated[float, Variable("K", "Width of the band", minimum=0.0, tunable=True)] = 1.0
    temperature0: Annotated[float, Variable("degC", "Temperature at the start")] = 15.0
    mode0: Annotated[Mode, Variable("1", "Mode at the start")] = Mode.HEATING


class Inputs(NamedTuple):
    """The weather."""

    outdoor: Annotated[float, Variable("degC", "Temperature outdoors")] = 5.0


class State(NamedTuple):
    """Room and heater."""

    temperature: float  #: [degC]
    mode: Mode
    switched: int  #: number of switches


class Outputs(NamedTuple):
    """Outputs of the room and the heater."""

    temperature: Annotated[float, Variable("degC", "Temperature of the room")]
    heating: Annotated[bool, Variable("1", "The heater is on")]
    switched: Annotated[int, Variable("1", "How often the heater has switched")]


def start(parameters: Parameters) -> State:
    """State at the start."""
    return State(parameters.temperature0, parameters.mode0, 0)


def update(parameters: Parameters, state: State, inputs: Inputs, h: float) -> State:
    """State after a step of h seconds with held inputs."""
    power = parameters.heater if state.mode == Mode.HEATING else 0.0
    settled = inputs.outdoor + power / parameters.loss
    remaining = exp(-h * parameters.loss / parameters.capacity)
    temperature = settled + (state.temperature - settled) * remaining
    mode = state.mode
    if temperature < parameters.setting - parameters.band / 2:
        mode = Mode.HEATING
    elif temperature > parameters.setting + parameters.band / 2:
        mode = Mode.OFF
    return State(temperature, mode, state.switched + int(mode != state.mode))


def outputs(state: State) -> Outputs:
    """Outputs of the room and the heater."""
    return Outputs(state.temperature, state.mode == Mode.HEATING, state.switched)
