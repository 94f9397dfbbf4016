"""The bundle in other co-simulation tools; those that are not installed are skipped."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest

from orchestrator import bundle
from orchestrator.hosts import HOSTS, compare
from orchestrator.scenario import read_scenario


@pytest.mark.parametrize("scenario", ["fig4", "fig5-pd"])
@pytest.mark.parametrize("host", HOSTS)
def test_host_gives_the_numbers_of_our_jacobi_master(dist: Path, host: str, scenario: str):
    """Every Real output over 500 steps, to 1e-9; fmpy.ssp ignores parameters, so fig4 only."""
    if find_spec(HOSTS[host].package) is None:
        pytest.skip(f"{HOSTS[host].package} is not installed")
    if host == "fmpy-ssp" and scenario != "fig4":
        pytest.skip("fmpy.ssp ignores parameter sets")
    system = bundle.closed_loop(dist, read_scenario(scenario))
    [verdict] = compare(system, [host], 500, 0.02)
    assert verdict.failure is None
    assert verdict.deviation <= HOSTS[host].bound


def test_missing_host_is_reported_and_does_not_end_the_others(dist: Path, monkeypatch):
    monkeypatch.setitem(
        HOSTS, "ghost", HOSTS["ecos"].__class__("no-such-package", HOSTS["ecos"].run)
    )
    system = bundle.closed_loop(dist)
    verdicts = compare(system, ["ghost", "fmpy-ssp"], 50, 0.02)
    assert "not installed" in str(verdicts[0].failure)
    assert verdicts[1].failure is None
