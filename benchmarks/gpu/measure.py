"""Check and measure the engine gpu on a machine with a card: `python measure.py [PART ...]`.

The parts, in this order, each of which prints as it goes:

- `compile`: time to the first runs of Fig. 4, with an empty cache of compiled programs and again.
- `checks`: indices by `gpu` and by `batch`, of ready studies and of other scenarios. Deviations are
  relative to the larger of 1 and the value. A run counts as chaotic if moving its start by 1e-12 m
  moves an index by more than 1e-9 on the processor, too: rounding errors grow there.
- `random`: normal numbers on the card, beside Python's `random`.
- `speed`: steps a second by `gpu`, with all indices, and by `batch` on all cores.
- `registers`: steps a second of Fig. 4 with fewer registers for a thread, and so more threads at a
  time.
- `stepping`: steps a second of `Simulations`, one step a call.
- `study`: a large study of Fig. 4 with its table, and where its time goes.
- `policy`: steps of environments with a policy on the card, by torch where it is installed.
- `crazyflow`: environments of crazyflow, if it is installed.

Results are in `results.json` and `results.md` after every line. `--processor` measures with the
same programs on the processor instead, which shows that the script works, not how fast a card is.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import redirect_stdout, suppress
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from random import Random
from time import perf_counter
from typing import Any

import numpy as np

from auv_fmu import Simulations
from orchestrator.commands.main import main as auv_fmu
from orchestrator.program import card
from orchestrator.program.card import Cards
from orchestrator.program.library import PROCESSOR, Runners
from orchestrator.runs.preparation import load_scenario
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.columns import Case, Numbers, Outcomes, Points
from orchestrator.studies.space import Space
from orchestrator.studies.store import open_store
from orchestrator.studies.study import read_study, ready_studies, study_of
from orchestrator.studies.sweep import making_runs
from orchestrator.vehicle.signals import loops_of

#: The scenario of a new controller, which the script makes.
OWN = "new controller"

#: Scenarios that are checked besides ready studies, and those that are timed.
CHECKED = ("fig4", "fig5-pd", "sea", "remus", "formation-v", "path", OWN)
TIMED = ("fig4", "fig5-pd", "sea", "formation-v", OWN)

#: Standard deviations of the measurement noise [m].
NOISES = (0.0, 0.001)

#: Length of the runs that are checked, and of those that are timed, and their step [s].
CHECKED_TIME, TIMED_TIME, STEP = 60.0, 10.0, 0.02

#: Largest distance of the starts from the scenario's [m].
AWAY = 5.0

#: Distance by which a start is moved [m], and the deviation from which a run counts as chaotic.
MOVED, CHAOTIC = 1e-12, 1e-9

#: Runs in a block on the processor, so that the time of a measurement is kept.
PROCESSOR_BLOCK = 256

#: Length of the runs of the large study [s].
STUDY_TIME = 100.0

#: Steps of the comparison of random numbers: in some a generator renews its words.
DRAWN_STEPS = 300

#: Width of the hidden layers of the policy, and an action's share of the limits.
HIDDEN, SHARE = 64, 0.1

#: Most registers of a thread; there are 255.
REGISTERS = (255, 192, 168, 128)

#: Results by part, each of which has rows.
Results = dict[str, list[dict[str, Any]]]


class Report:
    """Results, written after each of them.

    Attributes:
        results: by part.

    """

    def __init__(self, folder: Path, head: Mapping[str, Any]) -> None:
        self._folder, self._head = folder, head
        self.results: Results = {}
        folder.mkdir(parents=True, exist_ok=True)

    def add(self, part: str, row: Mapping[str, Any]) -> None:
        """Add a row to a part, print it and write all."""
        self.results.setdefault(part, []).append(dict(row))
        shown = ", ".join(
            f"{name} {text(value)}" for name, value in row.items() if not isinstance(value, dict)
        )
        print(f"{part}: {shown}", flush=True)
        everything = {**self._head, **self.results}
        (self._folder / "results.json").write_text(json.dumps(everything, indent=1))
        (self._folder / "results.md").write_text(self._markdown())

    def _markdown(self) -> str:
        lines = [f"{name}: {value}\n" for name, value in self._head.items()]
        for part, rows in self.results.items():
            names = [*dict.fromkeys(name for row in rows for name in row)]
            flat = [
                name for name in names if not any(isinstance(row.get(name), dict) for row in rows)
            ]
            lines += [f"\n## {part}\n", *table(flat, [[row.get(n) for n in flat] for row in rows])]
            indices: dict[str, list[float]] = {}
            for row in rows:
                for index, values in row.get("by index", {}).items():
                    indices[index] = [
                        max(pair) for pair in zip(values, indices.get(index, values), strict=True)
                    ]
            if indices:
                head = ["index", "largest deviation", "largest median of a check"]
                lines += ["", *table(head, [[name, *pair] for name, pair in indices.items()])]
        return "\n".join(lines) + "\n"


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    """Return a table in Markdown."""
    cells = [[*head], ["---"] * len(head), *([text(cell) for cell in row] for row in rows)]
    return [f"| {' | '.join(row)} |" for row in cells]


def text(value: Any) -> str:
    """Return a value for people."""
    if value is None:
        return ""
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


# Engines and their runs


def use_processor() -> None:
    """Let programs for cards run on the processor."""
    beside = Path(__file__).parent
    sys.path[:0] = [str(beside), str(beside.parents[1] / "tests" / "support")]
    card_class = import_module("processor_card").ProcessorCard
    card.find_cards = lambda instead: [card_class()]


def own_controller(folder: Path) -> str:
    """Write a controller, and return the path of its scenario."""
    scenario = folder / "my_law.toml"
    with redirect_stdout(sys.stderr):
        auv_fmu(["new", "controller", "my_law", str(folder)])
    return str(scenario)


@cache
def loaded(scenario: str) -> Any:
    """Return the system of a scenario."""
    return load_scenario(scenario)[1]


def engine_of(scenarios: Sequence[str], runners: Runners) -> BatchEngine:
    """Return an engine for some scenarios."""
    return BatchEngine({name: loaded(name) for name in scenarios}, runners=runners)


def cards() -> Cards:
    """Return the cards of this machine."""
    return Cards("use --processor")


def some_points(
    scenario: str, stop_time: float, noise: float | None, numbers: np.ndarray
) -> Points:
    """Return runs of a scenario from random starts."""
    system = loaded(scenario)
    vehicles = [loop.vehicle for loop in loops_of(system)]
    given = {} if noise is None else {f"{name}.noise.std": noise for name in vehicles}
    draws, n = np.random.default_rng(int(numbers[0])), len(numbers)
    starts = {f"{vehicles[0]}.eta0.{axis}": draws.uniform(-AWAY, AWAY, n) for axis in ("y", "z")}
    case = Case(scenario, given, tuple(starts))
    times = np.full(n, stop_time), np.full(n, STEP)
    return Points(numbers, [case], np.zeros(n, int), starts, *times)


def made(engine: BatchEngine, points: Points) -> Outcomes:
    """Make runs."""
    return Outcomes.joined([*engine.outcomes(points)])


def in_seconds(engine: BatchEngine, blocks: Iterator[Points], seconds: float) -> tuple[int, float]:
    """Make blocks of runs for a while, and return how many runs were made, and the time [s]."""
    n, start, elapsed = 0, perf_counter(), 0.0
    with making_runs(engine, blocks) as done:
        for outcomes in done:
            n, elapsed = n + len(outcomes), perf_counter() - start
            if elapsed > seconds:
                break
    return n, elapsed


# Checks


def check(name: str, scenario: str | None, n: int) -> dict[str, Any]:
    """Compare the indices of runs by both engines.

    Args:
        name: of the check.
        scenario: its scenario; None: the name is that of a ready study.
        n: number of runs.

    """
    points = (
        study_points(name, n)
        if scenario is None
        else some_points(scenario, CHECKED_TIME, None, np.arange(n))
    )
    scenarios = [*dict.fromkeys(case.scenario for case in points.cases)]
    processor = engine_of(scenarios, PROCESSOR)
    ours, theirs, moved = (
        made(engine, some)
        for engine, some in (
            (engine_of(scenarios, cards()), points),
            (processor, points),
            (processor, moved_points(processor, points)),
        )
    )
    columns = theirs.columns
    away, own = (
        deviation(each.arranged(columns).indices, theirs.indices) for each in (ours, moved)
    )
    is_chaotic = own.max(axis=1) > CHAOTIC
    calm, chaotic = away[~is_chaotic], away[is_chaotic]
    return {
        "check": name,
        "runs": len(points),
        "other failures": int((np.array(ours.failures.each()) != theirs.failures.each()).sum()),
        "largest": float(calm.max(initial=0.0)),
        "median": float(np.median(calm)) if calm.size else 0.0,
        "equal indices": float((away == 0.0).mean()),
        "chaotic runs": int(is_chaotic.sum()),
        "largest of chaotic": float(chaotic.max(initial=0.0)),
        "largest of a moved start": float(own[~is_chaotic].max(initial=0.0)),
        "by index": {
            index: [float(calm[:, i].max(initial=0.0)), float(np.median(calm[:, i]))]
            for i, index in enumerate(columns)
            if len(calm)
        },
    }


def deviation(found: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """Return deviations relative to the larger of 1 and the value; infinite if only one is nan."""
    away = np.abs(found - expected) / np.maximum(1.0, np.abs(expected))
    missing = np.isnan(found), np.isnan(expected)
    away[missing[0] ^ missing[1]] = np.inf
    away[missing[0] & missing[1]] = 0.0
    return away


def study_points(name: str, n: int) -> Points:
    """Return some runs of a ready study."""
    study = read_study(name)
    space = Space(study, {scenario: load_scenario(scenario) for scenario in study.scenario})
    return space.points(np.array(sorted(Random(name).sample(range(len(space)), n))))


def moved_points(engine: BatchEngine, points: Points) -> Points:
    """Return runs whose first vehicle starts a little aside."""
    cases, values = [*points.cases], dict(points.values)
    moved = set()
    for i, case in enumerate(cases):
        name = f"{loops_of(loaded(case.scenario))[0].vehicle}.eta0.y"
        if name in case.varied:
            moved.add(name)
            continue
        [first, *_] = points[np.flatnonzero(points.case == i)[:1]]
        value = float(engine.value(first, name)) + MOVED
        cases[i] = case._replace(parameters={**case.parameters, name: value})
    values |= {name: values[name] + MOVED for name in moved}
    return Points(points.numbers, cases, points.case, values, points.stop_time, points.step)


def warm(scenario: str, noise: float) -> None:
    """Compile a program into the cache, for measurements of its speed."""
    made(engine_of([scenario], cards()), some_points(scenario, STEP, noise, np.arange(8)))


# Parts


def measure_compile(report: Report, given: argparse.Namespace) -> None:
    """Measure the time to first runs."""
    with tempfile.TemporaryDirectory() as folder:
        for what in ("empty cache", "cached"):
            with workers(given, 1, CUPY_CACHE_DIR=folder) as pool:
                pool.submit(loaded, "fig4").result()
                start = perf_counter()
                pool.submit(warm, "fig4", 0.0).result()
                report.add("compile", {"program": what, "seconds": perf_counter() - start})


def measure_checks(report: Report, given: argparse.Namespace) -> None:
    """Compare both engines, in several processes."""
    with workers(given, given.processes) as pool:
        # The largest programs first.
        jobs = (
            [*(pool.submit(warm, given.paths[name], noise) for name in TIMED for noise in NOISES)]
            if "speed" in given.parts
            else []
        )
        checks = {name: given.paths[name] for name in reversed(CHECKED)}
        checks |= dict.fromkeys(ready_studies())
        named = {pool.submit(check, *job, given.check): job[0] for job in checks.items()}
        for done in as_completed(named):
            if failure := done.exception():
                report.add("checks", {"check": named[done], "failure": str(failure)[:200]})
            else:
                report.add("checks", done.result())
        for job in jobs:
            job.result()


def measure_random(report: Report, given: argparse.Namespace) -> None:
    """Compare normal numbers, as two vehicles without a controller measure their positions."""
    seeds = np.arange(1, given.seeds + 1)
    noisy, clean = (
        Simulations(
            "fig4", len(seeds), {"plant.noise.std": std, "plant.noise.seed": seeds}, device="cuda"
        )
        for std in (1.0, 0.0)
    )
    for sims in (noisy, clean):
        sims["plant.tau"] = np.zeros(3)
    drawn = []
    for _ in range(DRAWN_STEPS):
        measured, true = (on_host(sims["plant.y"]).copy() for sims in (noisy, clean))
        drawn.append(measured - true)
        for sims in (noisy, clean):
            sims.step()
    found = np.concatenate(drawn, axis=1)
    expected = np.empty_like(found)
    for row, seed in zip(expected, seeds.tolist(), strict=True):
        random = Random(seed)
        row[:] = [random.gauss(0.0, 1.0) for _ in row]
    away = np.abs(found - expected)
    report.add("random", {"numbers": found.size, "largest difference": float(away.max())})


def on_host(array: Any) -> np.ndarray:
    """Return an array in this process's memory."""
    copied: np.ndarray = array.get() if hasattr(array, "get") else np.asarray(array)
    return copied


def measure_speed(report: Report, given: argparse.Namespace) -> None:
    """Measure steps a second of whole runs with all indices."""
    steps = round(TIMED_TIME / STEP)
    for name in TIMED:
        for noise in NOISES:
            scenario, left = given.paths[name], given.seconds
            row = {"scenario": name, "noise": noise}
            for runners, numbers in ((cards(), given.runs), (PROCESSOR, [10**9])):
                engine = engine_of([scenario], runners)
                is_card = runners is not PROCESSOR
                size = engine.most_runs if is_card else PROCESSOR_BLOCK
                made(engine, some_points(scenario, STEP, noise, np.arange(8)))
                for n in numbers:
                    blocks = (
                        some_points(scenario, TIMED_TIME, noise, block)
                        for block in Numbers((0, n)).blocks(size)
                    )
                    limit = left if is_card else given.seconds / 4
                    runs, seconds = in_seconds(engine, blocks, limit)
                    report.add(
                        "speed",
                        {
                            **row,
                            "engine": "gpu" if is_card else "batch",
                            "runs": runs,
                            "seconds": seconds,
                            "steps a second": runs * steps / seconds,
                        },
                    )
                    left -= seconds
                    if left <= seconds:
                        break


def measure_registers(report: Report, given: argparse.Namespace) -> None:
    """Measure steps a second with several numbers of registers for a thread."""
    options, steps = card.OPTIONS, round(TIMED_TIME / STEP)
    for n in REGISTERS:
        card.OPTIONS = (*options, f"--maxrregcount={n}")
        engine = engine_of(["fig4"], cards())
        made(engine, some_points("fig4", STEP, 0.0, np.arange(8)))
        blocks = (
            some_points("fig4", TIMED_TIME, 0.0, block)
            for block in Numbers((0, max(given.runs))).blocks(engine.most_runs)
        )
        runs, seconds = in_seconds(engine, blocks, given.seconds / len(REGISTERS))
        row = {"registers": n, "runs": runs, "seconds": seconds}
        report.add("registers", {**row, "steps a second": runs * steps / seconds})
    card.OPTIONS = options


def measure_stepping(report: Report, given: argparse.Namespace) -> None:
    """Measure single steps of many simulations."""
    for device in ("cuda", "cpu"):
        for n in given.environments if device == "cuda" else given.environments[:1]:
            sims = Simulations("fig4", n, device=device)
            commands = sims.arrays.zeros((n, 3))

            def by_hand(sims: Simulations = sims, commands: Any = commands) -> None:
                sims["plant.tau"] = commands
                sims.step()
                sims["plant.eta"].sum()

            for what, act in (("step", sims.step), ("set, step and read", by_hand)):
                rate = calls_a_second(
                    act, lambda sims=sims: float(sims["plant.eta"].sum()), given.seconds / 4
                )
                row = {"device": device, "simulations": n, "what": what}
                report.add("stepping", {**row, "steps a second": n * rate})


def calls_a_second(act: Callable[[], object], wait: Callable[[], object], seconds: float) -> float:
    """Return calls a second, with waiting for the card at the end and in between."""
    act()
    wait()
    n, start, elapsed = 0, perf_counter(), 0.0
    while elapsed < seconds:
        for _ in range(10):
            act()
        wait()
        n, elapsed = n + 10, perf_counter() - start
    return n / elapsed


def measure_study(report: Report, given: argparse.Namespace) -> None:
    """Measure a large study, and where its time goes."""
    ranges = {f"plant.eta0.{axis}": [-AWAY, AWAY] for axis in ("x", "y", "z")}
    sample = {"method": "sobol", "n": given.study, "seed": 1, "range": ranges}
    study = {"scenario": "fig4", "stop_time": STUDY_TIME, "sample": sample}
    space = Space(study_of("starts", study), {"fig4": load_scenario("fig4")})
    engine = engine_of(["fig4"], cards())
    start = perf_counter()
    made(engine, space.points(np.arange(8)))
    first = perf_counter() - start
    start, kept = perf_counter(), 0.0
    with tempfile.TemporaryDirectory() as folder:
        with open_store(Path(folder), {"made_of": {}}, space.indices) as store:
            points = map(space.points, Numbers((0, len(space))).blocks(engine.most_runs))
            with making_runs(engine, points) as blocks:
                for outcomes in blocks:
                    begin = perf_counter()
                    store.add(outcomes)
                    kept += perf_counter() - begin
            runs = perf_counter() - start - kept
            begin = perf_counter()
            store.publish(space)
            published = perf_counter() - begin
        size = Path(folder, "runs.parquet").stat().st_size
    report.add(
        "study",
        {
            "runs": len(space),
            "seconds": perf_counter() - start,
            "of them waiting for runs": runs,
            "keeping them": kept,
            "writing the table": published,
            "compilation before": first,
            "MB of Parquet": size / 1e6,
        },
    )


def measure_policy(report: Report, given: argparse.Namespace) -> None:
    """Measure environments whose actions a policy of two hidden layers computes on the card."""
    import gymnasium  # noqa: PLC0415

    import orchestrator.bridges.gymnasium  # noqa: F401, PLC0415

    for n in given.environments:
        envs = gymnasium.make_vec("auv_fmu/Tracking-v0", num_envs=n, device="cuda")
        seen, _ = envs.reset(seed=1)
        shape = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
        policy, package = policy_of(*shape, seen)

        now = [seen]

        def act(envs: Any = envs, policy: Any = policy, now: list[Any] = now) -> None:
            now[0] = envs.step(policy(now[0]))[0]

        rate = calls_a_second(act, lambda now=now: float(now[0].sum()), given.seconds / 4)
        row = {"environments": n, "policy": package}
        report.add("policy", {**row, "actions a second": n * rate})
        envs.close()


def policy_of(n_seen: int, n_actions: int, seen: Any) -> tuple[Callable[[Any], Any], str]:
    """Return a policy and the package that computes it: torch, or CuPy or numpy."""
    if find_spec("torch") and not isinstance(seen, np.ndarray):
        import torch  # noqa: PLC0415

        sizes = (n_seen, HIDDEN, HIDDEN, n_actions)
        layers = [
            part
            for i in range(len(sizes) - 1)
            for part in (torch.nn.Linear(sizes[i], sizes[i + 1]), torch.nn.Tanh())
        ]
        network = torch.nn.Sequential(*layers).cuda()

        @torch.no_grad()  # type: ignore[untyped-decorator]
        def by_torch(seen: Any) -> Any:
            return SHARE * network(torch.from_dlpack(seen).float())

        return by_torch, "torch"
    arrays = sys.modules[type(seen).__module__.partition(".")[0]]
    draws = np.random.default_rng(1)
    first, second, last = (
        arrays.asarray(draws.normal(size=size) / size[0])
        for size in ((n_seen, HIDDEN), (HIDDEN, HIDDEN), (HIDDEN, n_actions))
    )
    return (
        lambda seen: SHARE * arrays.tanh(arrays.tanh(arrays.tanh(seen @ first) @ second) @ last),
        arrays.__name__,
    )


def measure_crazyflow(report: Report, given: argparse.Namespace) -> None:
    """Measure environments of crazyflow."""
    if find_spec("crazyflow") is None:
        print("crazyflow: not installed")
        return
    import crazyflow.envs  # type: ignore[import-not-found] # noqa: F401, PLC0415
    import gymnasium  # noqa: PLC0415

    for n in given.environments:
        envs = gymnasium.make_vec("DroneFigureEightTrajectory-v0", num_envs=n, device="gpu")
        envs.reset()
        action = envs.action_space.sample()
        seen: list[Any] = []

        def act(envs: Any = envs, action: Any = action, seen: list[Any] = seen) -> None:
            seen[:] = [envs.step(action)[1]]

        rate = calls_a_second(act, lambda seen=seen: np.asarray(seen[0]), given.seconds / 4)
        report.add("crazyflow", {"environments": n, "actions a second": n * rate})
        envs.close()


def workers(given: argparse.Namespace, n: int, **environment: str) -> ProcessPoolExecutor:
    """Return processes that use the same device."""
    return ProcessPoolExecutor(
        n, get_context("spawn"), initializer=begin_worker, initargs=(given.processor, environment)
    )


def begin_worker(processor: bool, environment: Mapping[str, str]) -> None:
    """Begin a process."""
    os.environ.update(environment)
    if processor:
        use_processor()


PARTS: dict[str, Callable[[Report, argparse.Namespace], None]] = {
    "compile": measure_compile,
    "checks": measure_checks,
    "random": measure_random,
    "speed": measure_speed,
    "registers": measure_registers,
    "stepping": measure_stepping,
    "study": measure_study,
    "policy": measure_policy,
    "crazyflow": measure_crazyflow,
}


def versions() -> dict[str, str]:
    """Return the versions of packages that matter here."""
    found = {}
    for name in ("auv-fmu", "numpy", "cupy-cuda12x", "cupy-cuda13x", "torch", "crazyflow"):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def whole(text: str) -> int:
    """Return a whole number, which may be written as 1e6."""
    return int(float(text))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help="default: all")
    parser.add_argument("--out", type=Path, default=Path("measured"), help="default: measured")
    parser.add_argument("--processor", action="store_true", help="without a card")
    parser.add_argument("--seconds", type=float, default=8.0, help="a measurement takes, about")
    parser.add_argument("--limit", type=float, default=480.0, help="no part begins after it [s]")
    parser.add_argument("--processes", type=int, default=os.cpu_count(), help="for the checks")
    parser.add_argument("--check", type=whole, default=64, help="runs of each check")
    parser.add_argument("--seeds", type=whole, default=1000, help="of random numbers")
    numbers = {"type": whole, "nargs": "+", "metavar": "N"}
    parser.add_argument("--runs", default=[10**k for k in range(3, 8)], **numbers)
    parser.add_argument("--environments", default=[10**k for k in range(4, 7)], **numbers)
    parser.add_argument("--study", type=whole, default=10**6, help="runs of the large study")
    given = parser.parse_args()
    if unknown := {*given.parts} - {*PARTS}:
        parser.error(f"no such part: {', '.join(sorted(unknown))}")
    given.parts = given.parts or [*PARTS]
    if given.processor:
        use_processor()
    start = perf_counter()
    head = {
        "cards": ", ".join(cards().names),
        "processor": f"{os.cpu_count()} cores, {platform.machine()}",
        "python": platform.python_version(),
        "versions": versions(),
        "command": " ".join(sys.argv),
    }
    print(head, flush=True)
    report = Report(given.out, head)
    with tempfile.TemporaryDirectory() as folder:
        given.paths = {name: name for name in (*CHECKED, *TIMED)}
        given.paths[OWN] = own_controller(Path(folder))
        for part, measure in PARTS.items():
            if part not in given.parts:
                continue
            if (elapsed := perf_counter() - start) > given.limit:
                print(f"{part}: left out after {elapsed:.0f} s", flush=True)
                continue
            try:
                measure(report, given)
            except Exception as error:
                report.add(part, {"failure": f"{type(error).__name__}: {error}"})
    print(f"{perf_counter() - start:.0f} s in all; {given.out}/results.md", flush=True)


if __name__ == "__main__":
    main()
