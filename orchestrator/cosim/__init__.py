"""A co-simulation master for any FMUs, and for systems of SSP and OSP.

    from pathlib import Path
    from orchestrator.cosim import Experiment, Table, make_plan, read_ssp, simulate_plan

    table = Table()
    plan = make_plan(read_ssp(Path("system.ssp")), Experiment(stop_time=10.0, step=0.01))
    ending = simulate_plan(plan, [table])
    print(ending.failure or table["gain.y"][-1])

It knows no component, and imports `orchestrator.machine` and nothing else of this product. What it
offers is named here, imported on first use; the modules in it are private.

The loop, in :func:`.simulation.simulate_plan`::

    exchange initial values until they rest
    tell the observers the first row
    for every step from t to t + h:
        let hooks act whose time has come
        for every stage of the schedule:
            gather the inputs of its components
            step each of them, then read their outputs
        tell the observers the row
        stop if an FMU has failed, or a signal says so
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from orchestrator.machine.lazy import offered

if TYPE_CHECKING:
    from orchestrator.cosim.checkpoint import Checkpoints
    from orchestrator.cosim.component import Component, read_component
    from orchestrator.cosim.connection import Connection, Linear, Mapped, PortName, join_terminals
    from orchestrator.cosim.events import (
        Action,
        Alter,
        Condition,
        Event,
        Events,
        Freeze,
        Release,
        Reset,
        Set,
        Stop,
    )
    from orchestrator.cosim.experiment import (
        INITIAL,
        CouplingName,
        Exchange,
        Experiment,
        Order,
        OrderName,
    )
    from orchestrator.cosim.fmi.binary import binary_of, check_binary, runs_python
    from orchestrator.cosim.fmi.isolated import Isolation
    from orchestrator.cosim.formats.archive import read_document
    from orchestrator.cosim.formats.osp import read_osp, write_osp
    from orchestrator.cosim.formats.ssp_reader import bind_parameter_set, read_ssp
    from orchestrator.cosim.formats.ssp_writer import PARAMETER_SET, ssp_bytes, write_ssp
    from orchestrator.cosim.hooks import Hook, InputTable, Playback, RealTime, Run
    from orchestrator.cosim.loop import LOOPS, PYTHON_LOOP, LoopName, Stepping, choose_loop
    from orchestrator.cosim.observers import (
        TABLE_FORMATS,
        CsvLines,
        Ending,
        Header,
        Observer,
        Occurrence,
        Progress,
        Selection,
        Table,
        TableFormat,
        every,
    )
    from orchestrator.cosim.plan import Plan, make_plan
    from orchestrator.cosim.row import FACTOR, OFFSET
    from orchestrator.cosim.simulation import simulate_plan, simulate_to_end
    from orchestrator.cosim.stages import Stage, Stages, Visit, stages_of, types_read
    from orchestrator.cosim.system import System
    from orchestrator.cosim.variables import TYPES, Standing, StringTable, Value, Variable

__all__ = [
    "FACTOR",
    "INITIAL",
    "LOOPS",
    "OFFSET",
    "PARAMETER_SET",
    "PYTHON_LOOP",
    "TABLE_FORMATS",
    "TYPES",
    "Action",
    "Alter",
    "Checkpoints",
    "Component",
    "Condition",
    "Connection",
    "CouplingName",
    "CsvLines",
    "Ending",
    "Event",
    "Events",
    "Exchange",
    "Experiment",
    "Freeze",
    "Header",
    "Hook",
    "InputTable",
    "Isolation",
    "Linear",
    "LoopName",
    "Mapped",
    "Observer",
    "Occurrence",
    "Order",
    "OrderName",
    "Plan",
    "Playback",
    "PortName",
    "Progress",
    "RealTime",
    "Release",
    "Reset",
    "Run",
    "Selection",
    "Set",
    "Stage",
    "Stages",
    "Standing",
    "Stepping",
    "Stop",
    "StringTable",
    "System",
    "Table",
    "TableFormat",
    "Value",
    "Variable",
    "Visit",
    "binary_of",
    "bind_parameter_set",
    "check_binary",
    "choose_loop",
    "every",
    "join_terminals",
    "make_plan",
    "read_component",
    "read_document",
    "read_osp",
    "read_ssp",
    "runs_python",
    "simulate_plan",
    "simulate_to_end",
    "ssp_bytes",
    "stages_of",
    "types_read",
    "write_osp",
    "write_ssp",
]

__getattr__, __dir__ = offered(
    __name__,
    {
        "experiment": "CouplingName Exchange Experiment INITIAL Order OrderName",
        "fmi.binary": "binary_of check_binary runs_python",
        "fmi.isolated": "Isolation",
        "formats.osp": "read_osp write_osp",
        "formats.archive": "read_document",
        "formats.ssp_reader": "bind_parameter_set read_ssp",
        "formats.ssp_writer": "PARAMETER_SET ssp_bytes write_ssp",
        "checkpoint": "Checkpoints",
        "events": "Action Alter Condition Event Events Freeze Release Reset Set Stop",
        "hooks": "Hook InputTable Playback RealTime Run",
        "loop": "LOOPS LoopName PYTHON_LOOP Stepping choose_loop",
        "observers": "CsvLines Ending Header Observer Occurrence Progress Selection TABLE_FORMATS "
        "Table TableFormat every",
        "plan": "Plan make_plan",
        "row": "FACTOR OFFSET",
        "simulation": "simulate_plan simulate_to_end",
        "stages": "Stage Stages Visit stages_of types_read",
        "component": "Component read_component",
        "connection": "Connection Linear Mapped PortName join_terminals",
        "system": "System",
        "variables": "Standing StringTable TYPES Value Variable",
    },
)
