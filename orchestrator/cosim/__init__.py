"""A co-simulation master for any FMUs, and for systems of SSP and OSP.

    from pathlib import Path
    from orchestrator.cosim import Experiment, Table, make_plan, read_ssp, simulate_plan

    table = Table()
    plan = make_plan(read_ssp(Path("system.ssp")), Experiment(stop_time=10.0, step=0.01))
    ending = simulate_plan(plan, [table])
    print(ending.failure or table["gain.y"][-1])

It does not depend on any component, and imports only `orchestrator.machine` of this product. Its
names are imported on first use; its modules are private.

The loop, in :func:`.simulation.simulate_plan`::

    exchange initial values until they rest
    pass the first row to the observers
    for every step from t to t + h:
        call the hooks that are due
        for every stage of the step:
            gather the inputs of its components
            step each of them, then read their outputs
        pass the row to the observers
        stop if an FMU has failed, or a signal has arrived
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from orchestrator.machine.lazy import offered

if TYPE_CHECKING:
    from orchestrator.cosim.checkpoint import Checkpoints as Checkpoints
    from orchestrator.cosim.component import Component as Component
    from orchestrator.cosim.component import read_component as read_component
    from orchestrator.cosim.connection import Connection as Connection
    from orchestrator.cosim.connection import Linear as Linear
    from orchestrator.cosim.connection import Mapped as Mapped
    from orchestrator.cosim.connection import PortName as PortName
    from orchestrator.cosim.events import Alter as Alter
    from orchestrator.cosim.events import Condition as Condition
    from orchestrator.cosim.events import Event as Event
    from orchestrator.cosim.events import Events as Events
    from orchestrator.cosim.events import Freeze as Freeze
    from orchestrator.cosim.events import Release as Release
    from orchestrator.cosim.events import Reset as Reset
    from orchestrator.cosim.events import Set as Set
    from orchestrator.cosim.events import Stop as Stop
    from orchestrator.cosim.experiment import Exchange as Exchange
    from orchestrator.cosim.experiment import Experiment as Experiment
    from orchestrator.cosim.experiment import Order as Order
    from orchestrator.cosim.fmi.binary import check_binary as check_binary
    from orchestrator.cosim.fmi.isolated import Isolation as Isolation
    from orchestrator.cosim.formats.osp import read_osp as read_osp
    from orchestrator.cosim.formats.osp import write_osp as write_osp
    from orchestrator.cosim.formats.ssp_reader import read_parameter_set as read_parameter_set
    from orchestrator.cosim.formats.ssp_reader import read_ssp as read_ssp
    from orchestrator.cosim.formats.ssp_writer import write_ssp as write_ssp
    from orchestrator.cosim.hooks import Hook as Hook
    from orchestrator.cosim.hooks import InputTable as InputTable
    from orchestrator.cosim.hooks import RealTime as RealTime
    from orchestrator.cosim.hooks import Run as Run
    from orchestrator.cosim.observers import Ending as Ending
    from orchestrator.cosim.observers import Header as Header
    from orchestrator.cosim.observers import Observer as Observer
    from orchestrator.cosim.observers import Occurrence as Occurrence
    from orchestrator.cosim.observers import Selection as Selection
    from orchestrator.cosim.observers import Table as Table
    from orchestrator.cosim.observers import TableFile as TableFile
    from orchestrator.cosim.plan import Plan as Plan
    from orchestrator.cosim.plan import make_plan as make_plan
    from orchestrator.cosim.simulation import Session as Session
    from orchestrator.cosim.simulation import simulate_plan as simulate_plan
    from orchestrator.cosim.stages import Stage as Stage
    from orchestrator.cosim.stages import Visit as Visit
    from orchestrator.cosim.system import System as System
    from orchestrator.cosim.variables import Value as Value
    from orchestrator.cosim.variables import Variable as Variable

_MODULES = {
    "checkpoint": "Checkpoints",
    "component": "Component read_component",
    "connection": "Connection Linear Mapped PortName",
    "events": "Alter Condition Event Events Freeze Release Reset Set Stop",
    "experiment": "Exchange Experiment Order",
    "fmi.binary": "check_binary",
    "fmi.isolated": "Isolation",
    "formats.osp": "read_osp write_osp",
    "formats.ssp_reader": "read_parameter_set read_ssp",
    "formats.ssp_writer": "write_ssp",
    "hooks": "Hook InputTable RealTime Run",
    "observers": "Ending Header Observer Occurrence Selection Table TableFile",
    "plan": "Plan make_plan",
    "simulation": "Session simulate_plan",
    "stages": "Stage Visit",
    "system": "System",
    "variables": "Value Variable",
}

if not TYPE_CHECKING:
    __getattr__, __dir__ = offered(__name__, _MODULES)
__all__ = [*" ".join(_MODULES.values()).split()]  # noqa: PLE0604
