"""Each built FMU through fmpy, as a foreign host would use it."""

from __future__ import annotations

import ast
import gc
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from math import inf, nan
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2Discard, fmi2Error
from fmpy.validation import validate_fmu

import auv_fmu
import fmus
from fmus.discovery import components, source_of
from support.instances import FmuInstance, unpacked
from support.settings import EACH, NAMES

ROOT = Path(__file__).parents[2]

each = pytest.mark.parametrize("name", NAMES)


@pytest.fixture(params=EACH)
def fmu(request: pytest.FixtureRequest, dist: Path, tmp_path: Path) -> Iterator[FmuInstance]:
    with unpacked(dist / f"{request.param}.fmu", tmp_path) as instance:
        yield instance


@each
def test_description_is_valid_and_complete(dist: Path, name: str):
    path = str(dist / f"{name}.fmu")
    assert validate_fmu(path) == []
    description = fmpy.read_model_description(path)
    for variable in description.modelVariables:
        assert variable.variability is not None
        assert variable.description
        if variable.type == "Real":
            assert variable.unit == variable.declaredType.unit
    outputs = [v for v in description.modelVariables if v.causality == "output"]
    assert len(description.outputs) == len(description.initialUnknowns) == len(outputs)
    assert all(unknown.dependencies is not None for unknown in description.outputs)
    simulation = description.coSimulation
    assert not simulation.needsExecutionTool
    assert simulation.canGetAndSetFMUstate
    assert simulation.canSerializeFMUstate
    assert simulation.canHandleVariableCommunicationStepSize


def test_start_values_are_what_the_fmu_holds(fmu: FmuInstance):
    fmu.initialise()
    for variable in fmu.description.modelVariables:
        if variable.causality in ("parameter", "input"):
            value = fmu.get(variable.name)
            if variable.type == "String":
                assert value.decode() == variable.start
            elif variable.type == "Boolean":
                assert bool(value) == (variable.start == "true")
            else:
                assert value == float(variable.start)


def test_reset_is_a_new_beginning(fmu: FmuInstance):
    expected = fmu.initialise().run(0, 30)
    fmu.fmu.reset()
    assert fmu.initialise().run(0, 30) == expected


def test_serialised_state_continues_in_another_instance(fmu: FmuInstance):
    fmu.initialise().run(0, 50)
    time, content = fmu.time, fmu.fmu.serializeFMUstate(fmu.fmu.getFMUstate())
    expected = fmu.run(50, 100)
    other = FmuInstance(fmu.folder, "other").initialise()
    other.fmu.setFMUstate(other.fmu.deSerializeFMUstate(content))
    other.time = time
    try:
        assert other.run(50, 100) == expected
    finally:
        other.fmu.freeInstance()


@pytest.mark.parametrize(
    ("name", "parameter", "variability", "value"),
    [
        ("AuvPlant", "m22", "fixed", -17.5),
        ("ObserverController", "eps_t", "tunable", 0.0),
        ("ObserverController", "saturation", "fixed", 7),
        ("MotionPlanner", "h_max", "fixed", nan),
        ("DisturbanceGenerator", "A_f", "tunable", inf),
    ],
)
def test_no_run_begins_with_another_parameter(dist, tmp_path, name, parameter, variability, value):
    with unpacked(dist / f"{name}.fmu", tmp_path) as fmu:
        with pytest.raises(FMICallException) as failure:
            fmu.initialise(**{parameter: value})
        assert failure.value.status == fmi2Error
        assert fmu.get("fault")
        with pytest.raises(FMICallException):
            fmu.fmu.enterInitializationMode()
        fmu.fmu.reset()
        fmu.initialise().step()
        assert not fmu.get("fault")
        with pytest.raises(FMICallException) as failure:
            fmu.set(**{parameter: value})
        if variability == "tunable":
            assert failure.value.status == fmi2Discard, "the run goes on with the one that it has"
            fmu.step()
        else:
            assert failure.value.status == fmi2Error


@pytest.mark.slow
def test_many_instances_leave_the_interpreter_as_it_was(dist: Path, tmp_path: Path):
    """References that PythonFMU takes too often are given back, and leaks are freed."""
    fmpy.extract(dist / "MotionPlanner.fmu", unzipdir=tmp_path)

    def come_and_go(times: int) -> None:
        for _ in range(times):
            FmuInstance(tmp_path).fmu.freeInstance()
        gc.collect()

    come_and_go(300)  # caches of fmpy and ctypes are full from now on
    script = (tmp_path / "resources" / "slavemodule.txt").read_text()
    before, path = sys.getrefcount(vars(sys.modules[script])), list(sys.path)
    blocks = sys.getallocatedblocks()
    come_and_go(200)
    assert sys.getallocatedblocks() - blocks < 200, "less than one object an instance"
    after = sys.getrefcount(vars(sys.modules[script]))
    assert after == before
    assert sys.path == path


def test_process_with_an_instance_ends_in_peace(dist: Path, tmp_path: Path):
    """PythonFMU frees one of its objects twice at exit, which a busy heap does not survive."""
    fmpy.extract(dist / "MotionPlanner.fmu", unzipdir=tmp_path)
    script = (
        "import fmpy, sys; from fmpy.fmi2 import FMU2Slave; folder = sys.argv[1];"
        "fmu = FMU2Slave(guid='', modelIdentifier='MotionPlanner', unzipDirectory=folder);"
        "fmu.instantiate(); fmu.freeInstance()"
    )
    busy_heap = {**os.environ, "MALLOC_PERTURB_": "165", "MALLOC_CHECK_": "3"}
    for _ in range(5):
        subprocess.run([sys.executable, "-c", script, str(tmp_path)], env=busy_heap, check=True)


def build(folder: Path, packages: Path) -> None:
    """Build all FMUs from the sources in a folder, in a process of its own."""
    subprocess.run(
        [sys.executable, "-m", "fmus.build", "--out", str(folder)],
        env={"PYTHONPATH": str(packages), "PYTHONHASHSEED": "random", "PATH": os.environ["PATH"]},
        check=True,
        capture_output=True,
        cwd=packages,
    )


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """A copy of the sources that FMUs are built from."""
    packages = tmp_path / "packages"
    for package in (auv_fmu, fmus):
        [folder] = package.__path__
        shutil.copytree(
            folder, packages / package.__name__, ignore=shutil.ignore_patterns("dist", "*.pyc")
        )
    return packages


def test_two_versions_of_the_bundle_run_their_own_code_in_one_process(dist, tmp_path, sources):
    disturbance = sources / "auv_fmu/paper/disturbance.py"
    text = disturbance.read_text()
    assert "A_f * sign(u)" in text
    disturbance.write_text(text.replace("A_f * sign(u)", "4.0 * A_f * sign(u)"))
    for name, module in components().items():
        if name != "DisturbanceGenerator":
            shutil.rmtree(sources.joinpath(*module.split(".")[:-1]))
    build(tmp_path / "other", sources)
    with (
        unpacked(dist / "DisturbanceGenerator.fmu", tmp_path / "a") as ours,
        unpacked(tmp_path / "other" / "DisturbanceGenerator.fmu", tmp_path / "b") as theirs,
    ):
        for fmu in (ours, theirs):
            fmu.initialise(nu__u=1.0, A_d=0.0)
            fmu.step()
        assert ours.get("tau_w.u") == 0.5
        assert theirs.get("tau_w.u") == 2.0


@pytest.mark.slow
def test_same_sources_give_the_same_bytes(dist: Path, tmp_path: Path, sources: Path):
    build(tmp_path / "again", sources)
    for name in NAMES:
        assert (tmp_path / "again" / f"{name}.fmu").read_bytes() == (
            dist / f"{name}.fmu"
        ).read_bytes()


@each
def test_page_icon_and_licences_are_inside(dist: Path, name: str):
    with zipfile.ZipFile(dist / f"{name}.fmu") as archive:
        shown = archive.read("documentation/index.html").decode()
        licences = archive.read("documentation/licenses/license.txt").decode()
        assert archive.read("model.png").startswith(b"\x89PNG")
    description = fmpy.read_model_description(dist / f"{name}.fmu")
    named: set[str] = set()
    for code in re.findall(r"<code>([^<]+)</code>", shown):
        # The members of a group have one row, `y.x .y .z`.
        first, *ends = code.split()
        stem = re.sub(r"(\.\w+|\[\d+\])$", "", first)
        named |= {first, *(stem + end for end in ends)}
    for variable in description.modelVariables:
        # A list of things with members has one row: from the first of them to the last.
        first = re.sub(r"\[\d+\]\.", "[1].", variable.name)
        assert named & {variable.name, first, first.replace("[1].", "[2].")}, variable.name
    assert licences.count("Permission is hereby granted") == 2


@each
def test_fmu_names_the_paper_as_the_citation_does(dist: Path, native: Path, name: str):
    words = " ".join((ROOT / "CITATION.cff").read_text(encoding="utf-8").split())
    [title] = re.findall(r'paper that it implements, "(.+?)"\.', words)
    if not source_of(name).definition.origin.citation:
        pytest.skip("it has no equations of the paper")
    for path in (dist / f"{name}.fmu", native / f"{name}.fmu"):
        assert title in fmpy.read_model_description(path).description
        with zipfile.ZipFile(path) as archive:
            assert title in archive.read("documentation/index.html").decode()


def test_fmus_are_small(dist: Path):
    assert max((dist / f"{name}.fmu").stat().st_size for name in NAMES) < 400_000


def is_for_type_checkers(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


@each
def test_resources_need_nothing_but_an_old_standard_library(dist: Path, name: str):
    """Python 3.9 syntax; imports from the standard library or, under their hash, the bundle."""
    with zipfile.ZipFile(dist / f"{name}.fmu") as archive:
        scripts = {
            entry: archive.read(entry).decode()
            for entry in archive.namelist()
            if entry.endswith(".py")
        }
    own = {entry.split("/")[1].removesuffix(".py") for entry in scripts}
    suffixes = {module.rsplit("_", 1)[1] for module in own}
    assert len(suffixes) == 1, "all top-level modules carry the same hash"
    imported = set()
    for entry, text in scripts.items():
        tree = ast.parse(text, filename=entry, feature_version=(3, 9))
        unseen = [node for node in ast.walk(tree) if is_for_type_checkers(node)]
        for node in set(ast.walk(tree)).difference(*map(ast.walk, unseen)):
            if isinstance(node, ast.Import):
                imported |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                imported.add(str(node.module).split(".")[0])
    assert imported <= own | set(sys.stdlib_module_names)


@pytest.mark.parametrize("name", EACH)
def test_fmpy_runs_each_fmu_from_its_command_line(dist: Path, tmp_path: Path, name: str):
    output = tmp_path / "result.csv"
    subprocess.run(
        [sys.executable, "-m", "fmpy", "simulate", str(dist / f"{name}.fmu"), "--stop-time", "2",
         "--output-file", str(output)],
        check=True, capture_output=True,
    )  # fmt: skip
    lines = output.read_text().splitlines()
    assert len(lines) == 1 + 101
    assert lines[-1].startswith("2.0,")
