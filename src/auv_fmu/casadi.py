"""Components as functions of CasADi, with exact derivatives.

    from auv_fmu import casadi
    step = casadi.function("AuvPlant")
    model = casadi.model("AuvPlant", {"integrator": "rk4"})
    model.state, model.start, model.advance, model.observe

`function`, `model`, `refusal` and `Model` come from :mod:`orchestrator`, imported on first use, and
need the package casadi.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orchestrator.program.functions import Model, function, model, refusal

__all__ = ["Model", "function", "model", "refusal"]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> object:
    """Import a name of the product on first use."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("orchestrator.program.functions"), name)
