"""`auv-fmu check` reports all problems at once, and runs nothing."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import pytest

from orchestrator.commands import check
from orchestrator.commands.main import main
from orchestrator.cosim import Connection, PortName, System, read_component
from orchestrator.cosim.formats.archive import STRUCTURE
from orchestrator.machine.errors import InputError
from orchestrator.runs.preparation import load, load_scenario, prepare
from orchestrator.runs.request import Request
from orchestrator.runs.run import simulate
from orchestrator.runs.scenario import names
from support.others import build
from support.own import write
from support.texts import mentions

SCENARIO = """
title = "a mistake a line"
[wires]
"plant.tau" = "nobody.tau"
"plant.foo" = "controller.tau"
[parameters]
plant.m11 = "heavy"
plant.m99 = 3
controler.k_d = 3
"""


def lines(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Lines on the standard output; there are no messages."""
    out, err = capsys.readouterr()
    assert err == ""
    return str(out).splitlines()


def changed(archive: Path, *changes: tuple[str, str], without: str = "") -> Path:
    """Copy an archive, with changes in its description, or without one of its files."""
    path = Path(archive.name)
    with ZipFile(archive) as old, ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == STRUCTURE:
                for before, after in changes:
                    assert before.encode() in content
                    content = content.replace(before.encode(), after.encode(), 1)
            if not (without and name.endswith(without)):
                new.writestr(name, content)
    return path


@pytest.mark.parametrize("name", ["fig4", "auv.ssp", "MotionPlanner.fmu"])
def test_there_are_no_problems_in_files_of_the_bundle(dist, workplace, capsys, name):
    if "." in name:
        shutil.copy(dist / name, workplace)
    assert main(["check", name]) == 0
    assert lines(capsys) == [f"{name}: no problems found"]


def test_all_mistakes_of_a_scenario_are_said(workplace, capsys):
    Path("mine.toml").write_text(SCENARIO)
    assert main(["check", "mine.toml"]) == 2
    shown = lines(capsys)
    assert len(shown) == 5
    assert all(line.startswith("problem: ") for line in shown)
    for word in ("nobody", "foo", "heavy", "m99", "controler"):
        assert sum(word in line for line in shown) == 1
    # A run reports the first, and how many more.
    assert main(["run", "mine.toml"]) == 2
    out, err = capsys.readouterr()
    assert "nobody" in err and "4 more" in err
    assert not out


def test_all_mistakes_of_a_study_are_said(tmp_path, capsys):
    file = tmp_path / "mine.toml"
    file.write_text('titel = "x"\n[sample]\nn = 0\n[sample.range]\nplant.ell = [0.3, 0.4]\n')
    assert main(["check", str(file)]) == 2
    output = [line.partition("mine.toml: ")[2] for line in capsys.readouterr().out.splitlines()]
    assert {text.partition(";")[0] for text in output} == {
        "sample: n = 0: write a whole number from 1 to 1,000,000,000",
        "unknown entry 'titel'",
        "lacks scenario",
    }
    file.write_text('scenario = "fig5"\n[vary]\nplant.ell = [0.3, 0.4]\n')
    assert main(["check", str(file)]) == 0


FIG5 = "scenario = 'fig5'\n"


@pytest.mark.parametrize(
    ("text", "culprits"),
    [
        ("scenario = ['fig55', 'none.ssp']", ["fig55", "none.ssp"]),
        (
            f"{FIG5}[vary]\nplant.m11 = ['heavy']\nnobody.x = [1]\nplant.m22 = [20, 20.0]\n"
            "[parameters]\nplant.m99 = 3\nplant.d11 = 'x'\n",
            ["plant.m11 heavy", "nobody", "plant.m22 20 twice", "m99", "plant.d11 x"],
        ),
        (
            f"{FIG5}vary.plant.m11 = [20]\n[sample]\nn = 4\n"
            "range = { plant.ell = [-1, 1], controller.saturation = [1, 2] }\n",
            ["plant.ell -1", "controller.saturation vary"],
        ),
        (f"{FIG5}stop_time = -1.0\nvary.plant.m11 = [20]\n", ["-1 s"]),
        (f"{FIG5}vary.step = [0.02, 0.0]\n", ["step 0 s"]),
        (
            "scenario = 'fault-sensor'\nengine = 'batch'\nvary.plant.m11 = [20]\n"
            "figures.a = { kind = 'influence', show = 'my_index' }\n",
            ["events batch", "my_index"],
        ),
        ("scenario = ['fig4', 'fig4']\nvary.plant.m11 = [20]\n", ["fig4 twice"]),
        (
            f"{FIG5}vary.controller.saturation = ['tanh']\n"
            "figures.a = { kind = 'influence', show = 'late_error' }\n",
            ["lacks x"],
        ),
    ],
)
def test_check_of_a_study_finds_what_sweep_finds(text, culprits, workplace, capsys):
    """`check` reports all problems, `sweep` the first; it makes no run."""
    pytest.importorskip("pyarrow", reason="needs the extra `studies`")
    Path("mine.toml").write_text(text)
    assert main(["check", "mine.toml"]) == 2
    output = [line.removeprefix("problem: ") for line in capsys.readouterr().out.splitlines()]
    assert len(output) == len(culprits)
    for words in culprits:
        assert any(mentions(line, words) for line in output), output
    assert main(["sweep", "mine.toml"]) == 2
    first = capsys.readouterr().err.removeprefix("auv-fmu: ").partition(" (and ")[0].strip()
    assert first == output[0]
    assert {path.name for path in workplace.iterdir()} == {"mine.toml"}


def test_a_sample_that_is_not_even_is_an_info(workplace, capsys):
    pytest.importorskip("scipy", reason="needs the extra `studies`")
    Path("mine.toml").write_text(f"{FIG5}[sample]\nn = 1000\nrange.plant.ell = [0.3, 0.4]\n")
    assert main(["check", "mine.toml"]) == 0
    shown = capsys.readouterr().out
    assert "info: " in shown and "1024" in shown


def test_all_mistakes_of_an_archive_are_said(dist, workplace, capsys):
    path = changed(
        dist / "auv.ssp",
        ('endConnector="tau.u"', 'endConnector="tau.v"'),
        ('startElement="planner"', 'startElement="nobody"'),
        without="DisturbanceGenerator.fmu",
    )
    assert main(["check", str(path)]) == 2
    shown = "\n".join(lines(capsys))
    for word in ("tau.v", "nobody", "DisturbanceGenerator.fmu"):
        assert word in shown


_FORGOTTEN = '[components]\ncontroller = "PdController"\n'
_MESSAGE = 'nothing feeds or sets controller.dy.*; wire "controller.dy" = "plant.dy"'


def test_a_forgotten_wire_is_named(workplace, capsys):
    Path("pd.toml").write_text(_FORGOTTEN)
    assert main(["check", "pd.toml"]) == 0
    assert lines(capsys) == [f"info: {_MESSAGE}", "pd.toml: no problems found"]
    run = ["run", "pd.toml", "--stop-time", "0.1", "--no-figures"]
    assert main(run) == 0
    assert f"warning: pd: {_MESSAGE}" in capsys.readouterr().err
    assert main([*run, "--strict"]) == 2
    assert _MESSAGE in capsys.readouterr().err
    for call in (load, lambda name: simulate(name, stop_time=0.1)):
        with pytest.warns(UserWarning, match="wire") as caught:
            call("pd.toml")
        assert [str(warning.message) for warning in caught] == [_MESSAGE]
        assert caught[0].filename == __file__
    with pytest.raises(InputError, match=r"controller\.dy"):
        load("pd.toml", strict=True)


def test_a_single_source_of_a_group_is_proposed(tmp_path):
    """A wire has a group of ports on each side; two that have the outputs are one too many.

    What feeds the group of another component is not proposed.
    """
    change = ('name="u"', 'name="y.y"'), ('name="y"', 'name="y.y"')
    taking, giving = (tmp_path / name for name in ("taking", "giving"))
    for folder in (taking, giving):
        folder.mkdir()
    a, b = (
        read_component(name, build(folder, change=edit))
        for name, folder, edit in zip("ab", (taking, giving), change, strict=True)
    )
    system = System("open", {"a": a, "b": b}, ())
    ours = "nothing feeds or sets a.y.*, a.mode, a.on, a.said, b.u and 3 more"
    assert system.unfed_inputs() == f'{ours}; wire "a.y" = "b.y"'
    twice = replace(system, components={"a": a, "b": b, "c": replace(b, name="c")})
    assert "wire" not in str(twice.unfed_inputs())
    fed = Connection(PortName("b", "y.y"), PortName("d", "y.y"))
    other = replace(system, components={"a": a, "b": b, "d": replace(a, name="d")})
    assert '"a.y" = "b.y"' in str(other.unfed_inputs())
    assert "wire" not in str(replace(other, connections=(fed,)).unfed_inputs())


@pytest.mark.parametrize(
    "more",
    [
        '[wires]\n"controller.dy" = "plant.dy"\n"plant.tau_w" = false\n',
        "[parameters]\ncontroller.dy = { x = 0.0, y = 0.0, z = 0.0 }\n",
        "[[events]]\nat = 1.0\noverride = { controller.dy = 0.0 }\n",
        '[inputs]\nfile = "dy.csv"\n',
    ],
)
def test_inputs_that_are_set_or_left_open_on_purpose_are_not_named(workplace, capsys, more):
    Path("dy.csv").write_text("time,controller.dy.x,controller.dy.y,controller.dy.z\n0,0,0,0\n")
    Path("pd.toml").write_text(_FORGOTTEN + more)
    assert main(["check", "pd.toml"]) == 0
    assert lines(capsys) == ["pd.toml: no problems found"]


#: Parameters of the vehicle, and the message that they cause.
VEHICLES = {
    "plant.ell = 0.6": (
        "plant.ell = 0.6, but controller.ell = planner.ell = 0.35: "
        "controller and planner are set for another vehicle"
    ),
    "plant.ell = 0.6\nplanner.ell = 0.6\nplant.m11 = 26": (
        "plant.ell = 0.6, but controller.ell = 0.35; plant.m11 = 26, but planner.m11 = 25: "
        "controller and planner are set for another vehicle"
    ),
    "planner.righting.pitch = 4.0": (
        "plant.righting.pitch = 5, but planner.righting.pitch = 4: "
        "planner is set for another vehicle"
    ),
    "plant.ell = 0.6\nplanner.ell = 0.6\ncontroller.ell = 0.6": None,
    "plant.m44 = 3.0\nplant.tau_max.u = 60.0": None,
}


@pytest.mark.parametrize("values", VEHICLES)
def test_another_vehicle_in_some_components_is_named(workplace, capsys, values):
    info = VEHICLES[values]
    Path("auv.toml").write_text(f"stop_time = 0.1\n[parameters]\n{values}\n")
    assert main(["check", "auv.toml"]) == 0
    wrong = [f"info: {info}"] if info else []
    assert lines(capsys) == [*wrong, "auv.toml: no problems found"]
    assert main(["run", "auv.toml", "--no-figures"]) == 0
    assert capsys.readouterr().err == (f"auv-fmu: warning: auv: {info}\n" if info else "")
    assert main(["run", "auv.toml", "--no-figures", "--strict"]) == (2 if info else 0)


_DELAYED = """
[components]
dvl = "Dvl"
filter = "NavigationFilter"
[wires]
"dvl.nu" = "plant.nu"
"filter.dvl" = "dvl.sample"
[parameters]
dvl.delay = {}
"""


def test_samples_that_a_filter_ignores_are_named(workplace, capsys):
    """They are older than its delay_max, 1 s."""
    for delay in ("1.0", "1.5"):
        Path("auv.toml").write_text(_DELAYED.format(delay))
        assert main(["check", "auv.toml"]) == 0
        wrong = (
            "info: dvl.delay = 1.5, but filter.delay_max = 1: filter ignores these samples; raise "
            "filter.delay_max"
        )
        assert (wrong in lines(capsys)) == (delay == "1.5")


@pytest.mark.parametrize("name", names())
def test_nothing_is_open_in_a_ready_scenario(name):
    prepared = prepare(*load_scenario(name), Request(strict=True))
    assert prepared.doubts() == []


LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("bad.fmu", None, ""),
        ("bad.ssp", b"", ""),
        ("bad.toml", b"\xff\x00PK", ""),
        ("bad.fmu", LFS, "`git lfs pull`"),
        ("bad.ssp", LFS, "`git lfs pull`"),
    ],
)
def test_an_unreadable_file_is_one_problem(workplace, capsys, name, content, words):
    if content is not None:
        Path(name).write_bytes(content)
    assert main(["check", name]) == 2
    [line] = lines(capsys)
    assert f"{name}: " in line and words in line


@pytest.mark.parametrize("marker", ["Other.ssd", "modelDescription.xml"])
def test_no_module_in_a_folder_with_a_system_or_an_fmu_is_run(workplace, capsys, marker):
    folder = Path("theirs")
    folder.mkdir()
    (folder / marker).write_text("<it/>")
    for name in ("__init__", "theirs"):
        (folder / f"{name}.py").write_text("open('ran', 'w')\ndef outputs(): ...\n")
    assert main(["check", "theirs"]) == 2
    assert lines(capsys) != []
    assert not Path("ran").exists()


@pytest.mark.slow
def test_a_component_of_ones_own_is_described_and_what_fmi_says_of_that_is_told(
    workplace, capsys, monkeypatch
):
    write(Path())
    assert main(["check", "own_lag.py"]) == 0
    assert lines(capsys) == ["own_lag.py: no problems found"]
    monkeypatch.setattr(check, "validate_fmu", lambda path: [f"{Path(path).name} is flawed"])
    assert main(["check", "own_lag.py"]) == 2
    assert lines(capsys) == [
        f"problem: own_lag.py: {name}.fmu is flawed" for name in ("native-2", "native-3", "python")
    ]
