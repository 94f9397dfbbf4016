"""Co-simulate an autonomous underwater vehicle from FMI components, or any system of an SSP.

    from orchestrator import simulate
    result = simulate("fig4", {"plant.noise.std": 0.0})
    result.plot("plant.eta.*")

==================  ==========================================================
room                what it is for
==================  ==========================================================
:mod:`.machine`     the operating system: errors, files, processes, compilers
:mod:`.cosim`       a co-simulation master for any system of FMUs
:mod:`.vehicle`     this vehicle's signals, indices and certificates
:mod:`.figures`     figures of runs and of studies
:mod:`.runs`        scenarios, wiring, bundle, one run and its files
:mod:`.program`     a system as one compiled program
:mod:`.live`        the page in which a system runs
:mod:`.exchange`    other tools: hosts, verification of their tables
:mod:`.studies`     many runs
:mod:`.paper`       the paper's numbers and claims beside ours
:mod:`.commands`    the command line
==================  ==========================================================

Each imports only what stands above it in this table. Components are known as FMUs behind their
ports; what stands above `vehicle` knows none of them by name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from orchestrator.runs.loading import load
    from orchestrator.runs.result import Result, read
    from orchestrator.runs.simulate import simulate
    from orchestrator.studies.study_result import StudyResult
    from orchestrator.studies.sweep import sweep

__all__ = ["Result", "StudyResult", "load", "read", "simulate", "sweep"]

_MODULES = {
    "Result": "runs.result",
    "StudyResult": "studies.study_result",
    "load": "runs.loading",
    "read": "runs.result",
    "simulate": "runs.simulate",
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
