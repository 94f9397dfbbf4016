"""Names of ports are taken apart at their dots, and every system tells names of files apart."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.system.names import (
    file_name,
    flatten,
    listed,
    plain_file_names,
    port_name,
    splits,
)
from orchestrator.machine.errors import InputError

#: Words, signs of paths, and letters that some file systems take for others.
NAMES = st.one_of(
    st.text("aAbß.é/\\:*? -_", max_size=6),
    st.text(max_size=300),
    st.sampled_from(["con", "LPT1.x", "..", ".git", "x" * 300]),
)


@given(st.text("ab.", max_size=8))
def test_a_name_is_taken_apart_at_every_dot_the_longest_component_first(text):
    found = list(splits(text))
    assert {".".join(parts) for parts in found} <= {text}
    dots = [i for i, letter in enumerate(text) if letter == "."]
    assert [len(first) for first, _ in found] == dots[::-1]


def test_a_port_name_needs_both_of_its_parts():
    assert str(port_name("a.b.c")) == "a.b.c" and port_name("a.b.c").component == "a"
    for text in ("a", ".b", "a.", ""):
        with pytest.raises(InputError, match=repr(text)):
            port_name(text)


def test_keys_may_be_quoted_or_dotted():
    table = {"a": {"b": 1, "c.d": {"e": 2}}, "a.f": 3, "g": {"at": 4}}
    assert dict(flatten(table)) == {"a.b": 1, "a.c.d.e": 2, "a.f": 3, "g.at": 4}
    values = dict(flatten(table, lambda value: "at" in value))
    assert values == {"a.b": 1, "a.c.d.e": 2, "a.f": 3, "g": {"at": 4}}


@given(st.lists(NAMES, unique=True))
def test_every_name_has_a_file_of_its_own_on_every_system(names):
    found = [file_name(name) for name in names]
    assert len(set(found)) == len(names)
    for name in found:
        assert not re.search(r'[/\\:*?"<>|\0\n]', name) and not name.startswith(".")
        assert name == name.strip() and not name.endswith(".") and 0 < len(name.encode()) < 200
        assert name.split(".")[0].lower() not in ("con", "lpt1")
    beside: list[str] = []
    for name in names:
        beside.append(file_name(name, beside))
    assert len({name.casefold() for name in beside}) == len(names)


@given(st.lists(NAMES), st.lists(NAMES))
def test_names_in_a_uri_are_plain_and_no_two_differ_in_case_only(names, taken):
    found = plain_file_names(names, *taken)
    assert len(found) == len(names) == len({name.lower() for name in found})
    assert {name.lower() for name in found}.isdisjoint(name.lower() for name in taken)
    assert all(re.fullmatch(r"[A-Za-z0-9_.-]*", name) for name in found)


def test_of_many_names_the_first_are_said_and_how_many_more():
    assert listed("abc") == "a, b, c" and listed([]) == ""
    assert listed("abcde", "+") == "a+b+c+d+e"
    assert listed("abcdefgh").startswith("a, b, c, d, e ") and "3" in listed("abcdefgh")


def test_names_of_the_bundle_stay_as_they_are():
    for name in ("fig4", "fig5-pd", "my law (2)", "Größe_1", "v1.2+x"):
        assert file_name(name) == name
