"""Other things that can be run: one FMU, an unpacked SSP, and files of libcosim."""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest

from orchestrator import load, simulate
from orchestrator.commands.main import main
from orchestrator.cosim import write_ssp
from orchestrator.cosim.formats.osp import OSP_STRUCTURE
from orchestrator.machine.errors import InputError
from support.archives import archive, component, described, fmu, system, variable
from support.others import build
from support.relay import relay
from support.texts import mentions

STEP, STEPS = 0.125, 24

#: A ring through a function, with connections in both directions, and a longer step.
OSP = f"""<?xml version="1.0"?>
<OspSystemStructure xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure" version="0.1">
  <StartTime>0.0</StartTime><BaseStepSize>{STEP}</BaseStepSize><Algorithm>fixedStep</Algorithm>
  <!-- the first is beside this file's folder -->
  <Simulators>
    <Simulator name="a" source="../fmus/relay%20one.fmu" stepSize="{STEP}"><InitialValues>
      <InitialValue variable="v"><Real value="0.7"/></InitialValue>
      <InitialValue variable="a"><Real value="1.5"/></InitialValue>
    </InitialValues></Simulator>
    <Simulator name="b" source="relay.fmu" stepSize="{2 * STEP}"><InitialValues>
      <InitialValue variable="a"><Real value="-0.3"/></InitialValue>
      <InitialValue variable="c"><Real value="0.1"/></InitialValue>
      <InitialValue variable="u"><Real value="9"/></InitialValue>
    </InitialValues></Simulator>
    <Simulator name="c" source="relay.fmu"/>
  </Simulators>
  <Functions><LinearTransformation name="scaled" factor="0.5" offset="-0.25"/></Functions>
  <Connections>
    <SignalConnection>
      <Variable simulator="a" name="y"/><Signal function="scaled" name="in"/>
    </SignalConnection>
    <SignalConnection>
      <Signal function="scaled" name="out"/><Variable simulator="b" name="u"/>
    </SignalConnection>
    <VariableConnection>
      <Variable simulator="a" name="u"/><Variable simulator="b" name="y"/>
    </VariableConnection>
    <VariableConnection>
      <Variable simulator="b" name="g"/><Variable simulator="c" name="v"/>
    </VariableConnection>
  </Connections>
</OspSystemStructure>
"""

#: Runs a file of libcosim's, and prints all outputs after each step.
LIBCOSIM = """
import sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
execution = CosimExecution.from_osp_config_file(osp_path=sys.argv[1])
observer = CosimObserver.create_last_value()
execution.add_observer(observer=observer)
for _ in range(int(sys.argv[2])):
    assert execution.step()
    print("row", end=" ")
    for name in sys.argv[3:]:
        index = execution.slave_index_from_instance_name(name)
        print(*map(float.hex, observer.last_real_values(index, [2, 3])), end=" ")
    print()
"""


@pytest.fixture
def osp(tmp_path: Path) -> Path:
    """The folder with the file."""
    folder, beside = tmp_path / "plant", tmp_path / "fmus"
    for place in (folder, beside):
        place.mkdir()
    shutil.copy(relay(tmp_path), folder / "relay.fmu")
    shutil.copy(relay(tmp_path), beside / "relay one.fmu")
    (folder / OSP_STRUCTURE).write_text(OSP, encoding="utf-8")
    return folder


def outputs_of_libcosim(folder: Path, *names: str) -> np.ndarray:
    """The outputs g and y of components, after each step."""
    if find_spec("libcosimpy") is None:
        pytest.skip("libcosimpy is not installed")
    arguments = [sys.executable, "-c", LIBCOSIM, str(folder), str(STEPS), *names]
    done = subprocess.run(arguments, capture_output=True, text=True, check=True, timeout=60)
    # It logs to the same stream.
    rows = [line.split()[1:] for line in done.stdout.splitlines() if line.startswith("row ")]
    return np.array([[float.fromhex(value) for value in row] for row in rows])


def test_osp_file_gives_the_numbers_of_libcosim(osp: Path):
    expected = outputs_of_libcosim(osp, "a", "b", "c")
    with pytest.warns(UserWarning, match=r"b\.u: .*a\.y; "):
        result = simulate(osp / OSP_STRUCTURE, stop_time=STEPS * STEP, order="jacobi")
    assert result.failure is None
    ours = [result[f"{name}.{port}"][1:] for name in "abc" for port in "gy"]
    assert np.array_equal(np.column_stack(ours), expected)
    assert np.ptp(expected, axis=0)[[0, 1, 2, 3, 5]].min() > 0.05


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('<LinearTransformation name="scaled" factor="0.5" offset="-0.25"/>',
         '<Sum name="scaled" inputCount="1"/>', "scaled: <Sum>"),
        ('offset="-0.25"', 'offset="1,5"', "offset '1,5'"),
        ("VariableConnection>", "VariableGroupConnection>", "<VariableGroupConnection> 2"),
        ('name="in"/>', 'name="into"/>', "scaled: 0"),
        ('function="scaled" name="in"', 'function="scale" name="in"', "'scale'"),
        ('simulator="b" name="y"', 'simulator="d" name="y"', "'d'"),
        ('<Real value="0.7"/>', '<Real value="much"/>', "a.v much"),
        ('name="b" source', 'name="a" source', "two a"),
        ('"../fmus/relay%20one.fmu"', '"proxyfmu://host?file=x.fmu"', "'proxyfmu://host?file=x"),
        (f"<BaseStepSize>{STEP}<", "<BaseStepSize>fast<", "BaseStepSize 'fast'"),
    ],
)  # fmt: skip
def test_an_osp_file_that_cannot_be_run_is_refused_by_name(osp: Path, old, new, why):
    assert old in OSP
    (osp / OSP_STRUCTURE).write_text(OSP.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as error:
        load(osp)
    assert mentions(str(error.value), why) and "\n" not in str(error.value)


def test_changes_to_an_osp_file_are_warnings(osp: Path):
    text = OSP.replace("fixedStep", "ecco").replace(f'"{2 * STEP}"', f'"{2.03 * STEP}"')
    (osp / OSP_STRUCTURE).write_text(text, encoding="utf-8")
    with (
        pytest.warns(UserWarning, match="'ecco'"),
        pytest.warns(UserWarning, match=r"b: .* 0.25375 s .* 0.25 s"),
    ):
        assert load(osp).steps["b"] == 2 * STEP


def test_units_of_an_osp_file_are_not_converted(tmp_path: Path):
    for name, unit in (("m", "m"), ("mm", "mm")):
        fmu(tmp_path / f"{name}.fmu", variable("u", "input", unit=unit),
            variable("y", "output", unit=unit))  # fmt: skip
    wire = '<Variable simulator="m" name="y"/><Variable simulator="mm" name="u"/>'
    (tmp_path / OSP_STRUCTURE).write_text(
        '<OspSystemStructure version="0.1"><Simulators><Simulator name="m" source="m.fmu"/>'
        '<Simulator name="mm" source="mm.fmu"/></Simulators><Connections><VariableConnection>'
        f"{wire}</VariableConnection></Connections></OspSystemStructure>",
        encoding="utf-8",
    )
    with pytest.warns(UserWarning, match=r"m\.y -> mm\.u: .* m and mm"):
        [connection] = load(tmp_path).connections
    assert connection.transformation is not None and connection.transformation(2.5) == 2.5


def test_one_fmu_is_a_system_with_its_own_experiment(tmp_path: Path, capsys):
    experiment = '<DefaultExperiment startTime="1" stopTime="2" stepSize="0.25"/><ModelVariables>'
    own = build(tmp_path, change=("<ModelVariables>", experiment)).rename(tmp_path / "my-1.fmu")
    result = simulate(own, {"my_1.u": 3.0, "my_1.gain": 2.0})
    assert result.time.tolist() == [1.0, 1.25, 1.5, 1.75, 2.0]
    assert set(result["my_1.y"]) == {6.0}
    out = tmp_path / "out"
    assert main(["export", str(own), "--out", str(out)]) == 0
    assert load(out / "my-1.ssp").step == 0.25
    assert main(["run", str(own), "--variant", "x", "--out", str(out)]) == 2
    assert "has no variants" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("kind", "own", "other", "tools"),
    [("String", "a", "b", "OMSimulator"), ("Enumeration", "slow", "fast", "libcosim ecos")],
)
def test_export_names_the_values_that_other_tools_may_leave_out(
    tmp_path: Path, capsys, kind: str, own: str, other: str, tools: str
):
    ports = (variable("u", "input"), variable("y", "output"))
    given = {"start": own} if kind == "String" else {}
    values = (variable(f"p{i}", "parameter", kind, **given) for i in (1, 2))
    path = fmu(tmp_path / "m.fmu", *ports, *values)
    command = ["export", str(path), "--out", str(tmp_path / "x"), "--force"]
    assert main([*command, "--set", f"m.p1={own}"]) == 0
    assert "m.p" not in capsys.readouterr().err
    assert main([*command, "--set", f"m.p2={other}"]) == 0
    [line] = capsys.readouterr().err.splitlines()
    assert mentions(line, f"m.p2 {kind} {tools}") and "p1" not in line


@pytest.mark.parametrize("name", ["", "Winter.ssd"])
def test_an_unpacked_ssp_is_what_the_archive_is(tmp_path: Path, name: str):
    relay(tmp_path)
    twice = described(system(component("a") + component("b")))
    packed = archive(tmp_path / "x.ssp", described(system(component("a"))), {
        "a.fmu": relay(tmp_path), "Winter.ssd": twice})  # fmt: skip
    folder = tmp_path / "x"
    with ZipFile(packed) as content:
        content.extractall(folder)
    variant = "Winter" if name.startswith("W") else None
    expected, found = load(packed, variant=variant), load(folder / name)
    assert list(found.components) == list(expected.components)
    assert name.startswith("W") or found.name == expected.name
    assert list(load(folder, variant="Winter").components) == ["a", "b"]


def test_a_folder_runs_from_within_and_may_lack_a_stop_time(workplace: Path, capsys):
    """A scenario wins over a folder of its name."""
    Path("fig4").mkdir()
    assert "plant" in load("fig4").components
    [path] = write_ssp(load(relay(workplace)), workplace)
    Path("inside").mkdir()
    with ZipFile(path) as content:
        content.extractall("inside")
    assert main(["check", "inside"]) == 0
    assert "stop time" in capsys.readouterr().out
    assert main(["export", "inside", "--format", "osp", "--out", "out"]) == 0
    assert main(["run", "out", "--stop-time", "1", "--out", "results", "--no-figures"]) == 0
    assert Path("results/result.csv").read_text().count("\n") > 10


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("mine.mo", ".toml .ssp .ssd .fmu OspSystemStructure.xml"),
        ("empty", "empty: SystemStructure.ssd"),
        ("none.ssd", "none.ssd"),
        ("other.xml", "OspSystemStructure.xml <other>"),
        ("text.xml", "OspSystemStructure.xml: syntax"),
    ],
)
def test_other_files_are_refused_in_one_line(workplace: Path, capsys, name, why):
    Path("empty").mkdir()
    Path("other.xml").write_text("<other/>")
    Path("text.xml").write_text("text")
    for command in ("run", "check"):
        assert main([command, name]) == 2
        out, err = capsys.readouterr()
        assert mentions(out + err, why) and len((out + err).splitlines()) == 1


WIRED = """
stop_time = 1.0
step = 0.125
only = ["t", "g", "x"]
[components]
t = "t.fmu"
g = "g.fmu"
x = "x.fmu"
[wires]
"g.u" = "t.y"
"x.w[1]" = "t.z[2]"
"x.in" = "t.out"
"""


def ports(path: Path, *names: str) -> None:
    """An FMU without a library, of Real inputs and outputs: an output's name has a star."""
    fmu(path, *(variable(name.removesuffix("*"), "output" if name.endswith("*") else "input")
                for name in names))  # fmt: skip


@pytest.fixture
def wired(workplace: Path) -> Path:
    """A scenario of three FMUs with single ports and groups, and of no other component."""
    ports(Path("t.fmu"), "y*", "z[2]*", "out.a*", "out.b*", "one*")
    ports(Path("g.fmu"), "u", "speed")
    ports(Path("x.fmu"), "w[1]", "in.a", "in.b")
    path = workplace / "wired.toml"
    path.write_text(WIRED, encoding="utf-8")
    return path


def test_a_scenario_wires_single_ports_beside_groups(dist: Path, wired: Path):
    found = {str(wire.target): str(wire.source) for wire in load(wired).connections}
    assert found == {"g.u": "t.y", "x.w[1]": "t.z[2]", "x.in.a": "t.out.a", "x.in.b": "t.out.b"}


@pytest.mark.parametrize(
    ("wire", "why"),
    [
        ('"g.u" = "t.out"', "g.u t 'out' out.a out.b"),
        ('"x.in" = "t.one"', "t.one x.in in.a in.b?"),
        ('"g.sped" = "t.y"', "g sped sped.* speed?"),
        ('"g.u" = "tt.y"', "'tt' t?"),
        ('"t.y" = "g.u"', "g.u input output"),
    ],
)  # fmt: skip
def test_a_wire_that_cannot_be_says_what_to_write(dist: Path, wired: Path, wire: str, why: str):
    old = '"x.in" = "t.out"' if wire.startswith('"x.in"') else '"g.u" = "t.y"'
    wired.write_text(WIRED.replace(old, wire), encoding="utf-8")
    with pytest.raises(InputError) as error:
        load(wired).check()
    assert mentions(str(error.value), why) and "\n" not in str(error.value)
