"""A scenario and what it is compared with: equal except for the entries of `[compare]`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.commands.main import main
from orchestrator.cosim import PortName
from orchestrator.runs.preparation import load_scenario, prepare, with_companion
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import names, read_scenario
from orchestrator.vehicle.signals import STANDARD
from support.runs import PD, compared
from support.texts import mentions

WAYPOINTS = "x,y,z\n0,0,-2\n3,0,-2\n3,3,-2\n"


def pair_of(text, **request):
    """Prepare both runs of a scenario, from its text."""
    Path("mine.toml").write_text(text)
    request = Request(kind="native", **request)
    return with_companion(prepare(*load_scenario("mine.toml", "native"), request), request)


def runs_of(text):
    Path("mine.toml").write_text(f"stop_time = 1.0\n{text}")
    return compared("mine.toml")


@pytest.mark.parametrize(
    "text",
    [
        "[parameters]\nplanner.eta0.z = -10.0\n" + PD,
        '[components]\nplanner = "PathPlanner"\n[path]\nfile = "path.csv"\n' + PD,
        "[steps]\nplanner = 0.1\n" + PD,
    ],
)
def test_both_follow_the_reference_of_the_scenario(workplace, text):
    Path("path.csv").write_text(WAYPOINTS)
    ours, theirs = runs_of(text)
    assert np.array_equal(ours.group(*STANDARD.y_d), theirs.group(*STANDARD.y_d))
    assert not np.array_equal(ours["plant.eta.x"], theirs["plant.eta.x"])


def test_only_the_listed_differences_differ(workplace):
    ours, theirs = pair_of(
        'only = ["plant", "controller", "planner"]\n'
        '[components]\nplanner = "PathPlanner"\n'
        '[wires]\n"controller.eta" = false\n' + PD
    )
    assert [c.fmu.stem for c in theirs.system.components.values()] == [
        "AuvPlant",
        "PdController",
        "PathPlanner",
    ]
    more = {str(c.target) for c in {*theirs.system.connections} - {*ours.system.connections}}
    assert more == {f"controller.dy.{axis}" for axis in "xyz"}
    assert {*ours.system.connections} < {*theirs.system.connections}
    assert replace(theirs.scenario, compare=None).legend == "PD"


def test_parameters_of_the_user_win_over_the_comparison(workplace):
    """The comparison wins over the scenario; parameters that a controller lacks are left out."""
    text = (
        "[parameters]\nplant.m11 = 26.0\ncontroller.eps_t = 2.0\ncontroller.k_d = 40.0\n"
        + PD
        + "parameters.plant.m11 = 27.0\nparameters.controller.K1 = [1.0, 2.0, 3.0]\n"
    )
    for given, mass in (({}, 27.0), ({"plant.m11": 28.0, "controller.k_d": 30.0}, 28.0)):
        own, other = (prepared.system for prepared in pair_of(text, parameters=given))
        assert own.value(PortName.read("plant.m11")) == given.get("plant.m11", 26.0)
        assert other.value(PortName.read("plant.m11")) == mass
        assert other.value(PortName.read("controller.eps_t")) == 2.0
        assert other.value(PortName.read("controller.K1[3]")) == 3.0
        assert not other.has(PortName.read("controller.k_d"))


def test_a_table_of_inputs_goes_for_both(workplace):
    Path("tide.csv").write_text("time,plant.water.x\n0.0,0.25\n")
    event = '[[events]]\nat = 0.5\noverride = { "plant.water.x" = 0.3 }\n'
    for table in runs_of('[inputs]\nfile = "tide.csv"\n' + event + PD):
        assert set(table["plant.water.x"]) == {0.25, 0.3}


def test_wires_are_removed_in_either_table(workplace):
    own = '[components]\ncontroller = "PdController"\n[wires]\n"controller.dy" = "plant.dy"\n'
    other = '[compare]\nname = "proposed"\ncomponents.controller = "ObserverController"\n'
    wires = 'wires."controller.dy" = false\nwires."plant.tau_w" = false\n'
    ours, theirs = pair_of(own + other + wires)
    lost = {str(c.target) for c in {*ours.system.connections} - {*theirs.system.connections}}
    assert lost == {
        *(f"controller.dy.{axis}" for axis in "xyz"),
        *(f"plant.tau_w.{axis}" for axis in "uvwpqr"),
    }


def test_references_that_differ_are_said(workplace, capsys):
    Path("mine.toml").write_text("stop_time = 1.0\n" + PD + "parameters.planner.tau_d.u = 3.0\n")
    assert main(["run", "mine.toml", "--no-figures", "--kind", "native"]) == 0
    message = capsys.readouterr().err
    assert mentions(message, "pd: reference planner.y_d mine")


#: Scenarios with a second run, which has another controller, or another law of guidance.
COMPARED = [name for name in names() if read_scenario(name).compare]
LAW = PortName(STANDARD.planner, "law")


@pytest.mark.parametrize("name", COMPARED)
def test_the_ready_scenarios_compare_the_other_controller_or_law(name):
    """Everything else is the same."""
    request = Request(kind="native")
    ours, theirs = (
        prepared.system
        for prepared in with_companion(prepare(*load_scenario(name, "native"), request), request)
    )
    assert ours.components.keys() == theirs.components.keys()
    for component, part in ours.components.items():
        other = theirs.components[component]
        is_guided = ours.has(LAW)
        if component.rpartition(".")[2] == STANDARD.controller and not is_guided:
            models = part.description.modelName, other.description.modelName
            assert models == ("ObserverController", "PdController")
            continue
        assert part.digest == other.digest
        for variable in part.having("parameter"):
            port = PortName(component, variable.name)
            assert (ours.value(port) == theirs.value(port)) == (port != LAW)


@pytest.mark.parametrize("name", ["fig5", "fig6"])
def test_scenarios_of_the_pd_controller_are_the_companions(name):
    """Figures 5 and 6 have one each."""
    request = Request(kind="native")
    _, companion = with_companion(prepare(*load_scenario(name, "native"), request), request)
    own = prepare(*load_scenario(f"{name}-pd", "native"), request)
    assert own.identity == companion.identity
