"""The state of a component: complete, exact, its size known, and refused whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Callable
from enum import IntEnum
from math import inf, isfinite, nan
from typing import Annotated, Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonfmu.enums import Fmi2Status

from auv_fmu.language.arrays import Matrix, Vector
from auv_fmu.language.variable import Refusal
from fmus.python.state import Snapshot, measuring, restored
from support.instances import ClassInstance
from support.settings import REPRESENTATIVES


@pytest.fixture(params=REPRESENTATIVES)
def driver(request: pytest.FixtureRequest) -> ClassInstance:
    return ClassInstance(request.param)


def spoiled(saved: Snapshot, key: str, value: Any) -> dict[str, Any]:
    """A state with one part changed, as its bytes would bring it back if their checksum agreed."""
    return json.loads(json.dumps({**saved, key: value}))


def with_parameter(name: str, value: Any) -> Callable[[Snapshot], Any]:
    return lambda saved: {**saved["parameters"], name: value}


def with_input(value: Any) -> Callable[[Snapshot], Any]:
    return lambda saved: [value, *saved["inputs"][1:]]


def with_generator(place: int, value: Any) -> Callable[[Snapshot], Any]:
    """The noise generator's version, numbers and kept second number of the pair."""

    def change(saved: Snapshot) -> Any:
        first, numbers, following = saved["generator"]
        parts = [first, [*numbers], following]
        parts[place] = value(parts[place]) if callable(value) else value
        return parts

    return change


#: A key of the state of AuvPlant, and a function that gives another value for it.
SPOILED = {
    "parameter out of range": ("parameters", with_parameter("m11", -25.0)),
    "parameter not finite": ("parameters", with_parameter("m11", nan)),
    "parameter infinite": ("parameters", with_parameter("ell", inf)),
    "parameter too large for a float": ("parameters", with_parameter("ell", 10**400)),
    "parameter of another type": ("parameters", with_parameter("m11", "25")),
    "truth value for a number": ("parameters", with_parameter("m11", True)),
    "number for an integer": ("parameters", with_parameter("noise.seed", 1.5)),
    "integer of more than 32 bits": ("parameters", with_parameter("noise.seed", 3733856209)),
    "list for a parameter": ("parameters", with_parameter("m11", [25.0])),
    "parameter too many": ("parameters", with_parameter("m99", 1.0)),
    "parameters missing": ("parameters", lambda saved: {"m11": 50.0}),
    "parameters in a list": ("parameters", lambda saved: [*saved["parameters"].items()]),
    "limits that do not fit": ("parameters", lambda saved: {
        **saved["parameters"], "tau_min.u": 0.0, "tau_max.u": 0.0,
    }),
    "input not finite": ("inputs", with_input(nan)),
    "input of another type": ("inputs", with_input(None)),
    "inputs missing": ("inputs", lambda saved: [1.0]),
    "inputs no list": ("inputs", lambda saved: 7),
    "outputs that follow from the state": ("outputs", lambda saved: [0.0]),
    "mode bogus": ("mode", lambda saved: "bogus"),
    "mode of another type": ("mode", lambda saved: ["stepping"]),
    "state before the initialisation": ("mode", lambda saved: "instantiated"),
    "no state after the initialisation": ("state", lambda saved: None),
    "state of another shape": ("state", lambda saved: [*saved["state"], [0.0]]),
    "state flat": ("state", lambda saved: [0.0, 0.0, 0.0]),
    "state not finite": ("state", lambda saved: [[nan, 0.0, 0.0], *saved["state"][1:]]),
    "state of text": ("state", lambda saved: [["a", "b", "c"], *saved["state"][1:]]),
    "state of truth values": ("state", lambda saved: [[True] * 3, *saved["state"][1:]]),
    "state out of bounds": ("state", lambda saved: [[1e120, 0.0, 0.0], *saved["state"][1:]]),
    "zero quaternion": ("state", lambda saved: [
        saved["state"][0], [0.0] * 4, *saved["state"][2:],
    ]),
    "long quaternion": ("state", lambda saved: [
        saved["state"][0], [1.0, 0.0, 1.0, 0.0], *saved["state"][2:],
    ]),
    "force beyond its limit": ("state", lambda saved: [
        *saved["state"][:-2], [1e6, 0.0, 0.0], saved["state"][-1],
    ]),
    "generator of another version": ("generator", with_generator(0, 2)),
    "generator of no version": ("generator", with_generator(0, "three")),
    "generator too short": ("generator", with_generator(1, lambda numbers: numbers[:-2])),
    "generator with a negative number": ("generator", with_generator(1, lambda n: [-1, *n[1:]])),
    "generator with a large number": ("generator", with_generator(1, lambda n: [2**32, *n[1:]])),
    "generator with a fraction": ("generator", with_generator(1, lambda n: [0.5, *n[1:]])),
    "generator with text to come": ("generator", with_generator(2, "0.5")),
    "generator with no number to come": ("generator", with_generator(2, nan)),
    "no generator": ("generator", lambda saved: None),
    "generator of no parts": ("generator", lambda saved: [1]),
    "noise missing": ("draws", lambda saved: []),
    "noise that cannot be drawn": ("draws", lambda saved: [9.5, *saved["draws"][1:]]),
    "noise not finite": ("draws", lambda saved: [nan, *saved["draws"][1:]]),
    "generator with a number to come that cannot be": ("generator", with_generator(2, -9.5)),
    "time not a number": ("time", lambda saved: nan),
    "outputs that are perhaps fresh": ("fresh", lambda saved: 1),
    "start time not finite": ("start_time", lambda saved: inf),
    "start time of another type": ("start_time", lambda saved: "0"),
    "fault of another type": ("fault", lambda saved: 0),
    "part too many": ("more", lambda saved: 1),
    "part of an older version": ("refused", lambda saved: {}),
    "another component": ("identity", lambda saved: "something else"),
}  # fmt: skip


@pytest.mark.parametrize("what", SPOILED)
def test_state_that_no_run_can_have_led_to_is_refused_whole(what: str):
    plant, untouched = ClassInstance("AuvPlant"), ClassInstance("AuvPlant", m11=50.0)
    for driver in (plant, untouched):
        driver.excite(1)
        driver.step()
    saved = untouched.slave._get_fmu_state()
    before = plant.slave._get_fmu_state()
    key, change = SPOILED[what]
    plant.slave._set_fmu_state(spoiled(saved, key, change(saved)))
    assert plant.answers() == [Fmi2Status.error]
    assert plant.messages()[0].startswith("state refused: ")
    assert plant.slave._get_fmu_state() == before
    plant.slave._set_fmu_state(saved)
    for driver in (plant, untouched):
        driver.excite(2)
        assert driver.step()
    assert plant.outputs() == untouched.outputs(), "a good state is taken after a bad one"


def test_state_with_a_part_missing_is_refused(driver):
    saved = driver.slave._get_fmu_state()
    for key in saved:
        driver.slave._set_fmu_state({k: value for k, value in saved.items() if k != key})
    assert driver.answers() == [Fmi2Status.error] * len(Snapshot.__annotations__)


@given(place=st.integers(0), byte=st.integers(0, 255))
def test_no_changed_byte_of_a_state_is_overlooked(place, byte):
    """An accepted state is the same, written in another way; a refused one changes nothing."""
    driver = ClassInstance("ObserverController")
    driver.excite(1)
    driver.step()
    saved = driver.slave._get_fmu_state()
    content = bytearray(driver.slave._fmu_state_to_bytes(saved))
    content[place % len(content)] = byte
    driver.slave._set_fmu_state(driver.slave._fmu_state_from_bytes(bytes(content)))
    assert driver.answers() in ([], [Fmi2Status.error])
    assert driver.slave._get_fmu_state() == saved


#: Values that stand for something else in a state.
ODD = (
    nan, inf, -inf, 1e308, -1e308, 1e-320, -0.0, 0, 1, -1, 2**31, 10**400, "", "bogus", "\ud800",
    True, None, [], {}, [[]], [0.0], "stepping", "terminated", "instantiated", "initialising",
)  # fmt: skip


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The path of every value in a state."""
    keys = (
        value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    )
    return [
        *([path] if path else []),
        *(p for key in keys for p in places(value[key], (*path, key))),
    ]


@given(name=st.sampled_from(REPRESENTATIVES), data=st.data())
def test_changed_state_is_refused_as_a_whole_or_continues(name: str, data: st.DataObject):
    """The checksum counts as right, so only the values can be wrong."""
    driver = ClassInstance(name)
    driver.excite(1)
    driver.step()
    before = driver.slave._get_fmu_state()
    state = json.loads(json.dumps(before))
    # Every part as often as any other, however large it is.
    top = data.draw(st.sampled_from([*state]))
    *path, last = data.draw(st.sampled_from([(top, *p) for p in [(), *places(state[top])]]))
    part = state
    for key in path:
        part = part[key]
    part[last] = data.draw(st.sampled_from(ODD))
    driver.slave._set_fmu_state(state)
    if driver.answers():
        assert driver.answers() == [Fmi2Status.error]
        assert driver.slave._get_fmu_state() == before
    else:
        driver.slave.do_step(state["time"], 0.02)
        assert all(map(isfinite, driver.outputs()))


@pytest.mark.parametrize(
    "change",
    [
        {"start_time": 10**400},
        {"mode": "initialising"},
        {"mode": "instantiated", "state": None, "outputs": []},
    ],
)
def test_state_that_was_taken_once_is_refused(driver, change):
    driver.step()
    saved = driver.slave._get_fmu_state()
    driver.slave._set_fmu_state({**saved, **change})
    assert driver.answers() == [Fmi2Status.error]


def test_state_that_is_not_fit_for_bytes_says_so():
    driver = ClassInstance("AuvPlant")
    content = driver.slave._fmu_state_to_bytes({"generator": object()})
    driver.slave._set_fmu_state(driver.slave._fmu_state_from_bytes(content))
    assert "JSON" in driver.messages()[0]


def test_text_of_a_state_does_not_break_the_message(driver):
    saved = driver.slave._fmu_state_from_bytes(b'{"unusable": "%s' + b"x" * 10_000 + b'"}')
    driver.slave._set_fmu_state(saved)
    [message] = driver.messages()
    assert "%%s" in message
    assert len(message) < 600


#: Additions to the paper, in a run of AuvPlant.
ADDITIONS = {"roll": False, "current__x": 0.3, "actuator__T__u": 0.2, "actuator__T__q": 1e-3}


def test_state_of_a_vehicle_with_additions_continues_bit_for_bit_too():
    driver = ClassInstance("AuvPlant", **ADDITIONS)
    driver.run(0, 50)
    saved, time = json.loads(json.dumps(driver.slave._get_fmu_state())), driver.time
    expected = driver.run(50, 100)
    other = ClassInstance("AuvPlant")
    other.slave._set_fmu_state(saved)
    other.time = time
    assert other.run(50, 100) == expected


def test_state_that_rolls_is_none_of_a_vehicle_that_does_not():
    driver = ClassInstance("AuvPlant")
    driver.run(0, 50)
    saved = driver.slave._get_fmu_state()
    other = ClassInstance("AuvPlant", **ADDITIONS)
    other.slave._set_fmu_state({**saved, "parameters": {**saved["parameters"], "roll": False}})
    assert other.answers() == [Fmi2Status.error]
    assert "its roll, which is held at zero, is not zero" in other.messages()[0]


def test_state_after_a_refused_initialisation_can_be_restored():
    driver = ClassInstance("AuvPlant", nu0__p=1e160)
    saved = driver.slave._fmu_state_from_bytes(
        driver.slave._fmu_state_to_bytes(driver.slave._get_fmu_state())
    )
    other = ClassInstance("AuvPlant")
    other.slave._set_fmu_state(saved)
    assert other.messages() == []
    outputs = other.outputs()
    assert outputs == [0.0] * len(outputs)
    assert other.answers() == [Fmi2Status.error]
    other.set(nu0__p=0.0)
    other.slave.exit_initialization_mode()
    assert other.step()
    calm = ClassInstance("AuvPlant")
    calm.step()
    assert other.outputs() == calm.outputs()


class Pair(NamedTuple):
    x: float
    y: tuple[float, float]


class Whole(NamedTuple):
    n: int
    pair: Pair
    many: tuple[float, float]
    on: bool
    alone: float


WHOLE = Whole(9, Pair(1.0, (-2.0, 4.0)), (8.0, 16.0), True, -32.0)


def test_size_is_the_sum_of_the_squares_of_all_floats():
    assert measuring(Whole)(WHOLE) == sum(4.0**k for k in range(6))


def test_whole_numbers_in_the_place_of_floats_have_a_size():
    assert measuring(Pair)(Pair(3, (0, -4))) == 25.0


@pytest.mark.parametrize("bad", [nan, inf, -inf])
@pytest.mark.parametrize(
    "spoil",
    [
        lambda bad: {"pair": Pair(bad, (0.0, 0.0))},
        lambda bad: {"pair": Pair(0.0, (0.0, bad))},
        lambda bad: {"many": (0.0, bad)},
        lambda bad: {"alone": bad},
    ],
)
def test_what_is_not_finite_makes_the_size_not_finite(spoil, bad):
    spoiled = WHOLE._replace(**spoil(bad))
    assert not isfinite(measuring(Whole)(spoiled))


def test_json_gives_a_state_back():
    again = restored(Whole, json.loads(json.dumps(WHOLE)))
    assert again == WHOLE
    assert (type(again), type(again.pair)) == (Whole, Pair)


@pytest.mark.parametrize(
    ("kind", "value", "why"),
    [
        (Pair, [1.0], "[1.0] instead of 2 values"),
        (Pair, 1.0, "1.0 instead of 2 values"),
        (Pair, [1.0, [1.0, 2.0, 3.0]], "[1.0, 2.0, 3.0] instead of 2 values"),
        (float, nan, "a value is not finite"),
        (float, -inf, "a value is not finite"),
        (float, True, "True is not of type float"),
        (float, "x" * 99, f"'{'x' * 39} is not of type float"),
        (int, 1.0, "1.0 is not of type int"),
        (bool, 1, "1 is not of type bool"),
    ],
)
def test_values_of_another_shape_are_refused(kind, value, why):
    with pytest.raises(Refusal) as refusal:
        restored(kind, value)
    assert str(refusal.value) == why


def test_whole_numbers_may_stand_for_floats():
    """JSON of another writer may lack the point."""
    assert restored(Pair, [1, [2, 3]]) == (1, (2, 3))


class Colour(IntEnum):
    RED = 1
    BLUE = 4


class Typed(NamedTuple):
    n: int
    colour: Colour
    v: Annotated[Vector, 2]
    M: Annotated[Matrix, 1, 2]


TYPED = Typed(-3, Colour.BLUE, Vector((3.0, 0.0)), Matrix(((0.0, 4.0),)))


def test_size_includes_vectors_and_matrices_and_no_integers():
    assert measuring(Typed)(TYPED) == 25.0


@pytest.mark.parametrize("n", [2**31, -(2**31) - 1, 10**400])
def test_integers_of_more_than_32_bits_have_no_size(n):
    with pytest.raises(OverflowError, match="an integer exceeds 32 bits"):
        measuring(Typed)(TYPED._replace(n=n))


def test_numbers_that_an_enumeration_lacks_have_no_size():
    assert measuring(Typed)(TYPED._replace(colour=4)) == 25.0
    with pytest.raises(Refusal, match=r"^2 is not of type Colour$"):
        measuring(Typed)(TYPED._replace(colour=2))


@pytest.mark.parametrize("value", [True, Colour.RED, 1])
def test_a_truth_value_or_a_member_is_an_int_and_an_int_a_member(value):
    assert (restored(int, value), type(restored(int, value))) == (1, int)
    assert restored(Colour, value) is Colour.RED


def test_json_gives_members_vectors_and_matrices_back():
    again = restored(Typed, json.loads(json.dumps(TYPED)))
    assert again == TYPED
    kinds = (again, again.colour, again.v, again.M, again.M[0])
    assert tuple(map(type, kinds)) == (Typed, Colour, Vector, Matrix, Vector)


@pytest.mark.parametrize(
    ("kind", "value", "why"),
    [
        (int, 2**31, "an integer exceeds 32 bits"),
        (int, -(2**31) - 1, "an integer exceeds 32 bits"),
        (Colour, 2, "2 is not of type Colour"),
        (Colour, 1.0, "1.0 is not of type Colour"),
        (Colour, "RED", "'RED' is not of type Colour"),
        (Annotated[Vector, 2], [1.0], "[1.0] instead of 2 values"),
        (Annotated[Matrix, 1, 2], [[1.0, inf]], "a value is not finite"),
    ],
)
def test_what_no_run_can_have_led_to_is_refused(kind, value, why):
    with pytest.raises(Refusal) as refusal:
        restored(kind, value)
    assert str(refusal.value) == why
