"""The bundle in other co-simulation tools; a tool that is not installed is skipped."""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

from orchestrator.exchange.hosts import HOSTS, compare
from orchestrator.exchange.verify import verify
from orchestrator.formats.ssp.writer import structure_xml
from orchestrator.machine.children import machines_compiler
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from orchestrator.system.names import PortName
from orchestrator.system.structure import System
from support.tiers import slow

LIBDIR = sysconfig.get_config_var("LIBDIR")


def check(system: System, host: str, steps: int) -> None:
    """Hold all Real outputs of a host against ours; without the host the test is skipped."""
    if find_spec(HOSTS[host].package) is None:
        pytest.skip(f"{HOSTS[host].package} is not installed")
    [verdict] = compare(system, [host], steps, 0.02)
    assert verdict.failure is None
    assert verdict.deviation <= HOSTS[host].bound


@pytest.mark.parametrize("scenario", ["fig4", *slow("fig5-pd")])
@pytest.mark.parametrize("host", HOSTS)
def test_host_gives_the_numbers_of_our_jacobi_master(dist: Path, host: str, scenario: str):
    """Every Real output over 500 steps, to 1e-9; fmpy.ssp ignores parameters, so fig4 only."""
    if host == "c-program" and machines_compiler() is None:
        pytest.skip("there is no C compiler")
    if host == "fmpy-ssp" and scenario != "fig4":
        pytest.skip("fmpy.ssp ignores parameter sets")
    check(closed_loop(dist, read_scenario(scenario)), host, 500)


@pytest.mark.parametrize("host", ["libcosim-ssp", *slow("ecos")])
def test_text_in_a_parameter_set_reaches_its_component_without_a_connector(dist: Path, host: str):
    """The other saturation moves the vehicle by 19 cm in these steps."""
    system = closed_loop(dist).with_parameters({PortName("controller", "saturation"): "algebraic"})
    assert b'name="saturation"' not in structure_xml(system)
    check(system, host, 300)


@pytest.mark.parametrize("host", slow("libcosim-ssp", "libcosim-osp"))
def test_longer_steps_of_components_are_those_of_libcosim(dist: Path, host: str):
    system = replace(closed_loop(dist), steps={"controller": 0.06, "disturbance": 0.04})
    check(system, host, 300)


@pytest.mark.parametrize(
    "host", ["c-program", *slow(*(name for name in HOSTS if name not in ("c-program", "ecos")))]
)
def test_a_start_time_reaches_the_host(dist: Path, host: str):
    """The disturbance (56) is a function of the time."""
    if host == "c-program" and machines_compiler() is None:
        pytest.skip("there is no C compiler")
    check(replace(closed_loop(dist), start_time=10.0), host, 300)


@pytest.mark.skipif(find_spec("ecospy") is None, reason="ecospy is not installed")
def test_ecos_refuses_a_start_time(dist: Path):
    [verdict] = compare(replace(closed_loop(dist), start_time=10.0), ["ecos"], 3, 0.02)
    assert "from 10 s" in str(verdict.failure)


def test_missing_host_is_reported_and_does_not_end_the_others(dist: Path, monkeypatch):
    monkeypatch.setitem(
        HOSTS, "ghost", HOSTS["ecos"].__class__("no-such-package", HOSTS["ecos"].run)
    )
    system = closed_loop(dist)
    verdicts = compare(system, ["ghost", "fmpy-ssp"], 50, 0.02)
    assert "not installed" in str(verdicts[0].failure)
    assert verdicts[1].failure is None


@pytest.mark.skipif(find_spec("ecospy") is None, reason="ecospy is not installed")
def test_ecos_command_line_runs_the_ssp_with_an_empty_environment(dist: Path, tmp_path: Path):
    """A host that is no Python program; its table has six digits."""
    [package] = getattr(find_spec("ecospy"), "submodule_search_locations", [])
    command = tmp_path / "ecos"
    shutil.copy(Path(package, "binaries", "ecos"), command)
    command.chmod(0o755)
    process = subprocess.run(
        [command, "simulate", "--path", dist / "auv.ssp", "--stopTime", "5", "--stepSize", "0.02"],
        cwd=tmp_path, env={"LD_LIBRARY_PATH": f"{sys.prefix}/lib:{LIBDIR}"},
        check=False, capture_output=True, text=True,
    )  # fmt: skip
    assert process.returncode == 0, process.stdout + process.stderr
    said = verify(tmp_path / "auv.csv", closed_loop(dist), 1e-5)
    assert "to 5 s, in jacobi order" in said
