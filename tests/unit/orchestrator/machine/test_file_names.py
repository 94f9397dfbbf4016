"""Every system tells the names of files apart."""

from __future__ import annotations

import re

from hypothesis import given
from hypothesis import strategies as st

from orchestrator.machine.file_names import file_name, plain_file_names

#: Words, signs of paths, and letters that some file systems take for others.
NAMES = st.text("aAbß.é/\\:*? -_", max_size=6) | st.sampled_from(["con", "LPT1.x", "..", "x" * 300])


@given(st.lists(NAMES, unique=True))
def test_every_name_has_a_file_of_its_own_on_every_system(names):
    found = [file_name(name) for name in names]
    assert len(set(found)) == len(names)
    for name in found:
        assert not re.search(r'[/\\:*?"<>|\0]', name) and not name.startswith(".")
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
