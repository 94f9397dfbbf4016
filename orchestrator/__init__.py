"""Co-simulate an autonomous underwater vehicle from FMI components, or any system of an SSP.

    from orchestrator import simulate
    result = simulate("fig4", {"plant.noise.std": 0.0})
    result.plot("plant.eta.*")

==========================  ==========================================================
room                        what it is for
==========================  ==========================================================
:mod:`.errors`              what can go wrong, in words for the user
:mod:`.findings`            all that is wrong with a file
:mod:`.reading`             files of the user's, read with care
:mod:`.system`              what is simulated, and how it is written down
:mod:`.master`              how it is stepped
:mod:`.analysis`            the loop's signals by the paper's names; indices, figures
:mod:`.experiments`         scenarios, wiring, bundle, one run and its files
:mod:`.exchange`            other tools: hosts, reference results, verification
:mod:`.studies`             many runs: what varies, engines, Dask
:mod:`.paper`               the paper's numbers and claims beside ours
:mod:`.commands`            the command line
==========================  ==========================================================

Each imports only what stands above it in this table. Components are known as FMUs behind their
ports; what stands above `analysis` knows none of them by name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orchestrator.experiments.preparation import load
    from orchestrator.experiments.result import Result, simulate
    from orchestrator.studies.sweep import sweep

__all__ = ["Result", "load", "simulate", "sweep"]

_MODULES = {
    "Result": "experiments.result",
    "load": "experiments.preparation",
    "simulate": "experiments.result",
    "sweep": "studies.sweep",
}


def __dir__() -> list[str]:
    """What is to be found here, asked for or not."""
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> object:
    """Import what is asked for when it is asked for: `auv-fmu --help` needs none of it."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module  # noqa: PLC0415

    return getattr(import_module(f"orchestrator.{_MODULES[name]}"), name)
