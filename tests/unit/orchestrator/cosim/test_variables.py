"""Variables, including elements of arrays, and their values from and to text."""

from __future__ import annotations

import struct
from math import nextafter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.component import Component, read_description
from orchestrator.cosim.variables import StringTable, Variable, are_of, references_of, same
from orchestrator.machine.errors import InputError
from orchestrator.machine.texts import is_finite, literal
from support.small_fmus import description_of_fmi3
from support.texts import mentions

_VARIABLES = """
<UInt64 name="n" valueReference="1" causality="structuralParameter" start="3"/>
<Float64 name="A" valueReference="2" causality="parameter" start="1 2 3 4 5 6">
  <Dimension start="2"/><Dimension valueReference="1"/></Float64>
<Float64 name="u" valueReference="3" causality="input" start="0.5"><Dimension valueReference="1"/>
</Float64>
<String name="s" valueReference="4" causality="parameter"><Dimension start="2"/>
  <Start value="a b"/><Start value=""/></String>
<UInt8 name="k" valueReference="5" causality="parameter" start="7" min="5" max="9"/>
<Binary name="b" valueReference="6" causality="input"><Start value="00"/></Binary>
<Clock name="c" valueReference="7" causality="input" intervalVariability="triggered"/>
<Int32 name="of_c" valueReference="8" causality="output" clocks="7"/>
<Float64 name="y" valueReference="9" causality="output"><Dimension start="2"/>
  <Alias name="z"/></Float64>
<Int8 name="none" valueReference="10" causality="input" start="1"><Dimension start="0"/></Int8>
"""


@pytest.fixture
def component(tmp_path: Path) -> Component:
    structure = '<Output valueReference="9" dependencies=""/><Output valueReference="8"/>'
    text = description_of_fmi3("it", _VARIABLES, structure, 'providesDirectionalDerivatives="true"')
    (tmp_path / "modelDescription.xml").write_text(text)
    return Component("a", tmp_path, read_description(tmp_path).description, "")


def test_elements_count_from_one_the_last_index_first(component):
    starts = {name: component.start(name) for name in component.variables if name[0] in "Ausk"}
    assert starts == {
        "A[1,1]": 1.0, "A[1,2]": 2.0, "A[1,3]": 3.0, "A[2,1]": 4.0, "A[2,2]": 5.0, "A[2,3]": 6.0,
        "u[1]": 0.5, "u[2]": 0.5, "u[3]": 0.5, "s[1]": "a b", "s[2]": "", "k": 7,
    }  # fmt: skip
    assert [variable.name for variable in component.arrays["A"]] == [*starts][:6]
    assert references_of(component.having("parameter")) == [2, 4, 5]
    assert not component.has_feedthrough("y[2]")
    assert component.gives_derivatives


@pytest.mark.parametrize(
    ("name", "words"),
    [("b", "Binary"), ("c", "Clock"), ("of_c", "Clock"), ("z", "y"), ("u", "u[1]"), ("u[4]", "u")],
)
def test_names_that_are_not_ports_are_refused_by_name(component, name, words):
    with pytest.raises(InputError) as error:
        component.variable(name)
    assert mentions(str(error.value), f"a {name} {words}")


def test_sizes_are_not_set_and_ranges_hold(component):
    assert [*component.unsupported] == ["b", "c", "of_c", "none"]
    assert not component.is_settable("n") and component.is_settable("u[1]")
    assert (component.variable("k").min, component.variable("k").max) == ("5", "9")


_SPEED = {"slow": "2", "fast": "5"}


def variable(kind: str, lower: str | None = None, upper: str | None = None, items=None):
    return Variable("x", kind, min=lower, max=upper, items=items or {})


FLOATS = st.floats(allow_nan=False, allow_infinity=False)
INTEGERS = st.integers(-(2**31), 2**31 - 1)
TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"))


@given(FLOATS)
def test_a_real_comes_back_from_its_text_bit_for_bit(value):
    for kind in ("Real", "Float64"):
        found = variable(kind).typed(literal(value), "x")
        assert struct.pack("d", found) == struct.pack("d", value)
    assert variable("Real").holds(value)


@given(INTEGERS, st.booleans(), TEXTS)
def test_other_values_come_back_from_their_texts(number, truth, text):
    for kind, value in (("Integer", number), ("Int32", number), ("Boolean", truth)):
        found = variable(kind).typed(literal(value), "x")
        assert (type(found), found) == (type(value), value)
        assert variable(kind).holds(value)
    assert variable("Boolean").typed(str(truth).upper(), "x") is truth
    assert variable("String").typed(literal(text), "x") == text
    assert variable("String").holds(text)


def test_an_item_of_an_enumeration_may_be_named():
    for text in ("fast", "5", 5):
        assert variable("Enumeration", items=_SPEED).typed(text, "x") == 5
    for wrong in ("faster", 3, "0"):
        with pytest.raises(InputError) as error:
            variable("Enumeration", items=_SPEED).typed(wrong, "x")
        assert mentions(str(error.value), f"x {wrong} slow fast")


@pytest.mark.parametrize(
    ("declared", "value", "words"),
    [
        (variable("Real"), "1_000", "1_000"),
        (variable("Real"), "\u0661", "x"),
        (variable("Real"), "nan", "nan"),
        (variable("Real"), "-inf", "-inf"),
        (variable("Real"), 10**400, "x"),
        (variable("Real", "0", "2.5"), nextafter(2.5, 3.0), "2.5"),
        (variable("Real", "0", "2.5"), -5e-324, "0"),
        (variable("Integer"), "1.0", "1.0"),
        (variable("Integer"), 2**31, "2147483647"),
        (variable("Integer", "-9999999999", None), -(2**31) - 1, "-2147483648"),
        pytest.param(variable("Integer"), 10**5000, "x", id="more digits than Python writes"),
        (variable("Integer"), True, "True"),
        (variable("Int8"), 128, "127"),
        (variable("UInt8"), -1, "0"),
        (variable("UInt16"), 2**16, "65535"),
        (variable("UInt32", "2", "9"), 10, "9"),
        (variable("Int64"), 2**63, "9223372036854775807"),
        (variable("Int64", "9007199254740993"), 2**53, "9007199254740993"),
        (variable("UInt64"), 2**64, "18446744073709551615"),
        (variable("Float32"), 3.5e38, "3.402823466385289e+38"),
        (variable("Boolean"), "yes", "yes"),
        (variable("Boolean"), 2, "2"),
        (variable("String"), "a\0b", "x"),
        pytest.param(variable("String"), "\ud800", "x", id="half a pair"),
    ],
)
def test_what_the_variable_cannot_have_is_refused_by_name(declared, value, words):
    with pytest.raises(InputError) as error:
        declared.typed(value, "x")
    assert mentions(str(error.value), f"x {words}")


def test_limits_themselves_are_taken():
    for declared, limits in (
        (variable("Real", "0", "2.5"), (0.0, 2.5)),
        (variable("Integer", "-9999999999", "9999999999"), (-(2**31), 2**31 - 1)),
    ):
        assert tuple(declared.typed(value, "x") for value in limits) == limits


def test_a_value_of_another_type_is_none_of_the_variable():
    values = {"Real": 1.0, "Integer": 1, "Boolean": True, "String": "1"}
    for kind in values:
        assert [name for name, value in values.items() if variable(kind).holds(value)] == [kind]
    assert not variable("String").holds("\udc80")
    assert not variable("Integer").holds(2**31)
    ends = (-(2.0**31), 2.0**31 - 1)
    tried = np.array([ends[0] - 1, *ends, ends[1] + 1, 0.5])
    assert tried[are_of("Integer", tried)].tolist() == list(ends)


@given(FLOATS, st.floats(-1e-8, 1e-8))
def test_an_fmu_may_round_a_value_by_a_billionth(value, share):
    other = value * (1.0 + share)
    if is_finite(other) and abs(value) > 1e-300 and abs(abs(share) - 1e-9) > 1e-13:
        assert same(value, other) == (abs(share) < 1e-9)
    assert not same("1", 1) and not same(1, 2) and same(1, 1.0)


@given(st.lists(st.integers(-(2**63), 2**64 - 1)))
def test_an_integer_comes_back_from_the_row_whatever_its_size(values):
    values += [2**53, 2**53 + 1, -(2**53) - 1, 2**63 - 1, -(2**63), 2**64 - 1]
    table = StringTable()
    numbers = [table.stand_in(value) for value in values]
    assert [table.integer(number) for number in numbers] == values
    for number, value in zip(numbers, values, strict=True):
        assert number == value if abs(value) <= 2**53 else (number > 0) == (value > 0)
    for number in (2.0**65 + 2.0**13 * (len(table.state()) + 1), 2.0**65):
        with pytest.raises(ValueError, match=r"number|invalid"):
            table.integer(number)


def test_a_float32_is_what_the_fmu_will_hold():
    # 0.1 rounded to 24 bits: IEEE 754.
    assert variable("Float32", "0", "0.1").typed("0.1", "x") == 13421773 / 2**27
    assert variable("Float32").typed("1e-50", "x") == 0.0


@given(st.lists(TEXTS), st.lists(TEXTS))
def test_texts_keep_their_numbers_in_another_process(before, after):
    table, other = StringTable(), StringTable()
    numbers = {text: table.number(text) for text in before}
    other.restore(table.state())
    for text in after:
        assert other.number(text) == table.number(text)
    assert table.state() == other.state() == list(dict.fromkeys(["", *before, *after]))
    assert all(table.text(float(number)) == text for text, number in numbers.items())
    for number in (-1, len(table.state())):
        with pytest.raises(ValueError, match=str(number)):
            table.text(number)


@pytest.mark.parametrize(("fmi_type", "beyond"), [("Int64", 2.0**63), ("UInt64", 2.0**64)])
def test_no_double_beyond_64_bits_is_taken_for_the_end_of_the_range(fmi_type: str, beyond: float):
    within = nextafter(beyond, 0.0)
    assert are_of(fmi_type, np.array([0.0, within, beyond])).tolist() == [True, True, False]
