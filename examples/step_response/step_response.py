"""The response of a first-order lag to a step, as a formula of the time.

    realOut(t) = a realIn (1 - exp(-t / tau))

Nothing is integrated: the output follows from the input, the parameters and the time. So `outputs`
takes `t`, and there is no class `State`. After `tau` seconds the output has 63 % of its final
value, and after 3 `tau` it has 95 %.

This is the component of PythonFMU's example `sympyslave.py`, with the same names and values. That
one evaluates the formula with SymPy, which the host must have; this one needs only `math`.

The formula is a step response only for a constant input. Look at `realOut`, and change `a`.
"""

from __future__ import annotations

from math import exp
from typing import Annotated, NamedTuple

from auv_fmu import POSITIVE, Variable

STOP_TIME = 10.0


class Parameters(NamedTuple):
    """Gain and time constant."""

    a: Annotated[float, Variable("1", "Gain", tunable=True)] = 5.0
    tau: Annotated[float, Variable("s", "Time constant", minimum=POSITIVE, tunable=True)] = 2.0


class Inputs(NamedTuple):
    """Height of the step."""

    realIn: Annotated[float, Variable("1", "Height of the step at time 0")] = 22.0


class Outputs(NamedTuple):
    """Response."""

    realOut: Annotated[float, Variable("1", "Response to the step")]


def outputs(parameters: Parameters, inputs: Inputs, t: float) -> Outputs:
    """Response at the time t."""
    return Outputs(inputs.realIn * parameters.a * (1.0 - exp(-t / parameters.tau)))
