"""Print numbers of pages that take minutes to compute: `python tools/page_numbers.py NAME`.

=============  ====================================================================================
`accuracy`     the tables of docs/explanation/accuracy.md: effect of the step on the scenarios
`noise`        effect of 1 mm of noise: README, reproduction.md, and remarks of scenarios
`seeds`        effect of random seas, links and noise: remarks of scenarios, and their pages
`guidance`     docs/explanation/guidance.md: errors across the path with each law, over seeds
`remus`        docs/explanation/remus.md: changes of `remus` over seeds, and steady turns
`bluerov`      docs/explanation/bluerov2.md: changes of `bluerov` over seeds, and steady speeds
`networks`     docs/tutorials/your-own-component.md: deviation of networks from onnxruntime
`gains`        the best gains under a limit of the commands, in docs/explanation/ready-studies.md
`roundings`    docs/explanation/batch.md: how far the indices of `batch` and `gpu` may be apart
`consistency`  docs/explanation/navigation.md: NEES of the navigation filter over many runs
`studies`      the numbers below the figures of that page, from finished studies in folders
`benchmark`    runs `auv-fmu benchmark`, and writes its table into docs/explanation/benchmark.md
`benchmarks`   runs the commands of the files in benchmarks/results, and writes their output there
=============  ====================================================================================

Numbers of several draws are medians, with the quantiles of 5 and 95 % of the draws. Numbers of runs
from several starts are bands from the smallest to the largest.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import date
from functools import partial
from itertools import pairwise
from itertools import product as combinations
from math import ceil, cos, exp, log, nan, radians, sin, sqrt
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.optimize import root

from auv_fmu.bluerov2 import bluerov2, thruster_allocation
from auv_fmu.bluerov2.thruster_allocation import Wanted
from auv_fmu.loop import closed_loop
from auv_fmu.loop.closed_loop import LongestSteps, Setting, Vehicles
from auv_fmu.navigation.rotations import inverse, logarithm, product
from auv_fmu.paper import motion_planner, plant
from auv_fmu.paper.attitude import (
    normalised,
    quaternion_from_euler,
    rotate,
    rotation_from_euler,
    rotation_from_quaternion,
)
from auv_fmu.paper.euler import STEP
from auv_fmu.paper.output_feedback import ControllerState
from auv_fmu.remus import remus100
from auv_fmu.remus.hull import Drag, Hull, cross_flow, inertia
from auv_fmu.remus.remus100 import Form, RemusState, accelerations, inertia_of
from auv_fmu.remus.tail import Tail
from fmus.ports.port import H_MAX
from orchestrator import Simulations, simulate
from orchestrator.benchmark.contest import vehicles
from orchestrator.commands.main import main as main_of_command
from orchestrator.cosim import PortName, System, Table
from orchestrator.machine.compilers import ROUNDED
from orchestrator.machine.errors import InputError
from orchestrator.machine.workers import cores
from orchestrator.paper.claims import total_variation_until
from orchestrator.paper.page import numbers, table
from orchestrator.program.components import definitions_of
from orchestrator.program.library import Processor, Program, Source
from orchestrator.runs.networks import component_text, read_network
from orchestrator.runs.preparation import load_scenario, prepare_request, with_companion
from orchestrator.runs.request import Request
from orchestrator.runs.scenario import names, read_scenario
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.columns import Outcomes, Point, Texts
from orchestrator.studies.engine import outcomes_of
from orchestrator.studies.space import Space
from orchestrator.studies.store import StudyResult
from orchestrator.studies.study import BATCH, GPU, EngineName, read_study, ready_studies
from orchestrator.studies.sweep import Means, Ready, making_runs, prepare_study
from orchestrator.vehicle.indices import INDICES as EVERY
from orchestrator.vehicle.indices import (
    SMALLEST_DISTANCE_LABEL,
    prefixed,
    smallest_distances,
)
from orchestrator.vehicle.signals import (
    ACTUATORS,
    AXES,
    STANDARD,
    AllocatedLoop,
    Loop,
    limits,
    loops_of,
    tracking_error,
    true_control_point,
)
from pages import filled_in

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"

Values = Mapping[str, Any]
STD, SEED = "plant.noise.std", "plant.noise.seed"
QUIET: Values = {STD: 0.0}


# Runs


def system_of(name: str) -> System:
    """System of a scenario, or of its PD controller: `path-pd` belongs to `path`."""
    if name in names():
        return load_scenario(name)[1]
    request = Request(name.removesuffix("-pd"))
    return with_companion(prepare_request(request), request)[1].system


class Runs:
    """Runs by the batch engine, in steps of 20 ms, until the scenarios' own ends."""

    def __init__(self, *scenarios: str) -> None:
        """Load the systems."""
        self.systems = {name: system_of(name) for name in scenarios}
        self._engine = BatchEngine(self.systems)
        self._ends = {name: read_scenario(name.removesuffix("-pd")).stop_time for name in scenarios}

    def point(self, name: str, values: Values, step: float, stop_time: float | None) -> Point:
        """The engine's description of a run."""
        end = stop_time or self._ends[name] or self.systems[name].stop_time
        assert end is not None
        return Point(0, name, values, end, step)

    def table(
        self, name: str, values: Values, step: float = STEP, stop_time: float | None = None
    ) -> Table:
        """Rows of a run."""
        return self._engine.table(self.point(name, values, step, stop_time))

    def indices(
        self, name: str, draws: Iterable[Values], step: float = STEP, stop_time: float | None = None
    ) -> dict[str, np.ndarray]:
        """The indices of several runs."""
        points = (self.point(name, values, step, stop_time) for values in draws)
        found = [outcome.indices for outcome in outcomes_of(self._engine, points)]
        return {key: np.array([indices[key] for indices in found]) for key in found[0]}

    def variation_ratio(self, name: str, until: float, values: Values, step: float = STEP) -> Any:
        """Total variation of each signal up to a time, PD over proposed."""
        both = (self.table(scenario, values, step) for scenario in (f"{name}-pd", name))
        return np.divide(*(total_variation_until(made, until) for made in both))


def size_of(made: Table, loop: Loop = STANDARD) -> np.ndarray:
    """Norms of the tracking error, |e|, in all rows [m]."""
    return np.asarray(np.linalg.norm(tracking_error(made, loop), axis=1))


def band(values: Iterable[float], digits: int = 3) -> str:
    """Median, with the quantiles of 5 and 95 %."""
    low, median, high = np.quantile([*values], (0.05, 0.5, 0.95))
    return f"{median:,.{digits}g} ({low:,.{digits}g} to {high:,.{digits}g})"


def show(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table in Markdown."""
    print(f"\n{table(head, rows)}", flush=True)


# Effect of the step on the scenarios

#: Scenarios, with a chaotic one, whose numbers are bands.
SCENARIOS = ("fig4", "fig5", "fig5-pd", "fig6", "fig6-pd", "fig7a", "fig7b", "fig7c")
CHAOTIC = "fig6-pd"
REGULAR = [name for name in SCENARIOS if name != CHAOTIC]

#: Smaller steps than the paper's, and one that stands for their limit [s].
SMALLER, LIMIT = (0.01, 0.005, 0.002), 0.0002
RK4: Values = {**QUIET, "plant.integrator": "rk4"}
NO_FRICTION: Values = {**QUIET, "disturbance.A_f": 0.0}
WAYS: Sequence[tuple[Values, float]] = [*((QUIET, h) for h in (STEP, *SMALLER)), (RK4, STEP)]
HEADS = [*(f"{1e3 * h:g} ms" for h in (STEP, *SMALLER)), "20 ms, `rk4`"]

#: Indices in metrics.json, by their names in the tables.
INDICES = {
    f"{short} {part}": f"{name}.{part}"
    for short, name, parts in (
        ("L2", "l2_effort", ACTUATORS), ("peak", "peak_command", ACTUATORS),
        ("TV", "total_variation", ACTUATORS), ("e_f", "final_error", AXES),
    )
    for part in parts
}  # fmt: skip

#: An index that changes by a larger share depends on the step.
MUCH = 0.05


def accuracy() -> None:
    """Print how paths and indices depend on the step, all without noise."""
    runs = Runs(*SCENARIOS)

    def path(name: str, values: Values = QUIET, step: float = STEP) -> np.ndarray:
        return true_control_point(runs.table(name, values, step))[:: round(STEP / step)]

    def y_d(values: Values, step: float) -> np.ndarray:
        rows = runs.table("fig6", values, step).group(*STANDARD.y_d)
        return rows[:: round(STEP / step)]

    def starts(name: str) -> list[dict[str, float]]:
        x = float(runs.table(name, QUIET)["plant.eta.x"][0])
        return [{"plant.eta0.x": x + 1e-6 * i / 10} for i in range(1, 11)]

    rows = []
    for name in SCENARIOS:
        exact, own = path(name, {**RK4, "plant.h_max": STEP / 10}), path(name)
        moved = max(apart(path(name, {**QUIET, **start}), own) for start in starts(name))
        rows.append(
            [f"`{name}`", distances(own, exact), distances(path(name, RK4), exact), length(moved)]
        )
    show(["scenario", "`euler`", "`rk4`", "start moved by 1 µm"], rows)

    rows = []
    for name in REGULAR:
        for friction, text in ((NO_FRICTION, "0"), (QUIET, "as it is")):
            limit = path(name, friction, LIMIT)
            ways = (path(name, {**friction, **values}, h) for values, h in WAYS)
            rows.append([f"`{name}`", text, *(distances(way, limit) for way in ways)])
    limit = y_d(QUIET, LIMIT)
    reference = ["the reference", "", *(distances(y_d(*way), limit) for way in WAYS)]
    show(["scenario", "`A_f`", *HEADS], [*sorted(rows), reference])
    for name in ("fig4", "fig5", "fig5-pd"):
        limit, end = path(name, NO_FRICTION, LIMIT), read_scenario(name).stop_time or 0.0
        changed = {PortName.read(port): value for port, value in NO_FRICTION.items()}
        exact = continuous(runs.systems[name].with_parameters(changed), end)
        split = path(name, {**NO_FRICTION, "controller.h_max": 0.002})
        print(f"\n`{name}` without friction, from the limit: solve_ivp {distances(exact, limit)}; "
              f"20 ms with controller.h_max = 2 ms {distances(split, limit)}.")  # fmt: skip

    rows, same = [], []
    for name in REGULAR:
        found = [runs.indices(name, [values], h) for values, h in WAYS]
        for index, column in INDICES.items():
            values = [float(indices[column][0]) for indices in found]
            changes = [abs(value / values[0] - 1.0) for value in values]
            if max(changes) <= MUCH:
                same.append(max(changes))
                continue
            marks = ["**" * (change > MUCH) for change in changes]
            cells = [f"{m}{number(v)}{m}" for m, v in zip(marks, values, strict=True)]
            rows.append([f"`{name}`", index, *cells])
    show(["scenario", "index", *HEADS], sorted(rows))
    print(f"\nThe {len(same)} other indices change by {100 * max(same):.1f} % at most.")
    ends = [
        runs.indices(CHAOTIC, [{**values, **start} for start in starts(CHAOTIC)], h)
        for values, h in WAYS
    ]
    show(
        [f"`{CHAOTIC}`", *HEADS],
        [
            [index, *(between(ending[column]) for ending in ends)]
            for index, column in INDICES.items()
        ],
    )
    rows = []
    for name, until in (("fig5", 100.0), ("fig6", 60.0)):
        ratios = [runs.variation_ratio(name, until, *way) for way in WAYS]
        rows += [
            [f"`{name}`, {until:g} s, {k}", *(number(ratio, 2) for ratio in column)]
            for k, column in zip(ACTUATORS, np.transpose(ratios), strict=True)
        ]
    show(["TV, PD over proposed", *HEADS], rows)
    free_body()


def free_body() -> None:
    """Change of the energy of a free body in 20 s."""
    zeros = [*(f"d{i}{i}" for i in range(1, 7)), *(f"tau.{k}" for k in ACTUATORS)]
    free = {f"plant.{name}": 0.0 for name in (*zeros, "righting.pitch", "righting.roll")}
    free |= {"plant.nu0.u": 1.0, "plant.nu0.q": 0.3, "plant.nu0.r": 0.5}
    rows = []
    for text, values in (
        ("`euler`, 20 ms", {}),
        ("`euler`, `h_max` = 2 ms", {"plant.h_max": 0.002}),
        ("`rk4`, 20 ms", {"plant.integrator": "rk4"}),
    ):
        result = simulate("fig3b", {**free, **values}, stop_time=20.0, kind="native")
        masses = np.array([result.parameters[f"plant.m{i}{i}"] for i in range(1, 7)])
        energy = result.group(*(f"plant.nu.{k}" for k in "uvwpqr")) ** 2 @ masses
        rows.append([text, f"{100 * (energy[-1] / energy[0] - 1.0):+.2g} %"])
    show(["plant", "change of the energy"], rows)


def continuous(system: System, stop: float) -> np.ndarray:
    """Path of the loop in continuous time, every 20 ms [m].

    An Euler step of planner and controller, divided by its length, is their rate.
    """
    from scipy.integrate import solve_ivp  # noqa: PLC0415

    setting, h = setting_of(system), 2.0**-10
    gains, settings = setting.controller, setting.planner
    begun = closed_loop.begin(setting, (0.0, 0.0, 0.0))
    control_begun = begun.controller_state
    if isinstance(control_begun, ControllerState):
        # All steps have one length, so that it does not change.
        control_begun = control_begun._replace(h=h)
    start = begun.vehicles.plant, begun.vehicles.planner, control_begun

    def unpacked(t: float, x: np.ndarray) -> tuple[Vehicles, Any, Any]:
        state, planner, control = like(start, iter(x.tolist()))
        rotation = rotation_from_quaternion(normalised(state.quaternion))
        moving = motion_planner.motion(settings.vehicle, planner, settings.tau_d)
        vehicles = Vehicles(state, rotation, planner, moving)
        return vehicles, control, closed_loop.scene(setting, vehicles, t, (0.0, 0.0, 0.0))

    def rates(t: float, x: np.ndarray) -> np.ndarray:
        vehicles, control, seen = unpacked(t, x)
        measured = closed_loop.measurement(gains, seen)
        control = closed_loop.gated(gains, control, seen.y)
        signals = closed_loop.evaluate(gains, control, measured, 0.0)
        own, state = setting.plant, vehicles.plant
        tau = plant.applied(own, signals.tau)
        moving = plant.rates(own.vehicle, own.roll, state, vehicles.rotation, tau, seen.tau_w)
        planned = motion_planner.step(vehicles.planner, vehicles.moving, h)
        later = closed_loop.advanced(gains, control, signals, h)
        rest = np.subtract(flat((planned, later)), flat((vehicles.planner, control))) / h
        return np.array([*flat(moving), *(0.0 for _ in flat((state.tau, state.water))), *rest])

    times = STEP * np.arange(round(stop / STEP) + 1)
    solution = solve_ivp(
        rates, (0.0, stop), flat(start), "DOP853", t_eval=times, rtol=1e-9, atol=1e-11
    )
    states = zip(solution.t, solution.y.T, strict=True)
    return np.array([unpacked(t, x)[2].plant.y for t, x in states])


def setting_of(system: System) -> Setting:
    """The parameters of the components of Fig. 2, as their equations take them."""
    given: dict[str, Any] = {
        name: {
            variable.name: variable.typed(system.value(port), str(port))
            for variable in component.having("parameter")
            for port in [PortName(name, variable.name)]
        }
        for name, component in system.components.items()
    }
    parameters: dict[str, Any] = {
        name: definition.parameters.of(given[name])
        for name, definition in definitions_of(system).items()
    }
    longest = LongestSteps(*(given[name][H_MAX] for name in LongestSteps._fields))
    return Setting(**parameters, h_max=longest)


def flat(state: Any) -> list[float]:
    """The numbers of a state, in their order."""
    return [state] if isinstance(state, float) else [x for part in state for x in flat(part)]


def like(state: Any, numbers: Iterator[float]) -> Any:
    """State of the same form with other numbers."""
    if isinstance(state, float):
        return next(numbers)
    parts = [like(part, numbers) for part in state]
    return type(state)(*parts) if hasattr(state, "_fields") else tuple(parts)


def apart(path: np.ndarray, other: np.ndarray) -> float:
    """Largest distance of two paths [m]."""
    return float(np.linalg.norm(path - other, axis=1).max())


def distances(path: np.ndarray, other: np.ndarray) -> str:
    """Largest distance and root mean square of two paths."""
    rms = np.sqrt(np.mean(np.sum((path - other) ** 2, axis=1)))
    return f"{length(apart(path, other))}; {length(rms)}"


def length(x: float) -> str:
    """A length [m] in a unit that needs neither exponent nor zeros."""
    units = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9}
    unit = next((unit for unit, size in units.items() if x >= 0.995 * size), "nm")
    return f"{number(x / units[unit], 2)} {unit}"


def number(x: float, digits: int = 3) -> str:
    """A number with so many digits and no exponent."""
    return f"{float(f'{x:.{digits}g}'):,.9g}"


def between(values: Sequence[float] | np.ndarray) -> str:
    """The smallest and the largest of some values."""
    return " to ".join(dict.fromkeys(number(end) for end in (min(values), max(values))))


# Effect of 1 mm of noise

#: Numbers of draws: of a run, of a long run, and of a run with events, by the FMUs.
MANY, SOME, FEW = 1000, 30, 100
FIGURES = ("fig4", "fig5", "fig6", "fig7a", "fig7b", "fig7c", "fig5-pd", "fig6-pd")
FAULTS = ("fault-thruster", "fault-sensor", "current-step")


def draws(n: int, values: Values | None = None) -> list[Values]:
    """The values of draws with the seeds 1 to n."""
    return [{STD: 0.001, SEED: seed, **(values or {})} for seed in range(1, n + 1)]


def noise() -> None:
    """Print commands, all indices, the times until commands saturate, and scenarios with events."""
    runs = Runs(*FIGURES, "path", "path-pd")
    rows = []
    for name, values in [*((name, {}) for name in FIGURES), ("fig5", {"controller.eps_t": 1.0})]:
        quiet = runs.indices(name, [{**values, **QUIET}])
        found = runs.indices(name, draws(MANY, values))
        (still, peaks), (never, shares) = (
            [
                np.column_stack([indices[f"{index}.{k}"] for k in ACTUATORS])
                for indices in (quiet, found)
            ]
            for index in ("peak_command", "saturated_fraction")
        )
        cells = [numbers(still[0]), numbers(100 * never[0]), *map(band, peaks.T)]
        beyond = f"{100 * np.mean(shares.max(axis=1) > 0.0):.3g} %"
        cells += [numbers(peaks.max(axis=0)), beyond, numbers(100 * shares.max(axis=0))]
        rows.append([f"`{name}`" + ", eps_t = 1" * bool(values), *cells])
    head = ["", "peaks without noise", "% of steps", *(f"peak {k}" for k in ACTUATORS)]
    show([*head, "largest", "draws beyond a limit", "% of steps, at most"], rows)

    rows = []
    for name in ("fig4", "fig5", "fig5-pd", "path", "path-pd"):
        quiet, found = runs.indices(name, [QUIET]), runs.indices(name, draws(MANY))
        for column in INDICES.values():
            rows.append([f"`{name}`", column, f"{quiet[column][0]:.4g}", band(found[column], 4)])
    show(["", "index", "without noise", "with it"], rows)

    rows = []
    for name, until in (("fig5", 100.0), ("fig6", 60.0), ("fig6", 200.0)):
        for text, some in (("none", [QUIET]), ("1 mm", draws(SOME))):
            ratios = [runs.variation_ratio(name, until, values) for values in some]
            rows.append([f"`{name}`, {until:g} s", text, *map(band, np.transpose(ratios))])
    show(["TV, PD over proposed", "noise", *ACTUATORS], rows)

    rows = []
    for name, values in (
        ("fig4", {}), ("fig4", {"controller.eps_t": 10.0}), ("fig5", {}), ("fig6", {}),
        ("fig4", {"controller.k_d": 20.0}),
    ):  # fmt: skip
        firsts: list[float] = []
        columns: list[list[float]] = []
        for draw in draws(SOME, values):
            made = runs.table(name, draw, stop_time=1000.0)
            commands, time = np.abs(made.step_values(*STANDARD.commanded)), made.step_start
            beyond = (commands > limits(made)[1]).any(axis=1)
            firsts.append(time[beyond.argmax()] if beyond.any() else np.inf)
            columns.append([
                *(100.0 * beyond[time <= until].mean() for until in (200.0, 500.0, 1000.0)),
                commands[:, 0].max(), made.step_values(STANDARD.theta_hat[0])[-1, 0],
            ])  # fmt: skip
        first = f"{np.median(firsts):.4g} ({min(firsts):.4g} to {max(firsts):.4g})"
        rows.append([f"`{name}` {values}", first, *map(band, np.transpose(columns))])
    ends = [f"% of steps until {time} s" for time in (200, 500, 1000)]
    show(["", "first beyond a limit [s]", *ends, "peak u", "theta_hat_1"], rows)

    for name in FAULTS:
        events, seeds_of_noise = read_scenario(name).events, range(1, FEW + 1)
        pair = [
            [
                fault_measures(simulate(system, {SEED: i}, events=events, stop_time=100.0))
                for i in seeds_of_noise
            ]
            for system in (system_of(name), system_of(f"{name}-pd"))
        ]
        rows = [
            [text, *(band(run[text] for run in runs_of) for runs_of in pair)] for text in pair[0][0]
        ]
        show([f"`{name}`", "proposed", "PD"], rows)


def fault_measures(made: Table) -> dict[str, float]:
    """Measure a run with an event at 50 s."""
    time, size = made.time, size_of(made)
    command = np.abs(made.step_values("controller.tau.u"))
    late, outside = time >= 50.0, time[size > 0.5][-1]
    return {
        "peak of tau_u [N]": command.max(),
        "peak of tau_u from 60 s on": command[made.step_start >= 60.0].max(),
        "largest |e| from 30 to 50 s [m]": size[(time >= 30.0) & (time <= 50.0)].max(),
        "largest |e| from 50 s on": size[late].max(),
        "when [s after 50]": time[late][size[late].argmax()] - 50.0,
        "within 0.5 m [s after 55]": outside - 55.0,
        "within 0.5 m [s after 60]": outside - 60.0,
        "largest |e| in the last 5 s": size[time >= 95.0].max(),
    }


# Consistency of the navigation filter

#: Times at which it is tested [s].
MOMENTS = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0, 60.0, 80.0, 100.0)

#: Sensors of the scenario `navigation`, and changes of them.
SENSORS = ("imu", "attitude", "depth", "dvl", "fix")
ERRORS: Mapping[str, Mapping[str, float]] = {
    "errors that the filter models": {"dvl.bias.std": 0.0},
    "and a bias of the DVL of 1 mm/s": {},
    "and a bias of the heading of 2 degrees": {"attitude.bias.heading": radians(2.0)},
}


def estimation_errors(eta: np.ndarray, nu: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Errors of position, velocity and attitude of an estimate (eta, nu), in the earth frame."""
    (turn, velocity), (turn_hat, velocity_hat) = (
        (
            quaternion_from_euler(*row[3:6]),
            rotate(rotation_from_euler(*row[3:6]), (row[6], row[7], row[8])),
        )
        for row in ((*eta, *nu), found)
    )
    attitude = logarithm(product(turn, inverse(turn_hat)))
    return np.array((*eta[:3] - found[:3], *np.subtract(velocity, velocity_hat), *attitude))


def nees(n: int, values: Mapping[str, Any], moments: Sequence[float]) -> np.ndarray:
    """Normalised estimation errors squared of `navigation`, (moments, n, 4).

    They are of position, velocity and attitude, with 3 degrees of freedom, and of all together.

    Args:
        n: number of runs, each with its own seeds.
        values: parameters besides the seeds.
        moments: times [s].

    """
    random = np.random.default_rng(1)
    seeds = {f"{name}.seed": random.integers(1, 10**6, n) for name in SENSORS}
    runs = Simulations("navigation", n, {**seeds, **values})
    lower, found = np.tril_indices(9), np.empty((len(moments), n, 4))
    for moment, row in zip(moments, found, strict=True):
        runs.run(until=moment)
        estimates = np.hstack([runs["filter.eta"], runs["filter.nu"]])
        signals = runs["plant.eta"], runs["plant.nu"], estimates
        for k, (*truth, triangle) in enumerate(zip(*signals, runs["filter.P"], strict=True)):
            e, P = estimation_errors(*truth), np.empty((9, 9))
            P[lower] = P.T[lower] = triangle
            parts = (slice(0, 3), slice(3, 6), slice(6, 9), slice(0, 9))
            row[k] = [e[part] @ np.linalg.solve(P[part, part], e[part]) for part in parts]
    return found


def consistency(n: int = 1000) -> None:
    """Print the mean NEES over runs."""
    spread = 1.96 * np.sqrt(2.0 * np.array((3.0, 3.0, 3.0, 9.0)) / n)
    print(f"{n} runs; 95 % of the means are within 3 +- {spread[0]:.2f} and 9 +- {spread[3]:.2f}")
    for title, values in ERRORS.items():
        print(title)
        for moment, means in zip(MOMENTS, nees(n, values, MOMENTS).mean(axis=1), strict=True):
            print(f"  {moment:5g} s", *(f"{mean:9.3f}" for mean in means))


# Effect of random seas, links and noise

#: Spans of time for the largest errors [s].
SPANS: Mapping[str, Sequence[tuple[float, float]]] = {
    "sea": [(0, 25), (60, 101)],
    "formation-v": [(25, 121)],
    "formation-change": [(25, 121)],
    "formation-lost-link": [(25, 121), (100, 121)],
    "remus": [(120, 281)],
    "bluerov": [(0, 20), (20, 50), (65, 71)],
    "remus-prestero": [(50, 281)],
    "los": [(60, 90), (190, 221)],
    "los-remus": [(90, 120), (330, 361)],
}

#: Scenarios with guidance: :func:`guidance` prints their numbers.
GUIDED = ("los", "los-remus")

#: Runs without randomness.
EVEN: Mapping[str, tuple[str, Values]] = {
    "sea": (
        "still water",
        {"sea.waves.spectrum": "none", "sea.current.speed": 0.0, "sea.current.sigma": 0.0},
    ),
    "formation-change": ("no noise", {"auv*.plant.noise.std": 0.0}),
}


def seed_numbers(scenario: str, made: Table, loops: Sequence[Loop]) -> dict[str, float]:
    """Numbers of a run: the largest of several vehicles, the smallest of distances."""
    sizes, found = np.array([size_of(made, loop) for loop in loops]), {}
    for start, end in SPANS[scenario]:
        here = (made.time >= start) & (made.time < end)
        text = f"error from {start:g} s to {min(end, made.time[-1]):g} s [m]"
        found[text] = sizes[:, here].max()
    commands = [made.step_values(*loop.commanded) for loop in loops]
    found["peak command u [N]"] = max(np.abs(command[:, 0]).max() for command in commands)
    found["peak command q, r [N.m]"] = max(np.abs(command[:, 1:]).max() for command in commands)
    if isinstance(loops[0], AllocatedLoop):
        attained = made.step_values(*(f"allocation.tau_attained.{k}" for k in ACTUATORS))
        beyond = [np.abs(commands[0] - attained) > 1e-9]
    else:
        ends = (limits(made, loop) for loop in loops)
        beyond = [
            (command < low) | (command > up)
            for command, (low, up) in zip(commands, ends, strict=True)
        ]
    for i, actuator in enumerate(ACTUATORS):
        share = max(mask[:, i].mean() for mask in beyond)
        found[f"steps beyond the limits, {actuator} [%]"] = 100.0 * share
    if scenario in GUIDED:
        active, y_e = made["planner.active"], made["planner.y_e"]
        for k in (2, 3):
            leg = y_e[active == k]
            found[f"across leg {k}, beyond it [m]"] = (-np.sign(leg[0]) * leg).max()
    if len(loops) > 1:
        found[f"{SMALLEST_DISTANCE_LABEL} [m]"] = smallest_distances(made, loops).min()
    return found


def over_seeds(
    scenario: str, pd: bool, n: int, values: Values | None = None
) -> dict[str, np.ndarray]:
    """Numbers of the run with the scenario's own seeds, and of n runs with others."""
    system = system_of(scenario + "-pd" * pd)
    seeds = [
        f"{component}.{port}"
        for component, part in system.components.items()
        for port in part.variables
        if port.endswith("seed")
    ]
    end, rows = read_scenario(scenario).stop_time, []
    for k in range(n + 1):
        own = {seed: 1000 * k + i for i, seed in enumerate(seeds) if k}
        made = simulate(system, {**(values or {}), **own}, stop_time=end, loop="compiled")
        rows.append(seed_numbers(scenario, made, loops_of(system)))
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def print_seeds(found: Mapping[str, np.ndarray]) -> None:
    """Print numbers of a run, and their median and quantiles over those with other seeds."""
    for name, (own, *others) in found.items():
        low, middle, high = np.percentile(others, (5, 50, 95))
        some = f"; not 0 in {100 * np.mean(np.array(others) > 0):.0f} %" * ("%" in name)
        print(f"  {name:45}{own:8.3f};{middle:8.3f} ({low:.3f} to {high:.3f}){some}")


def guidance(*, n: int = 60) -> None:
    """Print the scenarios with guidance, with each law, own seeds and n others."""
    for scenario, law in combinations(GUIDED, ("proportional", "integral", "adaptive")):
        print(f"\n{scenario}, {law}: own seeds; median (5 % to 95 %)")
        print_seeds(over_seeds(scenario, False, n, {"planner.law": law}))


def seeds(*scenarios: str, n: int = 60) -> None:
    """Print the run with the scenario's own seeds and n others, with either controller."""
    every = [scenario for scenario in SPANS if scenario not in GUIDED]
    for scenario, pd in combinations(scenarios or every, (False, True)):
        print(f"\n{scenario}, {'PD' if pd else 'proposed'}: own seeds; median (5 % to 95 %)")
        print_seeds(over_seeds(scenario, pd, n))
        if scenario in EVEN:
            what, values = EVEN[scenario]
            even = over_seeds(scenario, pd, 0, values)
            print(f"  {what}: {', '.join(f'{name} {x[0]:.3f}' for name, x in even.items())}")


# The REMUS 100


def ell(value: float) -> dict[str, Any]:
    """Changes for another control point, at the start of the reference."""
    known = {f"{name}.ell": value for name in ("plant", "controller", "planner")}
    return {**known, "plant.eta0.x": -value}


#: Changes, in the words of the page.
CHANGES: Mapping[str, Values] = {
    "nothing": {},
    "current of 0.3 m/s across the first leg": {"plant.current.y": 0.3},
    "speed measured": {"allocation.measured": True},
    "nominal speed of 1.0 m/s": {"allocation.speed": 1.0},
    "nominal speed of 2.5 m/s": {"allocation.speed": 2.5},
    "no lags": {"plant.fin.T": 0.0, "plant.propeller.T": 0.0},
    "all of the propeller's torque": {"plant.propeller.torque": 1.0},
    "ell = 0.35 m": ell(0.35),
    "ell = 0.1 m": ell(0.1),
    "lambda = 2.1 m/s": {"controller.lambda": 2.1},
    "start 3 m aside": {"plant.eta0.y": 3.0},
    "lambda = 0.15 m/s": {"controller.lambda": 0.15},
    "lambda = 0.6 m/s": {"controller.lambda": 0.6},
    "eps_t = 5 W": {"controller.eps_t": 5.0},
    "gamma = 3": {"controller.gamma": 3.0},
    "no noise": QUIET,
    "no noise, fin of 0.03 s": {**QUIET, "plant.fin.T": 0.03},
    "fins up to 20 degrees": {f"{name}.fin.max": radians(20.0) for name in ("plant", "allocation")},
    "k_d = 50": {"controller.k_d": 50.0},
    "noise of 3 mm": {STD: 0.003},
    "noise of 1 cm": {STD: 0.01},
    "gains of the paper": {
        "controller.K1": [10.0, 10.0, 10.0], "controller.K2": [10.0, 10.0, 10.0],
        "controller.k_d": 50.0, "controller.lambda": 1.0, "controller.eps_t": 1.0,
    },
}  # fmt: skip


#: Seeds of the noise, over which numbers of changed scenarios are medians.
SEEDS = range(1, 11)


def show_changes(
    scenario: str,
    columns: Sequence[str],
    changes: Mapping[str, Values],
    numbers_of: Callable[[Table], Sequence[float]],
) -> None:
    """Print the numbers of a scenario and of its PD controller with changes, over seeds.

    Runs that end early have none: their numbers are nan.
    """
    rows, none = [], [nan] * len(columns)
    for (name, values), pd in combinations(changes.items(), ("", "-pd")):
        lacking = ("controller.K2", "controller.k_d") if pd else ()
        shared = {key: value for key, value in values.items() if key not in lacking}
        system, end = system_of(scenario + pd), read_scenario(scenario).stop_time
        made = (simulate(system, {**shared, SEED: k}, stop_time=end) for k in SEEDS)
        found = np.array([none if result.failure else numbers_of(result) for result in made])
        rows.append([name, "PD" if pd else "proposed", *map(band, found.T)])
    show(["changed", "controller", *columns], rows)


def remus() -> None:
    """Print the numbers with each change, for both controllers, and of the models.

    The columns are the largest error in the first 40 s and from 120 s on [m], the largest part of
    the latter across the path [m], the share of steps with a fin at its limit, in pitch and yaw
    [%], the largest command in yaw [N.m], and the mean rate of the rudder [degrees/s]. The models
    have masses, steady turns, trims and corners.
    """
    columns = ("first", "late", "across", "q", "r", "yaw", "rate")
    prestero = {
        str(name): value
        for name, value in read_scenario("remus-prestero").parameters.items()
        if name.component != "controller" and "waypoint" not in name.port
    }
    changes = {**CHANGES, "Prestero's coefficients": prestero}
    show_changes("remus", columns, changes, remus_numbers)
    for scenario in ("remus", "remus-pd"):
        result = simulate(scenario, stop_time=1500.0)
        size, time = size_of(result, AllocatedLoop()), result.time
        resting = size[(time >= 290.0) & (time < 600.0)].max()
        later = (f"{size[time.searchsorted(t)]:.2f} m at {t:g} s" for t in (600.0, 1500.0))
        print(f"after the end, {scenario}: {resting:.2f} m at most, {', '.join(later)}")
    models()


def remus_numbers(result: Table) -> Sequence[float]:
    """Numbers of a run."""
    loop, late = AllocatedLoop(), result.time >= 120.0
    size, across = size_of(result, loop), beside(result, loop)[late].max()
    pairs = ((f"controller.tau.{k}", f"allocation.tau_attained.{k}") for k in "qr")
    limited = (
        100.0 * (np.abs(np.subtract(*result.step_values(*pair).T)) > 1e-9).mean() for pair in pairs
    )
    command = np.abs(result.step_values("controller.tau.r")).max()
    rate = np.abs(np.diff(np.degrees(result["plant.actuator.delta_r"]))).sum() / result.time[-1]
    first = size[result.time < 40.0].max()
    return (first, size[late].max(), across, *limited, command, rate)


def prestero_vehicle() -> remus100.Parameters:
    """Parameters of the vehicle of `remus-prestero`."""
    found = read_scenario("remus-prestero").parameters
    mass, z, net, x, lift_r, lift_s = (
        found[PortName("plant", port)]
        for port in ("mass", "r_bg.z", "net_buoyancy", "fin.x", "fin.lift.r", "fin.lift.s")
    )
    hull = Hull(mass=mass, r_bg=(0.0, 0.0, z), net_buoyancy=net)
    tail = Tail(x=x, lift_r=lift_r, lift_s=lift_s)
    return remus100.Parameters(hull=hull, tail=tail, form=Form.COEFFICIENTS)


def force(
    vehicle: remus100.Parameters, nu: Sequence[float], theta: float = 0.0, *fins: float
) -> np.ndarray:
    """Force and moment [N, N.m] on a Remus100 that does not heel, by rudder and stern planes."""
    u, v, w, p, q, r = nu
    delta_r, delta_s = fins or (0.0, 0.0)
    none, mass = (0.0, 0.0, 0.0), inertia_of(vehicle)
    state = RemusState(none, (0.0, theta, 0.0), (u, v, w, p, q, r), (delta_r, delta_s, 0.0), none)
    made: np.ndarray = np.array(mass.M) @ accelerations(vehicle, mass, state)
    return made


def turning(vehicle: remus100.Parameters, nu: Sequence[float], rudder: float) -> np.ndarray:
    """Force and moment in sway and yaw [N, N.m] on a Remus100."""
    return force(vehicle, nu, 0.0, rudder, 0.0)[[1, 5]]


#: Hull of remus100.m.
MSS_HULL = Hull(length=1.0096 * 1.6, diameter=1.0096 * 0.19, mass=31.9)


def mss_force(nu: Sequence[float], rudder: float) -> np.ndarray:
    """Force and moment in sway and yaw of remus100.m of the MSS toolbox (6d4b553).

    The drag coefficient of a cylinder is that of its cylinderDrag.m for the Reynolds numbers of
    these turns.
    """
    u, v, _, _, _, r = nu
    hull, M = MSS_HULL, inertia(MSS_HULL).M
    reynolds = abs(v) * 1.6e6
    c_d = float(np.interp(
        reynolds,
        (118086.0, 214709.0, 230940.0, 271581.0, 297098.0, 325252.0),
        (1.21134, 1.21171, 1.20109, 1.16918, 1.11163, 1.00926),
    ))  # fmt: skip
    slender = np.interp(1.6 / 0.19, (5.0, 10.0), (0.62, 0.68) if reynolds < 2e5 else (0.80, 0.82))
    sway, yaw = cross_flow(Hull(), Drag(c_d_across=c_d * float(slender)), 1025.0, v, r)
    lift = -0.5 * 1026.0 * (u * u + v * v) * 0.0133 * 0.5 * rudder
    Y = lift + sway - M[1, 1] / 20.0 * v - hull.mass * u * r
    return np.array((Y, -hull.length / 2.0 * lift + yaw - M[5, 5] * r))


def steady_turn(
    speed: float, balance: Callable[[Sequence[float]], np.ndarray]
) -> tuple[float, float]:
    """Sway [m/s] and rate [rad/s] of a steady turn at a speed, by its forces in sway and yaw."""

    def residual(x: np.ndarray) -> np.ndarray:
        v, r = x
        return balance(((speed * speed - v * v) ** 0.5, v, 0.0, 0.0, 0.0, r))

    v, r = root(residual, (-0.1, 0.15)).x
    return float(v), float(r)


def trim(vehicle: remus100.Parameters, speed: float) -> tuple[float, float]:
    """Pitch and stern planes [degrees] with which a vehicle holds its depth at a speed."""

    def residual(x: np.ndarray) -> np.ndarray:
        theta, planes = x
        nu = (speed * cos(theta), 0.0, speed * sin(theta), 0.0, 0.0, 0.0)
        return force(vehicle, nu, theta, 0.0, planes)[[2, 4]]

    theta, planes = np.degrees(root(residual, (-0.05, -0.1)).x)
    return float(theta), float(planes)


def largest_corner(scenario: str, moments: tuple[float, float]) -> float:
    """Largest corner [degrees] that the planner of a scenario accepts between legs of 100 m.

    Args:
        scenario: with the planner's vehicle, its cruise and its rounding.
        moments: of stern planes and rudder at the cruise speed [N.m].

    """
    own, system = read_scenario(scenario).parameters, load_scenario(scenario)[1]
    values = {str(n): v for n, v in own.items() if "waypoint" not in n.port}

    def accepted(angle: float) -> bool:
        limits = [66.0, *(moment * cos(radians(angle) / 2.0) ** 2 for moment in moments)]
        ends = {"tau_max": limits, "tau_min": [-limit for limit in limits], "count": 3}
        x, y = 100.0 * cos(radians(angle)), 100.0 * sin(radians(angle))
        points = ((0.0, 0.0), (100.0, 0.0), (100.0 + x, y))
        path = {
            f"waypoint[{k}].{axis}": value
            for k, point in enumerate(points, 1)
            for axis, value in zip("xyz", (*point, 5.0), strict=True)
        }
        changes = {f"planner.{name}": value for name, value in {**ends, **path}.items()}
        try:
            simulate(system, {**values, **changes}, stop_time=0.02)
        except InputError:
            return False
        return True

    low, high = 0.0, 179.0
    while high - low > 0.5:
        middle = (low + high) / 2.0
        low, high = (middle, high) if accepted(middle) else (low, middle)
    return low


def models() -> None:
    """Compare Remus100 with its two hulls, and the model of the MSS toolbox."""
    vehicles = {"Fossen": remus100.Parameters(), "Prestero": prestero_vehicle()}
    for name, vehicle in vehicles.items():
        M = inertia_of(vehicle).M
        print(f"\n{name}: masses {', '.join(f'{M[k, k]:.3g}' for k in range(6))} kg, kg.m2")
        show_turns(name, partial(turning, vehicle))
        ahead, aside, full = [1.5, *[0.0] * 5], [1.5, 0.1, *[0.0] * 4], radians(15.0)
        N, M_q = turning(vehicle, ahead, full)[1], -force(vehicle, ahead, 0.0, 0.0, full)[4]
        drag, (Y, moment) = -force(vehicle, ahead)[0], turning(vehicle, aside, 0.0)
        print(f"  at 1.5 m/s: moments of 15 degrees {N:.2f}, {M_q:.2f} N.m; drag {drag:.1f} N; "
              f"by a sway of 0.1 m/s {Y:.2f} N, {moment:.2f} N.m")  # fmt: skip
        slopes = [turning(vehicle, [1.5, a, 0.0, 0.0, 0.0, b], 0.0) for a, b in 1e-6 * np.eye(2)]
        swaying = np.linalg.solve(np.array(M)[np.ix_((1, 5), (1, 5))], 1e6 * np.transpose(slopes))
        print(f"  fastest growth: {max(np.linalg.eigvals(swaying).real):.2f} 1/s")
        for net in (3.34, 7.0):
            floats = vehicle._replace(hull=vehicle.hull._replace(net_buoyancy=net))
            theta, planes = trim(floats, 1.5)
            enough = (x for x in np.arange(1.5, 0.3, -0.01) if trim(floats, x)[1] < -15.0)
            print(f"  B - W = {net:g} N: pitch {theta:.1f}, stern planes {planes:.1f} degrees at "
                  f"1.5 m/s; more than 15 degrees at {next(enough, 0.0):.2f} m/s")  # fmt: skip
    M, moment = inertia(MSS_HULL).M, mss_force([1.5, *[0.0] * 5], radians(15.0))[1]
    print(f"\nMSS: sway {M[1, 1]:.3g} kg, yaw {M[5, 5]:.3g} kg.m2; moments of 15 degrees at "
          f"1.5 m/s {moment:.2f}, {0.7 / 0.5 * moment:.2f} N.m")  # fmt: skip
    show_turns("MSS", mss_force)
    for scenario, moments in (("remus", (2.25, 1.61)), ("remus-prestero", (3.62, 3.62))):
        corner = largest_corner(scenario, moments)
        print(f"largest corner of the planner of {scenario}, rounded in 30 s: {corner:.0f} degrees")


def show_turns(name: str, balance: Callable[[Sequence[float], float], np.ndarray]) -> None:
    """Print steady turns, by forces in sway and yaw for a velocity and an angle of the rudder."""
    for most, speed in combinations((15.0, 20.0), (1.06, 1.5)):
        v, r = steady_turn(speed, partial(lambda angle, nu: balance(nu, angle), radians(most)))
        print(f"  turn of {name} with {most:g} degrees of rudder at {speed:g} m/s: {r:.3f} rad/s, "
              f"radius {speed / r:.1f} m, sway {v:.3f} m/s")  # fmt: skip


# The BlueROV2 Heavy

#: Changes, in the words of the page.
ROV_CHANGES: Mapping[str, Values] = {
    "nothing": {},
    "current of 0.2 m/s across the first leg": {"plant.current.y": 0.2},
    "not trimmed, 0.10 kg too heavy": {"plant.volume": 0.0134},
    "ell = 0.35 m": ell(0.35),
    "lambda = 0.5 m/s": {"controller.lambda": 0.5},
    "lambda = 2 m/s": {"controller.lambda": 2.0},
    "gains of the paper": {
        "controller.K1": [10.0, 10.0, 10.0], "controller.K2": [10.0, 10.0, 10.0],
        "controller.k_d": 50.0,
    },
    "k_d = 50": {"controller.k_d": 50.0},
    "K1 = 60": {"controller.K1": [60.0, 60.0, 60.0]},
    "gamma = 10": {"controller.gamma": 10.0},
    "no noise": QUIET,
    "noise of 3 mm": {STD: 0.003},
    "noise of 1 cm": {STD: 0.01},
    "lag of 0.15 s": {"plant.actuator.T": 0.15},
    "damping of Wu (2018)": {
        "plant.drag.linear.u": 4.03, "plant.drag.linear.v": 6.22, "plant.drag.linear.w": 5.18,
        "plant.drag.linear.p": 0.07, "plant.drag.linear.q": 0.07, "plant.drag.linear.r": 0.07,
        "plant.drag.quadratic.u": 18.18, "plant.drag.quadratic.v": 21.66,
        "plant.drag.quadratic.w": 36.99, "plant.drag.quadratic.p": 1.55,
        "plant.drag.quadratic.q": 1.55, "plant.drag.quadratic.r": 1.55,
    },
}  # fmt: skip


def bluerov() -> None:
    """Print the numbers with each change, for both controllers, and steady speeds.

    The columns are the largest error in the first 20 s, from 20 s to 50 s and from 65 s on [m], the
    part of the second across the path [m], the share of steps in which a thruster is at its limit
    [%], the largest roll and pitch [degrees], and how far the commands of a thruster move a second,
    in the mean of the eight [1/s].
    """
    columns = ("first", "later", "across", "end", "limit", "roll", "pitch", "moves")
    show_changes("bluerov", columns, ROV_CHANGES, bluerov_numbers)
    allocation = thruster_allocation.Parameters()
    derived = thruster_allocation.derive(allocation)
    water = bluerov2.Hydrodynamics()
    wu = (4.03, 18.18), (6.22, 21.66), (5.18, 36.99)
    for k, direction in enumerate(("ahead", "aside", "down")):
        most = tuple(1e6 * (i == k) for i in range(3))
        wanted = Wanted((most[0], 0.0, 0.0), (most[1], most[2], 0.0))
        force = thruster_allocation.evaluate(allocation, derived, wanted)
        ours = water.linear[k], water.quadratic[k]
        speeds = (steady_speed(*pair, force.tau_attained[k]) for pair in (ours, wu[k]))
        print(f"{direction}: at most {force.tau_attained[k]:.0f} N, at which the speed is "
              f"{' m/s, of Wu (2018) '.join(f'{x:.2f}' for x in speeds)} m/s")  # fmt: skip


def steady_speed(linear: float, quadratic: float, force: float) -> float:
    """The speed at which a drag equals a force [m/s]."""
    return (sqrt(linear**2 + 4.0 * quadratic * force) - linear) / (2.0 * quadratic)


def bluerov_numbers(result: Table) -> Sequence[float]:
    """Numbers of a run."""
    loop, time = AllocatedLoop(), result.time
    size, later = size_of(result, loop), (time >= 20.0) & (time <= 50.0)
    commands = result.step_values(*(f"allocation.command[{k}]" for k in range(1, 9)))
    limited = 100.0 * (np.abs(commands) > 1.0 - 1e-9).any(axis=1).mean()
    moves = np.abs(np.diff(commands, axis=0)).sum(axis=0).mean() / time[-1]
    roll, pitch = (np.degrees(np.abs(result[f"plant.eta.{k}"]).max()) for k in ("phi", "theta"))
    errors = (size[time < 20.0], size[later], beside(result, loop)[later], size[time >= 65.0])
    return (*(error.max() for error in errors), limited, roll, pitch, moves)


def beside(made: Table, loop: Loop) -> np.ndarray:
    """Norms of the tracking error across the path, in all rows [m]."""
    error, ahead = tracking_error(made, loop), made.group(*loop.dy_d)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True) + (ahead == 0.0).all(axis=1)[:, None]
    return np.asarray(np.linalg.norm(error - (error * ahead).sum(axis=1)[:, None] * ahead, axis=1))


# Networks

#: Neurons of the layers (the first are inputs); seeds of a shape, and inputs of each.
SHAPES = ((4, 8, 2), (1, 300, 1), (3, 300, 2), (12, 64, 64, 6), (16, 200, 200, 4))
NETWORKS, INPUTS = 20, 10
FUNCTIONS: dict[str, Callable[[Any], Any]] = {"Tanh": np.tanh, "Relu": lambda z: np.maximum(z, 0.0)}


def networks() -> None:
    """Compare networks with weights as PyTorch draws them, at inputs of standard deviation 1."""
    rows = []
    with TemporaryDirectory() as folder:
        for sizes, activation in combinations(SHAPES, FUNCTIONS):
            path = Path(folder) / "network.onnx"
            found = [differences(path, sizes, activation, seed) for seed in range(NETWORKS)]
            largest = [f"{x:.1e}" for x in np.max(found, axis=0)]
            rows.append([" - ".join(map(str, sizes)), activation.lower(), *largest])
    show(("neurons", "activation", "to onnxruntime", "to numpy, in double"), rows)


def differences(path: Path, sizes: tuple[int, ...], activation: str, seed: int) -> Any:
    """Distances of a component from onnxruntime and numpy, in parts of its largest output."""
    import onnx  # noqa: PLC0415
    import onnxruntime  # noqa: PLC0415

    random, make = np.random.default_rng(seed), onnx.helper
    constants, nodes, value = {}, [], "x"
    for i, (n, m) in enumerate(pairwise(sizes)):
        for name, shape in ((f"W{i}", (m, n)), (f"b{i}", (m,))):
            constants[name] = (random.uniform(-1.0, 1.0, shape) / np.sqrt(n)).astype(np.float32)
        nodes.append(make.make_node("Gemm", [value, f"W{i}", f"b{i}"], [f"z{i}"], transB=1))
        nodes.append(make.make_node(activation, [f"z{i}"], [value := f"a{i}"]))
    last = f"z{len(sizes) - 2}"
    graph = make.make_graph(
        nodes[:-1],
        "network",
        [make.make_tensor_value_info("x", onnx.TensorProto.FLOAT, [1, sizes[0]])],
        [make.make_tensor_value_info(last, onnx.TensorProto.FLOAT, [1, sizes[-1]])],
        [onnx.numpy_helper.from_array(array, name) for name, array in constants.items()],
    )
    opsets = [make.make_opsetid("", 17)]
    onnx.save(make.make_model(graph, opset_imports=opsets, ir_version=8), str(path))
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    component: dict[str, Any] = {"__name__": "component"}
    exec(component_text("Network", read_network(path), path.name), component)
    given = random.normal(size=(INPUTS, sizes[0])).astype(np.float32)
    single = np.array([session.run(None, {"x": x[None]})[0][0] for x in given])
    own = np.array([[*component["_network"](component["Vector"](map(float, x)))] for x in given])
    double = given.astype(float)
    for i in range(len(sizes) - 1):
        double = double @ constants[f"W{i}"].T.astype(float) + constants[f"b{i}"]
        double = FUNCTIONS[activation](double) if f"z{i}" != last else double
    return np.array([np.abs(own - other).max() for other in (single, double)]) / np.abs(own).max()


# The best gains


#: Largest commands of the searches [N, N.m].
LIMITS = (10.0, 20.0, 80.0)

#: Generations of a search, and candidates of a generation for each gain.
GENERATIONS, CANDIDATES = 250, 10


def gains(n: int = 1, engine: EngineName = BATCH, population: int | None = None) -> None:
    """Search the ranges of the study `gains` for the least `late_error` under a limit of commands.

    It makes 136,000 runs by differential evolution, a generation at a time, in six to seven minutes
    of a core. A search finds good gains, and no proof that there are no better ones; `--runs 2`
    makes each twice, `--population N` has N candidates in each of 251 generations, and `--engine
    gpu` makes their runs on a graphics card.
    """
    from scipy.optimize import differential_evolution  # noqa: PLC0415

    study = read_study("gains")
    assert study.sample
    ready, ranges = prepare_study(study, Means(engine=engine)), study.sample.ranges
    for place, scenario in enumerate(study.scenario):
        has = ready.systems[scenario][1].components["controller"].variables
        searched = [name for name in ranges if name.partition(".")[2] in has]
        bounds = [(log(ranges[name].low), log(ranges[name].high)) for name in searched]
        size = CANDIDATES if population is None else ceil(population / len(searched))

        def cost(logarithms: np.ndarray, limit: float) -> np.ndarray:
            values = dict(zip(searched, np.exp(logarithms), strict=True))  # noqa: B023
            found = candidates(ready, place, values)  # noqa: B023
            peak = np.max([found[f"peak_command.{k}"] for k in ACTUATORS], axis=0)
            # Gains whose commands are too large are worse than all others, and failures still more.
            costs: np.ndarray = np.where(
                peak <= limit, np.log(found["late_error"]), 10.0 + np.log(peak / limit)
            )
            costs[np.isnan(costs)] = np.inf
            return costs

        for limit in LIMITS:
            found = [
                differential_evolution(
                    cost, bounds, (limit,), maxiter=GENERATIONS, popsize=size, tol=0.0, rng=seed,
                    polish=False, vectorized=True, updating="deferred",
                )
                for seed in range(1, n + 1)
            ]  # fmt: skip
            best = min(found, key=lambda fit: float(fit.fun))
            others = ", ".join(f"{exp(fit.fun):.3g}" for fit in found)
            print(
                f"{scenario}, commands up to {limit:g}: {exp(best.fun):.3g} m (by seed: {others})"
            )
            for name, value in zip(searched, map(exp, best.x), strict=True):
                print(f"    {name} = {value:.4g}", flush=True)


def candidates(ready: Ready, place: int, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The indices of runs of a study with some values in its scenario at a place."""
    first, n = ready.space.points(np.array([place])), len(next(iter(values.values())))
    same = first[np.zeros(n, dtype=int)]
    runs = replace(same, numbers=np.arange(n), values={**same.values, **values})
    assert isinstance(ready.engine, BatchEngine)
    # A part for each thread, since a single block could hold them all.
    parts = np.array_split(runs.numbers, ready.engine.runners.threads or cores())
    with making_runs(ready.engine, (runs[part] for part in parts)) as blocks:
        outcomes = Outcomes.joined([*blocks])
    rows = outcomes.indices[np.argsort(outcomes.numbers)]
    return dict(zip(outcomes.columns, rows.T, strict=True))


# Equality of the engines `batch` and `gpu`

#: Redefines functions so that a result is moved by one unit in the last place, up, down or not at
#: all, by a hash of its bits and of a seed. Libraries give 0 and 1 exactly, and none exceeds them.
MOVED = """\
#include <math.h>
#include <stdint.h>
#include <string.h>

static double moved(double x) {{
    uint64_t bits, mixed;
    memcpy(&bits, &x, sizeof bits);
    mixed = bits + {seed}u * 0x9e3779b97f4a7c15u;
    mixed = (mixed ^ mixed >> 30) * 0xbf58476d1ce4e5b9u;
    mixed = (mixed ^ mixed >> 27) * 0x94d049bb133111ebu;
    mixed ^= mixed >> 31;
    if (x == 0.0 || fabs(x) == 1.0 || !isfinite(x)) return x;
    bits = bits + mixed % 3 - 1;
    memcpy(&x, &bits, sizeof bits);
    return x;
}}

{functions}
"""

#: Seeds of the roundings; how far a start is moved [m]; and the difference that counts as one.
ROUNDINGS, NUDGE, APART = (1, 2, 3), 1e-12, 1e-6

#: Indices that count steps: they jump by whole steps.
COUNTS = ("saturated_fraction", "time_to_reach", "time_to_settle")

#: Share of saturated steps above which a run without a caution may be chaotic, too.
OFTEN = 0.05

#: An engine, and the runs that it is to make.
Job = tuple[BatchEngine, Sequence[Point]]


class MovedFunctions(Processor):
    """The processor, with functions whose results are moved in the last place.

    Attributes:
        head: what texts in C begin with.

    """

    def __init__(self, seed: int) -> None:
        """Choose the roundings."""
        functions = (f"#define {name}(...) moved({name}(__VA_ARGS__))" for name in ROUNDED)
        self.head = MOVED.format(seed=seed, functions="\n".join(functions))

    def __call__(self, source: Source) -> Program:
        """Return a compiled program."""
        return super().__call__(replace(source, text=self.head + source.text))


def roundings(*studies: str, n: int = 200) -> None:
    """Compare n random runs of ready studies with the same by functions of other roundings.

    A run differs if an index that counts no steps is more than 1e-6 apart, relative to values above
    1. It is chaotic if a start moved by 1e-12 m does that, too. One that differs and is not chaotic
    is made again without friction. Suspect is a run with a caution, or with more than 5 % of its
    steps saturated.
    """
    rows = [rounded_study(name, n) for name in studies or ready_studies()]
    show([*rows[0]], [[*row.values()] for row in rows])


def rounded_study(name: str, n: int) -> dict[str, str]:
    """Print the differences of a study by index, and return its row in the table of all."""
    study = read_study(name)
    loaded = {scenario: load_scenario(scenario) for scenario in study.scenario}
    systems = {scenario: system for scenario, (_, system) in loaded.items()}
    space, loops = Space(study, loaded), loops_of(next(iter(systems.values())))
    points = [space[number] for number in sorted(Random(n).sample(range(len(space)), n))]
    own = BatchEngine(systems)
    others = [BatchEngine(systems, runners=MovedFunctions(seed)) for seed in ROUNDINGS]

    x, smooth = loops[0].start[0], {f"{loop.disturbance}.A_f": 0.0 for loop in loops}
    nudged = [changed(point, {x: start_of(own, point, x) + NUDGE}) for point in points]
    made, started, *moved = outcomes_of_jobs(
        [(own, points), (own, nudged), *((other, points) for other in others)]
    )
    index_of = {
        f"{prefix}{column}": index.name
        for _, prefix in prefixed(loops)
        for index in EVERY
        for column in index.columns
    }
    indices = np.array([index_of.get(column, column) for column in made.columns])
    apart = np.array([index_differences(each, made) for each in moved])
    rows = []
    for index in dict.fromkeys(indices.tolist()):
        each = apart[:, :, indices == index]
        beyond = f"{100 * (each > APART).any(axis=(0, 2)).mean():.3g} %"
        rows.append([index, power(float(np.median(each))), power(each.max()), beyond])
    print(f"\n{name}")
    show(["index", "median", "largest", f"runs above {APART:g}"], rows)

    continuous = ~np.isin(indices, COUNTS)
    size = apart[:, :, continuous].max(axis=(0, 2))
    differs = size > APART
    chaotic = (index_differences(started, made)[:, continuous] > APART).any(axis=1)
    warned = np.array([caution is not None for caution in made.cautions.each()])
    saturated = (made.indices[:, indices == "saturated_fraction"] > OFTEN).any(axis=1)
    ties = [changed(points[i], smooth) for i in np.flatnonzero(differs & ~chaotic)]
    again = outcomes_of_jobs([(engine, ties) for engine in (own, *others)])
    even, *uneven = (each.arranged(made.columns) for each in again)
    still = np.array([index_differences(each, even)[:, continuous] > APART for each in uneven])
    return {
        "study": f"`{name}`",
        "runs": str(n),
        "median": power(float(np.median(size))),
        "largest": power(size.max()),
        "differ": str(differs.sum()),
        "largest of the others": power(size[~differs].max(initial=0.0)),
        "chaotic": str(chaotic.sum()),
        "differ and chaotic": str((differs & chaotic).sum()),
        "with a caution": str((differs & chaotic & warned).sum()),
        "suspect": str((warned | saturated).sum()),
        "chaotic, not suspect": str((chaotic & ~warned & ~saturated).sum()),
        "differ, not chaotic": str(len(ties)),
        "of these without friction": str(still.any(axis=(0, 2)).sum()),
        "other failures": str(max(other_texts(each.failures, made.failures) for each in moved)),
        "other cautions": str(max(other_texts(each.cautions, made.cautions) for each in moved)),
    }


def changed(point: Point, values: Values) -> Point:
    """A run with some values changed."""
    return point._replace(parameters={**point.parameters, **values})


def start_of(engine: BatchEngine, point: Point, name: str) -> float:
    """The value of a parameter in a run."""
    value = engine.value(point, name)
    assert isinstance(value, float)
    return value


def outcomes_of_jobs(jobs: Sequence[Job]) -> list[Outcomes]:
    """The outcomes of each job; jobs are done at the same time."""
    with ThreadPoolExecutor() as pool:
        return [*pool.map(lambda job: Outcomes.of(outcomes_of(*job)), jobs)]


def index_differences(outcomes: Outcomes, expected: Outcomes) -> np.ndarray:
    """Differences of indices, relative to values above 1; inf if only one of two is missing."""
    values, own = outcomes.arranged(expected.columns).indices, expected.indices
    apart: np.ndarray = np.abs(values - own) / np.maximum(1.0, np.abs(own))
    apart[np.isnan(apart)] = np.inf
    apart[np.isnan(values) & np.isnan(own)] = 0.0
    return apart


def other_texts(texts: Texts, expected: Texts) -> int:
    """Number of runs with another text."""
    return sum(a != b for a, b in zip(texts.each(), expected.each(), strict=True))


def power(x: float) -> str:
    """A number with one digit and an exponent."""
    return "one is missing" if x == np.inf else f"{x:.0e}" if x else "0"


# Studies

#: Prefixes of column names that do not distinguish columns.
COMPONENT = re.compile(r"^(auv\*\.)?(plant|controller|disturbance|link)\.")


def share(column: Any) -> str:
    """Share of runs whose column is true, with its exact interval of 95 %, as if independent."""
    from scipy.stats import binomtest  # noqa: PLC0415

    hits, n = int(column.sum()), len(column)
    low, high = binomtest(hits, n).proportion_ci()
    return f"{hits} of {n}, {100 * hits / n:.3g} % ({100 * low:.3g} to {100 * high:.3g})"


def bound(column: Any) -> str:
    """Upper bound of the share at 95 % if the column of no run is true: (1 - share)^n = 0.05."""
    return f"{column.sum()} of {len(column)}, {100 * (1 - 0.05 ** (1 / len(column))):.2g} %"


def rank(x: Any, y: Any) -> str:
    """Spearman's correlation of two columns, and its standard error; it misses U shapes."""
    from scipy.stats import spearmanr  # noqa: PLC0415

    return f"{spearmanr(x, y).statistic:.3f} ± {(len(x) - 1) ** -0.5:.3f} (n = {len(x)})"


#: Statistics of columns, by the first word of a line.
STATISTICS: Mapping[str, Callable[..., str]] = {
    "n": lambda column: str(len(column)),
    "median": lambda column: f"{column.median():.5g} (n = {len(column)})",
    "band": lambda column: "{1:.3g} ({0:.3g} to {2:.3g})".format(
        *column.quantile([0.05, 0.5, 0.95])
    ),
    "min": lambda column: f"{column.min():.5g}",
    "max": lambda column: f"{column.max():.5g}",
    "share": share,
    "bound": bound,
    "rank": rank,
}


def queries(study: str) -> dict[str, Any]:
    """The part of page_numbers.toml about a study."""
    text = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
    table: dict[str, Any] = tomllib.loads(text)[study]
    return table


def lines_of(study: str) -> list[str]:
    """Lines for a study, with the alternatives expanded."""
    found: list[str] = []
    for line in queries(study)["lines"].strip().splitlines():
        parts = re.split(r"\{(.*?)\}", line)
        choices = (part.split(",") if i % 2 else [part] for i, part in enumerate(parts))
        found += map("".join, combinations(*choices))
    return [re.sub(r"NEAR\((\w+); (\S+)\)", r"\2 / 1.1 < \1 < \2 * 1.1", line) for line in found]


def parsed(line: str) -> tuple[str, list[str], list[str], str]:
    """Statistic of a line, its columns, the columns that group it, and the query."""
    what, _, where = line.partition(" | ")
    columns, by = (part.split() for part in what.partition(" by ")[::2])
    return columns[0], columns[1:] or ["run"], by, where


def prepared(study: str, runs: Any) -> Any:
    """Runs with short names, and with computed columns."""
    runs = runs.rename(columns=lambda name: COMPONENT.sub("", name))
    runs = runs.rename(columns=lambda name: re.sub(r"\W+", "_", name).strip("_"))
    runs = runs.rename(columns={"lambda": "lam"})
    if "scenario" in runs:
        runs["proposed"], runs["PD"] = runs.scenario == "fig5", runs.scenario == "fig5-pd"
    runs["failed"] = runs.failure.fillna("") != ""
    runs["ended"] = runs.failure.str.extract(r" t = (\S+) s", expand=False).astype(float)
    # The largest of several vehicles.
    runs["late_error"] = runs.filter(regex="(^|_)late_error$").max(axis=1)
    runs["lost"] = ~(runs.late_error <= 1.0)
    runs["saturated"] = runs.filter(like="saturated_fraction").max(axis=1) > 0.0
    runs["peak"] = runs.filter(like="peak_command").max(axis=1)
    runs["final_error"] = runs.filter(like="final_error_").max(axis=1)
    for name, made in queries(study).get("made", {}).items():
        runs[name] = runs.eval(made)
    if study == "distance":
        # The proposed controller's run of a point comes first.
        first = runs.groupby(["step", "noise_std", "way"]).l2_effort_u.transform("first")
        runs["effort_ratio"] = runs.l2_effort_u / first
    for amplitude, other in (("A_f", "A_d"), ("A_d", "A_f")) if study == "robustness" else ():
        # True if the reference is kept with this disturbance and all weaker ones on the line.
        line = runs.sort_values(amplitude).groupby(
            ["scenario", "step", "noise_std", "omega_d", other]
        )
        runs[f"kept_{amplitude[-1]}"] = ~line.lost.cummax()
    return runs


def answer(line: str, runs: Any) -> str:
    """The numbers of a line."""
    import pandas as pd  # noqa: PLC0415

    statistic, columns, by, where = parsed(line)
    part = runs.query(where) if where else runs
    for tenth in (name for name in by if name.startswith("tenth_")):
        part = part.assign(**{tenth: pd.qcut(part[tenth.removeprefix("tenth_")], 10, labels=False)})
    found = []
    for key, group in part.groupby(by) if by else [((), part)]:
        names = (f"{value:.3g}" if isinstance(value, float) else str(value) for value in key)
        number = STATISTICS[statistic](*(group[name] for name in columns))
        found.append(" ".join((*names, number)))
    return ", ".join(found)


def studies(*folders: str) -> None:
    """Print the numbers of the studies in some folders."""
    for folder in folders:
        result = StudyResult(Path(folder))
        study = result.record["study"]
        runs = prepared(study, result.to_dataframe().reset_index())
        print(f"\n{study}")
        for line in lines_of(study):
            print(f"  {line}: {answer(line, runs)}")


# The table of controllers


def benchmark(folder: str = "results/benchmark", n: int = 1000) -> int:
    """Make the benchmark in a folder, and write its table, picture and answer into the page.

    Runs that are there are not made again.
    """
    if status := main_of_command(["benchmark", "--runs", str(n), "--out", folder]):
        return status
    made, page = ROOT / folder, ROOT / "docs" / "explanation" / "benchmark.md"
    tables = (made / "table.md").read_text(encoding="utf-8").split("\n\n")
    with (made / "table.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["task"] == "all"]
    text = filled_in(page, {"answer": answer_of(rows), "table": tables[2]})
    page.write_text(text, encoding="utf-8")
    shutil.copyfile(made / "errors.png", ROOT / "docs" / "images" / "benchmark.png")
    return 0


def answer_of(rows: Sequence[Mapping[str, str]]) -> str:
    """The places of the paper's law: rows of all tasks, the best law of each vehicle first."""

    def place(among: Sequence[Mapping[str, str]]) -> str:
        names = [row["law"] for row in among]
        return f"{names.index('paper') + 1} of {len(names)}"

    titles = {name: vehicle.scenario.label for name, vehicle in vehicles().items()}
    every = [row for row in rows if row["vehicle"] == "all"]
    alike = [row for row in every if "velocity" not in row["sensors"]]
    each = (
        f"{title}: {place([row for row in rows if row['vehicle'] == name])}"
        for name, title in titles.items()
    )
    [own] = [row for row in every if row["law"] == "paper"]
    tasks = next(iter(vehicles().values())).tasks
    n = int(own["runs"]) // (len(titles) * len(tasks))
    best = every[0]
    error, failed = (
        [f"{factor * float(row[name]):.2g}" for row in (own, best)]
        for name, factor in (("error", 1.0), ("failed", 100.0))
    )
    text = (
        f"Over all vehicles and tasks the paper's law is number {place(every)}, and number "
        f"{place(alike)} among the laws that measure no velocity ({'; '.join(each)}). Its late "
        f"error is {error[0]} m in the median, and {failed[0]} % of its runs fail. With the best "
        f"law, {best['law'].replace('_', ' ')}, it is {error[1]} m and {failed[1]} %. The numbers "
        f"are from `auv-fmu benchmark --runs {n}`."
    )
    return textwrap.fill(text, 100, break_on_hyphens=False)


# Benchmarks


def benchmarks(*chosen: str) -> int:
    """Run the commands of files in benchmarks/results, some or all; 1 if one has failed."""
    files = {file.stem: file for file in sorted(RESULTS.glob("*.txt"))}
    if unknown := {*chosen} - files.keys():
        sys.exit(f"{', '.join(sorted(unknown))}: choose from {', '.join(files)}")
    failed = [name for name in chosen or files if not is_written(files[name])]
    return 1 if failed else 0


def is_written(file: Path) -> bool:
    """Run the command of a file and write its output there; return False if it fails."""
    command, where = command_of(file), machine()
    arguments = [sys.executable, *shlex.split(command)]
    done = subprocess.run(
        arguments, cwd=ROOT, check=False, stdout=subprocess.PIPE, encoding="utf-8"
    )
    if done.returncode:
        failure = f"{command}: exit status {done.returncode}"
        print(f"{file.stem} stays as it is: {failure}", file=sys.stderr)
        return False
    text = f"$ python {command}\n{date.today()}, {where}\n\n{done.stdout.rstrip()}\n"
    file.write_text(text, encoding="utf-8")
    return True


def command_of(file: Path) -> str:
    """The command in the first line of a file, without `$ python `."""
    return file.read_text(encoding="utf-8").partition("\n")[0].removeprefix("$ python ")


def machine() -> str:
    """Processor of this machine, with the number of cores and the load."""
    file = Path("/proc/cpuinfo")
    facts = file.read_text(encoding="utf-8") if file.is_file() else ""
    listed = re.search(r"^model name\s*: (.+)$", facts, re.MULTILINE)
    processor = listed[1] if listed else platform.machine()
    load = f", load {os.getloadavg()[0]:.0f}" if hasattr(os, "getloadavg") else ""
    return f"{processor}, {os.cpu_count()} cores{load}"


#: Functions by name.
PAGES: Mapping[str, Callable[..., int | None]] = {
    function.__name__: function
    for function in (
        accuracy,
        noise,
        seeds,
        guidance,
        remus,
        bluerov,
        networks,
        gains,
        roundings,
        consistency,
        studies,
        benchmark,
        benchmarks,
    )
}


def main() -> int:
    """Print the numbers of a page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page", choices=PAGES)
    parser.add_argument(
        "what", nargs="*",
        help="seeds: scenarios; roundings: studies; studies: folders; benchmark: a folder; "
        "benchmarks: files; default: all",
    )  # fmt: skip
    parser.add_argument(
        "--runs",
        type=int,
        metavar="N",
        help="seeds, roundings, benchmark: runs; gains: searches of each",
    )
    parser.add_argument(
        "--engine", choices=(BATCH, GPU), help=f"gains: what makes the runs; default: {BATCH}"
    )
    parser.add_argument(
        "--population", type=int, metavar="N",
        help=f"gains: candidates of a generation; default: {CANDIDATES} for each gain",
    )  # fmt: skip
    options = parser.parse_args()
    given = {"n": options.runs, "engine": options.engine, "population": options.population}
    given = {name: value for name, value in given.items() if value is not None}
    return PAGES[options.page](*options.what, **given) or 0


if __name__ == "__main__":
    sys.exit(main())
