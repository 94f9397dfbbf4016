"""What a scenario says of events, and what is refused before anything is stepped."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.hooks.events import Alter, Freeze, Set
from orchestrator.cosim.system.connection import Connection
from orchestrator.cosim.system.names import PortName
from orchestrator.cosim.system.structure import System
from orchestrator.cosim.system.units import Linear, Mapped
from orchestrator.machine.errors import InputError, Refused
from orchestrator.runs.loading import load
from orchestrator.runs.scenario import check_events, read_scenario
from orchestrator.runs.scenario_events import read_events, shared_events
from support.texts import mentions


@pytest.fixture(scope="module")
def system() -> System:
    return load("fig4", "native")


def read(tables, system):
    check_events("here", tables)
    return read_events("here", tables, system)


def action(system, **table):
    [event] = read([{"at": 1.0, **table}], system)
    return event.action


def names(*ports):
    return tuple(map(PortName.read, ports))


def test_an_output_means_whoever_it_feeds_and_an_input_itself_alone(system):
    assert action(system, lose="plant.nu_r.u") == Alter(
        "override", ((PortName("disturbance", "nu.u"), 0.0),)
    )
    assert action(system, freeze="plant.eta.psi") == Freeze(names("controller.eta.psi"))
    assert action(system, freeze="controller.eta.psi") == Freeze(names("controller.eta.psi"))


def test_a_group_means_its_members(system):
    ys = names("controller.y.x", "controller.y.y", "controller.y.z")
    assert action(system, drop="plant.y") == Freeze(ys)
    assert action(system, override={"plant.y": [1.0, 2.0, 3.0]}) == Alter(
        "override", tuple(zip(ys, (1.0, 2.0, 3.0), strict=True))
    )
    taken = action(system, set={"controller": {"K1": 9.0}})
    assert taken == Set(tuple((PortName("controller", f"K1[{i}]"), 9.0) for i in (1, 2, 3)), ())


def test_what_is_overridden_is_transformed_as_the_signal_is(system):
    source, target = PortName.read("plant.eta.phi"), PortName.read("controller.eta.phi")

    def through(transformation, **table):
        wires = (Connection(source, target, transformation),)
        return action(replace(system, connections=wires), **table)

    degrees = Linear(57.0, 1.0)
    name = "plant.eta.phi"
    assert through(degrees, override={name: 2.0}) == Alter("override", ((target, 115.0),))
    assert through(degrees, bias={name: 2.0}) == Alter("bias", ((target, 114.0),))
    # Who listens hears something else, in its own units.
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
def test_what_cannot_happen_is_refused_with_its_number(system, table, reason):
    tables = [{"at": 0.0, "stop": True}, table]
    with pytest.raises(InputError, match=r"^here: event 2: ") as refused:
        read(tables, system)
    assert mentions(str(refused.value), reason)
    assert "\n" not in str(refused.value)


def test_another_system_has_those_events_that_can_happen_to_it(system):
    tables = [{"at": 1.0, "set": {"controller.k_d": 3.0}}, {"at": 1.0, "drop": "plant.y"}]
    assert shared_events(tables, system) == tuple(tables)
    assert shared_events(tables, load("fig5-pd", "native")) == (tables[1],)


def test_all_that_is_wrong_with_a_file_is_found_at_once(tmp_path):
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
