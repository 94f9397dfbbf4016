"""Simulate an autonomous underwater vehicle: equations of one paper, and runs of them.

    from auv_fmu import simulate
    result = simulate("fig4", {"plant.noise.std": 0.0})
    result.plot("plant.eta.*")

`simulate`, `Simulation`, `Simulations`, `load`, `read`, `sweep` and `Result` come from
:mod:`orchestrator`, imported on first use. The subpackages below hold the equations, one module per
subject.

The paper is "Three-dimensional tracking control of autonomous underwater vehicles with
limited torque and without velocity sensors". Equation numbers in this package are its own.

================  ========================================================================
subpackage        contents
================  ========================================================================
:mod:`.language`  elements of equations: declarations, vectors, random numbers
:mod:`.paper`     the paper's vehicle, reference, disturbance and controllers
:mod:`.proof`     quantities that only the paper's proof needs; not part of any FMU
:mod:`.remus`     the REMUS 100, not in the paper
:mod:`.bluerov2`  the BlueROV2 Heavy, not in the paper
:mod:`.water`     waves and currents of a sea, not in the paper
:mod:`.guidance`  paths, tracks, formations and their messages, not in the paper
:mod:`.loop`      Fig. 2 as straight-line Python, with all of these
:mod:`.casadi`    components as functions of CasADi; not part of any FMU
================  ========================================================================

Each imports only from those above it, and lists its modules in its own docstring.

The functions take and return Python floats and tuples and import only the standard library,
because they run inside FMUs in hosts that may have no numpy. `architecture.md` explains why.

Symbols are the paper's: dx and ddx are the first and second time derivative of x, x_hat is its
estimate, s_z is s(z). lambda_ is lambda, a keyword of Python.

The order of arguments is: sets of parameters, states and signals, single parameters such as ell and
lambda, the step h.

Conventions: SI units; north-east-down earth frame E (reading 16); body frame B with x forward, y to
starboard, z down; tuples are in the order of the paper's vectors.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.linear_algebra import interpolate, solve
from auv_fmu.language.variable import POSITIVE, Refusal, Variable

if TYPE_CHECKING:
    from orchestrator import (
        Result,
        Simulation,
        SimulationFailed,
        Simulations,
        load,
        read,
        simulate,
        sweep,
    )  # fmt: skip

__all__ = ["POSITIVE", "Matrix", "Refusal", "Variable", "Vector", "interpolate", "solve"]

# The copy of this package in an FMU has another name, and only the equations.
if __name__ == "auv_fmu":
    __all__ += [
        "Result", "Simulation", "SimulationFailed", "Simulations", "load", "read", "simulate",
        "sweep",
    ]  # fmt: skip

__version__ = "0.1.0"

#: Origin of the components, and the paper to which their equation numbers refer.
__author__ = "auv-fmu"
__license__ = "MIT"
__citation__ = (
    'Equation numbers are from the paper "Three-dimensional tracking control of autonomous '
    'underwater vehicles with limited torque and without velocity sensors"'
)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> object:
    """Import a name of the product on first use; equations need neither numpy nor a master."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    # Not an import statement: the build of an FMU would follow it.
    return getattr(import_module("orchestrator"), name)
