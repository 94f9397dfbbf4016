"""The values that a port takes, and its messages about others."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import pytest

from auv_fmu import Refusal
from auv_fmu.language.quantities import (
    ETA_WITHOUT_ROLL,
    TAU,
    THETA,
    group_name,
    member_name,
    member_of,
    per_axis,
)
from fmus.ports.port import Port

UNBOUNDED = Port("k", "parameter", "fixed", "Real", "Gain", "1", 1.0)
REAL = replace(UNBOUNDED, minimum=0.5, maximum=2.5)
INTEGER = Port("n", "parameter", "fixed", "Integer", "Number", start=0)
BOOLEAN = Port("on", "parameter", "fixed", "Boolean", "Switch", start=False)
CHOICES = {"a": -7, "b": 8}
NAMED = Port("m", "input", "discrete", "Enumeration", "Kind", start=8, choices=CHOICES)
LARGEST = float.fromhex("0x1.fffffffffffffp+1023")


@pytest.mark.parametrize(
    ("port", "value"),
    [
        (REAL, 0.5), (REAL, 2.5), (REAL, 1), (UNBOUNDED, LARGEST), (UNBOUNDED, -LARGEST),
        (INTEGER, -(2**31)), (BOOLEAN, True), (NAMED, -7),
    ],
)  # fmt: skip
def test_good_value_comes_back(port, value):
    assert port.checked(value) is value


@pytest.mark.parametrize(
    ("port", "value", "why"),
    [
        (REAL, 0.4999, "k = 0.4999: must be at least 0.5"),
        (REAL, 2.5001, "k = 2.5001: must be at most 2.5"),
        (REAL, nan, "k = nan: must be finite"),
        (REAL, inf, "k = inf: must be finite"),
        (UNBOUNDED, -inf, "k = -inf: must be finite"),
        (UNBOUNDED, 10**400, "k = 10000000000000000000: must be finite"),
        (REAL, "1", "k = '1': must be a Real"),
        (REAL, True, "k = True: must be a Real"),
        (REAL, "x" * 99, "k = 'xxxxxxxxxxxxxxxxxxx: must be a Real"),
        (INTEGER, 1.0, "n = 1.0: must be an Integer"),
        (INTEGER, True, "n = True: must be an Integer"),
        (BOOLEAN, 1, "on = 1: must be a Boolean"),
        (NAMED, "a", "m = 'a': must be an Enumeration"),
        (NAMED, 1, "m = 1: use one of -7 (a), 8 (b)"),
        (INTEGER, 2**31, "n = 2147483648: must fit into 32 bits"),
    ],
)
def test_bad_value_is_refused_with_the_reason(port, value, why):
    with pytest.raises(Refusal) as refusal:
        port.checked(value)
    assert str(refusal.value) == why


@pytest.mark.parametrize("value", [0.0, -1e9, 7.5])
def test_a_value_out_of_range_may_have_the_right_type(value):
    """Such a value is allowed for an output."""
    REAL.check_type(value)
    with pytest.raises(Refusal, match="must be"):
        REAL.checked(value)


def test_a_scalar_is_its_own_member():
    assert [member_of(name) for name in ("u", "tau.u", "K[1,2]", "x_1")] == ["u", "u", "1,2", "x_1"]


@pytest.mark.parametrize(("member", "name"), [("x", "y.x"), (3, "y[3]")])
def test_members_have_structured_names(member, name):
    assert member_name("y", member) == name
    assert group_name(name) == "y"
    assert group_name("a.b[1].c") == group_name("a[1][2]") == "a"


def test_members_of_the_quantities():
    assert TAU == {"u": "N", "q": "N.m", "r": "N.m"}
    assert [*ETA_WITHOUT_ROLL] == ["x", "y", "z", "theta", "psi"]
    assert per_axis("kg/s") == {1: "kg/s", 2: "kg/s", 3: "kg/s"}
    assert [*THETA] == [1, 2, 3, 4]


def test_names_have_members_and_places_at_every_level():
    for name in ("u", "_u1", "a.b.c", "K[1,2]", "waypoint[3].x", "a[1].b[2,10]"):
        assert Port(name, "input", "continuous", "Real", "Value").name == name
