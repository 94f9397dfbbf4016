"""Texts of files become numbers only where every program reads the same number."""

from __future__ import annotations

import pytest

from orchestrator.machine.texts import finite, integer, is_finite, real, whole


def test_finite_numbers_are_told_from_others():
    numbers = [1, 1.5, -(10**308), True, "1", None, float("nan"), float("inf"), 10**309]
    assert [is_finite(number) for number in numbers] == [True] * 3 + [False] * 6


@pytest.mark.parametrize("read", [real, integer, lambda text: finite(text, "line 3")])
@pytest.mark.parametrize("text", ["1_000", "\u0661", "one", ""])
def test_what_only_python_takes_for_a_number_is_refused(read, text):
    with pytest.raises(ValueError, match=r"number|literal|convert"):
        read(text)


def test_an_integer_may_be_written_with_a_point():
    assert whole("3.0", "u:") == 3 and whole("9007199254740993", "u:") == 2**53 + 1
    for text in ("3.5", "inf"):
        with pytest.raises(ValueError, match=r"u: '"):
            whole(text, "u:")
