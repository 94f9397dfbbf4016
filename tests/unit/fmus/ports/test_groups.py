"""Groups and flat values: made from each other, and held against the ports."""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, NamedTuple, TypedDict

import pytest

from auv_fmu.linear_algebra import Matrix, Vector
from auv_fmu.quantities import NU, POSITION, TAU, per_axis
from fmus.ports.groups import Nothing, ParameterSet, packing, slices, unpacking
from fmus.ports.port import Port, inputs, outputs, parameter, parameters, setting
from fmus.python.component import Component

Vector3 = tuple[float, float, float]
Vector6 = tuple[float, float, float, float, float, float]

IN = (*inputs("tau", TAU, "Command"), *inputs("nu", NU, "Velocity"))
OUT = (*outputs("y", POSITION, "Point"), *outputs("nu", NU, "Velocity"))


class Inputs(NamedTuple):
    tau: Vector3
    nu: Vector6


class Outputs(TypedDict):
    y: Vector3
    nu: Vector6


class Reordered(NamedTuple):
    nu: Vector6
    tau: Vector3


class Short(NamedTuple):
    tau: Vector3
    nu: Vector3


class Incomplete(NamedTuple):
    tau: Vector3


class Renamed(NamedTuple):
    tau: Vector3
    velocity: Vector6


def test_values_become_groups_in_the_order_of_the_ports():
    unpack = unpacking(Inputs, IN, {})
    assert unpack([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]) == Inputs(
        tau=(1.0, 2.0, 3.0), nu=(4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
    )
    assert isinstance(unpack([0.0] * 9), Inputs)


def test_groups_become_values_in_the_order_of_the_ports_whatever_their_own():
    pack = packing(Outputs, OUT)
    groups: Outputs = {"nu": (4.0, 5.0, 6.0, 7.0, 8.0, 9.0), "y": (1.0, 2.0, 3.0)}
    assert pack(groups) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]


def test_no_groups_and_one_are_groups_too():
    assert unpacking(Nothing, (), {})([]) == Nothing()
    assert unpacking(Incomplete, IN[:3], {})([1.0, 2.0, 3.0]) == Incomplete((1.0, 2.0, 3.0))


@pytest.mark.parametrize("wrong", [Reordered, Short, Incomplete, Renamed])
def test_groups_that_are_not_those_of_the_ports_are_found_at_once(wrong: type):
    with pytest.raises(TypeError, match=wrong.__name__):
        unpacking(wrong, IN, {})


def test_a_field_may_bear_another_name_than_its_group_if_that_is_said():
    assert unpacking(Renamed, IN, {"velocity": "nu"})([0.0] * 9).velocity == (0.0,) * 6


def test_ports_of_a_group_lie_together():
    assert slices(IN) == {"tau": slice(0, 3), "nu": slice(3, 9)}
    with pytest.raises(TypeError, match="nu"):
        slices((*IN[3:5], *IN[:3], *IN[5:]))


class Gains(NamedTuple):
    K1: Vector3
    lambda_: float


class Nested(NamedTuple):
    gains: Gains
    ell: float


K1 = parameters("K1", (1.0, 2.0, 3.0), per_axis("N"), "Gain")
LAMBDA = parameter("lambda", 4.0, "1/s", "Gain")
ELL = parameter("ell", 5.0, "m", "Distance")


def test_parameters_become_the_set_of_the_equations_field_by_field():
    declared = ParameterSet(Nested, ell=ELL, gains=ParameterSet(Gains, K1=K1, lambda_=LAMBDA))
    assert [port.name for port in declared.ports] == ["ell", "K1[1]", "K1[2]", "K1[3]", "lambda"]
    values = {port.name: port.start for port in declared.ports}
    assert declared.of(values) == Nested(Gains((1.0, 2.0, 3.0), 4.0), 5.0)


@pytest.mark.parametrize(
    "fields", [{"K1": K1}, {"K1": K1[:2], "lambda_": LAMBDA}, {"K1": K1, "lambda_": K1}]
)
def test_a_field_that_is_missing_or_of_another_size_is_found_at_once(fields):
    with pytest.raises(TypeError, match=r"Gains.* has the fields .*, its parameters are "):
        ParameterSet(Gains, **fields)


def test_a_component_whose_parameters_mean_nothing_is_no_component():
    with pytest.raises(TypeError, match="Meaningless"):

        class Meaningless(Component[Nothing, Inputs, Outputs, Nothing]):
            ports = (*IN, *OUT, ELL)
            parameter_set = ParameterSet(Nothing)


class Kind(IntEnum):
    A = 1
    B = 5


class Several(NamedTuple):
    n: int
    x: float
    v: Annotated[Vector, 2]
    M: Annotated[Matrix, 2, 1]
    on: bool


def port(name: str, kind: str, causality: str = "input") -> Port:
    return Port(name, causality, "discrete", kind, "One of several")


SEVERAL = (
    port("n", "Integer"),
    port("x", "Real"),
    *(port(f"v[{i}]", "Real") for i in (1, 2)),
    *(port(f"M[{i},1]", "Real") for i in (1, 2)),
    port("on", "Boolean"),
)

#: Reals first.
VALUES = [1.5, 2.0, 3.0, 4.0, 5.0, 7, True]


def test_scalars_vectors_and_matrices_are_made_of_values_with_reals_first():
    made = unpacking(Several, SEVERAL, {})(VALUES)
    assert made == (7, 1.5, (2.0, 3.0), ((4.0,), (5.0,)), True)
    kinds = (made, made.v, made.M, made.M[0])
    assert tuple(map(type, kinds)) == (Several, Vector, Matrix, Vector)
    assert packing(Several, SEVERAL)(made) == VALUES


@pytest.mark.parametrize(
    ("name", "kind", "why"),
    [
        ("n", "Real", "Several: n is of type int, its port is a Real"),
        ("x", "Integer", "Several: x is of type float, its port is a Integer"),
        ("on", "Integer", "Several: on is of type bool, its port is a Integer"),
        ("M[2,1]", "Boolean", r"Several: M\[2,1\] is of type float, its port is a Boolean"),
    ],
)
def test_a_port_of_another_type_than_its_number_is_found_at_once(name, kind, why):
    wrong = [port(name, kind) if it.name == name else it for it in SEVERAL]
    with pytest.raises(TypeError, match=why):
        unpacking(Several, wrong, {})


class Asked(NamedTuple):
    kind: Kind


def test_an_input_may_be_a_member_of_an_enumeration():
    [made] = unpacking(Asked, [port("kind", "Integer")], {})([5])
    assert made is Kind.B


class Whole(NamedTuple):
    n: int
    kind: Kind
    pair: tuple[int, int]


WHOLE = tuple(port(name, "Integer", "output") for name in ("n", "kind", "pair[1]", "pair[2]"))


def test_integers_of_32_bits_are_packed_and_members_as_integers():
    values = packing(Whole, WHOLE)(Whole(-(2**31), Kind.B, (2**31 - 1, 0)))
    assert values == [-(2**31), 5, 2**31 - 1, 0]
    assert {*map(type, values)} == {int}


@pytest.mark.parametrize("whole", [(2**31, 0, 0), (0, -(2**31) - 1, 0), (0, 0, 10**400)])
def test_integers_of_more_bits_are_not_packed(whole):
    n, *pair = whole
    with pytest.raises(OverflowError, match="an integer exceeds 32 bits"):
        packing(Whole, WHOLE)(Whole(n, Kind.A, tuple(pair)))


class Chosen(NamedTuple):
    kind: Kind
    K: Annotated[Matrix, 1, 2]
    n: int
    on: bool
    gains: Gains


def test_parameters_are_members_of_enumerations_matrices_and_sets():
    kinds = {kind.name: kind for kind in Kind}
    declared = ParameterSet(
        Chosen,
        kind=setting("kind", "B", "Which", kinds),
        K=parameters("K", (1.0, 2.0), {"a": "1", "b": "1"}, "Gain"),
        n=setting("n", 3, "How many"),
        on=setting("on", True, "Whether"),
        gains=ParameterSet(Gains, K1=K1, lambda_=LAMBDA),
    )
    made = declared.of({port.name: port.start for port in declared.ports})
    assert made == (Kind.B, ((1.0, 2.0),), 3, True, ((1.0, 2.0, 3.0), 4.0))
    assert (type(made.kind), type(made.K), type(made.K[0])) == (Kind, Matrix, Vector)
    assert declared.paths["K.b"] == ("K", 0, 1)
    with pytest.raises(TypeError, match="kind is of type Kind, its port is a Integer"):
        ParameterSet(Only, kind=setting("kind", 1, "Which"))


class Only(NamedTuple):
    kind: Kind
