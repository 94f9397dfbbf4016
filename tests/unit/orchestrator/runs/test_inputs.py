"""Tables of inputs, and what is refused of them."""

from __future__ import annotations

import numpy as np
import pytest

from orchestrator.machine.errors import InputError
from orchestrator.runs.inputs import Inputs, read_inputs
from orchestrator.runs.loading import load, loaded
from orchestrator.runs.preparation import prepare
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import read_scenario
from orchestrator.system.names import port_name

U = port_name("plant.tau.u")


def read(tmp_path, text, between="linear", given=()):
    file = tmp_path / "inputs.csv"
    file.write_text(text)
    return read_inputs(Inputs(file, between), load("fig3a", "native"), given)


def test_a_run_begins_with_what_the_table_says_of_its_start(tmp_path):
    text = "time,plant.tau.u,plant.tau.q\n-1,0.0,5.0\n1,4.0,5.0\n"
    system, _ = read(tmp_path, text)
    assert system.parameters[U] == 2.0
    system, _ = read(tmp_path, text, "hold")
    assert system.parameters[U] == 0.0
    system, _ = read(tmp_path, "time,plant.tau.u\n3,8.0\n")
    assert system.parameters[U] == 8.0


def test_a_straight_line_may_be_steeper_than_any_number(tmp_path):
    """Its ends are finite, and so is all that lies between."""
    text = "time,plant.tau.u,plant.tau.q\n-1,-1.5e308,2.0\n1,1.5e308,4.0\n"
    system, input_table = read(tmp_path, text)
    assert system.parameters[U] == 0.0
    for time, expected in ((-1.0, [-1.5e308, 2.0]), (0.5, [0.75e308, 3.5]), (1.0, [1.5e308, 4.0])):
        row = 1 if time == 1.0 else 0
        np.testing.assert_allclose(input_table.at(time, row), expected, rtol=1e-12)


def test_other_tables_have_other_digests(tmp_path):
    texts = ["time,plant.tau.u\n0,1\n", "time,plant.tau.u\n0,2\n", "time,plant.tau.q\n0,1\n"]
    assert len({read(tmp_path, text)[1].digest for text in texts}) == len(texts)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("t,plant.tau.u\n0,1\n", "first column is 't'"),
        ("time\n0\n", "holds no inputs"),
        ("time,plant.tau.u\n", "holds no inputs"),
        ("time,plant.tau.u\n0,nan\n", "must be finite"),
        ("time,plant.tau.u\n1,1\n0,1\n", "times must not fall"),
        ("time,plant.tau.u\n-1e308,1\n1e308,1\n", "must lie less than 1e+308 s apart"),
        ("time,plant.tau.u,plant.tau.u\n0,1,1\n", "two columns have the same name"),
        ("time,plant.tau.x\n0,1\n", "did you mean"),
        ("time,plant.eta.x\n0,1\n", "of causality output"),
        ("time,plant.m11\n0,1\n", "of causality parameter"),
        ("time,plant.tau.u\n0,1\n0,1,2\n", "not a table"),
    ],
)
def test_a_table_that_is_none_is_refused(tmp_path, text, reason):
    with pytest.raises(InputError) as refused:
        read(tmp_path, text)
    assert reason in str(refused.value)
    assert "inputs.csv: " in str(refused.value)


def test_an_input_that_is_fed_is_refused(tmp_path):
    file = tmp_path / "inputs.csv"
    file.write_text("time,plant.tau.u\n0,1\n")
    with pytest.raises(InputError, match=r"is fed by controller\.tau\.u"):
        read_inputs(Inputs(file), load("fig4", "native"), ())


def test_a_value_beside_the_table_is_refused(tmp_path):
    with pytest.raises(InputError, match="beside the table"):
        read(tmp_path, "time,plant.tau.u\n0,1\n", given=[U])
    # On the command line it wins over what the scenario has.
    inputs = tmp_path / "inputs.csv"
    prepared = prepare(*loaded("fig3a", "native"), Request(kind="native", inputs=inputs))
    assert prepared.system.parameters[U] == 1.0
    assert np.array_equal(prepared.input_table.values, [[1.0]])


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ("file = 3", "file = 3: write a text"),
        ('between = "linear"', "inputs: lacks file; write file = "),
        ('file = "a.csv"\nform = "x"', "unknown entry 'form'"),
    ],
)
def test_an_entry_that_is_none_is_refused(tmp_path, entry, reason):
    file = tmp_path / "mine.toml"
    file.write_text(f"[inputs]\n{entry}\n")
    with pytest.raises(InputError, match=reason):
        read_scenario(str(file))


def test_an_empty_entry_names_no_file(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("inputs = {}\n")
    with pytest.raises(InputError, match=r"mine\.toml: inputs: lacks file"):
        read_scenario(str(file))


def test_a_way_that_is_none_is_refused(tmp_path):
    with pytest.raises(InputError, match="'spline': use one of linear, hold"):
        read(tmp_path, "time,plant.tau.u\n0,1\n", "spline")
