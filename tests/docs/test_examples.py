"""The examples of the guides run, and give what the guides say."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from ast import literal_eval
from importlib.util import find_spec
from inspect import signature
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator import Result, read, simulate, sweep
from orchestrator.commands.main import main
from orchestrator.machine.compilers import machines_compiler
from orchestrator.runs.preparation import load_scenario
from orchestrator.runs.scenario import read_scenario
from orchestrator.studies.space import Space
from orchestrator.studies.study import read_figures, ready_studies, study_of
from orchestrator.vehicle.indices import index_columns
from orchestrator.vehicle.signals import tracking_error, true_control_point
from support.machine import contents
from support.markdown import DOCS, blocks
from support.ros import beside, run_node
from support.tiers import slow

pytestmark = pytest.mark.usefixtures("workplace")

(
    ACCURACY, BATCH, DERIVATIVES, EVENTS, EXAMPLES, EXCHANGE, EXPORT, LEARN, LIBCOSIM, PARAMETERS,
    PYTHON, ROS, SCENARIOS, STEP, STUDIES, TEST_ONE, TRAJECTORIES, VEHICLES,
) = (
    DOCS / f"{name}.md"
    for name in (
        "explanation/accuracy",
        "explanation/batch",
        "how-to/derivatives",
        "how-to/events",
        "reference/examples",
        "how-to/hosts/model-exchange",
        "how-to/export-results",
        "how-to/learn",
        "how-to/hosts/libcosim",
        "how-to/change-parameters",
        "how-to/python",
        "how-to/ros",
        "reference/scenario-files",
        "how-to/step",
        "how-to/studies",
        "how-to/test-one-component",
        "how-to/trajectories",
        "how-to/vehicles",
    )
)  # fmt: skip


def needs(extra: str, *packages: str) -> pytest.MarkDecorator:
    missing = not all(map(find_spec, packages))
    return pytest.mark.skipif(missing, reason=f"needs the extra `{extra}`")


needs_studies = needs("studies", "pyarrow", "scipy")


def executed(page: Path, capsys: pytest.CaptureFixture[str], number: int = 0) -> list[str]:
    """Output of an example in Python."""
    exec(compile(blocks(page, "python")[number].text, str(page), "exec"), {})
    return str(capsys.readouterr().out).splitlines()


@pytest.mark.parametrize(
    ("page", "number"),
    [
        case
        for page in (SCENARIOS, EVENTS, PARAMETERS)
        for first, *others in [[(page, n) for n in range(len(blocks(page, "toml")))]]
        for case in (first, *slow(*others))
    ],
    ids=lambda value: getattr(value, "stem", value),
)
def test_scenario_of_a_guide_runs_and_is_drawn(page: Path, number: int):
    """Without a warning, until the stop time of the command line."""
    [table] = [text for _, text in blocks(EVENTS, "text") if text.startswith("time")]
    Path("inputs.csv").write_text(table)
    Path("waves.csv").write_text("time,plant.tau_w.u,plant.tau_w.w\n0,0,0\n2,0.5,-0.5\n")
    Path("survey.csv").write_text("x,y,z\n3,6,0\n15,6,4\n15,10,4\n")
    Path("mine.toml").write_text(blocks(page, "toml")[number].text)
    assert main(["run", "mine.toml", "--stop-time", "2", "--kind", "native", "--strict"]) == 0
    assert [*Path("results/mine").glob("mine*.png")]
    assert json.loads(Path("results/mine/metrics.json").read_text())["stop_time"] == 2.0


@pytest.mark.parametrize("name", ["fault-thruster", "fault-sensor", "current-step"])
def test_remarks_of_scenarios_are_on_the_page(name):
    text = " ".join(EVENTS.read_text(encoding="utf-8").split())
    assert " ".join(read_scenario(name).remark.split()) in text


def test_events_in_python_are_told(capsys):
    assert executed(EVENTS, capsys) == [
        "10.0 lose controller.tau.r",
        "15.0 lose controller.tau.r, ended",
        "20.0 set plant.current.x = 0.3",
    ]


def test_changed_gain_in_python_gives_an_error_each(capsys):
    lines = executed(PARAMETERS, capsys)
    assert [line.split()[0] for line in lines] == ["50.0", "25.0"]


def test_an_fmu_gives_the_derivatives_of_the_page(native, capsys):
    Path("dist").mkdir()
    shutil.copy(native / "AuvPlant.fmu", "dist")
    found = executed(DERIVATIVES, capsys)
    assert found == answers(DERIVATIVES, 0)
    assert [float(line[1:-1]) for line in found] == pytest.approx([1.0 / 25.0, -30.0 / 25.0])


@needs("casadi", "casadi")
def test_functions_of_casadi_give_the_derivatives_of_the_page(capsys):
    m11, d11, h = 25.0, 30.0, 0.02
    wanted = f"(19, 19) (19, 15) {1.0 - h * d11 / m11:.3f} {h / m11:.4f}"
    assert executed(DERIVATIVES, capsys, 1) == [wanted] == answers(DERIVATIVES, 1)
    assert executed(DERIVATIVES, capsys, 2) == answers(DERIVATIVES, 2)
    ends = []
    for eps_t in (0.999, 1.001):
        values = {"plant.noise.std": 0.0, "controller.eps_t": eps_t}
        ends.append(simulate("fig4", values, stop_time=2.0)["controller.e.x"][-1])
    slope = float(answers(DERIVATIVES, 2)[-1].split()[-1])
    assert slope == pytest.approx((ends[1] - ends[0]) / 0.002, rel=0.01)


def answers(page: Path, number: int) -> list[str]:
    """Output of an example, as the page shows it."""
    return blocks(page, "text")[number].text.splitlines()


def test_solvers_of_other_tools_run_fmus_for_model_exchange(native, capsys):
    Path("dist").mkdir()
    shutil.copy(native / "AuvPlant.fmu", "dist")
    [settled] = executed(EXCHANGE, capsys)
    assert float(settled) == pytest.approx(10.0 / 30.0, rel=1e-4)
    if find_spec("casadi"):
        assert executed(EXCHANGE, capsys, 2) == ["0.04"]
    pytest.importorskip("pathsim_fmi")
    script = DOCS.parent / "examples" / "dc_motor" / "dc_motor.py"
    assert main(["build", str(script), "--kind", "native", "--out", "dist"]) == 0
    capsys.readouterr()
    *_, speed = executed(EXCHANGE, capsys, 1)
    # di/dt = (12 - 1.5 i - 0.1 w) / 0.12, dw/dt = (0.1 i - 0.0005 w) / 0.005, for 2 s.
    A = np.array([[-1.5 / 0.12, -0.1 / 0.12], [0.1 / 0.005, -0.0005 / 0.005]])
    values, vectors = np.linalg.eig(A)
    end = np.linalg.solve(-A, [100.0, 0.0])
    w = (vectors @ (np.exp(2.0 * values) * np.linalg.solve(vectors, -end)) + end)[1].real
    assert float(speed) == pytest.approx(w, rel=1e-3)


def test_tests_of_one_fmu_pass_as_the_page_says(native, workplace):
    Path("dist").symlink_to(native)
    Path("fmus").symlink_to(DOCS.parent / "fmus")
    [code] = blocks(TEST_ONE, "python")
    Path("test_observer.py").write_text(code.text)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_observer.py"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    [block] = blocks(TEST_ONE, "text")
    assert block.text.strip() in ended.stdout


def test_example_of_a_component_is_built_verified_and_run(workplace):
    Path("examples").symlink_to(DOCS.parent / "examples")
    for command in blocks(EXAMPLES, "sh")[0].text.splitlines():
        program, *arguments = command.split()
        assert program == "auv-fmu" and main(arguments) == 0
    [code] = blocks(EXAMPLES, "python")
    python = [sys.executable, "-c", code.text]
    ended = subprocess.run(python, capture_output=True, text=True, check=True)
    assert f"It prints {ended.stdout.strip()}," in EXAMPLES.read_text(encoding="utf-8")


@needs("hosts", "libcosimpy")
@pytest.mark.parametrize(("number", "options"), [(0, []), (1, ["--format", "fmu"])])
def test_libcosim_moves_the_vehicle_as_the_page_says(workplace, number, options):
    """An archive is evaluated in another order than one FMU, but neither stays at zero."""
    assert main(["export", "fig4", *options]) == 0
    python = [sys.executable, "-c", blocks(LIBCOSIM, "python")[number].text]
    ended = subprocess.run(python, capture_output=True, text=True, check=True)
    ours = simulate("fig4", stop_time=10.0)
    expected = [ours[f"plant.eta.{axis}"][-1] for axis in "xyz"]
    [answer] = re.findall(r"^\[[-\d., e]+\]$", ended.stdout, re.MULTILINE)
    assert json.loads(answer) == pytest.approx(expected, abs=[2e-2, 1e-9][number])


def test_tests_that_the_page_names_are_there():
    [_, _, named] = blocks(TEST_ONE, "sh")
    for path in named.text.split()[1:]:
        assert (DOCS.parent / path).exists(), path


def prints_what_it_says(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Execute the examples of a page, one after the other."""
    names: dict[str, object] = {}
    printed = ""
    for language, text in blocks(page, "python", "text"):
        if language == "text":
            assert printed == text
            continue
        exec(compile(text, str(page), "exec"), names)
        printed = capsys.readouterr().out


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_simulations_stepped_on_the_page_print_what_it_says(capsys):
    prints_what_it_says(STEP, capsys)


@needs("gymnasium", "gymnasium")
@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_environments_on_the_page_print_what_it_says(capsys):
    prints_what_it_says(LEARN, capsys)


@needs("parquet, and pandas", "pandas", "pyarrow")
def test_examples_in_python_print_what_the_page_says(workplace, capsys):
    prints_what_it_says(PYTHON, capsys)
    assert Path("commands.png").is_file()
    files = contents(workplace / "results/mine").keys()
    assert files == {"result.parquet", "metrics.json", "run.json"}


def test_first_result_on_the_page_is_shown_as_it_is(capsys):
    [shown] = executed(PYTHON, capsys)
    assert f"`{shown}`" in PYTHON.read_text(encoding="utf-8")


def test_batch_engine_gives_what_the_fmus_give(capsys):
    first, *lines = executed(BATCH, capsys)
    result = simulate("fig5", {"controller.eps_t": 1.0}, stop_time=40.0, kind="native")
    z, failure = first.split()
    assert (float(z), failure) == (result["plant.eta.z"][-1], "None")
    assert float(lines[0].split()[0]) == result.metrics()["l2_effort"][0]
    assert len(lines) == 2


def test_pages_of_studies_name_all_columns_options_and_ready_studies():
    pages = (STUDIES, DOCS / "reference" / "study-files.md")
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    for name in index_columns():
        assert f"`{name.split('.')[0].split('[')[0]}" in text, name
    for name in (*signature(sweep).parameters.keys() - {"study", "progress"}, *ready_studies()):
        assert f"--{name} " in text or f"`{name}`" in text, name


@needs_studies
def test_study_has_as_many_runs_as_the_page_says():
    example, _ = blocks(STUDIES, "toml")
    study = study_of("mine", tomllib.loads(example.text))
    space = Space(study, {name: load_scenario(name) for name in study.scenario})
    assert len(space) == 8 * 2 * 64 * 2
    assert read_figures("mine", study.figures, space.columns, space.has_scenarios)


@needs_studies
def test_an_index_of_ones_own_is_a_column(workplace):
    """The last time at which the depth is not near, from the rows of each run."""
    Path("settling_time.py").write_text(blocks(STUDIES, "python")[2].text)
    Path("settling.toml").write_text(blocks(STUDIES, "toml")[1].text)
    assert main(["check", "settling.toml"]) == 0
    assert main(["check", "settling_time.py"]) == 0
    result = sweep("settling.toml", kind="native", out="made")
    assert Path("made", "settling.png").is_file()
    for z, settled in zip(result["plant.eta0.z"], result["settling_time"], strict=True):
        run = simulate("fig4", {"plant.eta0.z": z}, stop_time=20.0, kind="native")
        away = np.abs(run["plant.eta.z"] - run["planner.y_d.z"]) > 0.5
        assert settled == run.time[away][-1] > 5.0


@needs_studies
def test_study_in_python_has_the_columns_that_the_page_says(capsys):
    first, second, *_ = executed(STUDIES, capsys)
    assert first == "6 0 ['run', 'plant.eta0.y', 'controller.saturation', 'l2_effort.u']"
    assert second == "[0. 0. 1. 1. 2. 2.] [None None None None None None]"


@needs_studies
def test_a_function_is_an_index_of_a_result_and_of_a_study(capsys):
    """The last time at which the depth is not near, from the rows of each run."""
    _, line = executed(STUDIES, capsys, 1)
    times, shares = (np.fromstring(text, sep=" ") for text in re.findall(r"\[(.*?)\]", line))
    for z, time, share in zip((-5.0, 0.0, 5.0), times, shares, strict=True):
        run = simulate("fig4", {"plant.eta0.z": z}, stop_time=20.0, kind="native")
        away = np.abs(run["plant.eta.z"] - run["planner.y_d.z"]) > 0.5
        assert time == pytest.approx(run.time[away][-1], abs=1e-6)
        assert share == pytest.approx(sum(away) / len(run), abs=1e-6)


def exported(number: int) -> Result:
    """The result that a part of the page about exports has written."""
    names: dict[str, Any] = {}
    for code in (blocks(EXPORT, "python")[i].text for i in (0, number)):
        exec(compile(code, EXPORT.name, "exec"), names)
    result: Result = names["result"]
    return result


def test_matlab_gets_columns_and_units():
    result = exported(1)
    from scipy.io import loadmat  # noqa: PLC0415

    content = loadmat("fig4.mat", squeeze_me=True)
    assert np.array_equal(content["time"], result.time)
    assert np.array_equal(content["controller_theta_hat_1"], result["controller.theta_hat[1]"])
    assert str(content["units"]["plant_tau_q"]) == "N.m"
    assert len([name for name in content if name[0] != "_"]) == len(result.columns) + 2


def test_hdf5_and_netcdf_get_columns_and_units():
    h5py = pytest.importorskip("h5py", reason="needs the extra `docs`")
    result = exported(2)
    with h5py.File("fig4.h5") as file:
        assert file.keys() == {"time", *result}
        assert np.array_equal(file["plant.eta.z"], result["plant.eta.z"])
        assert file["plant.eta.z"].attrs["units"] == "m"
    pytest.importorskip("netCDF4", reason="needs the extra `docs`")
    xarray = pytest.importorskip("xarray", reason="needs the extra `docs`")
    exported(3)
    with xarray.open_dataset("fig4.nc") as dataset:
        assert [*dataset.data_vars] == [*result]
        assert np.array_equal(dataset["plant.tau.q"], result["plant.tau.q"])
        assert np.array_equal(dataset["time"], result.time)
        assert (dataset["plant.tau.q"].units, dataset.scenario) == ("N.m", "fig4")


@needs("parquet, and pandas", "pandas", "pyarrow")
def test_pandas_keeps_units_in_parquet(capsys):
    exported(4)
    assert capsys.readouterr().out == "N.m\n"
    from pandas import read_parquet  # noqa: PLC0415

    assert read_parquet("fig4.parquet").attrs["units"]["plant.eta.psi"] == "rad"


QUIET = {"plant.noise.std": 0.0}
RK4 = {**QUIET, "plant.integrator": "rk4"}


def said_of_accuracy(*cells: str) -> list[str]:
    """Rest of the first row that begins with some cells, without bold marks."""
    begins = f"| {' | '.join(cells)} |"
    lines = ACCURACY.read_text(encoding="utf-8").splitlines()
    found = next(line for line in lines if line.startswith(begins))
    return [cell.strip(" *") for cell in found.strip("|").split("|")[len(cells) :]]


@pytest.mark.parametrize("name", ["fig4", "fig5-pd"])
def test_paths_of_the_plants_schemes_are_as_far_apart_as_the_page_says(name):
    """To the two digits of the page; `rk4` is exact to less than a micrometre."""
    euler, rk4, exact = (
        true_control_point(simulate(name, values, kind="native"))
        for values in (QUIET, RK4, {**RK4, "plant.h_max": 0.002})
    )
    cell = said_of_accuracy(f"`{name}`")[0].split("; ")[0]
    away = np.linalg.norm(euler - exact, axis=1).max()
    assert away == pytest.approx(float(cell.removesuffix(" cm")) / 100, rel=0.05)
    assert np.linalg.norm(rk4 - exact, axis=1).max() < 1e-6


def test_effort_of_the_pd_controller_belongs_to_the_plants_scheme_as_the_page_says():
    cells = said_of_accuracy("`fig5-pd`", "L2 q")
    found = [
        simulate("fig5-pd", values, kind="native").metrics()["l2_effort"][1]
        for values in (QUIET, RK4)
    ]
    assert [f"{effort:.3g}" for effort in found] == [cells[0], cells[-1]] == ["166", "133"]


@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_a_users_trajectory_follows_its_table(capsys: pytest.CaptureFixture[str]):
    """Between the rows it follows the curve of the rows, whose derivatives are known."""
    executed(TRAJECTORIES, capsys)
    for command in blocks(TRAJECTORIES, "sh")[1].text.splitlines():
        assert main(command.split()[1:]) == 0
    Path("eight.toml").write_text(blocks(TRAJECTORIES, "toml")[0].text)
    assert main(["check", "eight.toml"]) == 0
    result = simulate("eight.toml")
    w, t = 2.0 * np.pi / 240.0, result.time
    x, y = 20.0 * np.exp(1j * w * t), 10.0 * np.exp(2j * w * t)
    assert np.abs(result["planner.y_d.x"] - x.imag).max() < 2e-9
    assert np.abs(result["planner.dy_d.x"] - (1j * w * x).imag).max() < 2e-8
    assert np.abs(result["planner.ddy_d.y"] - ((2j * w) ** 2 * y).imag).max() < 2e-6
    away = np.linalg.norm(tracking_error(result), axis=1)[t > 20.0].max()
    assert away == pytest.approx(0.2, abs=0.01)
    lines = Path("track.csv").read_text().splitlines()[1:]
    rows = (line.partition(",") for line in lines)
    quick = "".join(f"{float(t) / 4},{place}\n" for t, _, place in rows)
    Path("track.csv").write_text(f"t,x,y,z\n{quick}")
    with pytest.raises(ValueError, match="planner") as refused:
        simulate("eight.toml")
    assert str(refused.value) == " ".join(blocks(TRAJECTORIES, "text")[0].text.split())


@needs("pettingzoo", "pettingzoo")
@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_agents_on_the_page_about_vehicles_get_rewards(capsys):
    [line] = executed(VEHICLES, capsys)
    rewards = literal_eval(line)
    assert [*rewards] == ["auv1", "auv2", "auv3"] and max(rewards.values()) < 0.0


@pytest.mark.slow
@needs("ros", "rclpy")
@pytest.mark.skipif(machines_compiler() is None, reason="there is no C compiler")
def test_pilot_in_ros_goes_to_the_east():
    Path("pilot.py").write_text(blocks(ROS, "python")[0].text)
    with beside("pilot.py"):
        run_node("fig4", "--stop-time", "30", "--out", "result")
    result = read("result")
    late = result.time > 20.0
    assert np.degrees(result["plant.eta.psi"][late]) == pytest.approx(90.0, abs=5.0)
    assert np.degrees(result["plant.eta.theta"][late]) == pytest.approx(0.0, abs=5.0)
    # 20 N against the damping of 30 kg/s, and a friction of 0.5 N.
    assert np.diff(result["plant.eta.y"][late]) / 0.02 == pytest.approx(0.65, abs=0.05)


def test_master_runs_an_ssp_as_its_page_says(native, workplace, capsys):
    shutil.copy(native / "auv.ssp", "system.ssp")
    [code] = blocks(DOCS / "how-to" / "master.md", "python")
    exec(compile(code.text.replace("gain.y", "plant.eta.x"), "master.md", "exec"), {})
    assert isfinite(float(capsys.readouterr().out))
