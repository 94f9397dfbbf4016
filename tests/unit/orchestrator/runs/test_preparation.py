"""Values of the user win over the scenario, and values of the scenario over its system."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.cosim import Connection, PortName, System, read_component
from orchestrator.machine.errors import InputError
from orchestrator.runs.preparation import (
    DEFAULT_STEP,
    check_brings_its_own,
    is_path,
    left_behind,
    prepare,
    read_fmu,
)
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import Scenario
from support.archives import fmu, variable

K = PortName("a", "k")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fmu(
        tmp_path_factory.mktemp("fmu") / "a.fmu",
        variable("u", "input"), variable("y", "output"), variable("k", "parameter", start="1"),
    )  # fmt: skip


@pytest.fixture
def system(path: Path) -> System:
    wire = Connection(PortName("a", "y"), PortName("b", "u"))
    return System("s", {name: read_component(name, path) for name in "ab"}, (wire,))


@pytest.mark.parametrize("name", ["stop_time", "step"])
def test_the_user_wins_over_the_scenario_and_the_scenario_over_the_system(system, name):
    given = Scenario("s", stop_time=8.0, step=0.5)
    owns = replace(system, stop_time=16.0, step=0.25)
    for scenario, request, expected in (
        (given, Request(**{name: 2.0}), 2.0),
        (given, Request(), getattr(given, name)),
        (Scenario("s"), Request(), getattr(owns, name)),
    ):
        assert getattr(prepare(scenario, owns, request).experiment, name) == expected


def test_the_default_step_is_the_papers_and_a_stop_time_is_required(system):
    assert prepare(Scenario("s", stop_time=1.0), system, Request()).experiment.step == DEFAULT_STEP
    with pytest.raises(InputError, match="--stop-time"):
        prepare(Scenario("s"), system, Request())


def test_orders_steps_and_parameters_of_the_user_win(system):
    scenario = Scenario("s", stop_time=1.0, step=0.1, order="jacobi")
    owns = replace(system, steps={"a": 0.2})
    assert prepare(scenario, owns, Request()).experiment.order == "jacobi"
    request = Request(order="gauss-seidel", steps={"a": 0.3, "b": 0.2}, parameters={K: 3.0})
    found = prepare(scenario, owns, request)
    assert found.experiment.order == "gauss-seidel"
    assert found.system.steps == {"a": 0.3, "b": 0.2}
    assert found.system.parameters[K] == 3.0
    # The arguments are unchanged.
    assert owns.steps == {"a": 0.2} and K not in owns.parameters


@pytest.mark.parametrize(
    ("request_", "word"),
    [
        (Request(parameters={PortName.read("c.k"): 1.0}), "'c'"),
        (Request(step=-1.0), "-1 s"),
        (Request(steps={"a": 0.15}), "a"),
        (Request(order=("a",)), "b"),
        (Request(loop="fast"), "'fast'"),
    ],
)
def test_impossible_requests_are_refused_by_name(system, request_, word):
    with pytest.raises(InputError, match=word):
        prepare(Scenario("s", stop_time=1.0, step=0.1), system, request_)


def test_inputs_without_a_source_give_a_warning(system):
    scenario = Scenario("s", stop_time=1.0)
    [doubt] = prepare(scenario, system, Request()).doubts()
    assert "a.u" in doubt and "b.u" not in doubt
    fed = Request(parameters={PortName.read("a.u"): 0.0})
    assert prepare(scenario, system, fed).doubts() == []


def test_identity_changes_with_the_parameters_and_not_with_the_loop(system):
    scenario = Scenario("s", stop_time=1.0)
    whole = prepare(scenario, system, Request())
    assert whole.identity == prepare(scenario, system, Request(loop="python")).identity
    assert whole.identity != prepare(scenario, system, Request(parameters={K: 2.0})).identity


def test_one_fmu_is_a_system(path: Path):
    found = read_fmu(path)
    assert list(found.components) == ["a"] and found.connections == ()


def test_paths_are_told_from_names():
    assert all(map(is_path, ("a.toml", "b/a.ssp", "a.ssd", "OspSystemStructure.xml", "a.fmu")))
    assert not any(map(is_path, ("fig4", "fig4.txt", "toml")))


def test_parts_that_are_lost_with_a_scenario_are_named():
    assert left_behind(Scenario("s")) is None
    assert "events" in str(left_behind(Scenario("s", events=[{"at": 1.0}])))
    check_brings_its_own("mine.ssp", "python")
    for form in (("native", "2"), ("python", "3"), ("python", "2", "win64")):
        with pytest.raises(InputError, match=r"mine\.ssp"):
            check_brings_its_own("mine.ssp", *form)
