"""An ohmic resistor between two pins.

    i = (v_positive - v_negative) / R

A current is positive where it flows into a pin. The resistor has no memory: there is no class
`State`, and the currents follow the voltages at once. The description of the FMU says so, because
`outputs` takes the inputs. So a host can solve a ring of resistors.

This is the component Resistor of PythonFMU's example `demoslave.py`, with the same names and
values. Only their local variables are outputs here.

Look at the currents: 1 mA flows with the default voltages. `R` may change during a run.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable

STOP_TIME = 10.0


class Parameters(NamedTuple):
    """Resistance."""

    R: Annotated[float, Variable("Ohm", "Resistance", minimum=POSITIVE, tunable=True)] = 10000.0


class Inputs(NamedTuple):
    """Voltages of the pins."""

    positive_pin_v: Annotated[float, Variable("V", "Voltage of the positive pin")] = 20.0
    negative_pin_v: Annotated[float, Variable("V", "Voltage of the negative pin")] = 10.0


class Outputs(NamedTuple):
    """Voltage and currents."""

    positive_pin_i: Annotated[float, Variable("A", "Current into the positive pin")]
    negative_pin_i: Annotated[float, Variable("A", "Current into the negative pin")]
    delta_v: Annotated[float, Variable("V", "Voltage between the pins")]
    i: Annotated[float, Variable("A", "Current through the resistor")]


def outputs(parameters: Parameters, inputs: Inputs) -> Outputs:
    """Voltage and currents, by Ohm's law."""
    delta_v = inputs.positive_pin_v - inputs.negative_pin_v
    i = delta_v / parameters.R
    return Outputs(positive_pin_i=i, negative_pin_i=-i, delta_v=delta_v, i=i)
