"""Groups and flat values, made from each other."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from itertools import chain
from typing import Annotated, Any, NamedTuple

import pytest

from auv_fmu import Matrix, Variable, Vector
from auv_fmu.language.quantities import NU, POSITION, TAU, per_axis
from fmus.ports.fields import declared
from fmus.ports.groups import SCOPE, Nothing, ParameterSet, hints_of, packed, slices, unpacking
from fmus.ports.port import Port

Vector3 = tuple[float, float, float]
Vector6 = tuple[float, float, float, float, float, float]
PLAIN = Variable(description="One of several")


def ports_of(made: type, causality: str = "input") -> list[Port]:
    return [*chain(*declared(made, causality).values())]


def packing(made: type) -> Callable[[Any], list[Any]]:
    """Compile functions as a slave does, into whose text they are written."""
    groups = {name: f"it.{name}" for name in hints_of(made)}
    function: Callable[[Any], list[Any]] = eval(f"lambda it: {packed(made, groups)}", {**SCOPE})
    return function


class Inputs(NamedTuple):
    tau: Annotated[Vector3, Variable(TAU, "Command")]
    nu: Annotated[Vector6, Variable(NU, "Velocity")]


class Outputs(NamedTuple):
    y: Annotated[Vector3, Variable(POSITION, "Point")]
    nu: Annotated[Vector6, Variable(NU, "Velocity")]


class One(NamedTuple):
    x: Annotated[float, PLAIN]


def test_values_become_groups_and_groups_values_in_the_order_of_the_fields():
    made = unpacking(Inputs, ports_of(Inputs))([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0])
    assert made == Inputs(tau=(1.0, 2.0, 3.0), nu=(4.0, 5.0, 6.0, 7.0, 8.0, 9.0))
    assert isinstance(made, Inputs)
    groups = Outputs(nu=(4.0, 5.0, 6.0, 7.0, 8.0, 9.0), y=(1.0, 2.0, 3.0))
    assert packing(Outputs)(groups) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]


def test_no_groups_and_one_are_groups_too():
    assert unpacking(Nothing, ())([]) == Nothing()
    assert unpacking(One, ports_of(One))([1.0]) == One(1.0)


def test_ports_of_a_group_lie_together():
    ports = ports_of(Inputs)
    assert slices(ports) == {"tau": slice(0, 3), "nu": slice(3, 9)}
    with pytest.raises(TypeError, match="nu"):
        slices((*ports[3:5], *ports[:3], *ports[5:]))


class Gains(NamedTuple):
    K1: Annotated[Vector3, Variable(per_axis("N"), "Gain")] = (1.0, 2.0, 3.0)
    lambda_: Annotated[float, Variable("1/s", "Gain", name="lambda")] = 4.0


class Nested(NamedTuple):
    ell: Annotated[float, Variable("m", "Distance")] = 5.0
    gains: Annotated[Gains, Variable(name="")] = Gains()


def test_parameters_become_the_set_of_the_equations_field_by_field():
    whole = ParameterSet(Nested, ports_of(Nested, "parameter"))
    assert [port.name for port in whole.ports] == ["ell", "K1[1]", "K1[2]", "K1[3]", "lambda"]
    values = {port.name: port.start for port in whole.ports}
    assert whole.of(values) == Nested(5.0, Gains((1.0, 2.0, 3.0), 4.0))


class Kind(IntEnum):
    A = 1
    B = 5


class Several(NamedTuple):
    n: Annotated[int, PLAIN]
    x: Annotated[float, PLAIN]
    v: Annotated[Vector, 2, PLAIN]
    M: Annotated[Matrix, 2, 1, PLAIN]
    on: Annotated[bool, PLAIN]
    one: One


#: Reals first.
VALUES = [1.5, 2.0, 3.0, 4.0, 5.0, 6.5, 7, True]


def test_scalars_vectors_matrices_and_classes_are_made_of_values_with_reals_first():
    made = unpacking(Several, ports_of(Several))(VALUES)
    assert made == (7, 1.5, (2.0, 3.0), ((4.0,), (5.0,)), True, (6.5,))
    kinds = (made, made.v, made.M, made.M[0], made.one)
    assert tuple(map(type, kinds)) == (Several, Vector, Matrix, Vector, One)
    assert packing(Several)(made) == VALUES


class Asked(NamedTuple):
    kind: Annotated[Kind, PLAIN]


def test_an_input_may_be_a_member_of_an_enumeration():
    [made] = unpacking(Asked, ports_of(Asked))([5])
    assert made is Kind.B


class Whole(NamedTuple):
    n: Annotated[int, PLAIN]
    kind: Annotated[Kind, PLAIN]
    pair: Annotated[tuple[int, int], PLAIN]


def test_integers_of_32_bits_are_packed_and_members_as_integers():
    values = packing(Whole)(Whole(-(2**31), Kind.B, (2**31 - 1, 0)))
    assert values == [-(2**31), 5, 2**31 - 1, 0]
    assert {*map(type, values)} == {int}


@pytest.mark.parametrize("whole", [(2**31, 0, 0), (0, -(2**31) - 1, 0), (0, 0, 10**400)])
def test_integers_of_more_bits_are_not_packed(whole):
    n, *pair = whole
    with pytest.raises(OverflowError, match="an integer exceeds 32 bits"):
        packing(Whole)(Whole(n, Kind.A, tuple(pair)))


class Chosen(NamedTuple):
    kind: Annotated[Kind, PLAIN] = Kind.B
    K: Annotated[Matrix, 1, 2, PLAIN] = Matrix(((1.0, 2.0),))
    n: Annotated[int, PLAIN] = 3
    on: Annotated[bool, PLAIN] = True
    gains: Gains = Gains()


def test_parameters_are_members_of_enumerations_matrices_and_sets():
    whole = ParameterSet(Chosen, ports_of(Chosen, "parameter"))
    made = whole.of({port.name: port.start for port in whole.ports})
    assert made == (Kind.B, ((1.0, 2.0),), 3, True, ((1.0, 2.0, 3.0), 4.0))
    assert (type(made.kind), type(made.K), type(made.K[0])) == (Kind, Matrix, Vector)
    assert whole.paths["K[1,2]"] == ("K", 0, 1)
    assert whole.paths["gains.lambda"] == ("gains", "lambda_")
