"""The equations in C give what their Python text gives, bit for bit, or raise what it raises."""

from __future__ import annotations

from ctypes import byref, c_double, c_ulong
from random import Random
from typing import Any, get_args, get_origin, get_type_hints

import pytest
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu.path_planner import MOST, Parameters, Waypoints
from fmus.discovery import components
from fmus.python.callbacks import explained
from support.equations import WHY, bits, equations, filled, flat, structure
from support.settings import behaviour_of

PACKAGES = [*components().values()]

#: Where equations live, and where they overflow.
MAGNITUDES = (1e-3, 1.0, 1.0, 1.0, 10.0, 1e9, 1e100, 1e160, 1e308)

every = pytest.mark.parametrize("package", PACKAGES)
randoms = st.randoms(use_true_random=True)


def number(random: Random) -> float:
    return random.choice((0.0, -0.0, 1.0, random.uniform(-1.0, 1.0) * random.choice(MAGNITUDES)))


def value(kind: Any, random: Random, wild: float = 0.3) -> Any:
    """Something that a type of the equations can hold; most numbers are tame."""
    if kind is float:
        return number(random) if random.random() < wild else random.uniform(-3.0, 3.0)
    if kind in (int, bool):
        return random.randrange(3 if kind is int else 2)
    if get_origin(kind) is tuple:
        return tuple(value(k, random, wild) for k in get_args(kind))
    parts = {name: value(k, random, wild) for name, k in get_type_hints(kind).items()}
    return parts if issubclass(kind, dict) else kind(**parts)


def outcome(made: Any) -> tuple[str, list[str]]:
    return "", bits(flat(made))


def raised(call: Any) -> tuple[str, list[str]]:
    """What a function gives, or what it raises as a slave would say it."""
    try:
        return outcome(call())
    except Exception as error:
        return explained(error)[: WHY - 1], []


@every
@given(random=randoms)
def test_begin(package, random):
    both, wild = equations(package), random.choice((0.0, 0.02, 0.3))
    parameters, inputs = value(both.parameters, random, wild), value(both.inputs, random, wild)
    t = number(random)
    given = {"parameters": parameters, "inputs": inputs, "t": t}
    state, outputs = both.kept(), structure(both.outputs)()
    why = both.call(
        "begin",
        filled(both.parameters, parameters),
        filled(both.inputs, inputs),
        t,
        state,
        outputs,
    )
    found = (why, []) if why else outcome([state, outputs])
    assert found == raised(lambda: both.python("begin", **given))


@every
@given(random=randoms)
def test_advance(package, random):
    both, wild = equations(package), random.choice((0.0, 0.02, 0.3))
    parameters, inputs = value(both.parameters, random, wild), value(both.inputs, random, wild)
    state = value(both.state, random, wild)
    t, h, n = number(random), random.random(), random.randrange(1, 5)
    given = {"parameters": parameters, "state": state, "inputs": inputs, "t": t, "h": h, "n": n}
    kept, outputs = both.kept(state), structure(both.outputs)()
    why = both.call("derive", filled(both.parameters, parameters), kept)
    if both.derived:
        derived = raised(lambda: both.python("derive", **given))
        assert ((why, []) if why else outcome(kept.x1)) == derived
        if why:
            return
        given["derived"] = both.python("derive", **given)
    why = both.call(
        "advance",
        filled(both.parameters, parameters),
        kept,
        filled(both.inputs, inputs),
        t,
        h,
        n,
        outputs,
    )
    found = (why, []) if why else outcome([kept, outputs])
    assert found == raised(lambda: both.python("advance", **given))


@pytest.mark.parametrize(
    "package", [p for name, p in components().items() if behaviour_of(name).hooks["expected"]]
)
@given(random=randoms)
def test_expected(package, random):
    both, wild = equations(package), random.choice((0.0, 0.02, 0.3))
    parameters, state = value(both.parameters, random, wild), value(both.state, random, wild)
    outputs = value(both.outputs, random, wild)
    if hasattr(state, "quaternion") and random.random() < 0.5:
        state = state._replace(quaternion=(0.6, 0.0, 0.8, 0.0))
    found = structure(both.outputs)()
    why = both.call(
        "expected",
        filled(both.parameters, parameters),
        both.kept(state),
        filled(both.outputs, outputs),
        found,
    )
    given = {"parameters": parameters, "state": state, "outputs": outputs}
    assert ((why, []) if why else outcome(found)) == raised(
        lambda: both.python("expected", **given)
    )


@given(random=randoms)
def test_restarts_of_the_observer(random):
    both, wild = equations("fmus.observer_controller"), 0.0
    parameters = value(both.parameters, random, wild)
    state, inputs = value(both.state, random, wild), value(both.inputs, random, wild)
    given = {"parameters": parameters, "state": state, "inputs": inputs}
    kept = both.kept(state)
    passed = filled(both.parameters, parameters), kept, filled(both.inputs, inputs)
    assert bool(both.result("credible", *passed)) == both.python("credible", **given)
    assert both.call("restart", *passed) == ""
    assert outcome(kept) == outcome(both.python("restarted", **given))
    text = both.library.restarted().decode() % 0.02
    assert text == both.behaviour.RESTARTED.format(t=0.02)


@given(random=randoms)
def test_limits_that_leave_an_actuator_nothing(random):
    both, wild = equations("fmus.auv_plant"), 0.3
    parameters = value(both.parameters, random, wild)
    why = both.call("check", filled(both.parameters, parameters))
    assert why == raised(lambda: both.python("check", parameters=parameters) or ())[0]


@given(random=randoms, n=st.integers(0, MOST + 2), timed=st.booleans())
def test_paths_are_refused_alike(random, n, timed):
    """Most of them somewhere on the way; more waypoints than there are, for a place beyond them."""
    both, default = equations("fmus.path_planner"), Parameters()
    series = [tuple(random.uniform(-15.0, 15.0) for _ in range(MOST)) for _ in "xyz"]
    t = tuple(sorted(random.uniform(0.0, 2000.0) for _ in range(MOST)))
    flat_z = tuple(0.2 * z for z in series[2])
    T = random.uniform(1.0, 40.0)
    waypoints = Waypoints(n, *series[:2], flat_z, t, timed, random.uniform(0.05, 1.0), T)
    parameters = default._replace(waypoints=waypoints)
    why = both.call("check", filled(both.parameters, parameters))
    assert why == raised(lambda: both.python("check", parameters=parameters) or ())[0]


@given(random=randoms)
def test_noise_of_the_localisation(random):
    both, wild = equations("fmus.auv_plant"), 0.3
    parameters, outputs = value(both.parameters, random, wild), value(both.outputs, random, wild)
    n = value(tuple[float, float, float], random, wild)
    passed = filled(both.outputs, outputs)
    both.library.measure(
        byref(filled(both.parameters, parameters)), (c_double * 3)(*n), byref(passed)
    )
    measured = both.behaviour.measured(parameters, outputs["y"], n)
    assert outcome(passed) == outcome({**outputs, "y": measured})


@pytest.mark.parametrize("seed", [0, 1, -1, 2**31 - 1, -(2**31)])
def test_seed_is_the_number_that_the_slave_gives_its_generator(seed):
    both = equations("fmus.auv_plant")
    parameters = structure(both.parameters)()
    parameters.noise.seed = seed
    both.library.seed.restype = c_ulong
    assert both.library.seed(byref(parameters)) == seed % 2**32
