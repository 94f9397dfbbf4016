"""Programs of random systems do what FMUs of both kinds do."""

from __future__ import annotations

import pytest

from fuzz.systems import SYSTEMS, WHOLE, outcomes
from orchestrator.machine.compilers import machines_compiler


@pytest.mark.slow
@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_programs_do_what_fmus_do_bit_for_bit():
    found = [*outcomes(1)]
    assert [outcome for outcome in found if outcome.findings] == []
    assert len([outcome for outcome in found if outcome.end == WHOLE]) > SYSTEMS / 4
