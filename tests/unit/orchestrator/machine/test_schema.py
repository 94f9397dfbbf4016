"""Valid tables pass, and each mistake is reported once, with its path and the valid values."""

from __future__ import annotations

from copy import deepcopy
from typing import Annotated, Any, ClassVar

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydantic import ConfigDict, Field, model_validator

from orchestrator.machine.errors import Refused
from orchestrator.machine.schema import Names, OneOf, TomlTable, entries, entry, needed
from orchestrator.machine.texts import flatten
from support.texts import mentions


class Leg(TomlTable):
    length: float = needed("How long.", "1.5")
    speed: float = entry("How fast.", "as fast as it goes")


class Route(TomlTable):
    who: Names = needed("Who goes.", '"anna"')
    times: Annotated[int, Field(ge=1, le=1000)] = entry("How often.", "once")
    pace: Annotated[str, OneOf(("slow", "fast"))] = entry("In which way.", "slow")
    is_back: bool = entry("Whether back.", "no", key="back")
    legs: list[Leg] = entry("In parts.", "in one")
    rest: float | Leg = entry("What follows.", "nothing")

    @model_validator(mode="after")
    def _is_no_circle(self) -> Route:
        if self.is_back and not self.legs:
            raise ValueError("goes back from nowhere")
        return self


class Routes(TomlTable):
    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Route]
    named: ClassVar = Route


WHOLE: dict[str, Any] = {
    "who": ["anna", "bert"], "times": 3, "pace": "fast", "back": True,
    "legs": [{"length": 1}, {"length": 2.5, "speed": 1.0}], "rest": {"length": 3.0},
}  # fmt: skip


@pytest.mark.parametrize("gone", [(), ("times", "pace"), ("back", "legs"), ("rest",)])
def test_valid_tables_pass_unchanged(gone):
    content = {key: value for key, value in WHOLE.items() if key not in gone}
    before = deepcopy(content)
    Route.check("a.toml", content)
    assert content == before
    Routes.check("a.toml", {"home": content, "away": {"who": "anna", "rest": 2}})


@pytest.mark.parametrize(
    ("change", "culprits"),
    [
        ({"time": 3}, ["time times"]),
        ({"who": 3}, ["who 3"]),
        ({"who": ["anna", 3]}, ["who 3"]),
        ({"times": 1001}, ["times 1001 1,000"]),
        ({"times": 2.0}, ["times 2.0"]),
        ({"times": True}, ["times true"]),
        ({"pace": "fats"}, ["pace fats slow fast"]),
        ({"back": 1}, ["back 1 true false"]),
        ({"rest": "none"}, ["rest none"]),
        ({"rest": float("nan")}, ["rest nan"]),
        # The value has the second of the two allowed types: a table.
        ({"rest": {"length": "far"}}, ["rest length far"]),
        ({"legs": [{"length": 1.0}, {"length": "x"}]}, ["leg 2 length x"]),
        ({"legs": [{"speed": 1.0}]}, ["leg 1 length 1.5"]),
        ({"legs": []}, ["goes back from nowhere"]),
        ({"times": 0, "pace": "x"}, ["times 0", "pace x"]),
    ],
)
def test_each_mistake_is_reported_once(change, culprits):
    for table, content in ((Route, {**WHOLE, **change}), (Routes, {"home": {**WHOLE, **change}})):
        with pytest.raises(Refused) as error:
            table.check("a.toml", content)
        problems = error.value.problems
        assert len(problems) == len(culprits)
        for problem, words in zip(problems, culprits, strict=True):
            assert problem.startswith("a.toml: ") and problem.isprintable()
            assert mentions(problem, words + (" home" if table is Routes else ""))


def test_entries_have_the_order_and_keys_of_the_file():
    found = entries(Route)
    assert list(found) == ["who", "times", "pace", "back", "legs", "rest"]
    assert found["back"].meaning == "Whether back." and found["back"].default == "no"
    assert mentions(found["times"].type, "1 1,000") and mentions(found["pace"].type, "slow fast")
    # An optional entry cannot be None, which TOML lacks.
    assert not any("None" in field.type for field in found.values())


class Loose(TomlTable):
    values: dict[str, Any] = entry("Any.", "none")
    parts: list[dict[str, Any]] = entry("Any, in parts.", "none")


#: Names in one to three parts, which a file may quote or not.
NAMES = st.lists(st.sampled_from("ab"), min_size=1, max_size=3).map(tuple)


def nested(names: list[tuple[tuple[str, ...], int]]) -> dict[str, Any]:
    """Nest values by their names, some of whose first parts are quoted as one key."""
    table: dict[str, Any] = {}
    for name, quoted in names:
        *path, last = (".".join(name[:quoted]), *name[quoted:]) if quoted else name
        inner = table
        for part in path:
            inner = inner.setdefault(part, {})
            if not isinstance(inner, dict):
                return {}
        if last in inner:
            return {}
        inner[last] = 1
    return table


@given(st.lists(st.tuples(NAMES, st.integers(0, 3)), max_size=5))
def test_a_name_that_is_stated_twice_is_reported_for_any_quoting(names):
    table = nested(names)
    stated = [".".join(name) for name, _ in names if table]
    # Skip names that TOML refuses, or that no system has.
    assume(not any(name.startswith(f"{other}.") for name in stated for other in stated))
    twice = {name for name in stated if stated.count(name) > 1}
    for content, where in (({"values": table}, "values"), ({"parts": [{}, table]}, "part 2")):
        problems: tuple[str, ...] = ()
        try:
            Loose.check("a.toml", content)
        except Refused as error:
            problems = error.problems
        assert {*problems} == {f"a.toml: {where}: {name} is stated twice" for name in twice}


def test_keys_may_be_quoted_or_dotted():
    table = {"a": {"b": 1, "c.d": {"e": 2}}, "a.f": 3, "g": {"at": 4}}
    assert dict(flatten(table)) == {"a.b": 1, "a.c.d.e": 2, "a.f": 3, "g.at": 4}
    values = dict(flatten(table, lambda value: "at" in value))
    assert values == {"a.b": 1, "a.c.d.e": 2, "a.f": 3, "g": {"at": 4}}
