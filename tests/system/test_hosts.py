"""The bundle in other co-simulation tools; a tool that is not installed is skipped."""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

from fmus.kinds import FMI_VERSIONS
from orchestrator.commands import exchange
from orchestrator.commands.main import main
from orchestrator.cosim import Experiment, PortName, System
from orchestrator.exchange import hosts
from orchestrator.exchange.hosts import HOSTS, Host, compare, folder_of, is_whole
from orchestrator.exchange.verify import verify
from orchestrator.machine.errors import InputError
from orchestrator.runs.scenario import read_scenario
from orchestrator.runs.wiring import closed_loop
from support import small_fmus
from support.fleets import fleet_of
from support.small_fmus import connected, description, unknown, variable, write
from support.tiers import slow

LIBDIR = sysconfig.get_config_var("LIBDIR")


#: Hosts installed next to this program, and hosts with their own environments.
BESIDE = [name for name, host in HOSTS.items() if not host.pins]
APART = [name for name, host in HOSTS.items() if host.pins]

#: Hosts that apply no parameters; drivers pass none on.
WITHOUT_PARAMETERS = ["fmpy", "fmpy-ssp"]


def require(host: str) -> None:
    """Skip the test without the host."""
    pins = HOSTS[host].pins
    if HOSTS[host].label() is None or (pins and not is_whole(folder_of(pins))):
        pytest.skip(f"{HOSTS[host].package} is not installed")


def check(system: System, host: str, steps: int) -> None:
    """Compare all Real outputs of a host with the master's."""
    require(host)
    [verdict] = compare(system, [host], steps, 0.02)
    assert verdict.failure is None
    assert verdict.deviation <= 1e-9


@pytest.mark.parametrize("host", [*BESIDE, *slow(*APART)])
def test_host_gives_the_numbers_of_our_master_in_its_order(dist: Path, host: str):
    """Every Real output over 100 steps, with the other controller where parameters are applied."""
    scenario = "fig4" if host in (*WITHOUT_PARAMETERS, *APART) else "fig5-pd"
    check(closed_loop(dist, read_scenario(scenario)), host, 100)


def fleet(dist: Path) -> System:
    """Two vehicles in systems of their own; the second follows the first one's reference.

    Its disturbance reaches nothing: the two differ also where a host applies no parameters.
    """
    system = fleet_of(closed_loop(dist), 2)
    wires = [c for c in system.connections if c.source.component != "auv2.disturbance"]
    wires = [
        replace(c, source=replace(c.source, component="auv1.planner"))
        if c.source.component == "auv2.planner" else c for c in wires
    ]  # fmt: skip
    lost = {c.target for c in system.connections} - {c.target for c in wires}
    return replace(system, connections=tuple(wires), left_open={*system.left_open, *lost})


#: By how many steps the input of the last of :func:`chain` is late, listed downstream and upstream;
#: in other hosts it is two.
LATE = {
    "cofmupy": (-1, -1), "gemseo-fmu": (-1, -1), "pathsim-fmi": (-1, 2), "pycosimlibrary": (0, 2),
    "sofirpy": (0, 2), "syssimx": (0, 0), "syssimx-jacobi": (1, 1),
}  # fmt: skip


def chain(folder: Path, names: Sequence[str]) -> System:
    """The time passes through two components at once, and is then integrated; each is an FMU.

    Args:
        folder: for the FMU.
        names: of the components, in the order of which their inputs are connected, too.

    """
    ports = {"u": "input", "y": "output", "x": "output", "t": "output"}
    text = description(
        "moment",
        (variable(name, i, causality) for i, (name, causality) in enumerate(ports.items())),
        (unknown(i, "1" if i == 2 else "") for i in (2, 3, 4)),
    )
    fmu = write(folder / "moment.fmu", text, Path(small_fmus.__file__).with_name("moment.c"))
    sources = {"a": "clock.t", "b": "a.y", "sum": "b.y"}
    wires = {f"{name}.u": sources[name] for name in names if name in sources}
    made = connected("chain", dict.fromkeys(names, fmu), wires)
    return replace(made, left_open={PortName("clock", "u")}, step=0.125)


@pytest.mark.parametrize("place", [0, 1], ids=["downstream", "upstream"])
@pytest.mark.parametrize(
    "host", ["ecos", *slow(*(name for name in HOSTS if name not in ("ecos", "fmuloader")))]
)
def test_a_value_waits_for_the_tool_in_components_that_it_passes_at_once(
    tmp_path: Path, host: str, place: int
):
    """None if a tool follows feedthrough, one step for each if it exchanges all values at once.

    fmuloader is left out: it wants functions for model exchange, and has the loop of fmpy.
    """
    require(host)
    system = chain(tmp_path, ["clock", "a", "b", "sum"][:: (1, -1)[place]])
    assert system.step is not None
    h = system.step
    names = [f"{component}.{port}" for component, port, _ in hosts.real_outputs(system)]
    experiment = Experiment(12 * h, h, "jacobi", 0.0)
    rows, *_ = hosts._run(HOSTS[host], "", system, experiment, str)
    before, after = (dict(zip(names, row, strict=True)) for row in rows[-2:])
    given = (after["sum.x"] - before["sum.x"]) / h
    assert (after["clock.t"] - h - given) / h == LATE.get(host, (2, 2))[place]


@pytest.mark.parametrize("host", ["fmpy-ssp", *slow("ecos", "libcosim-ssp", "libcosim-osp")])
def test_vehicles_in_systems_have_our_numbers_in_other_hosts(dist: Path, host: str):
    """Some get a flat archive, since they do not read nested ones completely."""
    system = fleet(dist)
    if host not in WITHOUT_PARAMETERS:
        system = system.with_parameters({PortName("auv2.plant", "eta0.y"): 2.0})
    check(system, host, 50)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["formation-v", "sea"])
@pytest.mark.parametrize("host", ["libcosim-ssp", "ecos"])
def test_formations_and_seas_have_our_numbers_in_other_hosts(native: Path, host: str, scenario):
    system = closed_loop(native, read_scenario(scenario))
    # These hosts set no enumerations.
    own = {
        name: system.component(name.component).start(name.port)
        for name in system.changed("Enumeration")
    }
    system = system.with_parameters(own)
    check(system, host, 100)


@pytest.mark.skipif(find_spec("ecospy") is None, reason="ecospy is not installed")
def test_ecos_has_as_many_instances_as_components_with_fmi_3(dist3: Path):
    system = fleet(dist3).with_parameters({PortName("auv2.plant", "eta0.y"): 2.0})
    check(system, "ecos", 50)


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")
@pytest.mark.parametrize("fmi", FMI_VERSIONS)
@pytest.mark.parametrize("host", BESIDE)
def test_host_gives_our_numbers_with_a_release(release: dict[str, Path], host: str, fmi: str):
    if f"{fmi}.0" not in HOSTS[host].fmi:
        pytest.skip(f"it runs no FMI {fmi}.0")
    check(closed_loop(release[fmi]), host, 100)


@pytest.mark.parametrize(
    "host",
    [
        "fmpy",
        *slow(*(name for name, host in HOSTS.items() if "3.0" in host.fmi and name != "fmpy")),
    ],
)
def test_host_gives_the_numbers_of_our_master_with_fmi_3(dist3: Path, host: str):
    """Every Float64 output over 100 steps."""
    check(closed_loop(dist3, read_scenario("fig4")), host, 100)


CHOICE = {PortName("controller", "saturation"): "algebraic"}
STD = {PortName("plant", "noise.std"): 0.5}


@pytest.mark.parametrize(
    ("host", "values", "changed", "words"),
    [
        ("libcosim-ssp", CHOICE, {}, "controller.saturation"),
        ("fmpy", STD, {}, "plant.noise.std = 0.5"),
        ("fmpy", {}, {"start_time": 10.0}, "start time"),
        ("fmpy", {}, {"steps": {"controller": 0.06}}, "longer steps"),
        *slow(
            ("libcosim-osp", CHOICE, {}, "controller.saturation"),
            ("ecos", CHOICE, {}, "controller.saturation"),
            ("fmpy-ssp", STD, {}, "plant.noise.std = 0.5"),
            ("ecos", {}, {"start_time": 10.0}, "at 10 s"),
        ),
    ],
)
def test_host_refuses_what_it_does_not_apply(dist: Path, host: str, values, changed, words: str):
    require(host)
    system = replace(closed_loop(dist).with_parameters(values), **changed)
    [verdict] = compare(system, [host], 3, 0.02)
    assert words in str(verdict.failure)
    assert "Error" not in str(verdict.failure)


@pytest.mark.parametrize("host", slow("libcosim-ssp", "libcosim-osp"))
def test_longer_steps_of_components_equal_libcosim(dist: Path, host: str):
    system = replace(closed_loop(dist), steps={"controller": 0.06, "disturbance": 0.04})
    check(system, host, 102)  # whole steps of both


@pytest.mark.parametrize("host", ["libcosim-ssp", *slow("libcosim-osp", "fmpy-ssp")])
def test_a_start_time_reaches_the_host(dist: Path, host: str):
    """The disturbance (56) is a function of the time."""
    check(replace(closed_loop(dist), start_time=10.0), host, 100)


def test_missing_host_is_reported_and_does_not_end_the_others(dist: Path, monkeypatch):
    monkeypatch.setitem(HOSTS, "ghost", Host("no-such-package", hosts.ecos))
    verdicts = list(compare(closed_loop(dist), ["ghost", "fmpy-ssp"], 50, 0.02))
    assert "not installed" in str(verdicts[0].failure)
    assert verdicts[1].failure is None


def test_host_is_installed_when_it_is_first_run(dist: Path, monkeypatch):
    """One that cannot be installed does not end the others."""

    def python(pins: Sequence[str], hear: Callable[[], object]) -> Path:
        hear()
        if pins == ["fmpy==1"]:
            raise InputError("no such version")
        return Path(sys.executable)

    monkeypatch.setattr(hosts, "python_with", python)
    for pin in ("fmpy==1", "fmpy==2"):
        monkeypatch.setitem(HOSTS, pin, replace(HOSTS["fmpy"], pins=[pin]))
    lines: list[str] = []
    verdicts = list(compare(closed_loop(dist), ["fmpy==1", "fmpy==2"], 50, 0.02, hear=lines.append))
    assert [verdict.failure for verdict in verdicts] == ["no such version", None]
    assert [verdict.package for verdict in verdicts] == ["fmpy 1", "fmpy 2"]
    assert verdicts[1].deviation <= 1e-9
    assert len(lines) == 2 and "fmpy 2" in lines[1]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ("", BESIDE),
        ("--all", [*HOSTS]),
        ("sofirpy ecos", ["sofirpy", "ecos"]),
        ("--kind native --fmi 3", ["ecos", "fmpy"]),
    ],
)
def test_hosts_apart_are_run_where_they_are_asked_for(
    dist: Path, monkeypatch, options: str, expected: list[str]
):
    asked: list[str] = []
    monkeypatch.setattr(exchange, "compare", lambda _, hosts, *__, **___: asked.extend(hosts) or [])
    assert main(["hosts", *options.split()]) == 0
    assert asked == expected


def test_version_of_fmi_that_a_host_does_not_run_is_reported(dist3: Path):
    [verdict] = compare(closed_loop(dist3), ["sofirpy"], 3, 0.02)
    assert "FMI 3.0" in str(verdict.failure)


@pytest.mark.skipif(find_spec("ecospy") is None, reason="ecospy is not installed")
def test_ecos_command_line_runs_the_ssp_with_an_empty_environment(dist: Path, tmp_path: Path):
    """A host outside Python; its table has six digits."""
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
    report = verify(tmp_path / "auv.csv", closed_loop(dist), 1e-5)
    assert "to 5 s, in jacobi order, outputs read after values are passed on" in report
