"""`auv-fmu benchmark`: its runs, draws, statistics and search, and laws of the user's own."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import scipy.stats

from orchestrator.benchmark import contest, tuning
from orchestrator.benchmark.contest import laws, loop_of, study_of_law, vehicles
from orchestrator.benchmark.cost import CHATTER, FAILED, LOST, SATURATED, costs
from orchestrator.benchmark.table import ALL, Runs, cost_of, lines, quantiles, share_of
from orchestrator.benchmark.tuning import Budget, search, training
from orchestrator.commands.main import main
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import FmuEngine, outcomes_of
from orchestrator.studies.space import Space
from orchestrator.studies.study import StopTime
from orchestrator.studies.sweep import Means, Ready, prepare_study
from orchestrator.vehicle.signals import true_control_point
from support.examples import EXAMPLES
from support.texts import mentions
from support.tiers import slow

pytest.importorskip("pyarrow", reason="needs the extra `studies`")

COMPONENTS = Path(contest.__file__).parent / "components"
ROOT = Path(__file__).parents[2]

#: The laws of the package, which has copies of their scripts once it is installed.
PACKAGED = laws()

LAW = '''\
"""A saturated law of the position."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from auv_fmu import Variable, Vector

XYZ = ("x", "y", "z")
GAINS = {"k": (1.0, 100.0)}


class Parameters(NamedTuple):
    """Gain."""

    k: Annotated[float, Variable("N/m", "Gain")] = 20.0


class Inputs(NamedTuple):
    """Positions."""

    y: Annotated[Vector, 3, Variable("m", "Measured", members=XYZ)]
    y_d: Annotated[Vector, 3, Variable("m", "Wanted", members=XYZ)]


class Outputs(NamedTuple):
    """The command."""

    tau: Annotated[Vector, 3, Variable({"u": "N", "q": "N.m", "r": "N.m"}, "Command")]


def outputs(parameters: Parameters, inputs: Inputs) -> Outputs:
    """The command of the law."""
    e = inputs.y_d - inputs.y
    return Outputs(Vector((parameters.k * e[0], -e[2], e[1])))
'''


def ready(law: str, vehicle: str, n: int = 2, engine: str = "batch") -> Ready:
    """The runs of a law with a vehicle, of 2 s."""
    study = study_of_law(laws()[law], vehicles()[vehicle], n)
    short = replace(study, stop_time=StopTime(2.0, {}))
    systems = {study.name: loop_of(laws()[law], vehicles()[vehicle], {})}
    return prepare_study(short, Means(engine=engine, kind="python"), given=systems)


def module(name: str) -> ModuleType:
    """The module of a component of the benchmark."""
    specification = spec_from_file_location(name, COMPONENTS / f"{name}.py")
    assert specification is not None and specification.loader is not None
    made = module_from_spec(specification)
    specification.loader.exec_module(made)
    return made


@pytest.fixture(autouse=True)
def scripts_of_the_examples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other tests load the examples, and a module of Python has one file."""
    monkeypatch.setattr(contest, "_laws_folder", lambda: EXAMPLES)


# Runs


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", vehicles())
def test_fmus_make_the_same_runs(vehicle: str):
    """In every task, bit for bit."""
    made = ready("pd", vehicle, 1)
    assert isinstance(made.engine, BatchEngine)
    by_fmus = FmuEngine(made.space.prepared, "python", made.own)
    # While the position is lost, too.
    points = [
        point._replace(stop_time=0.6, parameters={**point.parameters, "planner.loss.begin": 0.3})
        for point in made.space.points(np.arange(6))
    ]
    assert len({point.parameters["planner.task"] for point in points}) == 6
    for one, other in zip(
        outcomes_of(made.engine, points), outcomes_of(by_fmus, points), strict=True
    ):
        assert one == other
        assert one.indices["error"] > 0.0


def test_numbers_of_a_run_follow_from_its_rows():
    made = ready("paper", "auv", 1)
    assert isinstance(made.engine, BatchEngine)
    [point] = made.space.points(np.array([3]))
    # Some commands are beyond these limits.
    point = point._replace(parameters={**point.parameters, "limiter.tau_max.u": 20.0})
    [outcome] = outcomes_of(made.engine, [point])
    table = made.engine.table(point)
    reference = table.group("planner.y_d.x", "planner.y_d.y", "planner.y_d.z")
    error = np.linalg.norm(true_control_point(table) - reference, axis=1)
    late = error[table.time >= 1.0]
    tau = table.group("controller.tau.u", "controller.tau.q", "controller.tau.r")[:-1] / [
        20.0,
        80.0,
        80.0,
    ]
    limited = np.clip(tau, -1.0, 1.0)
    expected = {
        "error": np.sqrt((late**2).mean()),
        "largest": late.max(),
        "effort": np.sqrt((limited**2).mean()),
        "saturated": (np.abs(tau) > 1.0 - 1e-9).any(axis=1).mean(),
        "chatter": np.abs(np.diff(limited, axis=0)).sum() / 3.0 / 2.0,
    }
    found = {name: outcome.indices[name] for name in expected}
    assert found == pytest.approx(expected, rel=1e-12)
    assert 0.0 < found["saturated"] < 1.0


def test_all_laws_have_the_same_draws_and_the_search_has_others():
    remus = vehicles()["remus"]
    studies = [study_of_law(laws()[law], remus, 3) for law in ("paper", "pd")]
    first, second = (
        Space(study, {study.name: loop_of(laws()[law], remus, {})}).points(np.arange(18)).values
        for study, law in zip(studies, ("paper", "pd"), strict=True)
    )
    assert first.keys() == second.keys()
    assert all((first[name] == second[name]).all() for name in first)
    # Each task has the same draws.
    seeds = first["sensors.noise.seed"].reshape(6, 3)
    assert (seeds == seeds[0]).all() and len({*seeds[0]}) == 3
    for study in studies:
        assert len({str(training(study, number).sample) for number in range(3)}) == 3


def test_the_vehicle_sets_what_a_law_knows_of_it():
    for name, vehicle in vehicles().items():
        _, system = loop_of(laws()["pid"], vehicle, {"omega": 0.7})
        values = {str(port): value for port, value in system.parameters.items()}
        assert values["controller.omega"] == 0.7
        assert values["controller.ell"] == values["plant.ell"]
        assert values["controller.tau_max.q"] == values["limiter.tau_max.q"]
        mass = [values[f"controller.mass.{axis}"] for axis in "xyz"]
        assert mass == vehicle.known["mass"], name


# Components


def test_references_are_differentiated_exactly():
    """By central differences, where no corner or start is near."""
    course = module("course")
    h = 1e-4
    for task in course.Task:
        parameters = course.Parameters(task=task, step_speed=0.3)
        waypoints = course.zigzag(parameters)
        for t in (0.5, 7.3, 19.9, 33.0):
            before, at, after = (course.wanted(parameters, waypoints, s) for s in (t - h, t, t + h))
            for value, rate in (("y_d", "dy_d"), ("dy_d", "ddy_d")):
                difference = np.subtract(getattr(after, value), getattr(before, value)) / (2 * h)
                assert np.allclose(difference, getattr(at, rate), atol=1e-6), (task, t)
        start = course.wanted(parameters, waypoints, 0.0)
        if task != course.Task.STEP:
            assert np.allclose(start.y_d, (0.0, 0.0, parameters.depth), atol=1e-12)
            assert np.allclose(start.dy_d[:2], (parameters.speed, 0.0), atol=1e-12)


def test_only_its_tasks_have_waves_and_losses():
    course = module("course")
    inputs = course.Inputs((1.0, 2.0, 3.0))
    for task in course.Task:
        parameters = course.Parameters(task=task, calm=0.5)
        made = [
            course.outputs(parameters, course.derive(parameters), inputs, t) for t in (5.0, 23.0)
        ]
        moves = made[0].water != made[1].water
        assert moves == (task == course.Task.SEA)
        assert [each.lost for each in made] == [0.0, float(task == course.Task.SENSOR_LOSS)]
        if task in (course.Task.HELIX, course.Task.CURRENT):
            assert made[0].water[0] == (0.05 if task == course.Task.HELIX else 0.1)


def test_sensors_have_their_noise_and_hold_what_is_lost():
    sensors = module("sensors")
    parameters = sensors.Parameters(velocity_lost=1)
    vector = type(sensors.Vector((0.0,)))
    before = sensors.Inputs(
        vector((1.0, 2.0, 3.0)), vector((4.0, 5.0, 6.0)), vector((0.0,) * 3), 0.0
    )
    after = before._replace(true_y=vector((9.0, 9.0, 9.0)), true_dy=vector((8.0,) * 3), lost=1.0)
    state = sensors.update(parameters, sensors.start(before), before)
    seen = sensors.outputs(parameters, state, after).seen
    assert (seen.y, seen.dy) == (before.true_y, before.true_dy)
    n = vector(range(1, 10))
    assert sensors.measured(parameters, seen, n)[:2] == (seen.y, seen.dy)
    only = parameters._replace(velocity_lost=0)
    assert sensors.outputs(only, sensors.update(only, state, after), after).seen.dy == (8.0,) * 3
    noisy = sensors.measured(parameters, sensors.outputs(parameters, state, before).seen, n)
    assert np.allclose(np.subtract(noisy.y, before.true_y), 0.01 * np.array([1.0, 2.0, 3.0]))
    assert np.allclose(np.subtract(noisy.dy, before.true_dy), 0.01 * np.array([4.0, 5.0, 6.0]))
    assert np.allclose(np.degrees(noisy.eta), [0.7, 0.8, 2.7])


# Statistics


def test_numpy_and_scipy_give_the_same_statistics():
    random = np.random.default_rng(1)
    errors = random.exponential(size=101)
    assert quantiles(errors) == (np.median(errors), *np.sort(errors)[[5, 95]])
    for count, n in ((0, 30), (7, 100), (100, 100)):
        share, low, high = share_of(count, n)
        known = scipy.stats.binomtest(count, n).proportion_ci(method="wilson")
        assert (share, low, high) == pytest.approx((count / n, known.low, known.high), abs=1e-7)
    draws = [random.exponential(size=200) + 0.1 for _ in range(2)]
    middle, low, high = cost_of(draws)
    assert middle == pytest.approx(scipy.stats.gmean([values.mean() for values in draws]))
    known = scipy.stats.bootstrap(
        draws, lambda a, b, axis: np.sqrt(a.mean(axis=axis) * b.mean(axis=axis)),
        method="percentile", rng=np.random.default_rng(2), n_resamples=2000,
    ).confidence_interval  # fmt: skip
    assert (low, high) == pytest.approx((known.low, known.high), rel=0.02)


def test_costs_and_ranks():
    def runs(error: list[list[float]], largest: float = 0.5) -> Runs:
        columns = {
            "error": np.array(error),
            "largest": np.full((2, 2), largest),
            "effort": np.full((2, 2), 0.5),
            "saturated": np.full((2, 2), 0.1),
            "chatter": np.full((2, 2), 2.0),
        }
        columns["largest"][np.isnan(columns["error"])] = np.nan
        return Runs(
            ("a", "b"),
            {**columns, "cost": costs(columns), "failed": ~(columns["largest"] <= LOST)},
        )

    more = SATURATED * 0.1 + CHATTER * 2.0
    made = {
        ("good", "one"): runs([[0.1, 0.2], [0.3, 0.4]]),
        ("lost", "one"): runs([[0.1, 0.2], [0.3, 0.4]], LOST + 1.0),
        ("refused", "one"): runs([[np.nan, 0.2], [0.3, 0.4]]),
    }
    ranked = lines(made, ["lost", "refused", "good"], ["one"], ALL)
    assert [line.law for line in ranked] == ["good", "refused", "lost"]
    good, refused, lost = ranked
    assert good.cost[0] == pytest.approx(0.25 + more)
    assert refused.cost[0] == pytest.approx((0.9 + 3.0 * more + FAILED) / 4.0)
    assert refused.failed[0] == 0.25 and refused.error[2] == np.inf and refused.effort == 0.5
    assert lost.cost[0] == pytest.approx(FAILED) and lost.failed[0] == 1.0
    [line] = lines(made, ["good"], ["one"], "b")
    assert (line.runs, line.cost[0]) == (2, pytest.approx(0.35 + more))


# Search


@pytest.mark.slow
def test_search_is_the_same_for_a_seed():
    law, vehicle = laws()["learned"], vehicles()["auv"]
    budget = Budget(3, 8, 1, 2, 1)
    first = search(law, vehicle, budget, Means())
    assert search(law, vehicle, budget, Means()) == first
    assert search(law, vehicle, budget._replace(seed=6), Means())["gains"] != first["gains"]
    assert first["cost"] <= first["cost_of_own"]
    for name, value in first["gains"].items():
        low, high, _ = law.gains[name]
        assert 0.999 * low <= value <= 1.001 * high


@pytest.mark.slow
def test_search_finds_a_minimum_that_is_known(monkeypatch):
    law, vehicle = laws()["pid"], vehicles()["auv"]
    known = {"omega": 3.0, "zeta": 0.7, "T_i": 40.0, "T_f": 0.05}

    def bowl(law, ready, gains: np.ndarray, means) -> np.ndarray:
        return (np.log(gains / [*known.values()]) ** 2).sum(axis=1)

    monkeypatch.setattr(tuning, "_costs", bowl)
    found = search(law, vehicle, Budget(rounds=40, draws=1, final_draws=1), Means())
    for name, value in found["gains"].items():
        assert value == pytest.approx(known[name], rel=0.02)


def test_gains_of_the_program_are_within_the_ranges_of_its_laws():
    known = laws()
    for name, of_laws in contest.read_gains(contest.OWN_GAINS).items():
        assert name in vehicles()
        for law, found in of_laws.items():
            assert found["gains"].keys() == known[law].gains.keys(), (name, law)


def test_the_package_has_the_scripts_of_the_examples():
    for name, law in laws().items():
        if law.component.endswith(".py"):
            assert Path(PACKAGED[name].component).read_bytes() == Path(law.component).read_bytes()


def test_the_wheel_has_all_scripts_of_laws():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    included = project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    scripts = {
        "/".join(Path(law.component).parts[-2:])
        for law in laws().values()
        if law.component.endswith(".py")
    }
    assert {
        file.removeprefix("examples/"): place.removeprefix("orchestrator/benchmark/laws/")
        for file, place in included.items()
        if file.startswith("examples/")
    } == {script: script for script in scripts}


def test_gains_are_written_and_read_back(tmp_path: Path):
    found = {
        "auv": {"my_law": {"digest": "d", "cost": 0.1, "cost_of_own": 0.2, "gains": {"K1": 2.0}}}
    }
    (tmp_path / "gains.toml").write_text(tuning.written(found))
    assert contest.read_gains(tmp_path / "gains.toml") == found
    assert contest.read_gains(tmp_path / "none.toml") == {}


# The command


@pytest.fixture
def mine(workplace: Path) -> Path:
    path = workplace / "my_law.py"
    path.write_text(LAW)
    return path


COMMAND = ["benchmark", "my_law.py", "--runs", "2", "--vehicle", "auv", "--law", "pd"]


@pytest.mark.slow
def test_a_law_of_the_users_own_enters_the_table(mine: Path, capsys, monkeypatch):
    assert main(COMMAND) == 0
    out = capsys.readouterr().out
    assert mentions(out, "my_law PD position, attitude, velocity")
    folder = mine.parent / "results" / "benchmark"
    rows = [*csv.DictReader((folder / "table.csv").open())]
    assert {(row["law"], row["vehicle"]) for row in rows} == {("my_law", "auv"), ("pd", "auv")}
    assert len(rows) == 2 * 7
    assert "my_law" in (folder / "table.md").read_text()
    assert (folder / "errors.png").is_file() and (folder / "errors.svg").is_file()
    # Again: no run is made.
    monkeypatch.setattr(BatchEngine, "outcomes", None)
    assert main([*COMMAND, "--task", "helix"]) == 0
    assert "my_law" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "why"),
    [
        ('raise Refusal("too near")', "too near"),
        ('raise ValueError("too near")', "my_law.py:37: ValueError: too near"),
        ("e = nan * e", "tau.u = nan: must be finite"),
    ],
)
def test_runs_that_a_law_ends_are_counted_with_a_reason(mine: Path, capsys, line, why):
    """Each time, though no run is made again."""
    law = LAW.replace("import Variable", "import Refusal, Variable").replace(
        "    return", f"    if e[0] * e[0] < 1.0:\n        {line}\n    return"
    )
    mine.write_text(law.replace("from typing", "from math import nan\nfrom typing", 1))
    for _ in range(2):
        assert main(COMMAND) == 0
        [error] = [line for line in capsys.readouterr().err.splitlines() if "refused;" in line]
        assert error.startswith("auv-fmu: my_law.py: 12 of 12 runs with auv were refused; the ")
        assert error.endswith(f"controller: outputs refused: {why}") or error.endswith(
            f"controller: initialisation refused: {why}"
        )


@pytest.mark.slow
def test_its_gains_are_searched_once(mine: Path, capsys):
    search = [*COMMAND, "--tune", "--candidates", "5"]
    assert main(search) == 0
    assert "searching" in capsys.readouterr().err
    gains = contest.read_gains(mine.parent / "results" / "benchmark" / "gains.toml")
    assert gains["auv"].keys() == {"my_law"}
    record = contest.StudyResult(mine.parent / "results" / "benchmark" / "auv" / "my_law").record
    assert str(gains["auv"]["my_law"]["gains"]["k"]) in str(record)
    assert main(search) == 0
    assert "searching" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("(1.0, 100.0)", "(1.0, 0.5)", "GAINS 0 < low < high"),
        ("(1.0, 100.0)", "range(2)", "GAINS 0 < low < high"),
        ("def outputs(", "def outputs((", "my_law.py line 32"),
        *slow(
            ('{"k"', '{"kk"', "GAINS there is no parameter kk did you mean k"),
            ("tau: Annotated", "force: Annotated", "no output tau.u a law has tau.u, tau.q, tau.r"),
            ("y_d", "wind", "input wind.x is unknown y, eta, dy, y_d"),
            ("    return Outputs", "    x = [1.0]\n    return Outputs", "my_law.py a list is not"),
        ),
    ],
)
def test_a_component_that_cannot_be_a_law_is_refused_in_a_line(mine: Path, capsys, old, new, words):
    mine.write_text(LAW.replace(old, new))
    assert main(COMMAND) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert mentions(error, words)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--law", "foo"], "no law foo there are paper"),
        (["--vehicle", "remu"], "no vehicle remu did you mean remus"),
        (["--task", "sing"], "no task sing"),
        (["--runs", "0"], "must be at least 1"),
        (["none.py"], "none.py no such Python file"),
        (["paper.py"], "paper has this name"),
    ],
)
def test_bad_options_are_refused(mine: Path, capsys, options, words):
    mine.with_name("paper.py").write_text(LAW)
    assert main(["benchmark", *options]) == 2
    assert mentions(capsys.readouterr().err, words)
