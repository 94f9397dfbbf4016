"""The printed table of section 4.2 against every reading: the numbers of docs/explanation/table.md.

`python tools/printed_table.py` makes the runs of all combinations of CHOICES with the batch engine,
reads each at every T_f of END_TIMES in every way of READINGS, and prints the tables of the page in
Markdown, with the numbers of its text. It takes some minutes, and 2 GB.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from auv_fmu.paper.disturbance import Disturbance
from auv_fmu.paper.euler import STEP
from auv_fmu.paper.motion_planner import TAU_D
from auv_fmu.paper.vehicle import Vehicle
from orchestrator.cosim import Order, Table
from orchestrator.machine.workers import Workers, workers
from orchestrator.paper.claims import (
    EFFORT_PD,
    EFFORT_PROPOSED,
    FINAL_ERROR_PD,
    FINAL_ERROR_PROPOSED,
    Approach,
    approach_of,
    errors,
)
from orchestrator.paper.page import numbers, table
from orchestrator.runs.preparation import load_scenario
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.columns import Point
from orchestrator.vehicle.index.final_error import LAST
from orchestrator.vehicle.index.tracking import REACHED
from orchestrator.vehicle.signals import ACTUATORS, AXES, STANDARD, applied

#: The scenarios, and the twelve printed numbers: of each three efforts and three errors.
SCENARIOS = ("fig5", "fig5-pd")
PRINTED = np.array([*EFFORT_PROPOSED, *FINAL_ERROR_PROPOSED, *EFFORT_PD, *FINAL_ERROR_PD])
SIX = {name: slice(6 * i, 6 * i + 6) for i, name in enumerate(SCENARIOS)}
TITLES = [
    f"{controller} {part}"
    for controller in ("proposed", "PD")
    for part in (*(f"effort {k}" for k in ACTUATORS), *(f"e_f {k} [m]" for k in AXES))
]
END_TIMES = np.arange(20.0, 201.0)
#: Starts, moved by at most 1e-6 m, by which variants of five degrees of freedom are compared, and
#: others that are shown, with these quantiles; and a band that is narrower, relatively, is not.
SEARCHED, SHOWN, QUANTILES, MOVED, SAME = range(31), range(31, 131), (0.1, 0.5, 0.9), 1e-6, 0.01
#: Tolerances, relative to a printed number.
TOLERANCES = (0.1, 0.25, 0.5)


class Option(NamedTuple):
    """One option of an open point, and the printed statement that it contradicts."""

    text: str
    parameters: Mapping[str, Any] = {}  # never changed
    against: str = ""
    order: Order | None = None


_WAVES, _SIGN = Disturbance(), "(2): the sign of tau_w"
_FORWARD, _BACKWARD = {"disturbance.A_f": -_WAVES.A_f}, {"disturbance.A_d": -_WAVES.A_d}
Choices = Mapping[str, Sequence[Option]]

#: Choices for runs; the scenarios have the first option of each.
CHOICES: Choices = {
    "eps_t of the proposed controller": [
        Option("10, as for PD"), Option("1, as for Fig. 4", {"controller.eps_t": 1.0}),
    ],
    "observer": [
        Option("(51)"), Option("(24), integral from zero", {"controller.observer": "integral"}),
    ],
    "start": [
        Option("(2, 6, 0), the reference at z = -30 m"),
        Option("the origin", {"plant.eta0.x": 0.0, "plant.eta0.y": 0.0}, "4.1: (2, 6, 0)"),
        Option("the reference at z = +30 m", {"planner.eta0.z": 30.0}, "4.2: z_d(0) = -30"),
    ],
    "noise": [
        Option("none"), Option("1 mm", {"plant.noise.std": 1e-3}),
        Option("1 cm", {"plant.noise.std": 1e-2}, "Fig. 4: no saturation"),
    ],
    "Jacobian": [
        Option("of the full attitude"),
        Option(
            "(11) as printed", {"controller.printed_jacobian": True}, "Fig. 5: feasible commands"
        ),
    ],
    "vehicle": [
        Option("six degrees of freedom, righting moment in roll 5 N·m"),
        Option("six, no righting moment in roll", {"plant.righting.roll": 0.0}),
    ],
    "plant": [
        Option("Euler's scheme"),
        Option("fourth-order Runge-Kutta", {"plant.integrator": "rk4"}, "4.1: Euler, 20 ms"),
    ],
    "disturbance": [
        Option("tau_w as in (2)"), Option("-tau_w", {**_FORWARD, **_BACKWARD}, _SIGN),
        Option("friction reversed", _FORWARD, _SIGN), Option("waves reversed", _BACKWARD, _SIGN),
    ],
    "theta_hat(0)": [
        Option("0"),
        Option("1, and theta_0", {f"controller.theta_0[{i}]": 1.0 for i in range(1, 5)},
               "4.1: theta_0 = 0"),
    ],
    "order": [Option("everything at t_k"), Option("Jacobi, 20 ms late", order="jacobi")],
    "reference at t = 0": [
        Option("at rest"),
        Option("in motion, at tau_ud / d11", {"planner.nu0.u": TAU_D[0] / Vehicle().d11}),
    ],
}  # fmt: skip
OF_PROPOSED = ("eps_t of the proposed controller", "observer")
#: The vehicle of (1) and (2). From 30 m away it passes the pole of (1), and is chaotic.
FIVE = Option("five degrees of freedom", {"plant.roll": False}, "4.1: 6-DOF")
#: Choices for the evaluation of a run, apart from T_f: the signal, and its reading.
SIGNALS = [Option("applied"), Option("commanded")]
ORDERS = [
    Option("(u, q, r)"), Option("(u, r, q)", against="below (6): tau_a = (tau_u, tau_q, tau_r)"),
]  # fmt: skip
FORMULAS = [
    Option("L2 norm, (59) without 1/T_f"), Option("(59) as a sum over steps, without the step"),
    Option("mean square, (59) without the root"),
]  # fmt: skip
READINGS = [*product(range(2), range(3))]


def six_of(made: Table) -> np.ndarray:
    """L2 norms and e_f of a run, with axes for SIGNALS and END_TIMES before them."""
    if made.time[-1] < END_TIMES[-1] - STEP:
        return np.full((2, len(END_TIMES), 6), np.nan)
    # Half a step is more than the rounding errors of times.
    ends = np.searchsorted(made.time, END_TIMES - 0.5 * STEP)
    begins = np.searchsorted(made.time, made.time[ends] - LAST)
    error, h = np.abs(errors(made)), np.diff(made.time)[:, np.newaxis]
    final = np.stack([error[i : k + 1].max(axis=0) for i, k in zip(begins, ends, strict=True)])
    signals = applied(made), made.step_values(*STANDARD.commanded)
    efforts = (np.sqrt(np.cumsum(signal**2 * h, axis=0)[ends - 1]) for signal in signals)
    return np.stack([np.hstack((effort, final)) for effort in efforts])


def as_read(twelve: np.ndarray, order: int, formula: int) -> np.ndarray:
    """Twelve numbers as they would be printed; an axis for END_TIMES comes before them."""
    places = [0, 1, 2, 6, 7, 8], [0, 2, 1, 6, 8, 7]
    l2, duration, read = twelve[..., places[order]], END_TIMES[:, np.newaxis], twelve.copy()
    read[..., places[0]] = (l2, l2 / np.sqrt(STEP * duration), l2**2 / duration)[formula]
    return read


def score(twelve: np.ndarray) -> np.ndarray:
    """Sum of |ln(ours / printed)|."""
    return np.asarray(np.abs(np.log(twelve / PRINTED)).sum(axis=-1))


def run_of(scenario: str, chosen: Mapping[str, Option]) -> Point:
    """The run with an option of each choice."""
    used = [
        option for name, option in chosen.items() if scenario == "fig5" or name not in OF_PROPOSED
    ]
    parameters = {name: value for option in used for name, value in option.parameters.items()}
    order = next((option.order for option in used if option.order), None)
    return Point(0, scenario, parameters, float(END_TIMES[-1]), STEP, order)


def quantiles(engine: BatchEngine, run: Point, starts: Sequence[int]) -> np.ndarray:
    """The six of a run from moved starts, with an axis for QUANTILES first."""
    names, found = [f"plant.eta0.{axis}" for axis in AXES], []
    start = np.array([engine.value(run, name) for name in names], float)
    for number in starts:
        away = start + np.random.default_rng(number).uniform(-MOVED, MOVED, len(AXES))
        moved = {**run.parameters, **dict(zip(names, away.tolist(), strict=True))}
        found.append(six_of(engine.table(run._replace(parameters=moved))))
    return np.asarray(np.quantile(found, QUANTILES, axis=0))


def medians(engine: BatchEngine, runs: Sequence[Point]) -> list[tuple[np.ndarray, None]]:
    """The six of runs that depend on the last bits; a task for a worker."""
    return [(quantiles(engine, run, SEARCHED)[1], None) for run in runs]


def single(engine: BatchEngine, runs: Sequence[Point]) -> list[tuple[np.ndarray, Approach | None]]:
    """The six of runs, and their approach to the reference; a task for a worker."""
    return [(six_of(made), approach_of(made)) for made in map(engine.table, runs)]


class Variants:
    """All combinations of some choices, with their numbers."""

    def __init__(self, crew: Workers, choices: Choices, task: Any, size: int) -> None:
        """Make the runs by a task, `size` at a time."""
        self.chosen = [dict(zip(choices, some, strict=True)) for some in product(*choices.values())]
        self.runs = [[run_of(name, chosen) for name in SCENARIOS] for chosen in self.chosen]
        points = list({str(run): run for pair in self.runs for run in pair}.values())
        blocks = {i: partial(task, points[i : i + size]) for i in range(0, len(points), size)}
        found = dict(crew.results(blocks, "block"))
        made = dict(
            zip(map(str, points), (outcome for i in blocks for outcome in found[i]), strict=True)
        )
        #: With axes for the combination, SIGNALS, END_TIMES, and the numbers.
        self.twelve = np.stack(
            [np.concatenate([made[str(run)][0] for run in pair], -1) for pair in self.runs]
        )
        self.flags = np.array([not any(o.against for o in c.values()) for c in self.chosen])
        self.ways = {
            name: [
                way
                for pair, flag in zip(self.runs, self.flags, strict=True)
                if flag and (way := made[str(pair[i])][1])
            ]
            for i, name in enumerate(SCENARIOS)
        }
        scores = np.stack([score(as_read(self.twelve, *reading)) for reading in READINGS], -1)
        #: With axes for the combination, SIGNALS, END_TIMES, and READINGS.
        self.scores = np.nan_to_num(scores, nan=np.inf)
        allowed = np.outer(self.flags, [not ORDERS[order].against for order, _ in READINGS])
        self.consistent = np.where(allowed[:, np.newaxis, np.newaxis], self.scores, np.inf)

    def arrived(self, name: str) -> np.ndarray:
        """Flags of consistent variants that have come to the reference by T_f."""
        arrived = (self.twelve[..., SIX[name]][..., 3:] <= REACHED).all(axis=-1)
        return np.asarray(arrived & self.flags[:, np.newaxis, np.newaxis])

    def span(self, name: str, formula: int) -> np.ndarray:
        """Least and largest six of consistent variants, by a formula."""
        read = as_read(self.twelve, 0, formula)[..., SIX[name]][self.arrived(name)]
        return np.array([read.min(axis=0), read.max(axis=0)])

    def near(self, tolerance: float) -> int:
        """Largest number of the twelve that are within a tolerance at once."""
        away = (np.abs(as_read(self.twelve, *reading) / PRINTED - 1.0) for reading in READINGS)
        return max(int((distances <= tolerance).sum(axis=-1).max()) for distances in away)

    def efforts_within(self, formula: int) -> float:
        """Least distance of all six efforts at once, over consistent variants that have arrived."""
        away = np.abs(as_read(self.twelve, 0, formula) / PRINTED - 1.0)
        farthest = away[..., [0, 1, 2, 6, 7, 8]].max(axis=-1)
        arrived = np.logical_and(*(self.arrived(name) for name in SCENARIOS))
        return float(farthest[arrived].min())


def digits(value: float) -> str:
    """Three digits, without an exponent for large efforts."""
    return f"{value:.3g}" if value < 1000.0 else f"{value:,.0f}"


def print_variants(crew: Workers, engine: BatchEngine, six: Variants, five: Variants) -> None:
    """Print our numbers, the nearest ones and the printed ones, and their options."""
    shown = {
        "ours": (six, (0, 0, int(np.flatnonzero(END_TIMES == 100.0)[0]), 0)),
        "nearest": (six, np.unravel_index(six.consistent.argmin(), six.scores.shape)),
        "nearest of all": (six, np.unravel_index(six.scores.argmin(), six.scores.shape)),
        "nearest of five": (five, np.unravel_index(five.consistent.argmin(), five.scores.shape)),
    }
    tasks = {
        (title, i): partial(quantiles, engine, held.runs[place[0]][i], SHOWN)
        for title, (held, place) in shown.items()
        for i in range(2)
    }
    made, columns = dict(crew.results(tasks, "variant")), []
    for title, (held, (i, signal, end, reading)) in shown.items():
        bands = np.concatenate([made[title, 0], made[title, 1]], axis=-1)
        low, values, high = as_read(bands, *READINGS[reading])[:, signal, end]
        is_band = (high - low > SAME * values).any()
        if not is_band:
            values = as_read(held.twelve[i], *READINGS[reading])[signal, end]
        columns.append([
            *(digits(x) + f" ({digits(a)} to {digits(b)})" * bool(is_band)
              for x, a, b in zip(values, low, high, strict=True)),
            f"{score(values):.2f}", f"{np.exp(score(values) / 12):.2f}",
        ])  # fmt: skip
        words = [
            f"{name}: {option.text}"
            for name, option in held.chosen[i].items()
            if option.parameters or option.order
        ]
        order, formula = READINGS[reading]
        words += [SIGNALS[signal].text, ORDERS[order].text, FORMULAS[formula].text]
        around = held.scores[i, signal, [max(end - 10, 0), min(end + 10, 180)], reading]
        print(f"{title}: {'; '.join(words)}; T_f = {END_TIMES[end]:g} s, the score 10 s before and "
              f"after {numbers(around)}")  # fmt: skip
    spans = np.concatenate([[six.span(n, f) for f in (0, 1)] for n in SCENARIOS], axis=-1)
    rows = []
    *lines, total, factor = zip(*columns, strict=True)
    for title, printed, cells, ends in zip(TITLES, PRINTED, lines, spans.T, strict=True):
        ranges = [
            f"{digits(low)} to {digits(high)}".join(["**" * (not low <= printed <= high)] * 2)
            for low, high in ends.T
        ]
        rows.append([title, f"{printed:g}", *cells, *ranges])
    rows += [["score", "", *total, "", ""], ["factor", "", *factor, "", ""]]
    heads = ["range, L2 norm", "range, sum without the step"]
    print(f"\n{table(['', 'printed', *shown, *heads], rows)}\n")


def print_rest(six: Variants, five: Variants) -> None:
    """Print numbers that are near at once, bounds from impulses, and the scores of all options."""
    for title, held in (("six", six), ("five", five)):
        print(
            f"{title} degrees of freedom, {held.scores.size:,} variants: at most "
            f"{numbers([held.near(tolerance) for tolerance in TOLERANCES])} of the twelve within "
            f"{numbers([100 * tolerance for tolerance in TOLERANCES])} %; all six efforts within "
            f"{numbers([100 * held.efforts_within(formula) for formula in (0, 1)])} %"
        )
    for name, ways in six.ways.items():
        printed = float(PRINTED[SIX[name]][0])
        ends = [
            f"{min(each):.4g} to {max(each):.4g}"
            for each in zip(*((*way, way.least_effort) for way in ways), strict=True)
        ]
        print(
            f"{name}: arrives after {ends[0]} s, with an impulse of {ends[1]} N·s and an L2 effort "
            f"of at least {ends[2]} N·√s; with {printed:g} it takes "
            f"{min(way.soonest(printed) for way in ways):.3g} s, and as a sum it is possible from "
            f"T_f = {min(way.contradicts_until(printed, STEP) for way in ways):.3g} s on"
        )
    rows = []

    def add(choice: str, option: Option, mask: Any) -> None:
        best = [float(scores[mask].min()) for scores in (six.consistent, six.scores)]
        rows.append(
            [choice, option.text, *(f"{x:.2f}" * bool(x < np.inf) for x in best), option.against]
        )

    for choice, some in CHOICES.items():
        for option in some:
            add(choice, option, np.array([chosen[choice] is option for chosen in six.chosen]))
        if choice == "vehicle":
            least = f"{five.consistent.min():.2f}, of medians"
            rows.append([choice, FIVE.text, "", least, FIVE.against])
    for i, option in enumerate(SIGNALS):
        add("efforts of the signal", option, (slice(None), i))
    for k, (choice, some) in enumerate({"order": ORDERS, "formula": FORMULAS}.items()):
        for i, option in enumerate(some):
            add(
                f"{choice} of the efforts", option, (..., [reading[k] == i for reading in READINGS])
            )
    for k, row in reversed([*enumerate(rows)][1:]):
        row[0] *= row[0] != rows[k - 1][0]
    print("\n" + table(["open", "option", "best score", "best of all", "contradicts"], rows))


def main() -> None:
    """Make all runs, and print."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    engine = BatchEngine({scenario: load_scenario(scenario)[1] for scenario in SCENARIOS})
    of_five = {
        name: [option for option in some if not option.against] for name, some in CHOICES.items()
    }
    of_five["vehicle"] = [FIVE._replace(against="")]
    with workers() as crew:
        six = Variants(crew, CHOICES, partial(single, engine), 16)
        five = Variants(crew, of_five, partial(medians, engine), 1)
        print_variants(crew, engine, six, five)
    print_rest(six, five)


if __name__ == "__main__":
    main()
