"""The guide to your own controller, followed literally."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from orchestrator import simulate
from orchestrator.commands.main import main
from orchestrator.machine.compilers import machines_compiler
from orchestrator.runs.own_components import new_controller
from support.markdown import DOCS, blocks
from support.patches import patch
from support.texts import mentions
from support.tiers import slow


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which everything on the page was done."""
    if machines_compiler() is None:
        pytest.skip("there is no C compiler")
    folder = tmp_path_factory.mktemp("guide")
    with pytest.MonkeyPatch.context() as here:
        here.chdir(folder)
        for language, text in blocks(
            DOCS / "tutorials" / "your-own-controller.md", "sh", "diff", "python"
        ):
            if language == "diff":
                patch(folder, text)
            elif language == "python":
                exec(compile(text, "docs/tutorials/your-own-controller.md", "exec"), {})
            for line in text.splitlines() if language == "sh" else ():
                refused, _, arguments = line.rpartition("auv-fmu ")
                assert bool(main(shlex.split(arguments))) == (refused == "! "), line
    return folder


def metrics(folder: Path) -> dict[str, list[float]]:
    found: dict[str, list[float]] = json.loads((folder / "metrics.json").read_text())
    return found


def final_error(folder: Path) -> list[float]:
    return metrics(folder)["final_error"]


def test_law_of_the_guide_follows_the_reference(followed: Path):
    """Within the numbers of the page: at first, with an integral, and with a sixth of the gain."""
    assert max(final_error(followed / "script/results")) == pytest.approx(0.046, abs=5e-4)
    assert max(final_error(followed / "my_law/results")) == pytest.approx(0.020, abs=5e-4)
    assert max(final_error(followed / "my_law/soft")) > 0.2


def test_command_of_the_guide_is_within_the_limits_and_smoother_than_the_papers(followed: Path):
    ours, theirs = (metrics(followed / f"my_law/{name}") for name in ("results", "paper"))
    assert ours["saturated_fraction"] == [0.0, 0.0, 0.0]
    assert max(ours["total_variation"]) < min(theirs["total_variation"])


def test_runs_of_the_guide_are_drawn(followed: Path):
    assert (followed / "my_law/results/my_law.png").is_file()
    assert (followed / "my_law/results/my_law-velocity.svg").is_file()
    assert (followed / "compared.png").is_file()


def test_native_kind_of_the_guide_gives_the_same_bytes(followed: Path):
    tables = [followed / f"my_law/{name}/result.csv" for name in ("results", "native")]
    assert tables[0].read_bytes() == tables[1].read_bytes()


def test_both_forms_give_the_same_motion(workplace: Path):
    """In the only order that a slave of PythonFMU allows."""
    new_controller("my_law", Path("equations"))
    new_controller("my_law", Path("script"), python=True)
    first, second = (
        simulate(f"{form}/my_law.toml", stop_time=20.0, order="gauss-seidel")
        for form in ("equations", "script")
    )
    motion = [
        name for name in first.columns if name.startswith(("plant.eta", "plant.nu", "plant.y"))
    ]
    assert "plant.eta.x" in motion
    for name in motion:
        np.testing.assert_allclose(first[name], second[name], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "settings",
    [
        {"plant.noise.std": 0.1},
        *slow(
            {"planner.eta0.z": -30.0},
            {"plant.eta0.psi": 3.0},
            {"controller.m": 0.0, "controller.d": 0.0},
        ),
    ],
)
def test_law_to_begin_with_arrives_from_elsewhere(workplace: Path, settings: dict[str, float]):
    """Also with a sensor a hundred times as bad, and without parameters of the vehicle."""
    new_controller("my_law", Path())
    result = simulate("my_law.toml", settings)
    assert max(result.metrics()["final_error"]) < 0.08


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("x = = 1", "mine.py:1: SyntaxError"),
        ("import os\nraise ValueError('no')", "mine.py:2: ValueError: no"),
        ("x = 1", "Fmi2Slave"),
    ],
)
def test_mistake_in_a_script_is_told_with_its_line(text, complaint, tmp_path, capsys):
    script = tmp_path / "mine.py"
    script.write_text(text)
    assert main(["build", str(script)]) == 2
    assert complaint in capsys.readouterr().err
    assert not list(tmp_path.glob("*.fmu"))


@pytest.mark.parametrize(
    ("options", "isolated"),
    [
        ([], ["--isolate"]),
        *slow((["--python"], []), (["--python"], ["--isolate"]), ([], [])),
    ],
)
def test_mistake_in_a_step_is_told_once_with_its_line(options, isolated, workplace, capsys):
    """A mistake after half a second, in a module of the same folder; earlier rows stay."""
    assert main(["new", "controller", "my_law", ".", *options]) == 0
    Path("beside.py").write_text("def waiting(t):\n    return t < 0.5 or value\n")
    script = Path("my_law.py")
    text = script.read_text().replace("from math import", "import beside\nfrom math import", 1)
    argument, first = (
        ("current_time", "        value = self.values\n")
        if options
        else ("t", "    share = -expm1(-h / parameters.T)")
    )
    margin = first[: -len(first.lstrip())]
    text = text.replace(first, f"{margin}beside.waiting({argument})\n{first}")
    script.write_text(
        text.replace("derived: Error, h: float", "derived: Error, t: float, h: float")
    )
    assert main(["build", "my_law.py"]) == 0
    capsys.readouterr()
    assert main(["run", "my_law.toml", "--no-figures", "--out", "out", *isolated]) == 1
    [line] = capsys.readouterr().err.splitlines()
    assert mentions(line, "my_law t = 0.5 s: controller: beside.py:2: NameError: 'value'")
    assert line.count("beside.py") == 1
    assert len(Path("out/result.csv").read_text().splitlines()) == 1 + 26


def built_with(old: str, new: str) -> int:
    """Build a controller with a changed text; return the number of the last line of that text."""
    assert main(["new", "controller", "my_law", ".", "--python"]) == 0
    script = Path("my_law.py")
    before, found, after = script.read_text().partition(old)
    assert found
    script.write_text(before + new + after)
    assert main(["build", "my_law.py"]) == 0
    return (before + new).count("\n")


def test_mistake_in_the_first_step_is_the_only_message(workplace, capsys):
    """No figures and no indices of a run that has made no step."""
    line = built_with("        value = self.values\n", "        value = self.valu\n")
    capsys.readouterr()
    assert main(["run", "my_law.toml", "--out", "out"]) == 1
    output = capsys.readouterr()
    assert output.out == f"written to out{os.sep}\n"
    [complaint] = output.err.splitlines()
    assert f"my_law.py:{line}: AttributeError: " in complaint
    assert "Fatal" not in complaint


@pytest.mark.parametrize(
    ("head", "mistake", "status"),
    [("get()", "if self.filtered: nothing", 1), *slow(("put(value)", "nothing", 2))],
)
def test_mistake_in_a_value_is_told_with_its_line(workplace, capsys, head, mistake, status):
    """While a plain slave gets or sets a value, where plain PythonFMU ends with fmi2Fatal."""
    head = f"        def {head}:\n"
    line = built_with(head, f"{head}            {mistake}\n")
    capsys.readouterr()
    assert main(["run", "my_law.toml", "--no-figures"]) == status
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert f"controller: my_law.py:{line}: NameError: " in complaint


def test_changed_script_runs_changed_in_the_same_process(workplace):
    """Modules in the folder of the script are in the FMU; two versions of one do not meet."""
    assert main(["new", "controller", "two_versions", ".", "--python"]) == 0
    script = Path("two_versions.py")
    text = script.read_text().replace(
        "from pythonfmu import", "from beside import SIGN\nfrom pythonfmu import", 1
    )
    script.write_text(text.replace('value["tau.u"] = dot', 'value["tau.u"] = SIGN * dot'))
    forces = []
    for sign in ("1.0", "-1.0"):
        Path("beside.py").write_text(f"SIGN = {sign}\n")
        assert main(["build", "two_versions.py"]) == 0
        forces.append(simulate("two_versions.toml", stop_time=0.02)["controller.tau.u"][-1])
    assert forces[0] == -forces[1] != 0.0


@pytest.mark.slow
def test_many_instances_of_a_plain_slave_in_one_process(workplace):
    """A plain FMU of PythonFMU crashes the process after some dozens."""
    assert main(["new", "controller", "Often", ".", "--python"]) == 0
    code = (
        "from orchestrator import simulate\n"
        "for _ in range(80): simulate('often.toml', stop_time=0.02)\n"
    )
    subprocess.run([sys.executable, "-P", "-c", code], check=True)
