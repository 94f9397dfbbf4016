"""All variants of the printed table: their runs, and how its numbers move with what is open."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from orchestrator.machine.workers import Workers
from orchestrator.paper.choices import (
    END_TIMES,
    FORMULAS,
    OF_READING,
    OF_RUNS,
    OF_RUNS_OF_FIVE,
    ORDERS_OF_EFFORTS,
    PROPOSED,
    PUBLISHED,
    Choice,
    as_read,
    choice_options,
    contradicts_nothing,
    run_of,
    runs,
)
from orchestrator.paper.measures import Approach, approach_of, numbers_of
from orchestrator.runs.loading import load_scenario
from orchestrator.studies.batch_engine import BatchEngine
from orchestrator.studies.engine import Point
from orchestrator.studies.sweep import check_installed
from orchestrator.vehicle.index.tracking import REACHED
from orchestrator.vehicle.signals import AXES

#: How far a start is moved along each axis, at most [m].
FARTHEST_START = 1e-6

#: Numbers of the starts that variants of five degrees of freedom are compared by, and of others
#: from which every variant is made that is printed.
SEARCHED, SHOWN = range(31), range(31, 131)

#: Of each number over the starts.
QUANTILES = (0.1, 0.5, 0.9)

#: Bands that are wider, in parts of the number, are printed.
SAME = 0.01

#: Orders and formulas of the efforts, by their numbers.
_READINGS = tuple(product(range(len(ORDERS_OF_EFFORTS)), range(len(FORMULAS))))

_SIGNALS, *_, _T_FS = OF_READING

#: Runs that a worker makes at a time.
_BLOCK = 16


class Bounds(NamedTuple):
    """Smallest and largest of six numbers."""

    low: np.ndarray
    high: np.ndarray


class Variant(NamedTuple):
    """A combination of options and what it gives.

    Attributes:
        options: of each choice the index of one.
        score: sum of |ln(ours / printed)| over the twelve numbers.
        numbers: six by scenario.
        bands: of these, by scenario, where they depend on the last bits of the start; the numbers
            are medians then.

    """

    options: tuple[int, ...]
    score: float
    numbers: Mapping[str, np.ndarray]
    bands: Mapping[str, Bounds] | None = None

    @property
    def factor(self) -> float:
        """Between ours and printed, in the geometric mean."""
        return float(np.exp(self.score / sum(map(len, self.numbers.values()))))


@dataclass(frozen=True)
class Sensitivity:
    """The printed numbers of all variants.

    Attributes:
        numbers: by scenario, with L2 norms for efforts; an axis for each of `of_runs`, then for
            SIGNALS, END_TIMES and the six. A choice that a scenario has not has one element, and a
            run that has failed has NaN.
        of_runs: choices that the runs depend on.
        approaches: to the reference, by scenario; an axis for each of `of_runs`, then the two
            numbers of :class:`.Approach`, which are NaN for a run that has not come there.

    """

    numbers: Mapping[str, np.ndarray]
    of_runs: Sequence[Choice]
    approaches: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def choices(self) -> tuple[Choice, ...]:
        """All choices; the end time is the last."""
        return (*self.of_runs, *OF_READING)

    @cached_property
    def scores(self) -> np.ndarray:
        """Sum of |ln(ours / printed)|, an axis a choice; infinite where a run has failed."""
        readings = [
            sum(
                _distance(as_read(numbers, *reading), PUBLISHED[scenario])
                for scenario, numbers in self.numbers.items()
            )
            for reading in _READINGS
        ]
        together = np.nan_to_num(np.stack(readings, axis=-2), nan=np.inf)
        shape = (len(ORDERS_OF_EFFORTS), len(FORMULAS), len(END_TIMES))
        scores: np.ndarray = together.reshape(*together.shape[:-2], *shape)
        return scores

    def _scores(self, consistent: bool) -> np.ndarray:
        if not consistent:
            return self.scores
        return np.where(contradicts_nothing(PROPOSED, self.choices), self.scores, np.inf)

    @property
    def ours(self) -> Variant:
        """The variant that the scenarios have."""
        return self.variant(tuple(choice.ours for choice in self.choices))

    def nearest(self, consistent: bool) -> Variant:
        """The variant whose score is least.

        Args:
            consistent: among those that contradict nothing that is printed; else among all.

        """
        scores = self._scores(consistent)
        best = np.unravel_index(int(scores.argmin()), scores.shape)
        return self.variant(tuple(map(int, best)))

    def best_with_each(self, axis: int, consistent: bool) -> np.ndarray:
        """The least score with each option of a choice, of variants as :meth:`nearest` takes them.

        It is infinite where there is none.
        """
        others = tuple(other for other in range(len(self.choices)) if other != axis)
        best: np.ndarray = self._scores(consistent).min(axis=others)
        return best

    def most_within(self, tolerance: float) -> int:
        """How many of the twelve are at once no farther from the printed ones, at most."""
        return max(
            int(
                sum(
                    (
                        np.abs(as_read(numbers, *reading) / PUBLISHED[scenario] - 1.0) <= tolerance
                    ).sum(axis=-1, dtype=np.int8)
                    for scenario, numbers in self.numbers.items()
                ).max()
            )
            for reading in _READINGS
        )

    def efforts_within(self, formula: int) -> float:
        """How near all six efforts are at once, in parts of the printed ones: the farthest of them.

        At best, of what contradicts nothing that is printed and has come to the reference.
        """
        farthest = []
        for scenario, numbers in self.numbers.items():
            efforts = as_read(numbers, 0, formula)[..., :3]
            away = np.abs(efforts / PUBLISHED[scenario][:3] - 1.0).max(axis=-1)
            farthest.append(np.where(self._arrived(scenario, consistent=True), away, np.inf))
        return float(np.maximum(*farthest).min())

    def _arrived(self, scenario: str, consistent: bool) -> np.ndarray:
        """What has come to the reference by its end, with axes for SIGNALS and END_TIMES last."""
        arrived = np.asarray((self.numbers[scenario][..., 3:] <= REACHED).all(axis=-1))
        if consistent:
            arrived &= contradicts_nothing(scenario, (*self.of_runs, _SIGNALS, _T_FS))
        return arrived

    def span(self, scenario: str, consistent: bool, formula: int | None = None) -> Bounds:
        """Over what has come to the reference by its end.

        Args:
            scenario: of the numbers.
            consistent: of variants that contradict nothing that is printed; else of all.
            formula: of the efforts, by FORMULAS; None: all.

        """
        arrived = self._arrived(scenario, consistent)
        sixes = (
            as_read(self.numbers[scenario], *reading)[arrived]
            for reading in _READINGS
            if formula in (None, reading[1])
            and not (consistent and ORDERS_OF_EFFORTS[reading[0]].against)
        )
        lows, highs = zip(*((six.min(axis=0), six.max(axis=0)) for six in sixes), strict=True)
        return Bounds(np.min(lows, axis=0), np.max(highs, axis=0))

    def ways_of(self, scenario: str) -> list[Approach]:
        """The ways to the reference of the runs that contradict nothing that is printed."""
        approaches = self.approaches[scenario]
        taken = contradicts_nothing(scenario, self.of_runs) & ~np.isnan(approaches[..., 0])
        return [Approach(*way) for way in approaches[taken].tolist()]

    def variant(self, options: tuple[int, ...]) -> Variant:
        """What a combination of options gives."""
        n, sixes = len(self.of_runs), {}
        for scenario, numbers in self.numbers.items():
            of_run = np.minimum(options[:n], np.subtract(numbers.shape[:n], 1))
            sixes[scenario] = _six(numbers[tuple(of_run)], options[n:])
        return Variant(options, float(self.scores[options]), sixes)

    def over_starts(self, variant: Variant, quantiles: Mapping[str, np.ndarray]) -> Variant:
        """A variant with medians and bands, where its numbers depend on the start's last bits.

        Args:
            variant: of these.
            quantiles: the low, the median and the high of numbers as this class has them, over
                moved starts, by scenario.

        """
        found = {
            scenario: _six(three, variant.options[len(self.of_runs) :])
            for scenario, three in quantiles.items()
        }
        if all((high - low <= SAME * np.abs(median)).all() for low, median, high in found.values()):
            return variant
        medians = {scenario: median for scenario, (_, median, _) in found.items()}
        score = sum(_distance(six, PUBLISHED[scenario]) for scenario, six in medians.items())
        bands = {scenario: Bounds(low, high) for scenario, (low, _, high) in found.items()}
        return Variant(variant.options, float(score), medians, bands)


class Found(NamedTuple):
    """All variants, and the ones whose numbers are printed.

    Attributes:
        six: all with six degrees of freedom.
        five: those with five that contradict nothing else, by medians over moved starts.
        printed: what the scenarios have; the nearest of the six that contradicts nothing that is
            printed, the nearest of all of them, and the nearest of the five.

    """

    six: Sensitivity
    five: Sensitivity
    printed: tuple[Variant, ...]


def all_variants(
    crew: Workers,
    of_runs: Sequence[Choice] = OF_RUNS,
    of_five: Sequence[Choice] = OF_RUNS_OF_FIVE,
    searched: Sequence[int] = SEARCHED,
    shown: Sequence[int] = SHOWN,
) -> Found:
    """Make the runs of all combinations.

    Args:
        crew: that makes them.
        of_runs: choices that they depend on.
        of_five: the same with five degrees of freedom.
        searched: starts that those with five are searched with.
        shown: starts of the variants whose numbers are printed.

    Raises:
        InputError: a package is missing.
        KeyboardInterrupt: the user does not want to wait.

    """
    check_installed()
    engine = BatchEngine({scenario: load_scenario(scenario)[1] for scenario in PUBLISHED})
    made = _made(crew, of_runs, partial(_numbers_and_ways, engine), _BLOCK, "block of runs")
    numbers, ways = (
        {scenario: [each[i] for each in found] for scenario, found in made.items()} for i in (0, 1)
    )
    six = Sensitivity(_by_choice(numbers, of_runs), of_runs, _by_choice(ways, of_runs))
    medians = partial(_medians, engine, searched)
    made = _made(crew, of_five, medians, 1, "variant of five degrees of freedom")
    five = Sensitivity(_by_choice(made, of_five), of_five)
    nearest = (
        (six, six.ours),
        (six, six.nearest(consistent=True)),
        (six, six.nearest(consistent=False)),
        (five, five.nearest(consistent=True)),
    )
    tasks = {
        (i, scenario): partial(quantiles_of, engine, _run(found, variant, scenario), shown)
        for i, (found, variant) in enumerate(nearest)
        for scenario in PUBLISHED
    }
    taken = dict(crew.results(tasks, "variant"))
    printed = tuple(
        found.over_starts(variant, {scenario: taken[i, scenario] for scenario in PUBLISHED})
        for i, (found, variant) in enumerate(nearest)
    )
    return Found(six, five, printed)


def _made(
    crew: Workers,
    of_runs: Sequence[Choice],
    make: Callable[[Sequence[Point]], list[Any]],
    size: int,
    unit: str,
) -> dict[str, list[Any]]:
    """What workers make of all runs, of so many at a time, by scenario."""
    blocks = {
        (scenario, first): partial(make, found[first : first + size])
        for scenario in PUBLISHED
        for found in [list(runs(scenario, of_runs))]
        for first in range(0, len(found), size)
    }
    taken = dict(crew.results(blocks, unit))
    return {
        scenario: [one for block in blocks if block[0] == scenario for one in taken[block]]
        for scenario in PUBLISHED
    }


def _by_choice(
    made: Mapping[str, Sequence[Any]], of_runs: Sequence[Choice]
) -> dict[str, np.ndarray]:
    """With an axis for each choice in place of one for the runs."""
    return {
        scenario: np.reshape(
            found, (*(len(choice_options(each, scenario)) for each in of_runs), *np.shape(found[0]))
        )
        for scenario, found in made.items()
    }


def _run(found: Sensitivity, variant: Variant, scenario: str) -> Point:
    """The run of a variant in a scenario."""
    open_there = (choice_options(choice, scenario) for choice in found.of_runs)
    chosen = zip(open_there, variant.options, strict=False)
    return run_of(scenario, [options[min(i, len(options) - 1)] for options, i in chosen])


def _numbers_and_ways(
    engine: BatchEngine, block: Sequence[Point]
) -> list[tuple[np.ndarray, Sequence[float]]]:
    """Numbers and ways of some runs; a task for a worker.

    Of a run that has failed they are not numbers, nor is the way of one that has not arrived.
    """
    tables = map(engine.table, block)
    return [
        (numbers_of(table, END_TIMES), approach_of(table) or (np.nan, np.nan)) for table in tables
    ]


def _medians(
    engine: BatchEngine, starts: Sequence[int], block: Sequence[Point]
) -> list[np.ndarray]:
    """The numbers of some runs in the middle of those from moved starts; a task for a worker."""
    return [quantiles_of(engine, point, starts)[QUANTILES.index(0.5)] for point in block]


def quantiles_of(engine: BatchEngine, point: Point, starts: Sequence[int]) -> np.ndarray:
    """The numbers of a run from moved starts, an axis for QUANTILES first; a task for a worker."""
    found = [numbers_of(engine.table(each), END_TIMES) for each in moved(engine, point, starts)]
    quantiles: np.ndarray = np.quantile(found, QUANTILES, axis=0)
    return quantiles


def moved(engine: BatchEngine, point: Point, starts: Sequence[int]) -> Iterator[Point]:
    """A run from starts that are moved by :data:`FARTHEST_START` at most, each by its number."""
    names = [f"plant.eta0.{axis}" for axis in AXES]
    start = np.array([engine.value(point, name) for name in names], float)
    for number in starts:
        away = np.random.default_rng(number).uniform(-FARTHEST_START, FARTHEST_START, len(AXES))
        values = zip(names, np.add(start, away).tolist(), strict=True)
        yield point._replace(parameters={**point.parameters, **dict(values)})


def _six(numbers: np.ndarray, reading: Sequence[int]) -> np.ndarray:
    """The six of a reading, of axes for SIGNALS, END_TIMES and the six, which come last."""
    signal, order, formula, end = reading
    six: np.ndarray = as_read(numbers[..., signal, :, :], order, formula)[..., end, :]
    return six


def _distance(six: np.ndarray, published: np.ndarray) -> np.ndarray:
    """Sum of |ln(ours / printed)| over six numbers."""
    distance: np.ndarray = np.abs(np.log(six / published)).sum(axis=-1)
    return distance
