"""Scenario files: their entries, their tables, events, and mistakes by name."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim import Alter, Connection, Freeze, Linear, Mapped, PortName, Set, System
from orchestrator.machine.errors import InputError, Refused
from orchestrator.runs.preparation import load, load_scenario, prepare
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import (
    Difference,
    Inputs,
    Scenario,
    check_events,
    names,
    path_parameters,
    read_events,
    read_inputs,
    read_scenario,
    shared_events,
)
from orchestrator.runs.scenario_file import ScenarioFile
from support.texts import mentions

TEXT = """
title = "Mine"
stop_time = 3
only = ["plant"]
[components]
controller = "own/mine.fmu"
plant = "AuvPlant"
[wires]
"plant.tau" = false
[parameters]
plant.noise.std = 0.0
"controller.K1[1]" = 12.0
[ours]
plant.noise.std = "no sensor"
[compare]
name = "heavy"
components.plant = "own/heavy.fmu"
parameters.plant.m11 = 30.0
"""

U = PortName.read("plant.tau.u")


def read(folder: Path, text: str) -> Scenario:
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    return read_scenario(str(folder / "mine.toml"))


def test_entries_are_read_and_paths_are_relative_to_the_file(tmp_path: Path):
    found = read(tmp_path, TEXT)
    assert (found.name, found.stem, found.title, found.stop_time) == ("mine", "mine", "Mine", 3)
    assert found.compare == Difference(
        "heavy",
        components={"plant": str(tmp_path / "own/heavy.fmu")},
        parameters={PortName.read("plant.m11"): 30.0},
    )
    assert found.components == {
        "controller": str(tmp_path / "own/mine.fmu"), "plant": "AuvPlant",
    }  # fmt: skip
    assert found.wires == {"plant.tau": False}
    parameters = {str(name): value for name, value in found.parameters.items()}
    assert parameters == {"plant.noise.std": 0.0, "controller.K1[1]": 12.0}
    assert found.ours == {"plant.noise.std": "no sensor"}
    assert found.digest == sha256(TEXT.encode()).hexdigest()


def test_an_empty_file_is_the_closed_loop(tmp_path: Path):
    found = read(tmp_path, "")
    assert found == Scenario("mine", digest=sha256(b"").hexdigest())
    assert (found.legend, found.figure, found.stop_time) == ("mine", "tracking", None)


@pytest.mark.parametrize(
    ("text", "culprits"),
    [
        ("stop_tme = 1", "'stop_tme' stop_time"),
        ('stop_time = "long"', "stop_time 'long'"),
        ('only = "plant"', "only"),
        ('coupling = "loose"', "coupling 'loose'"),
        ("steps.plant = true", "steps"),
        ('[wires]\n"plant.tau" = true', "wires"),
        ("events = 1", "events"),
        ("inputs = {}", "inputs file"),
        ("[inputs]\nfile = 3", "file 3"),
        ('[inputs]\nfile = "a.csv"\nform = "x"', "'form'"),
        ('[inputs]\nfile = "a.csv"\nbetween = "spline"', "'spline' linear hold"),
        ("[path]", "path file"),
        ('[path]\nfiel = "path.csv"', "path 'fiel' file?"),
        ('[path]\nfile = "none.csv"', "none.csv"),
        ('[path]\nfile = "path.csv"\n[parameters]\nplanner.count = 2', "planner.count path.csv"),
        ("[parameters]\nell = 1.0", "'ell'"),
        ("stop_time = ", "mine.toml"),
        ("title = 1\nlabel = 2", "title 1 more"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, culprits: str):
    (tmp_path / "path.csv").write_text("x,y,z\n0,0,0\n9,0,0\n")
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    assert mentions(str(error.value), culprits), error.value


def test_unknown_names_are_refused_with_a_suggestion():
    with pytest.raises(InputError, match="fig4"):
        read_scenario("fig44")
    assert "fig4" in names()


def test_every_entry_of_a_scenario_can_be_written():
    fields = set(Scenario.__dataclass_fields__) - {"name", "digest"}
    assert ScenarioFile.model_fields.keys() == fields | {"path"}


def read_table(tmp_path, text, between="linear", given=(), scenario="fig3a"):
    file = tmp_path / "inputs.csv"
    file.write_text(text)
    system, [table] = read_inputs([Inputs(file, between)], load(scenario, "native"), given)
    return system, table


def test_a_run_begins_with_the_values_of_the_table_at_its_start(tmp_path):
    text = "time,plant.tau.u,plant.tau.q\n-1,0.0,5.0\n1,4.0,5.0\n"
    system, _ = read_table(tmp_path, text)
    assert system.parameters[U] == 2.0
    system, _ = read_table(tmp_path, text, "hold")
    assert system.parameters[U] == 0.0
    system, _ = read_table(tmp_path, "time,plant.tau.u\n3,8.0\n")
    assert system.parameters[U] == 8.0


def test_interpolation_does_not_overflow(tmp_path):
    """Between finite ends, all values are finite."""
    text = "time,plant.tau.u,plant.tau.q\n-1,-1.5e308,2.0\n1,1.5e308,4.0\n"
    system, input_table = read_table(tmp_path, text)
    assert system.parameters[U] == 0.0
    for time, expected in ((-1.0, [-1.5e308, 2.0]), (0.5, [0.75e308, 3.5]), (1.0, [1.5e308, 4.0])):
        row = 1 if time == 1.0 else 0
        np.testing.assert_allclose(input_table.at(time, row), expected, rtol=1e-12)


def test_other_tables_have_other_digests(tmp_path):
    texts = ["time,plant.tau.u\n0,1\n", "time,plant.tau.u\n0,2\n", "time,plant.tau.q\n0,1\n"]
    assert len({read_table(tmp_path, text)[1].digest for text in texts}) == len(texts)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("t,plant.tau.u\n0,1\n", "first column is 't'"),
        ("time\n0\n", "holds no inputs"),
        ("time,plant.tau.u\n", "holds no inputs"),
        ("time,plant.tau.u\n0,nan\n", "must be finite"),
        ("time,plant.tau.u\n1,1\n0,1\n", "times must not decrease"),
        ("time,plant.tau.u\n-1e308,1\n1e308,1\n", "must be less than 1e+308 s apart"),
        ("time,plant.tau.u,plant.tau.u\n0,1,1\n", "two columns have the same name"),
        ("time,plant.tau.x\n0,1\n", "did you mean"),
        ("time,plant.eta.x\n0,1\n", "has causality output"),
        ("time,plant.m11\n0,1\n", "has causality parameter"),
        ("time,plant.tau.u\n0,1\n0,1,2\n", "not a table"),
    ],
)
def test_invalid_tables_of_inputs_are_refused(tmp_path, text, reason):
    with pytest.raises(InputError) as refused:
        read_table(tmp_path, text)
    assert reason in str(refused.value)
    assert "inputs.csv: " in str(refused.value)


def test_a_connected_input_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"is fed by controller\.tau\.u"):
        read_table(tmp_path, "time,plant.tau.u\n0,1\n", scenario="fig4")


def test_a_value_in_addition_to_the_table_is_refused(tmp_path):
    with pytest.raises(InputError, match="a column of the table"):
        read_table(tmp_path, "time,plant.tau.u\n0,1\n", given=[U])
    # A table of the command line wins over the scenario.
    inputs = tmp_path / "inputs.csv"
    prepared = prepare(*load_scenario("fig3a", "native"), Request(kind="native", inputs=inputs))
    assert prepared.system.parameters[U] == 1.0
    assert np.array_equal(prepared.input_tables[0].values, [[1.0]])


def test_two_tables_of_one_input_are_refused_by_its_name(tmp_path):
    inputs = [Inputs(tmp_path / file) for file in ("a.csv", "b.csv")]
    for table in inputs:
        table.file.write_text("time,plant.tau.u\n0,1\n")
    with pytest.raises(InputError) as refused:
        read_inputs(inputs, load("fig3a", "native"), ())
    assert mentions(str(refused.value), "b.csv plant.tau.u a.csv")


def parameters(path: Path, text: str) -> dict[str, object]:
    path.write_text(text, encoding="utf-8")
    return {str(name): value for name, value in path_parameters(path, "planner").items()}


@pytest.mark.parametrize(
    "text",
    [
        "x,y,z\n1,2,3\n4,5,-6.5\n",
        "\ufeffz; X; y\r\n3; 1; 2\r\n-6.5; 4; 5\r\n",
        '"x"\t"y"\t"z"\n1\t2\t3\n4\t5\t-6.5\n\n',
    ],
)
def test_waypoints_without_times_are_passed_at_the_cruise_speed(tmp_path: Path, text: str):
    assert parameters(tmp_path / "path.csv", text) == {
        "planner.count": 2,
        "planner.waypoint[1].x": 1.0,
        "planner.waypoint[1].y": 2.0,
        "planner.waypoint[1].z": 3.0,
        "planner.waypoint[2].x": 4.0,
        "planner.waypoint[2].y": 5.0,
        "planner.waypoint[2].z": -6.5,
    }


def test_waypoints_with_times_are_passed_at_them(tmp_path: Path):
    found = parameters(tmp_path / "path.csv", "t,x,y,z\n0,0,0,0\n20,9,0,0\n")
    assert (found["planner.timed"], found["planner.waypoint[2].t"]) == (True, 20.0)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "columns t, x, y, z"),
        ("x,y\n1,2\n3,4\n", "columns t, x, y, z"),
        ("x,y,z,x\n1,2,3,4\n", "columns x,"),
        ("x,y,z\n1,2,3\n", "1 2 32"),
        ("x,y,z\n" + 33 * "1,2,3\n", "33 2 32"),
        ("x,y,z\n1,2,3\n1,2\n", "line 3 values"),
        ("x,y,z\n1,2,3\n1,2,3,4\n", "line 3 values"),
        ("x,y,z\n1,2,3\n1,2,deep\n", "3, z: 'deep'"),
        ("x,y,z\n1,2,3\n1,2,nan\n", "3, z: 'nan'"),
    ],
)
def test_invalid_tables_of_waypoints_are_refused_in_one_line(
    tmp_path: Path, text: str, reason: str
):
    with pytest.raises(InputError) as error:
        parameters(tmp_path / "path.csv", text)
    assert str(error.value).startswith(f"{tmp_path / 'path.csv'}: ")
    assert mentions(str(error.value), reason)
    assert "\n" not in str(error.value)


def test_path_of_a_scenario_is_relative_to_it_and_sets_its_planner(tmp_path: Path):
    (tmp_path / "path.csv").write_text("x,y,z\n0,0,0\n9,0,0\n")
    found = read(tmp_path, '[path]\nfile = "path.csv"\ncomponent = "leader"\n')
    assert found.parameters[PortName.read("leader.waypoint[2].x")] == 9.0


# Events


@pytest.fixture(scope="module")
def system() -> System:
    return load("fig4", "native")


def read_tables(tables, system):
    check_events("here", tables)
    return read_events("here", tables, system)


def action(system, **table):
    [event] = read_tables([{"at": 1.0, **table}], system)
    return event.action


def ports(*ports):
    return tuple(map(PortName.read, ports))


def test_an_event_on_an_output_acts_on_the_inputs_that_it_feeds(system):
    assert action(system, lose="plant.nu_r.u") == Alter(
        "override", ((PortName("disturbance", "nu.u"), 0.0),)
    )
    assert action(system, freeze="plant.eta.psi") == Freeze(ports("controller.eta.psi"))
    assert action(system, freeze="controller.eta.psi") == Freeze(ports("controller.eta.psi"))


def test_an_event_on_a_group_acts_on_its_members(system):
    ys = ports("controller.y.x", "controller.y.y", "controller.y.z")
    assert action(system, drop="plant.y") == Freeze(ys)
    assert action(system, override={"plant.y": [1.0, 2.0, 3.0]}) == Alter(
        "override", tuple(zip(ys, (1.0, 2.0, 3.0), strict=True))
    )
    taken = action(system, set={"controller": {"K1": 9.0}})
    assert taken == Set(tuple((PortName("controller", f"K1[{i}]"), 9.0) for i in (1, 2, 3)), ())


def test_events_apply_the_transformation_of_a_connection(system):
    source, target = PortName.read("plant.eta.phi"), PortName.read("controller.eta.phi")

    def through(transformation, **table):
        wires = (Connection(source, target, transformation),)
        return action(replace(system, connections=wires), **table)

    degrees = Linear(57.0, 1.0)
    name = "plant.eta.phi"
    assert through(degrees, override={name: 2.0}) == Alter("override", ((target, 115.0),))
    assert through(degrees, bias={name: 2.0}) == Alter("bias", ((target, 114.0),))
    # A bias of the input itself is in the units of the input.
    assert through(degrees, bias={str(target): 2.0}) == Alter("bias", ((target, 2.0),))
    for kind in ("override", "bias"):
        with pytest.raises(InputError, match=rf"phi: 1e\+300 is inf where it arrives, at {target}"):
            through(Linear(1e300), **{kind: {name: 1e300}})
    mapped = Mapped(((0.0, 7.0), (1.0, 5.0)))
    assert through(mapped, override={name: 1.0}) == Alter("override", ((target, 5.0),))
    assert through(mapped, override={name: 2.0}) == Alter("override", ((target, 2.0),))
    with pytest.raises(InputError, match="added"):
        through(mapped, bias={name: 2.0})


@given(
    source=st.sampled_from(["plant.eta.phi", "plant.fault", "controller.tau.u"]),
    transformation=st.one_of(
        st.none(),
        st.builds(Linear, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3)),
        st.dictionaries(st.integers(-2, 2), st.floats(-9, 9), max_size=5).map(
            lambda table: Mapped(tuple(table.items()))
        ),
    ),
)
def test_to_lose_a_signal_is_to_override_it_with_zero(system, source, transformation):
    target = PortName.read("controller.eta.phi")
    wires = (Connection(PortName.read(source), target, transformation),)
    wired = replace(system, connections=wires)
    lost = action(wired, lose=source)
    assert lost == action(wired, override={source: 0})
    [(reached, arriving)] = lost.values
    expected = {None: 0.0}.get(transformation)
    if isinstance(transformation, Linear):
        expected = transformation.offset
    elif isinstance(transformation, Mapped):
        expected = dict(transformation.pairs).get(0, 0)
    assert (reached, float(arriving)) == (target, expected)


@pytest.mark.parametrize(
    ("table", "reason"),
    [
        ({"lose": "plant.tau.u"}, "at when"),
        ({"at": 1.0, "when": "plant.eta.z > 1", "lose": "plant.tau.u"}, "at when"),
        ({"at": 1.0}, "set, override"),
        ({"at": 1.0, "lose": "a.b", "drop": "a.b"}, "lose drop"),
        ({"at": -1.0, "stop": True}, "at -1.0 0"),
        ({"at": float("nan"), "stop": True}, "finite"),
        ({"at": 1.0, "lose": "plant.tau.u", "for": 0.0}, "for 0.0 positive"),
        ({"at": 1.0, "stop": True, "for": 1.0}, "stop duration"),
        ({"at": 1.0, "repeat": True, "stop": True}, "repeat `when`"),
        ({"at": 1.0, "loose": "plant.tau.u"}, "'loose' lose"),
        ({"at": True, "stop": True}, "at number"),
        ({"at": 1.0, "stop": False}, "stop"),
        ({"at": 1.0, "set": {"plant.m11": 3.0}}, "plant.m11 fixed"),
        ({"at": 1.0, "set": {"plant.tau.u": 3.0}}, "controller.tau.u override"),
        ({"at": 1.0, "set": {"plant.eta.x": 3.0}}, "has causality output"),
        ({"at": 1.0, "set": {"controller.k_d": -3.0}}, "controller.k_d -3"),
        ({"at": 1.0, "set": {"controller.k_d": "much"}}, "controller.k_d real"),
        ({"at": 1.0, "set": {"controller.k_e": 3.0}}, "did you mean"),
        ({"at": 1.0, "lose": "rudder.tau"}, "no component 'rudder'"),
        ({"at": 1.0, "lose": "tau"}, "write COMPONENT.PORT or COMPONENT.PARAMETER"),
        ({"at": 1.0, "lose": "plant.d11"}, "has causality parameter"),
        ({"at": 1.0, "freeze": "controller.e.x"}, "feeds nothing"),
        ({"at": 1.0, "override": {"plant.y": [1.0, 2.0]}}, "2 3"),
        ({"at": 1.0, "override": {"plant.y": float("inf")}}, "must be finite"),
        ({"at": 1.0, "bias": {"plant.y": "much"}}, "cannot be added"),
        ({"at": 1.0, "reset": "rudder"}, "no component 'rudder'"),
        ({"when": "plant.eta.z", "stop": True}, "write a signal"),
        ({"when": "plant.eta.z > x", "stop": True}, "'x'"),
        ({"when": "plant.eta.z > nan", "stop": True}, "'nan'"),
        ({"when": "plant.eta.z < inf", "stop": True}, "'inf'"),
        ({"when": "plant.eta > 1", "stop": True}, "did you mean"),
        ({"when": "plant.d11 > 1", "stop": True}, "has causality parameter"),
    ],
    ids=str,
)
def test_impossible_events_are_refused_with_their_number(system, table, reason):
    tables = [{"at": 0.0, "stop": True}, table]
    with pytest.raises(InputError, match=r"^here: event 2: ") as refused:
        read_tables(tables, system)
    assert mentions(str(refused.value), reason)
    assert "\n" not in str(refused.value)


def test_another_system_keeps_the_events_that_can_happen_to_it(system):
    tables = [{"at": 1.0, "set": {"controller.k_d": 3.0}}, {"at": 1.0, "drop": "plant.y"}]
    assert shared_events(tables, system) == tuple(tables)
    assert shared_events(tables, load("fig5-pd", "native")) == (tables[1],)


def test_all_mistakes_in_a_file_are_found_at_once(tmp_path):
    file = tmp_path / "bad.toml"
    file.write_text(
        "titel = 3\n[[events]]\nat = 1.0\nloose = 3\n[[events]]\nstop = true\n[inputs]\nfile = 3\n"
    )
    with pytest.raises(Refused) as refused:
        read_scenario(str(file))
    found = [problem.partition("bad.toml: ")[2] for problem in refused.value.problems]
    assert {text.partition(":")[0] for text in found} == {
        "unknown entry 'titel'; did you mean title?", "event 1", "event 2", "inputs",
    }  # fmt: skip
