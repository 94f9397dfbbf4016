"""Allocation of a force and two moments to the fins and the propeller of Remus100."""

from __future__ import annotations

from auv_fmu import __author__, __license__, __version__
from auv_fmu.remus.allocation import Allocated, Parameters, Wanted, evaluate
from auv_fmu.remus.tail import __citation__

SAMPLED = True


def outputs(parameters: Parameters, inputs: Wanted) -> Allocated:
    """Return the commands of fins and propeller, and the resulting force and moments."""
    return evaluate(parameters, inputs.tau, inputs.nu_r)
