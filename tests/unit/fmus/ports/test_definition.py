"""A component is what its modules say: one module says it all."""

from __future__ import annotations

from functools import partial

import pytest

from fmus.discovery import source_of
from fmus.ports.definition import define
from fmus.ports.groups import Nothing
from fmus.ports.port import H_MAX, Misdeclared
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


def test_a_component_of_the_bundle_is_defined_by_two():
    definition = source_of("PathPlanner").definition
    assert (definition.name, definition.ports[0].name) == ("PathPlanner", "y_d.x")


def test_internal_steps_give_it_their_longest(defined):
    lag = defined(("h: float", "h: float, n: int"))
    assert lag.ports[-1] is H_MAX


TAKES = ("begin(parameters: Parameters)", "begin(parameters: Parameters, inputs: Inputs)")
AND_TIME = ("inputs: Inputs) ->", "inputs: Inputs, t: float) ->")
SAID = ('Variable("m", "Value")', 'Variable("m", "Value", feedthrough=())')


@pytest.mark.parametrize(
    ("changes", "feedthrough", "initially"),
    [
        ([], (), ()),
        ([TAKES], ("u",), ()),
        ([TAKES, AND_TIME], ("u", "time"), ()),
        ([SAID], (), ()),
        ([TAKES, SAID], (), ("u",)),
        ([TAKES, AND_TIME, SAID], (), ("u",)),
        ([(SAID[0], SAID[1].replace("()", '("u", "time")'))], ("u", "time"), ()),
    ],
)
def test_outputs_depend_on_what_begin_takes_unless_they_say(
    defined, changes, feedthrough, initially
):
    [x] = [port for port in defined(*changes).ports if port.causality == "output"]
    assert (x.feedthrough, x.initially) == (feedthrough, initially)


def test_what_is_not_needed_may_be_missing(monkeypatch, tmp_path):
    text = """\
from __future__ import annotations

from typing import Annotated, NamedTuple

from fmus.ports.groups import Nothing
from auv_fmu import Variable


class Outputs(NamedTuple):
    y: Annotated[float, Variable()]


def begin(t: float) -> tuple[Nothing, Outputs]:
    return Nothing(), Outputs(t)


def advance(t: float, h: float) -> tuple[Nothing, Outputs]:
    return Nothing(), Outputs(t + h)
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
            "    T: Anno",
            "    h_max: Anno",
            "Parameters.h_max has a name that every component has",
            ("Parameters", "h_max"),
        ),
        (
            '"Value")',
            '"Value", feedthrough=("v",))',
            "Outputs.x depends on 'v'; there are u, time",
            ("Outputs", "x"),
        ),
        ("class Inputs", "class Ins(NamedTuple):\n    pass\n\n\nclass Inputs", None, None),
        (
            "inputs: Inputs",
            "inputs: State",
            "inputs are of the type State; call it Inputs",
            ("advance", "inputs"),
        ),
        (
            "state: State, inputs: Inputs",
            "state: State",
            "Inputs is there, but no hook takes inputs",
            ("Inputs",),
        ),
        (
            'Outputs]:\n    """State and outputs after',
            'Inputs]:\n    """State and outputs after',
            "own_lag.advance does not return tuple[State, Outputs]",
            ("advance",),
        ),
        ("class Outputs", "class Outs", "own_lag has no Outputs", ()),
        ("def begin", "def start", "own_lag has no begin", ()),
        (
            "def check",
            "def test",
            "own_lag.test is not one of the hooks check, begin, derive",
            ("test",),
        ),
        (
            "h: float",
            "dt: float",
            "own_lag.advance takes dt, which is not one of parameters, sta",
            ("advance", "dt"),
        ),
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
