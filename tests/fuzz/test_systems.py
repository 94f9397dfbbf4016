"""Programs of random systems do what FMUs of both kinds do."""

from __future__ import annotations

import pytest

from fuzz.systems import SYSTEMS, WHOLE, files_of, outcomes
from orchestrator.machine.compilers import machines_compiler
from support.tiers import slow


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
@pytest.mark.parametrize(("seed", "systems"), [(0, 4), *slow((1, SYSTEMS))])
def test_programs_do_what_fmus_do_bit_for_bit(seed, systems):
    found = [*outcomes(seed, systems)]
    assert [one for one in found if one.findings] == []
    assert len([one for one in found if one.end == WHOLE]) > systems / 3


def test_a_seed_is_a_component():
    assert files_of(3) == files_of(3) != files_of(4)
