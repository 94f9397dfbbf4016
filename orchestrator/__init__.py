"""Co-simulate an autonomous underwater vehicle from FMI components, or any system of an SSP.

    from auv_fmu import simulate
    result = simulate("fig4", {"plant.noise.std": 0.0})
    result.plot("plant.eta.*")

==================  ==========================================================
room                contents
==================  ==========================================================
:mod:`.machine`     the operating system: errors, files, processes, compilers
:mod:`.cosim`       a co-simulation master for any system of FMUs
:mod:`.vehicle`     this vehicle's signals, indices and certificates
:mod:`.figures`     figures of runs and of studies
:mod:`.runs`        scenarios, wiring, bundle, one run and its files
:mod:`.program`     a system as one compiled program
:mod:`.simulation`  a system that is stepped, or many side by side
:mod:`.bridges`     simulations in the form that other libraries step
:mod:`.live`        the page in which a system runs
:mod:`.exchange`    other tools: hosts, verification of their tables
:mod:`.studies`     many runs
:mod:`.benchmark`   control laws compared in a table
:mod:`.paper`       the paper's numbers and claims compared with ours
:mod:`.commands`    the command line
==================  ==========================================================

Each imports only rooms above it in this table. Components are used as FMUs through their ports;
rooms above `vehicle` contain no name of a component.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from orchestrator.machine.lazy import offered

if TYPE_CHECKING:
    from orchestrator.runs.preparation import load
    from orchestrator.runs.result import Result, read
    from orchestrator.runs.run import simulate
    from orchestrator.simulation.simulation import Simulation, SimulationFailed
    from orchestrator.simulation.simulations import Simulations
    from orchestrator.studies.store import StudyResult
    from orchestrator.studies.sweep import sweep

__all__ = [
    "Result", "Simulation", "SimulationFailed", "Simulations", "StudyResult", "load", "read",
    "simulate", "sweep",
]  # fmt: skip

if not TYPE_CHECKING:
    __getattr__, __dir__ = offered(
        __name__,
        {
            "runs.preparation": "load",
            "runs.result": "Result read",
            "runs.run": "simulate",
            "simulation.simulation": "Simulation SimulationFailed",
            "simulation.simulations": "Simulations",
            "studies.store": "StudyResult",
            "studies.sweep": "sweep",
        },
    )
