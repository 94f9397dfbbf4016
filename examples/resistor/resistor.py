"""An ohmic resistor between two pins.

    i = (v_positive - v_negative) / R

A current is positive where it flows into a pin. The resistor has no memory: there is no class
`State`, and the currents depend on the voltages directly. Because `begin` takes the inputs, the
description of the FMU says so. Its outputs change only in a step, so in a ring of resistors one
value arrives a step late.

This is the component Resistor of PythonFMU's example `demoslave.py`, with the same names and
values. Only their local variables are outputs here.

Look at the currents: 1 mA flows with the default voltages. `R` may change during a run.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable


class Parameters(NamedTuple):
    """What may be set."""

    R: Annotated[float, Variable("Ohm", "Resistance", minimum=POSITIVE, tunable=True)] = 10000.0


class Inputs(NamedTuple):
    """The voltages of its pins."""

    positive_pin_v: Annotated[float, Variable("V", "Voltage of the positive pin")] = 20.0
    negative_pin_v: Annotated[float, Variable("V", "Voltage of the negative pin")] = 10.0


class Outputs(NamedTuple):
    """What follows from them."""

    positive_pin_i: Annotated[float, Variable("A", "Current into the positive pin")]
    negative_pin_i: Annotated[float, Variable("A", "Current into the negative pin")]
    delta_v: Annotated[float, Variable("V", "Voltage between the pins")]
    i: Annotated[float, Variable("A", "Current through the resistor")]


def begin(parameters: Parameters, inputs: Inputs) -> Outputs:
    """Outputs at the start."""
    delta_v = inputs.positive_pin_v - inputs.negative_pin_v
    i = delta_v / parameters.R
    return Outputs(positive_pin_i=i, negative_pin_i=-i, delta_v=delta_v, i=i)


def advance(parameters: Parameters, inputs: Inputs) -> Outputs:
    """Outputs after a step, which are those of the inputs that were held over it."""
    return begin(parameters, inputs)
