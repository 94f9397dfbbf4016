"""A whole system as one FMU: the numbers of a run, in fmpy and in the master."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from math import sin
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.util import fmu_info
from fmpy.validation import validate_fmu

from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import PortName, Variable
from orchestrator.runs.result import Result
from support.texts import mentions
from support.tiers import slow

#: Communication step of the scenarios [s], and how many steps are compared.
H, STEPS = 0.02, 120

SCENARIOS = ("fig4", "sea", *slow("formation-v", "navigation", "remus", "bluerov"))

#: Values for an input that is open in all of these.
WAVE = "time,plant.water.x\n" + "".join(f"{H * k!r},{0.3 * sin(k)!r}\n" for k in range(STEPS))


def export(name: str, *options: str, out: str = "one") -> Path:
    """Make the FMU of a scenario."""
    assert main(["export", name, "--format", "fmu", "--out", out, "--force", *options]) == 0
    [path] = Path(out).glob("*.fmu")
    return path


@cache
def made(name: str, *options: str) -> tuple[str, bytes]:
    """The FMU of a ready scenario: its name and what is in it."""
    with TemporaryDirectory() as folder:
        path = export(name, *options, out=folder)
        return path.name, path.read_bytes()


def exported(name: str, *options: str) -> Path:
    """The FMU of a scenario in the current folder; the FMU of a ready one is made once."""
    if name.endswith(".toml"):
        return export(name, *options)
    file, content = made(name, *options)
    Path("one").mkdir(exist_ok=True)
    Path("one", file).write_bytes(content)
    return Path("one", file)


def expected(name: str, **how: Any) -> Result:
    return simulate(name, **{"stop_time": STEPS * H, "kind": "native", **how})


def outputs(path: Path) -> list[str]:
    found = fmpy.read_model_description(str(path)).modelVariables
    return [
        variable.name
        for variable in found
        if variable.causality == "output" and variable.name != "fault"
    ]


def check(found: Any, result: Result, names: list[str]) -> None:
    """Compare outputs with the columns of a run, in their order, bit for bit."""
    assert len(names) > 50
    assert [name for name in result.columns if name in {*names}] == names
    assert len(result) == STEPS + 1
    for name in names:
        assert np.array_equal(np.asarray(found[name], dtype=float), result[name]), name


def play(path: Path, step: float = H) -> Any:
    return fmpy.simulate_fmu(
        str(path), stop_time=STEPS * H, step_size=step, output_interval=step, output=outputs(path)
    )


def alone(path: Path, **how: Any) -> dict[str, np.ndarray]:
    """The columns of the master, with the FMU as its only component, by the names of its ports."""
    found = simulate(path, stop_time=STEPS * H, step=H, **how)
    head = f"{path.stem.replace('-', '_')}."
    return {name.removeprefix(head): found[name] for name in found.columns if name != "time"}


@contextmanager
def slaves(path: Path, n: int) -> Iterator[list[Any]]:
    """New instances, initialised."""
    description, found = fmpy.read_model_description(str(path)), []
    for _ in range(n):
        slave = (FMU3Slave if description.fmiMajorVersion == 3 else FMU2Slave)(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        slave.instantiate()
        if description.fmiMajorVersion == 2:
            slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        found.append(slave)
    yield found
    for slave in found:
        slave.terminate()
    for slave in found:
        slave.freeInstance()


def real_outputs(path: Path) -> list[int]:
    found = fmpy.read_model_description(str(path)).modelVariables
    return [
        variable.valueReference
        for variable in found
        if variable.causality == "output" and variable.type in ("Real", "Float64")
    ]


def rows(slave: Any, references: list[int], steps: range) -> list[list[float]]:
    """The outputs after each of some steps."""
    get = slave.getFloat64 if isinstance(slave, FMU3Slave) else slave.getReal
    found = []
    for k in steps:
        slave.doStep(currentCommunicationPoint=k * H, communicationStepSize=H)
        found.append([*get(references)])
    return found


@pytest.mark.parametrize("name", SCENARIOS)
def test_outputs_are_the_columns_of_a_run_bit_for_bit(workplace: Path, name: str):
    path = exported(name)
    assert validate_fmu(str(path)) == []
    check(play(path), expected(name), outputs(path))


def test_in_fmi_3_it_has_the_same_bits(workplace: Path):
    path = exported("sea", "--fmi", "3")
    assert validate_fmu(str(path)) == []
    check(play(path), expected("sea"), outputs(path))


def test_in_our_master_it_is_a_component_with_the_same_bits(workplace: Path):
    path = exported("fig4")
    check(alone(path), expected("fig4"), outputs(path))


@pytest.mark.parametrize("order", ["jacobi", *slow("gauss-seidel")])
def test_orders_and_longer_steps_follow_the_scenario(workplace: Path, order: str):
    Path("slow.toml").write_text(
        f'title = "Slow"\nstop_time = {STEPS * H}\norder = "{order}"\n[steps]\ncontroller = 0.04\n'
        "disturbance = 0.06\n"
    )
    path = exported("slow.toml")
    check(play(path), expected("slow.toml"), outputs(path))
    description = fmpy.read_model_description(str(path))
    assert not description.coSimulation.canHandleVariableCommunicationStepSize
    with slaves(path, 1) as [slave], pytest.raises(FMICallException):
        slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=0.03)


def test_a_longer_step_is_split(workplace: Path):
    path = exported("fig4")
    long, short = play(path, 4 * H), play(path)
    for name in outputs(path):
        # The host computes times by additions, not from the number of the step.
        np.testing.assert_allclose(long[name], short[name][::4], 1e-9, 1e-9, err_msg=name)


def test_a_shorter_step_is_made_as_it_is(workplace: Path):
    path = exported("fig4", "--set", "plant.noise.std=0")
    fine = expected("fig4", step=H / 2, parameters={"plant.noise.std": 0.0})
    found = play(path, H / 2)
    for name in outputs(path):
        # fmpy takes differences of times for steps.
        np.testing.assert_allclose(found[name], fine[name], 1e-9, 1e-9, err_msg=name)


def test_open_inputs_are_driven(workplace: Path):
    path = exported("fig4")
    Path("wave.csv").write_text(WAVE)
    Path("wave_of_one.csv").write_text(WAVE.replace("plant.", "fig4.plant."))
    driven = expected("fig4", inputs="wave.csv")
    check(alone(path, inputs="wave_of_one.csv"), driven, outputs(path))
    assert not np.array_equal(driven["plant.nu_r.u"], expected("fig4")["plant.nu_r.u"])


def test_tuned_parameters_act_as_they_do_in_a_run(workplace: Path):
    path = exported("sea")
    values = {"plant.current.x": 0.3, "disturbance.A_f": 0.8, "controller.k_d": 40.0}
    tuned = expected("sea", events=[{"at": 1.0, "set": values}])
    own = {f"sea.{name}": value for name, value in values.items()}
    check(alone(path, events=[{"at": 1.0, "set": own}]), tuned, outputs(path))
    assert not np.array_equal(tuned["plant.eta.x"], expected("sea")["plant.eta.x"])


@pytest.mark.parametrize(("name", "fmi"), [("fig4", "2"), *slow(("formation-v", "3"))])
def test_a_state_determines_the_rest_of_the_run(workplace: Path, name: str, fmi: str):
    path = exported(name, "--fmi", fmi)
    references = real_outputs(path)
    with slaves(path, 2) as [first, second]:
        rows(first, references, range(41))
        state = first.getFMUState()
        content = first.serializeFMUState(state)
        rest = rows(first, references, range(41, 80))
        first.setFMUState(state)
        assert rows(first, references, range(41, 80)) == rest
        second.setFMUState(second.deserializeFMUState(content))
        assert rows(second, references, range(41, 80)) == rest


def test_instances_do_not_know_of_each_other(workplace: Path):
    path = exported("fig4")
    references = real_outputs(path)
    with slaves(path, 3) as [first, *others]:
        alone = rows(first, references, range(30))
        turns = [
            [rows(slave, references, range(k, k + 1))[0] for slave in others] for k in range(30)
        ]
    assert turns == [[row, row] for row in alone]


@pytest.mark.slow
def test_a_controller_of_ones_own_goes_with_it(workplace: Path):
    assert main(["new", "controller", "my_law"]) == 0
    scenario = str(Path("my_law", "my_law.toml"))
    path = exported(scenario)
    result = expected(scenario, events=[])
    assert load(scenario).components["controller"].fmu.name == "MyLaw.fmu"
    check(play(path), result, outputs(path))


def test_its_variables_match_the_components(workplace: Path):
    path = exported("fig4", "--set", "plant.noise.std=0")
    system = load("fig4").with_parameters({"plant.noise.std": 0.0})
    found = {
        variable.name: variable
        for variable in fmpy.read_model_description(str(path)).modelVariables
    }
    open_ones = {
        f"{name}.{port.name}"
        for name, component in system.components.items()
        for port in component.having("input")
        if port.name not in {wire.target.port for wire in system.feeding[name]}
    }
    assert {name for name, variable in found.items() if variable.causality == "input"} == open_ones
    for name, component in system.components.items():
        for own in component.variables.values():
            if own.causality not in ("output", "parameter") or own.name == "fault":
                continue
            variable = found[f"{name}.{own.name}"]
            kept = ("causality", "variability", "unit", "description", "type", "min", "max")
            assert {what: getattr(variable, what) for what in kept} == {
                what: getattr(own, what) for what in kept
            }
            if own.causality == "parameter":
                start = Variable.of(variable).typed(variable.start, variable.name)
                assert start == system.value(PortName(name, own.name))
    experiment = fmpy.read_model_description(str(path)).defaultExperiment
    assert (float(experiment.stopTime), float(experiment.stepSize)) == (100.0, H)
    assert "plant.nu_r.u" in fmu_info(str(path))


def test_feedthrough_goes_along_the_connections(workplace: Path):
    """Water is felt in the velocity through it at once, in the position a step later."""
    outputs = fmpy.read_model_description(str(exported("fig4"))).outputs
    found = {
        output.variable.name: {port.name for port in output.dependencies} for output in outputs
    }
    assert found["plant.eta.x"] == set()
    assert {name.rpartition(".")[0] for name in found["plant.nu_r.u"]} <= {
        "plant.water", "plant.dwater",
    }  # fmt: skip


def test_a_failure_names_the_component_and_the_reason(workplace: Path):
    path = exported("fig4")
    result = simulate(path, {"fig4.disturbance.A_f": 1e200}, stop_time=1.0)
    assert mentions(str(result.failure), "plant: state finite")


def test_terminals_match_the_components(workplace: Path):
    path = exported("sea", "--fmi", "3")
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
    found = {
        terminal.get("name"): [member.get("variableName") for member in terminal]
        for terminal in root.iter("Terminal")
    }
    axes = ("x", "y", "z", "phi", "theta", "psi")
    members = [name for name in found["plant.eta"] if name is not None]
    assert members == [f"plant.eta.{axis}" for axis in axes]


def test_its_bytes_depend_on_nothing_else(workplace: Path):
    assert exported("fig4").read_bytes() == export("fig4", out="again").read_bytes()


def test_a_system_that_cannot_be_one_fmu_is_refused_by_name(workplace: Path, refused):
    assert main(["new", "controller", "other_law", "--python"]) == 0
    for arguments, words in (
        ("other_law/other_law.toml --format fmu", "controller language"),
        ("fig4 --platforms all", "--platforms --kind native --format fmu"),
        ("fig4 --platforms all --format c", "--platforms --format c"),
        ("fig4 --format fmu --flat", "--flat --format ssp"),
        ("fig4 --format fmu --platforms amiga", "amiga linux64"),
    ):
        assert mentions(refused("export", *arguments.split(), "--out", "none"), words)
