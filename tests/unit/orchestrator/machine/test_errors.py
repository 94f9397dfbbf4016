"""Messages name few of many, and hint at names that were likely meant."""

from __future__ import annotations

from orchestrator.machine.errors import did_you_mean, listed


def test_of_many_names_the_first_are_said_and_how_many_more():
    assert listed("abc") == "a, b, c" and listed([]) == ""
    assert listed("abcde", "+") == "a+b+c+d+e"
    assert listed("abcdefgh").startswith("a, b, c, d, e ") and "3" in listed("abcdefgh")


def test_a_hint_names_members_other_case_and_near_names_only():
    assert did_you_mean("y", ["y[1]", "y[2]", "x"]).endswith("y[1] or y[2]?")
    assert did_you_mean("Plant", ["plant", "planner"]).endswith("plant?")
    assert did_you_mean("zzz", ["plant"]) == ""
