"""How the printed numbers move with what the paper leaves open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial, reduce
from itertools import product
from typing import NamedTuple

import numpy as np

from auv_fmu.euler import STEP
from orchestrator.paper.choices import (
    END_TIMES,
    FORMULAS,
    OF_READING,
    OF_RUNS,
    ORDERS_OF_EFFORTS,
    PD,
    PROPOSED,
    Choice,
    options_of,
)
from orchestrator.paper.measures import (
    EFFORT_PD,
    EFFORT_PROPOSED,
    FINAL_ERROR_PD,
    FINAL_ERROR_PROPOSED,
    Approach,
    sum_without_step,
)
from orchestrator.vehicle.indices import REACHED

#: What is printed, by scenario: three efforts and three errors.
PUBLISHED = {
    PROPOSED: np.array([*EFFORT_PROPOSED, *FINAL_ERROR_PROPOSED]),
    PD: np.array([*EFFORT_PD, *FINAL_ERROR_PD]),
}

#: Where u, q and r stand, by ORDERS_OF_EFFORTS.
_ORDERED = ([0, 1, 2], [0, 2, 1])

_T_F = np.array(END_TIMES)[:, np.newaxis]

#: What is printed, of L2 norms with an axis for END_TIMES before the three; by FORMULAS.
_TABULATED = (
    lambda l2: l2,
    partial(sum_without_step, duration=_T_F, h=STEP),
    lambda l2: l2**2 / _T_F,
)

#: How far a start is moved along each axis, at most [m].
FARTHEST = 1e-6

#: Numbers of the starts that variants of five degrees of freedom are compared by, and of others
#: from which every variant is made that is printed.
SEARCHED, SHOWN = range(31), range(31, 131)

#: Of each number over the starts.
QUANTILES = (0.1, 0.5, 0.9)

#: Bands that are wider, in parts of the number, are printed.
SAME = 0.01


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


class Bounds(NamedTuple):
    """Smallest and largest of six numbers."""

    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Sensitivity:
    """The printed numbers of all variants.

    Attributes:
        numbers: by scenario, with L2 norms for efforts; an axis for each of `of_runs`, then for
            SIGNALS, END_TIMES and the six. A choice that a scenario has not has one element, and a
            run that has failed has NaN.
        approaches: to the reference, by scenario; an axis for each of `of_runs`, then the two
            numbers of :class:`.Approach`, which are NaN for a run that has not come there.
        of_runs: choices that the runs depend on.

    """

    numbers: Mapping[str, np.ndarray]
    approaches: Mapping[str, np.ndarray]
    of_runs: Sequence[Choice] = OF_RUNS

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
            taken = self._arrived(scenario)
            taken = np.logical_and(taken, self._consistent(scenario))
            efforts = as_read(numbers, 0, formula)[..., :3]
            away = np.abs(efforts / PUBLISHED[scenario][:3] - 1.0).max(axis=-1)
            farthest.append(np.where(taken, away, np.inf))
        return float(np.maximum(*farthest).min())

    def _arrived(self, scenario: str) -> np.ndarray:
        """What has come to the reference by its end, with axes for SIGNALS and END_TIMES last."""
        return np.asarray((self.numbers[scenario][..., 3:] <= REACHED).all(axis=-1))

    def _consistent(self, scenario: str) -> np.ndarray:
        """What contradicts nothing that is printed, with axes as :meth:`_arrived` has them."""
        return contradicts_nothing(scenario, (*self.of_runs, _SIGNALS, _T_FS))

    def span(self, scenario: str, consistent: bool, formula: int | None = None) -> Bounds:
        """Over what has come to the reference by its end.

        Args:
            scenario: of the numbers.
            consistent: of variants that contradict nothing that is printed; else of all.
            formula: of the efforts, by FORMULAS; None: all.

        """
        numbers, taken = self.numbers[scenario], self._arrived(scenario)
        if consistent:
            taken = np.logical_and(taken, self._consistent(scenario))
        sixes = (
            as_read(numbers, *reading)[taken]
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

    def _scores(self, consistent: bool) -> np.ndarray:
        if not consistent:
            return self.scores
        return np.where(contradicts_nothing(PROPOSED, self.choices), self.scores, np.inf)

    def variant(self, options: tuple[int, ...]) -> Variant:
        """What a combination of options gives."""
        of_runs, rest = options[: len(self.of_runs)], options[len(self.of_runs) :]
        sixes = {}
        for scenario, numbers in self.numbers.items():
            sizes = numbers.shape[: len(of_runs)]
            sixes[scenario] = _six(numbers[tuple(np.minimum(of_runs, np.subtract(sizes, 1)))], rest)
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


#: Orders and formulas of the efforts, by their numbers.
_READINGS = tuple(product(range(len(ORDERS_OF_EFFORTS)), range(len(FORMULAS))))

_SIGNALS, *_, _T_FS = OF_READING


def as_read(numbers: np.ndarray, order: int, formula: int) -> np.ndarray:
    """Six numbers as printed, of some with L2 norms; axes for END_TIMES and the six come last."""
    efforts = _TABULATED[formula](numbers[..., _ORDERED[order]])
    return np.concatenate((efforts, numbers[..., 3:]), axis=-1)


def _six(numbers: np.ndarray, reading: Sequence[int]) -> np.ndarray:
    """The six of a reading, of axes for SIGNALS, END_TIMES and the six, which come last."""
    signal, order, formula, end = reading
    six: np.ndarray = as_read(numbers[..., signal, :, :], order, formula)[..., end, :]
    return six


def _distance(six: np.ndarray, published: np.ndarray) -> np.ndarray:
    """Sum of |ln(ours / printed)| over six numbers."""
    distance: np.ndarray = np.abs(np.log(six / published)).sum(axis=-1)
    return distance


def contradicts_nothing(scenario: str, choices: Sequence[Choice]) -> np.ndarray:
    """Whether a combination of options contradicts nothing that is printed, an axis a choice."""
    flags = [[not option.against for option in options_of(each, scenario)] for each in choices]
    found: np.ndarray = reduce(np.logical_and, np.meshgrid(*flags, indexing="ij", sparse=True))
    return found
