"""Programs of random systems do what FMUs of both kinds do, and the page's module as well."""

from __future__ import annotations

from shutil import which

import pytest

from fuzz import systems
from fuzz.systems import SAME_FUNCTIONS, SYSTEMS, WHOLE, findings_in_node, outcomes
from orchestrator.live import module
from orchestrator.machine.compilers import machines_compiler
from support.live import needs_zig
from support.tiers import slow

pytestmark = pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")


@pytest.mark.parametrize(("seed", "systems"), [(0, 6), *slow((1, SYSTEMS), (2, SYSTEMS))])
def test_programs_do_what_fmus_do_bit_for_bit(seed, systems):
    found = [*outcomes(seed, systems)]
    assert [one for one in found if one.findings] == []
    assert len([one for one in found if one.end == WHOLE]) > systems / 3


@needs_zig
@pytest.mark.skipif(which("node") is None, reason="node is not installed")
@pytest.mark.parametrize("seed", slow(0))
def test_the_module_of_the_page_does_what_programs_do_here(seed, monkeypatch):
    monkeypatch.setattr(module, "_FLAGS", (*module._FLAGS, "-include", str(SAME_FUNCTIONS)))
    assert findings_in_node(seed, systems=5) == []


def test_a_seed_is_a_component():
    assert systems.files_of(3) == systems.files_of(3) != systems.files_of(4)
