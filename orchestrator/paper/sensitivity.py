"""How the printed numbers move with what the paper leaves open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from typing import NamedTuple

import numpy as np

from orchestrator.paper.choices import OF_READING, OF_RUNS, PD, PROPOSED, Choice, options_of
from orchestrator.paper.measures import Way
from orchestrator.paper.published import (
    EFFORT_PD,
    EFFORT_PROPOSED,
    FINAL_ERROR_PD,
    FINAL_ERROR_PROPOSED,
)
from orchestrator.studies.engine import REACHED

#: What is printed, by scenario: three efforts and three errors.
PUBLISHED = {
    PROPOSED: np.array([*EFFORT_PROPOSED, *FINAL_ERROR_PROPOSED]),
    PD: np.array([*EFFORT_PD, *FINAL_ERROR_PD]),
}


class Variant(NamedTuple):
    """A combination of options and what it gives.

    Attributes:
        options: of each choice the index of one.
        score: sum of |ln(ours / printed)| over the twelve numbers.
        numbers: six by scenario.

    """

    options: tuple[int, ...]
    score: float
    numbers: Mapping[str, np.ndarray]

    @property
    def factor(self) -> float:
        """Between ours and printed, in the geometric mean."""
        return float(np.exp(self.score / sum(map(len, self.numbers.values()))))


class Range(NamedTuple):
    """Smallest and largest of six numbers."""

    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Sensitivity:
    """The printed numbers of all variants.

    Attributes:
        numbers: by scenario; an axis for each choice, then one for the six. A choice that a
            scenario has not has one element, and a run that has failed has NaN.
        ways: to the reference, by scenario; an axis for each of `of_runs`, then the two numbers of
            :class:`.Way`. Those of a run that has not come there are NaN.
        of_runs: choices that the runs depend on.

    """

    numbers: Mapping[str, np.ndarray]
    ways: Mapping[str, np.ndarray]
    of_runs: Sequence[Choice] = OF_RUNS

    @property
    def choices(self) -> tuple[Choice, ...]:
        """All choices; the end time is the last."""
        return (*self.of_runs, *OF_READING)

    @cached_property
    def scores(self) -> np.ndarray:
        """Sum of |ln(ours / printed)|; infinite where a run has failed."""
        distances = (
            np.abs(np.log(numbers / PUBLISHED[scenario])).sum(axis=-1)
            for scenario, numbers in self.numbers.items()
        )
        scores: np.ndarray = np.nan_to_num(sum(distances), nan=np.inf)
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
        near = (
            (np.abs(numbers / PUBLISHED[scenario] - 1.0) <= tolerance).sum(axis=-1, dtype=np.int8)
            for scenario, numbers in self.numbers.items()
        )
        return int(sum(near).max())

    def span(self, scenario: str, consistent: bool) -> Range:
        """Over what has come to the reference by its end.

        Args:
            scenario: of the numbers.
            consistent: of variants that contradict nothing that is printed; else of all.

        """
        numbers = self.numbers[scenario]
        taken = (numbers[..., 3:] <= REACHED).all(axis=-1)
        if consistent:
            taken &= contradicts_nothing(scenario, self.choices)
        return Range(numbers[taken].min(axis=0), numbers[taken].max(axis=0))

    def ways_of(self, scenario: str) -> list[Way]:
        """The ways to the reference of the runs that contradict nothing that is printed."""
        ways = self.ways[scenario]
        taken = contradicts_nothing(scenario, self.of_runs) & ~np.isnan(ways[..., 0])
        return [Way(*way) for way in ways[taken].tolist()]

    def _scores(self, consistent: bool) -> np.ndarray:
        if not consistent:
            return self.scores
        return np.where(contradicts_nothing(PROPOSED, self.choices), self.scores, np.inf)

    def variant(self, options: tuple[int, ...]) -> Variant:
        """What a combination of options gives."""
        six = {
            scenario: numbers[tuple(np.minimum(options, np.subtract(numbers.shape[:-1], 1)))]
            for scenario, numbers in self.numbers.items()
        }
        return Variant(options, float(self.scores[options]), six)


def contradicts_nothing(scenario: str, choices: Sequence[Choice]) -> np.ndarray:
    """Whether a combination of options contradicts nothing that is printed, an axis a choice."""
    flags = [[not option.against for option in options_of(each, scenario)] for each in choices]
    found: np.ndarray = reduce(np.logical_and, np.meshgrid(*flags, indexing="ij", sparse=True))
    return found
