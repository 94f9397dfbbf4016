"""Events in programs of systems: the rows of their FMUs, and what has happened, bit for bit."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fmus.compilers import machines_compiler
from orchestrator.master.observers.table import Table
from orchestrator.program.components import definitions_of
from orchestrator.program.events import agenda_of, occurrences
from orchestrator.program.writer import Text
from orchestrator.runs.loading import load_scenario
from orchestrator.runs.preparation import Prepared, prepare, with_companion
from orchestrator.runs.request import Request
from orchestrator.system.values import items_of

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")

DOUBLES = ctypes.POINTER(ctypes.c_double)

#: Of all kinds, at times and conditions, one upon the other.
ALL = """
stop_time = 20.0
step = 0.01
[parameters]
planner.eta0.z = -2.0
[[events]]
at = 2.0
for = 3.0
override = { controller.tau.u = 15.0 }
[[events]]
at = 3.0
for = 1.0
bias = { plant.y = 0.2 }
[[events]]
at = 3.5
for = 4.0
freeze = "planner.y_d"
[[events]]
when = "plant.nu.u > 0.2"
repeat = true
for = 0.5
set = { controller.eps_t = 2.0, plant.current.x = 0.1 }
[[events]]
at = 5.0
set = { plant.water = [0.1, 0.2, 0.0] }
[[events]]
at = 6.0
for = 2.0
set = { plant.water.x = 0.4 }
[[events]]
at = 7.0
release = "planner.y_d"
[[events]]
at = 7.0
for = 3.0
set = { plant.water.x = 0.2 }
[[events]]
at = 9.0
bias = { plant.water.x = 0.3 }
[[events]]
at = 10.0
reset = ["controller"]
[[events]]
at = 10.003
reset = ["plant", "disturbance"]
[[events]]
at = 12.0
release = "plant.water"
[[events]]
at = 15.0
drop = "plant.y"
LAST
"""

#: An event that undoes its own condition, and so happens more often than is listed.
CHATTERING = """
[[events]]
at = 6.0
set = { plant.water.z = 0.01 }
[[events]]
when = "plant.water.z > 0.001"
repeat = true
for = 0.01
override = { plant.water.z = 0.0 }
"""

ENDS = {
    "whole": '[[events]]\nwhen = "plant.eta.x < 1e9"\nstop = true',
    "chattering": CHATTERING,
    "stopped": "[[events]]\nat = 18.0\nstop = true",
    "stopped at a condition": '[[events]]\nwhen = "controller.tau.u < 2.0"\nstop = true',
    "at the start": "[[events]]\nat = 0.0\nfor = 0.02\noverride = { plant.water.y = 0.5 }",
    "refused": "[[events]]\nat = 18.0\noverride = { disturbance.tau_w.u = 1e300 }",
}

ORDERS = ("feedthrough", "gauss-seidel", "jacobi")


def runs(scenario: str, order: str | None = None, **request: Any) -> list[Prepared]:
    """A scenario, and what it is compared with."""
    asked = Request(scenario, kind="native", order=order, **request)
    own = prepare(*load_scenario(scenario, "native"), asked)
    return with_companion(own, asked)


def check(run: Prepared, folder: Path) -> None:
    """Compare the program of a run with its FMUs."""
    table = Table()
    ending = run.run([table])
    text = Text(run.plan, definitions_of(run.plan.system), alters=True)
    library = compiled(text, folder)
    experiment = text.plan.experiment
    parameters = (ctypes.c_double * len(text.parameters))(*values_of(text))
    size = library.size_of_simulation()
    simulation, ahead = (ctypes.create_string_buffer(size) for _ in range(2))
    rows = np.zeros((experiment.rows, 1 + len(text.columns)))
    assert not library.begin(
        simulation, parameters, experiment.start_time, experiment.step, experiment.stop_time,
        experiment.full_steps, experiment.rows - 1,
    )  # fmt: skip
    agenda = agenda_of(text, run.events)
    for until in (experiment.rows // 3, experiment.rows - 1):
        outcome = library.run_with_events(
            simulation, ahead, until, *map(pointer, (rows,)), parameters, len(run.events),
            *map(pointer, agenda),
        )  # fmt: skip
        if outcome:
            break
    assert outcome == (1 if ending.failure else 2 if ending.remark else 0)
    columns = [i for i, name in enumerate(table.columns) if not name.endswith(".fault")]
    assert [table.columns[i] for i in columns] == [*map(str, text.columns)]
    rows = rows[: library.rows_shown(simulation)]
    assert rows[:, 0].tolist() == table.time.tolist()
    wanted = table.rows[:, [0, *(1 + i for i in columns)]]
    for i, name in enumerate(("time", *text.columns)):
        np.testing.assert_array_equal(rows[:, i], wanted[:, i], str(name))
    assert occurrences(run.events, agenda.happened, experiment) == [*ending.events]


def values_of(text: Text) -> list[float]:
    """What a run begins with."""
    system, found = text.plan.system, []
    for name in text.parameters:
        value = system.value(name)
        variable = system.components[name.component].variables[name.port]
        found.append(float(items_of(variable).get(value, value)))
    return found


def pointer(values: np.ndarray) -> Any:
    """Where they are."""
    return values.ctypes.data_as(DOUBLES)


def compiled(text: Text, folder: Path) -> ctypes.CDLL:
    """The program as a library."""
    (folder / "program.c").write_text(text.text())
    command = [
        str(machines_compiler()), "-std=c99", "-O1", "-fno-math-errno", "-ffp-contract=off",
        "-Wall", "-Wextra", "-Wno-unused", "-fPIC", "-shared", "program.c", "-o", "program.so",
        "-lm",
    ]  # fmt: skip
    process = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stderr
    library = ctypes.CDLL(str(folder / "program.so"))
    library.size_of_simulation.restype = ctypes.c_size_t
    library.begin.argtypes = (
        ctypes.c_void_p, DOUBLES, *[ctypes.c_double] * 3, ctypes.c_int, ctypes.c_int,
    )  # fmt: skip
    return library


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("last", ENDS)
def test_events_of_all_kinds_do_what_they_do_to_fmus(last, order, tmp_path):
    scenario = tmp_path / "mine.toml"
    scenario.write_text(ALL.replace("LAST", ENDS[last]))
    check(runs(str(scenario), order)[0], tmp_path)


@pytest.mark.parametrize(
    "name", ["current-step", "fault-sensor", "fault-thruster", "formation-lost-link"]
)
def test_events_of_scenarios_do_what_they_do_to_fmus(name, tmp_path):
    for run in runs(name):
        # A library that is loaded is not loaded again from the same place.
        folder = tmp_path / run.scenario.name
        folder.mkdir()
        check(run, folder)
