"""What noise of 1 mm does: the numbers of README, reproduction.md and the scenarios' remarks.

`python tools/noise_numbers.py` prints them in Markdown, each over many draws of the noise. A number
of a draw is given by its median, with what 5 and 95 % of the draws stay below. It takes some
minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from orchestrator.paper.measures import errors, total_variation_until

from orchestrator import load, simulate
from orchestrator.cosim.observers.table import Table
from orchestrator.paper.page import numbers, table
from orchestrator.runs.scenario import read_scenario
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import Point
from orchestrator.vehicle.indices import metrics_of
from orchestrator.vehicle.signals import ACTUATORS, AXES, STANDARD, limits

NOISE = "plant.noise.std"

#: The default of AuvPlant [m].
STD = 0.001

#: Draws of a run; of a long one; of one with events, which the FMUs make.
MANY, SOME, FEW = 1000, 30, 100

#: The figures of section 4 with a controller.
FIGURES = ("fig4", "fig5", "fig6", "fig7a", "fig7b", "fig7c", "fig5-pd", "fig6-pd")

#: What else is run by the equations.
OTHERS = ("path", "path-pd")

#: What is compared with the run without noise, and its parts.
INDICES = {"peak_command": ACTUATORS, "total_variation": ACTUATORS, "l2_effort": ACTUATORS}
INDICES |= {"final_error": AXES}

#: A reading of Fig. 5 (reading 7).
SHARP = {"controller.eps_t": 1.0}

FAULTS = ("fault-thruster", "fault-sensor", "current-step")


class Runs:
    """Runs by the equations."""

    def __init__(self) -> None:
        """Load them."""
        systems = {name: load(name) for name in (*FIGURES, *OTHERS)}
        self._stop_times = {name: read_scenario(name).stop_time or 0.0 for name in systems}
        self._engine = BatchEngine(systems)

    def table(
        self, name: str, seed: int, values: Mapping[str, Any], stop_time: float | None = None
    ) -> Table:
        """A draw with all rows."""
        noise = {NOISE: STD, "plant.noise.seed": seed}
        time = stop_time or self._stop_times[name]
        return self._engine.table(Point(0, name, {**noise, **values}, stop_time=time, step=0.02))

    def indices(
        self, name: str, n: int = MANY, values: Mapping[str, Any] | None = None
    ) -> dict[str, np.ndarray]:
        """Of draws with the seeds 1 to n, or of the run without noise if n is 0."""
        given = (
            [{NOISE: STD, "plant.noise.seed": seed} for seed in range(1, n + 1)]
            if n
            else [{NOISE: 0.0}]
        )
        points = (
            Point(0, name, {**(values or {}), **noise}, stop_time=self._stop_times[name], step=0.02)
            for noise in given
        )
        outcomes = [outcome.indices for outcome in self._engine.outcomes(points)]
        return {name: np.array([found[name] for found in outcomes]) for name in outcomes[0]}


def of_actuators(index: str, found: Mapping[str, np.ndarray]) -> np.ndarray:
    """An index of the draws, with a column for each actuator."""
    return np.column_stack([found[f"{index}.{k}"] for k in ACTUATORS])


def band(values: Iterable[float], digits: int = 3) -> str:
    """Median, and what 5 and 95 % stay below."""
    low, median, high = np.quantile(list(values), (0.05, 0.5, 0.95))
    return f"{median:,.{digits}g} ({low:,.{digits}g} to {high:,.{digits}g})"


def commands(runs: Runs) -> None:
    """Which figures keep within the limits of (3)."""
    rows = []
    for name, values in [*((name, {}) for name in FIGURES), ("fig5", SHARP)]:
        quiet, found = runs.indices(name, 0, values), runs.indices(name, MANY, values)
        peaks, shares = (of_actuators(k, found) for k in ("peak_command", "saturated_fraction"))
        rows.append(
            [
                f"`{name}`" + (", eps_t = 1" if values else ""),
                numbers(of_actuators("peak_command", quiet)[0].tolist()),
                numbers(100 * of_actuators("saturated_fraction", quiet)[0]),
                *(band(column) for column in peaks.T),
                numbers(peaks.max(axis=0).tolist()),
                f"{100 * np.mean(shares.max(axis=1) > 0.0):.3g} %",
                numbers(100 * shares.max(axis=0)),
            ]
        )
    head = ["", "peaks without noise", "% of steps", *(f"peak {k}" for k in ACTUATORS)]
    show([*head, "largest", "draws beyond a limit", "% of steps, at most"], rows)


def roughness(runs: Runs) -> None:
    """Total variation of both controllers, and efforts and errors."""
    rows = []
    for name in ("fig4", "fig5", "fig5-pd", *OTHERS):
        quiet, found = runs.indices(name, 0), runs.indices(name)
        for index, parts in INDICES.items():
            for column in (f"{index}.{k}" for k in parts):
                cells = f"{quiet[column][0]:.4g}", band(found[column], 4)
                rows.append([f"`{name}`", column, *cells])
    show(["", "index", "without noise", "with it"], rows)
    rows = []
    for name, until in (("fig5", 100.0), ("fig6", 60.0), ("fig6", 200.0)):
        for values, n, said in (({NOISE: 0.0}, 1, "none"), ({}, SOME, "1 mm")):
            ratios = np.array(
                [
                    np.divide(
                        *(
                            total_variation_until(runs.table(one, seed, values), until)
                            for one in (f"{name}-pd", name)
                        )
                    )
                    for seed in range(1, n + 1)
                ]
            )
            rows.append([f"`{name}`, {until:g} s", said, *(band(column) for column in ratios.T)])
    show(["TV, PD over proposed", "noise", *ACTUATORS], rows)


def later(runs: Runs) -> None:
    """How long noise takes to drive commands beyond the limits."""
    rows = []
    for name, values, stop_time in (
        ("fig4", {}, 1000.0),
        ("fig4", {"controller.eps_t": 10.0}, 1000.0),
        ("fig5", {}, 1000.0),
        ("fig6", {}, 1000.0),
        ("fig4", {"controller.k_d": 20.0}, 1000.0),
    ):
        firsts: list[float] = []
        shares: list[list[float]] = []
        peaks: list[float] = []
        estimates: list[float] = []
        for seed in range(1, SOME + 1):
            made = runs.table(name, seed, values, stop_time)
            commands, time = np.abs(made.step_values(*STANDARD.commanded)), made.step_start
            beyond = (commands > limits(made)[1]).any(axis=1)
            firsts.append(time[beyond.argmax()] if beyond.any() else np.inf)
            shares.append(
                [100.0 * beyond[time <= until].mean() for until in (200.0, 500.0, stop_time)]
            )
            peaks.append(commands[:, 0].max())
            estimates.append(made.step_values(STANDARD.theta_hat[0])[-1, 0])
        rows.append(
            [
                f"`{name}` {values}",
                f"{np.median(firsts):.4g} ({min(firsts):.4g} to {max(firsts):.4g})",
                *(band(column) for column in np.transpose(shares)),
                band(peaks),
                band(estimates),
            ]
        )
    until = [f"% of steps until {time} s" for time in (200, 500, 1000)]
    show(["", "first beyond a limit [s]", *until, "peak u", "theta_hat_1"], rows)


def distance_of(made: Table) -> np.ndarray:
    """|e| of all rows [m]."""
    length: np.ndarray = np.linalg.norm(errors(made), axis=1)
    return length


def largest(made: Table, start: float, stop: float) -> float:
    """Largest |e| between two times [m]."""
    return float(distance_of(made)[(made.time >= start) & (made.time <= stop)].max())


def recovered(made: Table, start: float, within: float) -> float:
    """Time from which |e| stays within a distance [m], after another time [s]."""
    outside = made.time[distance_of(made) > within]
    return float(outside[-1] - start)


def when_largest(made: Table, start: float) -> float:
    """Time from another one to the largest |e| after it [s]."""
    after = made.time >= start
    return float(made.time[after][distance_of(made)[after].argmax()] - start)


def faults() -> None:
    """Scenarios with events."""
    measures: Mapping[str, Callable[[Table], float]] = {
        "peak of tau_u [N]": lambda made: metrics_of(made).found()["peak_command"][0],
        "peak of tau_u from 60 s on": lambda made: np.abs(
            made.step_values("controller.tau.u")[made.step_start >= 60.0]
        ).max(),
        "largest |e| from 30 to 50 s [m]": partial(largest, start=30.0, stop=50.0),
        "largest |e| from 50 s on": partial(largest, start=50.0, stop=100.0),
        "when [s after 50]": partial(when_largest, start=50.0),
        "within 0.5 m [s after 55]": partial(recovered, start=55.0, within=0.5),
        "within 0.5 m [s after 60]": partial(recovered, start=60.0, within=0.5),
        "largest |e| in the last 5 s": partial(largest, start=95.0, stop=100.0),
    }
    for name in FAULTS:
        scenario = read_scenario(name)
        of = {str(target): value for target, value in scenario.parameters.items()}
        made = {
            "proposed": [simulate(name, {"plant.noise.seed": i}) for i in range(1, FEW + 1)],
            "PD": [
                simulate("fig5-pd", {**of, "plant.noise.seed": i}, events=scenario.events)
                for i in range(1, FEW + 1)
            ],
        }
        rows = [
            [text, *(band(map(measure, draws)) for draws in made.values())]
            for text, measure in measures.items()
        ]
        show([f"`{name}`", *made], rows)


def show(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table in Markdown."""
    print(f"\n{table(head, rows)}", flush=True)


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    made = Runs()
    commands(made)
    roughness(made)
    later(made)
    faults()
