"""Ports follow from the fields of a class, and mistakes are named with class and field."""

from __future__ import annotations

from enum import IntEnum
from itertools import chain
from math import inf, nan
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import pytest
from fmpy.validation import validate_fmu
from hypothesis import given
from hypothesis import strategies as st

from auv_fmu import POSITIVE, Matrix, Variable, Vector
from fmus.ports.definition import DefaultExperiment, Model, Origin
from fmus.ports.description import fmi2_description, fmi3_description
from fmus.ports.fields import declared
from fmus.ports.groups import ParameterSet
from fmus.ports.port import Misdeclared, Port


class Mode(IntEnum):
    OFF = 0
    SLOW = 3
    FAST = 5


METRES = Variable("m", "Place")
PLAIN = Variable(description="Some")


def made(**fields: Any) -> Any:
    """A class `Fields` with fields, each a type or a type and a default value."""
    types = {
        name: field[0] if isinstance(field, tuple) else field for name, field in fields.items()
    }
    defaults = {name: field[1] for name, field in fields.items() if isinstance(field, tuple)}
    cls: Any = NamedTuple("Fields", [*types.items()])
    cls.__new__.__defaults__ = tuple(defaults.values())
    cls._field_defaults = defaults
    return cls


def ports(causality: str, **fields: Any) -> list[Port]:
    found = declared(made(**fields), causality)
    return [*chain(*found.values())]


def test_a_float_is_a_real_with_unit_bounds_and_start():
    note = Variable("s", "Time constant", minimum=POSITIVE, maximum=9.0, tunable=True)
    assert ports("parameter", T=(Annotated[float, note], 2)) == [
        Port(
            "T", "parameter", "tunable", "Real", "Time constant", "s", 2.0,
            minimum=POSITIVE, maximum=9.0,
        )
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("hint", "start", "kind", "zero"),
    [(int, 3, "Integer", 0), (bool, True, "Boolean", False), (float, 1.5, "Real", 0.0)],
)
def test_numbers_have_the_types_of_fmi(hint, start, kind, zero):
    [port] = ports("input", u=(Annotated[hint, PLAIN], start))
    assert (port.type, port.start) == (kind, start)
    assert port.variability == ("continuous" if hint is float else "discrete")
    assert port.unit == ("1" if hint is float else None)
    [port] = ports("input", u=Annotated[hint, PLAIN])
    assert (port.start, type(port.start)) == (zero, type(zero))
    [port] = ports("output", u=Annotated[hint, PLAIN])
    assert (port.type, port.start) == (kind, None)


@pytest.mark.parametrize("causality", ["input", "output", "parameter"])
def test_an_int_enum_is_an_enumeration(causality):
    [port] = ports(causality, mode=(Annotated[Mode, PLAIN], Mode.SLOW))
    assert (port.type, port.enumeration) == ("Enumeration", "Mode")
    assert port.start == (None if causality == "output" else 3)
    assert port.choices == {"off": Mode.OFF, "slow": Mode.SLOW, "fast": Mode.FAST}


def test_an_enumeration_starts_with_its_first_member_if_nothing_is_said():
    [port] = ports("input", mode=Annotated[Mode, PLAIN])
    assert (port.start, port.minimum, port.maximum) == (0, None, None)


@pytest.mark.parametrize(
    ("hint", "names"),
    [
        (Annotated[Vector, 2, METRES], ["p[1]", "p[2]"]),
        (Annotated[tuple[float, float], METRES], ["p[1]", "p[2]"]),
        (Annotated[Vector, 2, Variable("m", "Place", members=("x", "z"))], ["p.x", "p.z"]),
        (Annotated[Matrix, 2, 2, METRES], ["p[1,1]", "p[1,2]", "p[2,1]", "p[2,2]"]),
        (
            Annotated[tuple[tuple[int, int], tuple[int, int]], PLAIN],
            ["p[1,1]", "p[1,2]", "p[2,1]", "p[2,2]"],
        ),
        (Annotated[Vector, 1, METRES], ["p[1]"]),
        (Annotated[Vector, 2, Variable({"x": "m", "z": "m"}, "Place")], ["p.x", "p.z"]),
        (Annotated[Vector, 2, Variable({2: "m", 3: "m"}, "Place")], ["p[2]", "p[3]"]),
        (Annotated[Vector, 2, Variable("m", "Place", members=(0, 1))], ["p[0]", "p[1]"]),
    ],
)
def test_elements_have_numbers_or_names(hint, names):
    found = ports("input", p=hint)
    assert [port.name for port in found] == names
    labels = [name[1:].strip("[].") for name in names]
    text = "Some" if "int" in str(hint) else "Place"
    assert [port.description for port in found] == [f"{text}: {label}" for label in labels]


def test_members_may_have_units_of_their_own():
    note = Variable({"q": "N.m", "u": "N"}, "Command")
    found = ports("input", tau=Annotated[tuple[float, float], note])
    assert [(port.name, port.unit) for port in found] == [("tau.q", "N.m"), ("tau.u", "N")]


@pytest.mark.parametrize(
    ("note", "names"),
    [
        (Variable("m", "Place", name="lambda"), ["lambda[1]", "lambda[2]"]),
        (Variable({"x": "m", "z": "m"}, "Place", name="eta"), ["eta.x", "eta.z"]),
        (Variable("m", "Place", name="waypoint[{}].x"), ["waypoint[1].x", "waypoint[2].x"]),
        (Variable("m", "Place", members=(2, 3), name="stage[{}].t"), ["stage[2].t", "stage[3].t"]),
    ],
)
def test_a_name_may_differ_from_the_name_of_the_field(note, names):
    assert [port.name for port in ports("input", p=Annotated[Vector, 2, note])] == names


def test_the_name_of_a_class_in_a_class_may_be_another_or_none():
    fields = {"one": (Gains, Gains()), "two": (Annotated[Gains, Variable(name="")], Gains())}
    assert [port.name for port in ports("parameter", **fields)] == [
        "one.k", "one.v[1]", "one.v[2]", "k", "v[1]", "v[2]",
    ]  # fmt: skip
    [first, *_] = ports("parameter", p=(Annotated[Gains, Variable(name="a.b")], Gains()))
    assert first.name == "a.b.k"
    with pytest.raises(
        Misdeclared, match=r"^Fields.p is a NamedTuple, and its Variable may have only"
    ):
        ports("parameter", p=(Annotated[Gains, PLAIN], Gains()))


def test_choices_that_differ_in_capitals_only_are_refused():
    alike = IntEnum("Alike", {"A": 0, "a": 1})
    with pytest.raises(Misdeclared, match="has choices of Alike that differ only in capitals"):
        ports("input", p=Annotated[alike, PLAIN])


def test_elements_start_with_the_elements_of_the_default_value():
    rows = Matrix(((1.0, 2.0), (3.0, 4.0)))
    found = ports("parameter", K=(Annotated[Matrix, 2, 2, METRES], rows))
    assert [port.start for port in found] == [1.0, 2.0, 3.0, 4.0]


class Gains(NamedTuple):
    k: Annotated[float, PLAIN] = 1.0
    v: Annotated[tuple[float, float], PLAIN] = (2.0, 3.0)


def test_a_class_in_a_class_is_a_group_with_its_own_start_values():
    found = declared(made(gains=(Gains, Gains(k=5.0))), "parameter")["gains"]
    assert {port.name: port.start for port in found} == {
        "gains.k": 5.0, "gains.v[1]": 2.0, "gains.v[2]": 3.0,
    }  # fmt: skip
    assert ParameterSet(Gains, found).of(
        {"gains.k": 7.0, "gains.v[1]": 8.0, "gains.v[2]": 9.0}
    ) == Gains(7.0, (8.0, 9.0))
    assert [port.start for port in ports("parameter", gains=Gains)] == [1.0, 2.0, 3.0]


def test_outputs_depend_on_what_is_said_or_else_on_what_all_do():
    fields = made(
        a=Annotated[float, PLAIN],
        b=Annotated[float, Variable(feedthrough=())],
        c=Annotated[tuple[float, float], Variable(feedthrough=("u[{}]",), initially=())],
    )
    found = declared(fields, "output", ("u", "v"), ("w",))
    ports = [*chain(*found.values())]
    assert [(port.feedthrough, port.initially) for port in ports] == [
        (("u", "v"), ("w",)), ((), ("w",)), (("u[1]",), ()), (("u[2]",), ()),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("causality", "field", "why"),
    [
        ("input", float, 'has no unit and no description; write p: Annotated[float, Variable("m",'),
        ("input", Vector, "has no unit and no description; write p: Annotated[Vector, 3, Variable"),
        ("input", Annotated[Vector, METRES], "is a Vector without its size; write Annotated[Vecto"),
        ("input", Annotated[Matrix, 2, METRES], "is a Matrix without its size; write Annotated[Ma"),
        ("input", Annotated[Vector, 0, METRES], "is a Vector without its size"),
        ("input", Annotated[str, METRES], "has the type str; use float, int, bool, an IntEnum, a "),
        ("input", Annotated[list[float], METRES], "has the type list[float]; use float"),
        ("input", Annotated[tuple[float, int], METRES], "has elements of several types; write a N"),
        ("input", Annotated[int, METRES], "is of the type int; only a float has a unit"),
        ("input", Annotated[Vector, 3, Variable(members=("x", "y"))], "has 2 members for 3 number"),
        ("input", Annotated[float, Variable(members=("x",))], "has 1 members for one numbers"),
        ("input", Annotated[float, Variable(tunable=True)], "is no parameter, and tunable is for "),
        ("output", Annotated[float, Variable(terminal="y")], "is no input, and terminal is for "),
        ("input", Annotated[float, Variable(terminal="a b")], "has the terminal 'a b'; write a"),
        ("input", Annotated[float, Variable(feedthrough=())], "is no output, and feedthrough is f"),
        ("output", Annotated[float, Variable(feedthrough="u")], "has the feedthrough 'u'; write a"),
        ("output", Annotated[float, Variable(minimum=0.0)], "is an output; minimum and maximum ar"),
        ("parameter", Annotated[float, METRES], "has no default value, which a parameter starts w"),
        ("input", (Annotated[float, METRES], "x"), "starts with p = 'x': must be a Real"),
        ("input", (Annotated[float, METRES], None), None),
        ("input", (Annotated[int, PLAIN], 1.5), "starts with p = 1.5: must be an Integer"),
        ("input", (Annotated[float, METRES], float("nan")), "starts with p = nan: must be finite"),
        ("parameter", (Annotated[float, Variable(minimum=1.0)], 0.0), "starts with p = 0: must be"),
        ("input", Annotated[float, Variable(minimum=1.0)], "starts with p = 0: must be at least 1"),
        ("parameter", (Annotated[Vector, 2, METRES], Vector((1.0,))), "starts with (1.0,), which "),
        ("parameter", (Annotated[Vector, 2, METRES], 1.0), "starts with 1.0, which has not 2 elem"),
        ("parameter", (Annotated[Mode, PLAIN], 3), "starts with 3, which is no Mode"),
        ("parameter", (Gains, 3), "starts with 3, which is no Gains"),
        ("input", Annotated[Vector, 2, Variable(members=("x", "x"))], "has the members ('x', 'x')"),
        ("input", Annotated[Vector, 2, Variable(members=('a"b', "c"))], "has the members ('a\"b'"),
        ("input", Annotated[Vector, 2, Variable(members="xz")], "has the members 'xz'; write a tu"),
        ("input", Annotated[bool, Variable(minimum=0)], "has a minimum, which is for a float or a"),
        ("input", Annotated[int, Variable(minimum=0.5)], "has the minimum 0.5, which is not a fin"),
        ("input", Annotated[int, Variable(maximum=2**31)], "has the maximum 2147483648, which is "),
        ("input", Annotated[float, Variable(maximum=inf)], "has the maximum inf, which is not a f"),
        ("input", Annotated[float, Variable(minimum=1.0, maximum=-1.0)], "has the minimum 1.0 abo"),
        ("input", Annotated[Mode, Variable(minimum=0)], "has a minimum, which is for a float or a"),
        ("parameter", (Annotated[Mode, Variable(minimum=0)], Mode.OFF), "has a minimum, which is "),
        ("input", Annotated[float, Variable("m", "a\vb")], "has the description 'a\\x0bb'; write "),
        ("input", Annotated[float, Variable("m", "a\nb")], "has the description 'a\\nb'; write on"),
        ("input", Annotated[float, Variable("cubic m/s")], "has the unit 'cubic m/s'; write it wi"),
        ("input", Annotated[IntEnum("Far", {"A": 0, "B": 5 * 10**9}), PLAIN], None),
        ("input", (Annotated[float, METRES], 10**400), "starts with p = 1000000000000000000"),
    ],
)  # fmt: skip
def test_mistakes_are_named(causality, field, why):
    if isinstance(field, tuple) and why is None:
        assert ports(causality, p=field)[0].start == 0.0
        return
    with pytest.raises(Misdeclared) as caught:
        ports(causality, p=field)
    if why is None:
        why = "Far has the member 'B' = 5000000000; write a name and 32 bits"
        assert (str(caught.value), caught.value.place) == (why, ("Far", "B"))
        return
    assert str(caught.value).startswith(f"Fields.p {why}")
    assert caught.value.place == ("Fields", "p")


def test_a_type_that_is_not_known_is_named_with_its_field():
    cls = made(u=Annotated[float, METRES], v=float)
    cls.__annotations__ = {"u": "float", "v": "Annotate[float, 3]"}
    with pytest.raises(Misdeclared, match=r"^Fields\.v has a type .*: name 'Annotate' is not def"):
        declared(cls, "input")


def test_a_name_that_fmi_does_not_know_is_refused():
    with pytest.raises(Misdeclared, match=r"^Fields\.\u03bc is not a name of FMI; use the letters"):
        declared(made(**{"\u03bc": Annotated[float, METRES]}), "input")


# Anything that can be written

Odd = IntEnum("Odd", {'a"b': 0, "c": 1})  # type: ignore[misc]
Far = IntEnum("Far", {"A": 0, "B": 5 * 10**9})  # type: ignore[misc]


def mostly(value: Any, other: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """A good value, or once in a while any other."""
    return st.integers(0, 7).flatmap(lambda k: st.just(value) if k else other)


texts = st.sampled_from(("m", "\u00b5m", 'a"b\\', "<&>", "two words", 5)) | st.text(max_size=3)
numbers: st.SearchStrategy[Any] = st.sampled_from(
    (0, 1, -1, 0.5, -0.0, True, nan, inf, 2**31, 10**400, 5e-324, "0")
)
starts = numbers | st.sampled_from((Mode.SLOW, (1, 2), Odd.c, Matrix(((1.0, 2.0),))))
members = st.sampled_from((("x", "z"), ("x", "x"), ('a"b', "c"), ("1", "2"), "xz", ("x",)))
kinds: st.SearchStrategy[Any] = st.sampled_from(
    (
        ((float,), -0.0), ((float,), 2), ((int,), 3), ((bool,), True), ((Mode,), Mode.SLOW),
        ((Vector, 2), Vector((1.0, -0.0))), ((tuple[int, int],), (1, 2)),
        ((Matrix, 1, 2), Matrix(((1.0, 2.0),))), ((tuple[bool, bool],), (True, False)),
        ((tuple[float, int],), (0.0, 1)), ((str,), ""), ((Vector,), None), ((Odd,), Odd.c),
        ((Far,), Far.A),
    )
)  # fmt: skip


@st.composite
def fields(draw: st.DrawFn) -> tuple[Any, Any]:
    """A type with a declaration, and a start value."""
    kind, start = draw(kinds)
    unit = "N" if kind[0] in (float, Vector, Matrix) else "1"
    bounds = (draw(mostly(None, numbers)) for _ in range(2))
    note = Variable(
        draw(mostly(unit, texts)),
        draw(mostly("Plain", texts)),
        *bounds,
        draw(mostly(False, st.just(True))),
        draw(mostly((), members)),
    )
    return Annotated[(*kind, note)], draw(mostly(start, starts))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("described")


@given(
    causality=st.sampled_from(("input", "output", "parameter")),
    fields=st.dictionaries(mostly("p", st.sampled_from(("q_", "\u03bc"))), fields(), max_size=2),
)
def test_what_is_declared_can_be_described(folder, causality, fields):
    """A flaw is told in one line; without one, the schemas and rules of FMI have no objection."""
    flaw = None
    try:
        found = ports(causality, **fields)
    except Misdeclared as error:
        flaw = error
    if flaw:
        assert len(str(flaw).splitlines()) == 1
        assert flaw.place[0] in ("Fields", "Odd", "Far")
        return
    model = Model("It", "A thing", Origin(), tuple(found), DefaultExperiment(100.0, 0.02))
    for describe in (fmi2_description, fmi3_description):
        (folder / "modelDescription.xml").write_bytes(describe(model, "{1}"))
        assert validate_fmu(str(folder)) == []
