"""The shape of states: their size, and the way back from JSON."""

from __future__ import annotations

import json
from math import inf, isfinite, nan, sqrt
from typing import NamedTuple, Union

import pytest

from fmus.ports.port import Refusal
from fmus.python.shape import measuring, restored


class Pair(NamedTuple):
    x: float
    y: tuple[float, float]


class Whole(NamedTuple):
    n: int
    pair: Pair
    maybe: float | None
    either: Union[Pair, str]  # noqa: UP007  as components for Python 3.9 write it
    many: tuple[float, ...]
    on: bool
    text: str
    alone: float


WHOLE = Whole(9, Pair(1.0, (-2.0, 4.0)), 8.0, "b", (16.0, 32.0), True, "a", -64.0)


def test_size_is_the_euclidean_norm_of_all_floats():
    assert measuring(Whole)(WHOLE) == pytest.approx(sqrt(sum(4.0**k for k in range(7))))
    other = WHOLE._replace(maybe=None, either=Pair(0.0, (0.0, 8.0)))
    assert measuring(Whole)(other) == pytest.approx(sqrt(sum(4.0**k for k in range(7))))


def test_whole_numbers_in_the_place_of_floats_have_a_size():
    assert measuring(Pair)(Pair(3, (0, -4))) == 5.0


@pytest.mark.parametrize("bad", [nan, inf, -inf])
@pytest.mark.parametrize(
    "spoil",
    [
        lambda bad: {"pair": Pair(bad, (0.0, 0.0))},
        lambda bad: {"pair": Pair(0.0, (0.0, bad))},
        lambda bad: {"maybe": bad},
        lambda bad: {"either": Pair(0.0, (bad, 0.0))},
        lambda bad: {"many": (0.0, bad)},
        lambda bad: {"alone": bad},
    ],
)
def test_what_is_not_finite_makes_the_size_not_finite(spoil, bad):
    spoiled = WHOLE._replace(**spoil(bad))
    assert not isfinite(measuring(Whole)(spoiled))


@pytest.mark.parametrize("whole", [WHOLE, WHOLE._replace(maybe=None, either=Pair(0.5, (1.0, 2.0)))])
def test_json_gives_a_state_back(whole):
    again = restored(Whole, json.loads(json.dumps(whole)))
    assert again == whole
    assert type(again) is Whole
    assert type(again.pair) is Pair
    assert type(again.either) is type(whole.either)


@pytest.mark.parametrize(
    ("kind", "value", "why"),
    [
        (Pair, [1.0], "[1.0] in the place of 2 values"),
        (Pair, 1.0, "1.0 in the place of 2 values"),
        (Pair, [1.0, [1.0, 2.0, 3.0]], "[1.0, 2.0, 3.0] in the place of 2 values"),
        (float, nan, "a value is not finite"),
        (float, -inf, "a value is not finite"),
        (float, True, "True is no float"),
        (float, "x" * 99, f"'{'x' * 39} is no float"),
        (int, 1.0, "1.0 is no int"),
        (bool, 1, "1 is no bool"),
        (str, None, "None is no str"),
        (int | None, 1.5, "1.5 is no int, 1.5 is no NoneType"),
    ],
)
def test_what_is_of_another_shape_is_refused(kind, value, why):
    with pytest.raises(Refusal) as refusal:
        restored(kind, value)
    assert str(refusal.value) == why


def test_whole_numbers_may_stand_for_floats():
    """JSON of another writer may lack the point."""
    assert restored(Pair, [1, [2, 3]]) == (1, (2, 3))


@pytest.mark.parametrize("kind", [frozenset, tuple])
def test_what_is_of_no_known_type_is_left_as_it_is(kind):
    assert restored(kind, [1, [2, [3]]]) == (1, (2, (3,)))
