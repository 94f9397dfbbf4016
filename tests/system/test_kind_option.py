"""`--kind`, `--fmi` and `--platforms`: FMUs in C in all commands."""

from __future__ import annotations

import json
import shutil
import zipfile
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy.validation import validate_fmu

from fmus.kinds import KINDS
from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.runs import bundle
from support.settings import NAMES
from support.texts import mentions

SECOND = ["--stop-time", "1"]

OWN = """\
[components]
controller = "own.fmu"
"""


def kinds(folder: Path) -> dict[str, str]:
    """The kind of each component of a run."""
    record = json.loads((folder / "run.json").read_text())
    return {name: fmu["kind"] for name, fmu in record["fmus"].items()}


@pytest.mark.parametrize("name", NAMES)
def test_fmu_is_valid_and_small_and_says_who_made_it(native: Path, name: str):
    path = native / f"{name}.fmu"
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        [library] = (entry for entry in archive.infolist() if "binaries/" in entry.filename)
        assert not any(entry.startswith("resources/") for entry in archive.namelist())
    assert library.compress_size < 80_000
    assert root.get("generationTool", "").startswith("auv-fmu ")
    [implementation] = root.iter("CoSimulation")
    assert implementation.get("needsExecutionTool") == "false"
    assert [file.get("name") for file in implementation.iter("File")] == ["fmi2.c"]


def test_run_writes_the_same_table_to_the_bit(workplace: Path):
    for kind in KINDS:
        options = ["--stop-time", "0.5", "--kind", kind, "--no-figures", "--out", kind]
        assert main(["run", "fig5", *options]) == 0
    for name in ("result.csv", "metrics.json", "certificates.csv"):
        tables = [(workplace / kind / name).read_bytes() for kind in KINDS]
        assert tables[0] == tables[1]
    for kind in KINDS:
        for folder in (workplace / kind, workplace / kind / "fig5-pd"):
            assert {*kinds(folder).values()} == {kind}


def test_fmus_of_a_file_are_as_they_are(dist: Path, workplace: Path):
    shutil.copy(dist / "ObserverController.fmu", workplace / "own.fmu")
    (workplace / "own.toml").write_text(OWN)
    assert main(["run", "own.toml", "--kind", "native", *SECOND, "--no-figures"]) == 0
    assert kinds(workplace / "results/own") == {
        "plant": "native",
        "controller": "python",
        "disturbance": "native",
        "planner": "native",
    }
    expected = simulate("fig4", stop_time=1.0, kind="python")
    assert np.array_equal(simulate("own.toml", stop_time=1.0, kind="native").rows, expected.rows)


def test_export_with_fmi_3_is_an_ssp_2(workplace: Path):
    changes = ["--set", "plant.noise.std=0", "--set", "controller.saturation=algebraic"]
    options = ["--kind", "native", "--fmi", "3", *changes, "--out", "out"]
    assert main(["export", "fig4", *options]) == 0
    with zipfile.ZipFile(workplace / "out/fig4.ssp") as archive:
        structure = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
        values = ElementTree.fromstring(archive.read("parameters/controller.ssv"))
        archive.extract("resources/AuvPlant.fmu")
    assert (structure.get("version"), values.get("version")) == ("2.0", "2.0")
    types = {element.tag.partition("}")[2] for element in structure.iter()}
    assert {"Float64", "Int32", "Boolean"} < types
    assert not {"Real", "Integer", "String"} & types
    assert values.find(".//{*}Integer").get("value") == "1"
    assert validate_fmu("resources/AuvPlant.fmu") == []


@pytest.fixture
def any_platform(
    native: Path, monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """A build of FMUs that compiles nothing: each platform asked for has an empty library."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))

    def built(*options: str) -> dict[str, bytes]:
        asked = options[options.index("--platforms") + 1].split(",")
        files = {path.name: BytesIO(path.read_bytes()) for path in native.glob("*.fmu")}
        for name, file in files.items():
            with zipfile.ZipFile(file, "a") as archive:
                for platform in asked:
                    archive.writestr(f"binaries/{platform}/{Path(name).stem}.lib", b"")
        return {name: file.getvalue() for name, file in files.items()}

    monkeypatch.setattr(bundle, "_built", built)
    bundle.current_fmus.cache_clear()


@pytest.mark.usefixtures("any_platform")
@pytest.mark.parametrize("format_name", ["ssp", "osp"])
def test_exported_fmus_are_for_the_platforms_asked_for(workplace: Path, format_name: str):
    options = ["--kind", "native", "--platforms", "win64,darwin64", "--format", format_name]
    assert main(["export", "fig4", *options, "--out", "out"]) == 0
    if format_name == "ssp":
        zipfile.ZipFile("out/fig4.ssp").extractall("out")
    fmus = [*Path("out").rglob("*.fmu")]
    assert len(fmus) == 4
    for fmu in fmus:
        names = {Path(name).parts[1] for name in zipfile.ZipFile(fmu).namelist() if "binar" in name}
        assert {"win64", "darwin64"} < names


@pytest.mark.usefixtures("any_platform")
def test_an_fmu_of_the_user_without_a_platform_is_refused(dist: Path, workplace: Path, refused):
    shutil.copy(dist / "ObserverController.fmu", "own.fmu")
    Path("own.toml").write_text(OWN)
    options = ["--kind", "native", "--platforms", "linux64,aarch64-darwin"]
    assert mentions(refused("export", "own.toml", *options), "own.fmu aarch64-darwin --platforms")


def test_ssp_2_runs_as_ssp_1_does_bit_for_bit(workplace: Path):
    for fmi in "23":
        options = ["--kind", "native", "--fmi", fmi, "--out", fmi]
        assert main(["export", "fig4", *options]) == 0
        run = ["run", f"{fmi}/fig4.ssp", "--out", f"run{fmi}", "--no-figures"]
        assert main([*run, "--stop-time", "1", "--columns", "all", "--strict"]) == 0
    tables = [Path(f"run{fmi}/result.csv").read_bytes() for fmi in "23"]
    assert tables[0] == tables[1] and tables[0].count(b"\n") == 52


@pytest.mark.parametrize("run", [lambda: load("fig4", "c"), lambda: simulate("fig4", kind="c")])
def test_unknown_kind_is_a_value_error(run):
    with pytest.raises(ValueError, match=r"'c': .*auto, python, native"):
        run()


def test_system_keeps_the_fmus_it_was_loaded_with():
    with pytest.raises(ValueError, match="FMUs"):
        simulate(load("fig4"), kind="native")
