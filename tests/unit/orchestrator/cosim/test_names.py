"""Names of ports are taken apart at their dots."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orchestrator.cosim.connection import PortName
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
