"""Random components: a few of those that `python -m fuzz components` tries."""

from __future__ import annotations

import pytest

from fuzz.components import findings, text_of
from orchestrator.machine.compilers import machines_compiler
from support.tiers import slow


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
@pytest.mark.parametrize("seed", [*range(2), *slow(*range(2, 5))])
def test_what_check_passes_is_built_and_does_the_same_in_both_kinds(seed):
    assert findings(seed) == []


def test_a_seed_is_a_component():
    assert text_of(6) == text_of(6) != text_of(8)
