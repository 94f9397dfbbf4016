"""A scenario and the one that it is compared with: two controllers in the same surroundings."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from orchestrator.commands.main import main
from orchestrator.cosim.observers.table import Table
from orchestrator.cosim.system.names import PortName
from orchestrator.runs.bundle import current_fmus
from orchestrator.runs.loading import load_scenario
from orchestrator.runs.preparation import prepare, with_companion
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import names, read_scenario, role_of
from orchestrator.vehicle.signals import STANDARD
from support.markdown import DOCS, blocks
from support.texts import mentions

WAYPOINTS = "x,y,z\n0,0,-2\n3,0,-2\n3,3,-2\n"

PD = '[components]\ncontroller = "PdController"\n[wires]\n"controller.dy" = "plant.dy"\n'


def pair_of(text):
    """The two systems, from the text of a scenario."""
    Path("mine.toml").write_text(text)
    request = Request(kind="native")
    return with_companion(prepare(*load_scenario("mine.toml", "native"), request), request)


def runs_of(text, stop_time=1.0):
    tables = []
    for prepared in pair_of(f"stop_time = {stop_time}\n{text}"):
        table = Table()
        prepared.run([table])
        tables.append(table)
    return tables


@pytest.mark.parametrize(
    "text",
    [
        'compare = "fig5-pd"\n',
        'compare = "path-pd"\n',
        f'compare = "fig5"\n{PD}',
        f'compare = "fig4"\n{PD}[parameters]\nplanner.eta0.z = -10.0\n',
        'compare = "fig5-pd"\n[components]\nplanner = "PathPlanner"\n[path]\nfile = "path.csv"\n',
        'compare = "path-pd"\n[steps]\nplanner = 0.1\n',
        'compare = "other.toml"\n',
    ],
)
def test_both_follow_the_reference_of_the_scenario(workplace, text):
    Path("path.csv").write_text(WAYPOINTS)
    Path("other.toml").write_text(
        f"{PD}[steps]\nplanner = 0.5\n[parameters]\nplanner.tau_d.u = 3.0\n"
    )
    ours, theirs = runs_of(text)
    assert np.array_equal(ours.group(*STANDARD.y_d), theirs.group(*STANDARD.y_d))
    assert not np.array_equal(ours["plant.eta.x"], theirs["plant.eta.x"])


def test_both_follow_the_same_reference_in_the_example_of_the_guide(workplace):
    example = next(block.text for block in blocks(DOCS / "how-to" / "events.md", "toml"))
    ours, theirs = runs_of(example.replace("stop_time = 40.0\n", ""), 12.0)
    assert ours["planner.y_d.z"][0] == -2.0
    assert np.array_equal(ours.group(*STANDARD.y_d), theirs.group(*STANDARD.y_d))


def test_the_surroundings_are_those_of_the_scenario_and_the_controller_is_its_own(workplace):
    ours, theirs = pair_of(
        'compare = "fig5-pd"\n'
        'only = ["plant", "controller", "planner"]\n'
        '[components]\nplanner = "PathPlanner"\n'
        '[wires]\n"controller.eta" = false\n'
    )
    assert [c.fmu.stem for c in theirs.system.components.values()] == [
        "AuvPlant",
        "PdController",
        "PathPlanner",
    ]
    targets = {str(c.target) for c in theirs.system.connections}
    assert {"controller.dy.x", "controller.eta.psi"} <= targets
    assert "controller.eta.psi" not in {str(c.target) for c in ours.system.connections}


def test_where_the_controller_is_the_same_another_component_is_compared(workplace):
    """Its FMU does not go to the companion, which would be the scenario itself then."""
    shutil.copy(current_fmus("native") / "AuvPlant.fmu", "mine.fmu")
    ours, theirs = pair_of('compare = "fig4"\n[components]\nplant = "mine.fmu"\n')
    plants = [prepared.system.components["plant"].fmu.name for prepared in (ours, theirs)]
    assert plants == ["mine.fmu", "AuvPlant.fmu"]


@pytest.mark.parametrize("name", names())
def test_the_pairs_of_the_ready_scenarios_are_what_their_files_say(name):
    prepared = prepare(*load_scenario(name), Request())
    for companion in with_companion(prepared, Request())[1:]:
        _, system = load_scenario(companion.scenario.name)
        assert companion.system.components.keys() == system.components.keys()
        for component, theirs in system.components.items():
            assert companion.system.components[component].digest == theirs.digest
        assert set(companion.system.connections) == set(system.connections)


def test_references_that_differ_are_said(workplace, capsys):
    """An event of the companion alone turns its planner back."""
    Path("other.toml").write_text(f'{PD}[[events]]\nat = 0.5\nreset = "planner"\n')
    Path("mine.toml").write_text('compare = "other.toml"\nstop_time = 1.0\n')
    assert main(["run", "mine.toml", "--no-figures", "--kind", "native"]) == 0
    said = capsys.readouterr().err
    assert mentions(said, "other: reference planner.y_d mine")
    for name in ("fig5", "path"):
        assert read_scenario(name).compare
        assert main(["run", name, "--stop-time", "1", "--no-figures", "--kind", "native"]) == 0
        assert "its reference" not in capsys.readouterr().err


def test_parameters_that_differ_are_said(workplace, capsys):
    """Not those of the controllers, which are compared, and nothing where it is one controller."""
    command = ["run", "mine.toml", "--stop-time", "0.1", "--no-figures", "--kind", "native"]
    for text, said in (
        ("", "fig5-pd: mine's plant.noise.std = 0.0, 0.001;"),
        ("parameters.plant.noise.std = 0.0\nparameters.controller.k_d = 9.0\n", ""),
        (f"{PD}[parameters]\ncontroller.eps_t = 5.0\n", ""),
    ):
        Path("mine.toml").write_text(f'compare = "fig5-pd"\n{text}')
        assert main(command) == 0
        warned = [line for line in capsys.readouterr().err.splitlines() if "warning: fig5" in line]
        assert len(warned) == bool(said)
        assert mentions("".join(warned), said)


@pytest.mark.parametrize("name", [name for name in names() if read_scenario(name).compare])
def test_the_ready_scenarios_give_their_companions_the_same_parameters(name):
    ours, theirs = (
        {
            port: system.value(port)
            for component in system.components.values()
            for variable in component.having("parameter")
            if role_of(component.name) != STANDARD.controller
            for port in [PortName(component.name, variable.name)]
        }
        for system in (
            one.system
            for one in with_companion(prepare(*load_scenario(name), Request()), Request())
        )
    )
    assert ours == theirs


def test_an_event_of_the_scenario_leaves_a_table_of_the_companion_alone(workplace):
    """Both have the input, but only in the companion does it follow a table."""
    Path("tide.csv").write_text("time,plant.water.x\n0.0,0.25\n")
    Path("other.toml").write_text('title = "other"\n[inputs]\nfile = "tide.csv"\n')
    event = '[[events]]\nat = 0.5\nset = { "plant.water.x" = 0.3 }\n'
    ours, theirs = runs_of(f'compare = "other.toml"\n{event}')
    assert set(ours["plant.water.x"]) == {0.0, 0.3}
    assert set(theirs["plant.water.x"]) == {0.25}
