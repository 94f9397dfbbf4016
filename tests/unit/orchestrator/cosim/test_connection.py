"""Connections: names of ports, units, and transformations that follow each other."""

from __future__ import annotations

from fractions import Fraction
from math import isfinite

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.connection import (
    Linear,
    Mapped,
    PortName,
    UndefinedUnit,
    Unit,
    combine,
    conversion,
)
from orchestrator.machine.errors import InputError


@given(st.text("ab.", max_size=8))
def test_a_name_is_taken_apart_at_every_dot_the_longest_component_first(text):
    found = list(PortName.splits(text))
    assert {".".join(parts) for parts in found} <= {text}
    dots = [i for i, letter in enumerate(text) if letter == "."]
    assert [len(first) for first, _ in found] == dots[::-1]


def test_a_port_name_needs_both_of_its_parts():
    assert str(PortName.read("a.b.c")) == "a.b.c" and PortName.read("a.b.c").component == "a"
    for text in ("a", ".b", "a.", ""):
        with pytest.raises(InputError, match=repr(text)):
            PortName.read(text)


LENGTH, TEMPERATURE = (0, 1, 0, 0, 0, 0, 0, 0), (0, 0, 0, 0, 1, 0, 0, 0)
M, INCH = Unit("m", LENGTH), Unit("inch", LENGTH, 0.0254)
KELVIN, CELSIUS = Unit("K", TEMPERATURE), Unit("degC", TEMPERATURE, 1.0, 273.15)
FAHRENHEIT = Unit("degF", TEMPERATURE, 5 / 9, 273.15 - 32 * 5 / 9)


@pytest.mark.parametrize(
    ("source", "target", "value", "expected"),
    [
        (INCH, M, 100.0, 2.54),
        (M, INCH, 2.54, 100.0),
        (CELSIUS, KELVIN, 25.0, 298.15),
        (CELSIUS, FAHRENHEIT, 100.0, 212.0),
        (FAHRENHEIT, CELSIUS, -40.0, -40.0),
    ],
)
def test_conversion_is_the_one_of_the_tables(source, target, value, expected):
    converted = conversion(source, target)
    assert converted is not None
    assert converted(value) == pytest.approx(expected, rel=1e-12)


def test_equal_units_and_unknown_ones_leave_a_value_as_it_is():
    metre = Unit("metre", LENGTH)
    for source, target in ((M, M), (M, metre), (None, M), (M, None), (Unit("?"), Unit("?"))):
        assert conversion(source, target) is None


def test_units_of_different_things_are_refused():
    with pytest.raises(InputError, match="units differ, m and K"):
        conversion(M, KELVIN)
    with pytest.raises(UndefinedUnit, match=r"units differ, m and \?, and nothing defines \?"):
        conversion(M, Unit("?"))


@pytest.mark.parametrize(
    ("large", "small"),
    [
        (Unit("large", LENGTH, 1e200), Unit("small", LENGTH, 1e-200)),
        (Unit("large", LENGTH, 1e300), Unit("small", LENGTH, 1e-9)),
        (Unit("large", LENGTH, 1.0, 1e308), Unit("small", LENGTH, 0.5, -1e308)),
        (Unit("large", LENGTH, 1.0), Unit("small", LENGTH, 5e-324)),
    ],
)
def test_units_too_far_apart_for_a_number_are_refused_by_name(large, small):
    """A value would arrive as zero, infinite, or with only some of its digits."""
    for source, target in ((large, small), (small, large)):
        with pytest.raises(InputError, match=f"units {source.name} and {target.name} are too far"):
            conversion(source, target)


FACTORS = st.floats(allow_nan=False, allow_infinity=False)


@given(*[st.builds(Unit, st.just(name), st.just(LENGTH), FACTORS, FACTORS) for name in "ab"])
def test_a_conversion_is_refused_or_loses_no_value(source, target):
    try:
        converted = conversion(source, target)
    except InputError:
        return
    if converted is not None:
        assert converted.factor != 0.0
        exact = Fraction(source.factor) / Fraction(target.factor)
        assert abs(Fraction(converted.factor) / exact - 1) < Fraction(1, 2**52)
        assert isfinite(converted.offset)


NUMBERS = st.integers(-9, 9).map(float)
LINEARS = st.builds(Linear, NUMBERS, NUMBERS)
TABLES = st.dictionaries(NUMBERS, NUMBERS, max_size=5).map(
    lambda pairs: Mapped(tuple(pairs.items()))
)


@given(st.tuples(LINEARS, LINEARS) | st.tuples(TABLES, TABLES), NUMBERS)
def test_chained_transformations_are_one_after_the_other(both, value):
    first, then = both
    whole = combine(first, then)
    assert whole is not None
    assert whole(value) == then(first(value))


def test_what_leaves_a_value_as_it_is_goes_with_everything():
    table, line = Mapped(((1.0, 2.0),)), Linear(2.0, 1.0)
    for other in (table, line, Linear(), None):
        assert combine(Linear(), other) == combine(other, Linear()) == (other or Linear())
        assert combine(None, other) == combine(other, None) == other


def test_line_and_table_do_not_follow_each_other():
    with pytest.raises(InputError, match="follow each other"):
        combine(Linear(2.0), Mapped(((1.0, 2.0),)))


def test_what_tables_come_to_is_bounded():
    left, right = (
        Mapped(tuple((float(i), 0.5) for i in range(first, first + 501))) for first in (0, 501)
    )
    with pytest.raises(InputError, match="1,000"):
        combine(left, right)


@pytest.mark.parametrize("size", [1e200, 1e-200])
def test_transformations_that_no_number_holds_do_not_follow_each_other(size):
    with pytest.raises(InputError, match="successive linear transformations combine to"):
        combine(Linear(size), Linear(size))
    # A factor of zero is an intended one.
    assert combine(Linear(size), Linear(0.0, 1.0)) == Linear(0.0, 1.0)
