"""The definition of a component, from one module."""

from __future__ import annotations

from functools import partial
from xml.etree import ElementTree

import pytest

from fmus.ports.definition import define
from fmus.ports.description import fmi2_description
from fmus.ports.groups import Nothing
from fmus.ports.port import Misdeclared, largest_step
from support.own import imported


@pytest.fixture
def defined(monkeypatch, tmp_path):
    """The definition of the lag with some words of it changed."""
    own = partial(imported, monkeypatch, tmp_path)
    return lambda *changes: define("OwnLag", own(*changes))


def test_one_module_says_it_all(defined):
    lag = defined()
    assert [(port.name, port.causality) for port in lag.ports] == [
        ("u", "input"), ("x", "output"), ("T", "parameter"), ("x0", "parameter"),
    ]  # fmt: skip
    assert lag.summary == "A first-order lag, T dx/dt = u - x, solved exactly"
    assert lag.about == {"author": "Me", "version": "1.2"}
    assert lag.parameters.of({"T": 0.1, "x0": 2.0}) == (0.1, 2.0)
    assert lag.behaviour.state.__name__ == "State"


def test_a_component_that_splits_its_steps_has_a_parameter_for_it(defined):
    lag = defined(("class State", "H_MAX = 0.5\n\n\nclass State"))
    assert lag.ports[-1] == largest_step(0.5)


def test_a_component_states_its_experiment(defined):
    lag = defined(("class State", "STEP_SIZE = 10\nSTOP_TIME = 3600.0\n\n\nclass State"))
    assert (lag.behaviour.step, lag.behaviour.stop) == (10.0, 3600.0)
    element = ElementTree.fromstring(fmi2_description(lag, "{1}")).find("DefaultExperiment")
    assert element is not None
    assert element.attrib == {"startTime": "0.0", "stopTime": "3600.0", "stepSize": "10.0"}


TAKES = ("outputs(state: State)", "outputs(state: State, inputs: Inputs)")
AND_TIME = ("inputs: Inputs) -> Outputs", "inputs: Inputs, t: float) -> Outputs")
SAID = ('Variable("m", "Value")', 'Variable("m", "Value", feedthrough=())')
STARTS = ("start(parameters: Parameters)", "start(parameters: Parameters, inputs: Inputs)")
DERIVES = (
    "def outputs(state: State)",
    "def derive(inputs: Inputs, t: float) -> float:\n    return inputs.u + t\n\n\n"
    "def outputs(state: State, derived: float)",
)
GUARDED = (
    "def outputs",
    "RESTARTED = 'again'\n\n\ndef credible(state: State, inputs: Inputs) -> bool:\n"
    "    return state.x < inputs.u\n\n\ndef restarted(state: State) -> State:\n    return state"
    "\n\n\ndef outputs",
)
SAMPLED = ("class State", "SAMPLED = True\n\n\nclass State")


@pytest.mark.parametrize(
    ("changes", "feedthrough", "initially"),
    [
        ([], (), ()),
        ([TAKES], ("u",), ()),
        ([TAKES, AND_TIME], ("u", "time"), ()),
        ([SAID], (), ()),
        ([STARTS], (), ("u",)),
        ([STARTS, TAKES], ("u",), ()),
        ([STARTS, TAKES, SAID], (), ("u",)),
        ([STARTS, (SAID[0], SAID[1].replace("=()", "=(), initially=()"))], (), ()),
        ([(SAID[0], SAID[1].replace("()", '("u", "time")'))], ("u", "time"), ()),
        ([DERIVES], ("u", "time"), ()),
        ([GUARDED], ("u",), ()),
        ([TAKES, SAMPLED], ("u",), ()),
    ],
)
def test_outputs_depend_on_what_hooks_take_unless_they_say(
    defined, changes, feedthrough, initially
):
    [x] = [port for port in defined(*changes).ports if port.causality == "output"]
    assert (x.feedthrough, x.initially) == (feedthrough, initially)


def test_all_but_outputs_may_be_missing(monkeypatch, tmp_path):
    text = """\
from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable


class Outputs(NamedTuple):
    y: Annotated[float, Variable()]


def outputs(t: float) -> Outputs:
    return Outputs(t)
"""
    (tmp_path / "own_clock.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    import own_clock  # noqa: PLC0415

    clock = define("OwnClock", own_clock)
    assert (clock.behaviour.state, clock.behaviour.inputs) == (Nothing, Nothing)
    assert (clock.summary, [port.name for port in clock.ports]) == ("OwnClock", ["y"])
    assert clock.ports[0].feedthrough == ("time",)


@pytest.mark.parametrize(
    ("old", "new", "why", "place"),
    [
        (
            "    u: Anno",
            "    x: Anno",
            "Outputs.x has a name that Inputs has already",
            ("Outputs", "x"),
        ),
        (
            "    u: Anno",
            "    fault: Anno",
            "Inputs.fault has a name that every component has already",
            ("Inputs", "fault"),
        ),
        (
            "    T: Anno",
            "    time: Anno",
            "Parameters.time has a name that every component has",
            ("Parameters", "time"),
        ),
        (
            '"Value")',
            '"Value", feedthrough=("v",))',
            "Outputs.x depends on 'v'; there are u, time",
            ("Outputs", "x"),
        ),
        ("class Inputs", "class Ins(NamedTuple):\n    pass\n\n\nclass Inputs", None, None),
        (
            "state: State, inputs: Inputs",
            "state: State",
            "Inputs is there, but no hook takes inputs",
            ("Inputs",),
        ),
        (
            "h: float) -> State",
            "h: float) -> Inputs",
            "own_lag.update returns Inputs; write State",
            ("update", "return"),
        ),
        ("def outputs", "def _outputs", "own_lag has no function outputs", ()),
        ("def start", "def _start", "own_lag has update, but no start", ("update",)),
        (
            "def check",
            "def chek",
            "own_lag.chek is called by no function here; is it check?",
            ("chek",),
        ),
        (
            "h: float",
            "dt: float",
            "own_lag.update takes dt, which is not one of parameters, sta",
            ("update", "dt"),
        ),
        (
            "class State",
            "SAMPLED = True\n\n\nclass State",
            "own_lag.outputs takes no inputs, so it is not SAMPLED",
            ("outputs",),
        ),
        ("class State", "SAMPLED = 1\n\n\nclass State", "SAMPLED is 1; write True or", ()),
        ("class State", "H_MAX = 0.0\n\n\nclass State", "H_MAX is 0.0; write seconds, mo", ()),
        ("class State", "STOP_TIME = '9'\n\n\nclass State", "STOP_TIME is '9'; write sec", ()),
    ],
)
def test_mistakes_are_named(defined, old, new, why, place):
    if why is None:
        defined((old, new))
        return
    with pytest.raises(Misdeclared) as caught:
        defined((old, new))
    assert str(caught.value).startswith(why)
    assert caught.value.place == place


def test_what_is_sampled_is_discrete_and_depends_on_inputs(defined):
    [x] = [port for port in defined(TAKES, SAMPLED).ports if port.causality == "output"]
    assert (x.variability, x.feedthrough) == ("discrete", ("u",))
    with pytest.raises(Misdeclared, match=r"^Outputs\.x is sampled with the inputs, so it has "):
        defined(TAKES, SAMPLED, SAID)


def test_names_are_told_apart_from_those_that_a_component_has_anyway(defined):
    own = ("    T: Anno", "    h_max: Anno")
    assert "h_max" in [port.name for port in defined(own).ports]
    with pytest.raises(Misdeclared, match=r"Parameters\.h_max has a name that H_MAX has already"):
        defined(own, ("class State", "H_MAX = 1.0\n\n\nclass State"))


@pytest.mark.parametrize("name", ["u", "Length"])
def test_a_type_of_choices_has_a_name_of_its_own(defined, name):
    """In FMI the names of types differ from each other and from names of variables."""
    choice = f"class {name}(IntEnum):\n    OFF = 0\n\n\nclass State"
    own = f'    mode: Annotated[{name}, Variable("1", "Mode")] = {name}.OFF\n    T: Anno'
    with pytest.raises(
        Misdeclared, match=f"^{name} is the name of .* choices, and of something else in the FMU"
    ):
        defined(
            ("from math", "from enum import IntEnum\nfrom math"),
            ("class Parameters", choice.replace("State", "Parameters")),
            ("    T: Anno", own),
        )
