"""The table of the benchmark: statistics of the runs of each law, and their files."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from functools import cache
from math import isnan, nan, sqrt
from typing import Any, NamedTuple

import numpy as np

from orchestrator.benchmark.contest import TASK, Law, Vehicle, sensors_of
from orchestrator.benchmark.cost import costs, has_failed

#: Columns of a run that are kept.
COLUMNS = ("error", "largest", "effort", "saturated", "chatter")

#: Ends of the band of errors, and of intervals.
BAND, INTERVAL = (0.05, 0.95), (0.025, 0.975)

#: Samples of the bootstrap, and their seed; the quantile of the normal distribution for intervals.
_SAMPLES, _SEED, _Z = 1_000, 1, 1.959964

#: Stands for all vehicles, or all tasks.
ALL = "all"


class Runs(NamedTuple):
    """The runs of a law with a vehicle, of each task.

    Attributes:
        tasks: names.
        columns: by :data:`COLUMNS`, and `cost` and `failed`, as arrays (tasks, draws).

    """

    tasks: Sequence[str]
    columns: Mapping[str, np.ndarray]

    def of(self, task: str) -> Mapping[str, np.ndarray]:
        """Return the columns of a task, or of all tasks: arrays (tasks, draws)."""
        rows = slice(None) if task == ALL else [self.tasks.index(task)]
        return {name: column[rows] for name, column in self.columns.items()}


#: Runs by the names of laws and vehicles.
Made = Mapping[tuple[str, str], Runs]


class Line(NamedTuple):
    """Statistics of a law, over some vehicles and tasks.

    Attributes:
        law, vehicle, task: names, or :data:`ALL`.
        runs: number of runs.
        cost: geometric mean over vehicles of the mean cost, with the ends of its interval [m].
        error: median of the late error, with the ends of its band [m]; inf for refused runs.
        effort, chatter: medians [1, 1/s].
        saturated: mean share of saturated steps.
        failed: share of failed runs, with the ends of its interval.

    """

    law: str
    vehicle: str
    task: str
    runs: int
    cost: tuple[float, float, float]
    error: tuple[float, float, float]
    effort: float
    saturated: float
    chatter: float
    failed: tuple[float, float, float]


def runs_in(result: Mapping[str, np.ndarray], tasks: Sequence[str]) -> Runs:
    """Return the runs in the table of a study: each task has the same draws, in their order."""
    n = len(result[TASK]) // len(tasks)
    assert [*result[TASK][::n]] == [*tasks]
    columns = {name: result[name].reshape(len(tasks), n) for name in COLUMNS}
    return Runs(tasks, {**columns, "cost": costs(columns), "failed": has_failed(columns)})


def lines(made: Made, laws: Sequence[str], vehicles: Sequence[str], task: str) -> list[Line]:
    """Return a line for each law, the best first: over some vehicles, and one task or all."""
    every = [_line(made, law, vehicles, task) for law in laws]
    return sorted(every, key=lambda line: line.cost)


def _line(made: Made, law: str, vehicles: Sequence[str], task: str) -> Line:
    parts = [made[law, vehicle].of(task) for vehicle in vehicles]
    every = {name: np.concatenate([part[name].ravel() for part in parts]) for name in parts[0]}
    errors = np.nan_to_num(every["error"], nan=np.inf)
    n, is_made = len(errors), ~np.isnan(every["error"])
    effort, saturated, chatter = (
        float(mean(every[name][is_made])) if is_made.any() else nan
        for name, mean in (("effort", np.median), ("saturated", np.mean), ("chatter", np.median))
    )
    return Line(
        law,
        vehicles[0] if len(vehicles) == 1 else ALL,
        task,
        n,
        cost_of([part["cost"].mean(axis=0) for part in parts]),
        quantiles(errors),
        effort,
        saturated,
        chatter,
        share_of(int(every["failed"].sum()), n),
    )


def quantiles(errors: np.ndarray) -> tuple[float, float, float]:
    """Return the median and the ends of the band, each a value that occurs."""
    low, middle, high = np.quantile(errors, (BAND[0], 0.5, BAND[1]), method="inverted_cdf").tolist()
    return middle, low, high


def cost_of(draws: Sequence[np.ndarray]) -> tuple[float, float, float]:
    """Return the geometric mean of the mean costs, and its interval by the bootstrap.

    All laws have the same samples of draws, since these are the same for all.

    Args:
        draws: for each vehicle, the mean cost of the tasks with each draw.

    """
    sampled = np.zeros(_SAMPLES)
    for place, values in enumerate(draws):
        sampled += np.log(_weights(len(values), place) @ values)
    low, high = np.exp(np.quantile(sampled / len(draws), INTERVAL)).tolist()
    middle = float(np.exp(np.mean([np.log(values.mean()) for values in draws])))
    return middle, low, high


@cache
def _weights(n: int, place: int) -> np.ndarray:
    """Return the weights of n draws in each sample of the bootstrap, for the vehicle at a place."""
    generator = np.random.default_rng((_SEED, place))
    weights: np.ndarray = generator.multinomial(n, np.full(n, 1.0 / n), _SAMPLES) / n
    return weights


def share_of(count: int, n: int) -> tuple[float, float, float]:
    """Return a share, and its interval after Wilson (1927)."""
    p, z = count / n, _Z
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return p, max(0.0, middle - half), min(1.0, middle + half)


# Texts


def cells(made: Made, laws: Mapping[str, Law], vehicles: Mapping[str, Vehicle], task: str) -> Any:
    """Return the header and the rows of the table, as texts."""
    names = [*vehicles]
    header = [
        "law", "sensors", "cost [m]",
        *(f"error, {vehicle.scenario.label} [m]" for vehicle in vehicles.values()),
        "effort [%]", "saturated [%]", "chatter [%/s]", "failed [%]",
    ]  # fmt: skip
    rows = []
    for line in lines(made, [*laws], names, task):
        law = laws[line.law]
        errors = [_line(made, line.law, [name], task).error for name in names]
        rows.append(
            [
                law.label,
                ", ".join(sensors_of(law)),
                _band(line.cost),
                *map(_band, errors),
                *(
                    "-" if isnan(x) else f"{100 * x:.2g}" if abs(x) < 1.0 else f"{100 * x:.0f}"
                    for x in (line.effort, line.saturated, line.chatter)
                ),
                _band([100 * share for share in line.failed]),
            ]
        )
    return header, rows


def _band(values: Sequence[float]) -> str:
    middle, low, high = (f"{value:.2g}" if value < 100.0 else f"{value:.0f}" for value in values)
    return f"{middle} ({low} to {high})"


def as_text(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table with aligned columns."""
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (header, *rows)
    ]


def as_markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    every = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(row) + " |" for row in every)


def page(
    made: Made, laws: Mapping[str, Law], vehicles: Mapping[str, Vehicle], tasks: Sequence[str]
) -> str:
    """Return all tables in Markdown: of all tasks, and of each."""
    parts = ["# The table of controllers"]
    for task in (ALL, *tasks):
        title = "All tasks" if task == ALL else f"Task `{task}`"
        parts += [f"## {title}", as_markdown(*cells(made, laws, vehicles, task))]
    return "\n\n".join(parts) + "\n"


def as_csv(
    made: Made, laws: Mapping[str, Law], vehicles: Sequence[str], tasks: Sequence[str]
) -> str:
    """Return all statistics: of each law, with each vehicle and task and with all."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    ends = ("", "_low", "_high")
    writer.writerow(
        [
            "law", "vehicle", "task", "sensors", "runs",
            *(f"cost{end}" for end in ends), *(f"error{end}" for end in ends),
            "effort", "saturated", "chatter", *(f"failed{end}" for end in ends),
        ]
    )  # fmt: skip
    for some in ([*vehicles], *([vehicle] for vehicle in vehicles if len(vehicles) > 1)):
        for task in (ALL, *tasks):
            for line in lines(made, [*laws], some, task):
                writer.writerow(
                    [
                        line.law, line.vehicle, line.task, " ".join(sensors_of(laws[line.law])),
                        line.runs, *line.cost, *line.error, line.effort, line.saturated,
                        line.chatter, *line.failed,
                    ]
                )  # fmt: skip
    return text.getvalue()
