"""Runs of a study and their outcomes: single ones, and many of them as columns of arrays."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from orchestrator.cosim import Order

#: Rows of columns: a slice, places, or a mask.
Rows: TypeAlias = slice | np.ndarray


class Point(NamedTuple):
    """One run of a study.

    Attributes:
        number: in the study, from 0.
        scenario: name or path.
        parameters: by `component.parameter`, without those of the scenario.
        stop_time, step: of the experiment [s].
        order: of evaluation.
        start_time: of the experiment [s].

    """

    number: int
    scenario: str
    parameters: Mapping[str, Any]
    stop_time: float
    step: float
    order: Order | None = None
    start_time: float = 0.0


class Case(NamedTuple):
    """Common properties of some runs.

    Attributes:
        scenario: name or path.
        parameters: those with the same value in all runs, by `component.parameter`.
        varied: names of the others.
        order: of evaluation.
        start_time: of the experiment [s].

    """

    scenario: str
    parameters: Mapping[str, Any]
    varied: Sequence[str] = ()
    order: Order | None = None
    start_time: float = 0.0


@dataclass(frozen=True, eq=False)
class Points:
    """Some runs of a study, as columns.

    Attributes:
        numbers: in the study, from 0.
        cases: common properties of some of them.
        case: the place of each run's case.
        values: what varies, by name, also in runs whose case has no such name.
        stop_time, step: of the experiments [s].

    """

    numbers: np.ndarray
    cases: Sequence[Case]
    case: np.ndarray
    values: Mapping[str, np.ndarray]
    stop_time: np.ndarray
    step: np.ndarray

    @classmethod
    def of(cls, points: Iterable[Point]) -> Points:
        """Return single runs, each of which is a case."""
        every = [*points]
        return cls(
            np.array([point.number for point in every], dtype=np.int64),
            [Case(run.scenario, run.parameters, (), run.order, run.start_time) for run in every],
            np.arange(len(every)),
            {},
            np.array([point.stop_time for point in every], dtype=float),
            np.array([point.step for point in every], dtype=float),
        )

    def __len__(self) -> int:
        """Return the number of runs."""
        return len(self.numbers)

    def __getitem__(self, rows: Rows) -> Points:
        """Return some of the runs."""
        return Points(
            self.numbers[rows],
            self.cases,
            self.case[rows],
            {name: column[rows] for name, column in self.values.items()},
            self.stop_time[rows],
            self.step[rows],
        )

    def __iter__(self) -> Iterator[Point]:
        """Iterate over single runs."""
        columns = self.numbers, self.case, self.stop_time, self.step, *self.values.values()
        rows = zip(*(column.tolist() for column in columns), strict=True)
        for number, place, stop_time, step, *values in rows:
            case, chosen = self.cases[place], dict(zip(self.values, values, strict=True))
            parameters = {**case.parameters, **{name: chosen[name] for name in case.varied}}
            yield Point(
                number, case.scenario, parameters, stop_time, step, case.order, case.start_time
            )

    @property
    def steps(self) -> np.ndarray:
        """Lengths of the runs in steps."""
        start_time = np.array([case.start_time for case in self.cases])[self.case]
        steps: np.ndarray = (self.stop_time - start_time) / self.step
        return steps


class Outcome(NamedTuple):
    """The outcome of a run.

    Attributes:
        number: of the run.
        indices: by their columns, :func:`.index_columns`; none if the run failed.
        failure: reason why the run ended early, or None.
        cautions: keys of :data:`.cautions.CAUTIONS` with commas between them, or None.

    """

    number: int
    indices: Mapping[str, float]
    failure: str | None = None
    cautions: str | None = None


class Texts(NamedTuple):
    """A column of texts, most of which are None.

    Attributes:
        codes: the place of each text among those that occur.
        known: these texts; the first is None.

    """

    codes: np.ndarray
    known: Sequence[str | None] = (None,)

    @classmethod
    def of(cls, texts: Sequence[str | None]) -> Texts:
        """Return the column of some texts."""
        places = _places(texts)
        codes = np.array([places[text] for text in texts], dtype=np.int32)
        return cls(codes, tuple(places))

    @classmethod
    def where(cls, mask: np.ndarray, text: str) -> Texts:
        """Return a text in the rows of a mask, and None in the others."""
        return cls(mask.astype(np.int32), (None, text))

    @classmethod
    def joined(cls, parts: Sequence[Texts]) -> Texts:
        """Return one column after the other."""
        places = _places(chain(*(part.known for part in parts)))
        codes = [
            np.array([places[text] for text in part.known], dtype=np.int32)[part.codes]
            for part in parts
        ]
        return cls(np.concatenate(codes), tuple(places))

    def rows(self, rows: Rows) -> Texts:
        """Return some of the texts."""
        return Texts(self.codes[rows], self.known)

    def has(self, text: str) -> np.ndarray:
        """Return a mask of the rows with a text."""
        mask: np.ndarray = self.codes == (self.known.index(text) if text in self.known else -1)
        return mask

    def each(self) -> list[str | None]:
        """Return all texts."""
        return [self.known[code] for code in self.codes.tolist()]


def _places(texts: Iterable[str | None]) -> dict[str | None, int]:
    """Return the places of texts among those that occur, after None."""
    return {text: place for place, text in enumerate(dict.fromkeys(chain([None], texts)))}


@dataclass(frozen=True, eq=False)
class Outcomes:
    """The outcomes of some runs, as columns.

    Attributes:
        numbers: of the runs.
        columns: names of the columns of indices.
        indices: an array (runs, columns); nan for missing ones.
        failures: reasons why runs ended early.
        cautions: kinds of cautions.

    """

    numbers: np.ndarray
    columns: Sequence[str]
    indices: np.ndarray
    failures: Texts
    cautions: Texts

    @classmethod
    def of(cls, outcomes: Iterable[Outcome]) -> Outcomes:
        """Return single outcomes as columns."""
        every = [*outcomes]
        columns = tuple(dict.fromkeys(chain(*(outcome.indices for outcome in every))))
        rows = [[outcome.indices.get(name, np.nan) for name in columns] for outcome in every]
        return cls(
            np.array([outcome.number for outcome in every], dtype=np.int64),
            columns,
            np.array(rows, dtype=float).reshape(len(every), len(columns)),
            Texts.of([outcome.failure for outcome in every]),
            Texts.of([outcome.cautions for outcome in every]),
        )

    @classmethod
    def joined(cls, parts: Sequence[Outcomes]) -> Outcomes:
        """Return the outcomes of several parts, one after the other."""
        if len(parts) == 1:
            return parts[0]
        columns = tuple(dict.fromkeys(chain(*(part.columns for part in parts))))
        return cls(
            np.concatenate([part.numbers for part in parts]),
            columns,
            np.concatenate([part.arranged(columns).indices for part in parts]),
            Texts.joined([part.failures for part in parts]),
            Texts.joined([part.cautions for part in parts]),
        )

    def __len__(self) -> int:
        """Return the number of runs."""
        return len(self.numbers)

    def __getitem__(self, rows: Rows) -> Outcomes:
        """Return the outcomes of some of the runs."""
        return Outcomes(
            self.numbers[rows],
            self.columns,
            self.indices[rows],
            self.failures.rows(rows),
            self.cautions.rows(rows),
        )

    def __iter__(self) -> Iterator[Outcome]:
        """Iterate over single outcomes, without missing indices."""
        columns = self.numbers.tolist(), self.indices, self.failures.each(), self.cautions.each()
        for number, values, failure, cautions in zip(*columns, strict=True):
            pairs = zip(self.columns, values.tolist(), strict=True)
            indices = {name: value for name, value in pairs if value == value}  # noqa: PLR0124
            yield Outcome(number, indices, failure, cautions)

    def arranged(self, columns: Sequence[str]) -> Outcomes:
        """Return the outcomes with other columns; those that are missing are nan."""
        if tuple(columns) == tuple(self.columns):
            return self
        indices = np.full((len(self), len(columns)), np.nan)
        for place, name in enumerate(columns):
            if name in self.columns:
                indices[:, place] = self.indices[:, self.columns.index(name)]
        return replace(self, columns=tuple(columns), indices=indices)


class Numbers:
    """A set of numbers of runs, as ranges: its memory does not grow with their lengths."""

    def __init__(self, ends: Iterable[int] = ()) -> None:
        """Make a set of ranges: the first number of each, and the first number after it."""
        self.ends = np.array([*ends], dtype=np.int64)

    @classmethod
    def of(cls, numbers: np.ndarray) -> Numbers:
        """Return a set of numbers, in their order."""
        gaps = np.flatnonzero(np.diff(numbers) != 1)
        begins = np.append(numbers[:1], numbers[gaps + 1])
        ends = np.append(numbers[gaps], numbers[-1:]) + 1
        made = cls()
        made.ends = np.column_stack([begins, ends]).ravel()
        return made

    def __len__(self) -> int:
        """Return how many there are."""
        return int((self.ends[1::2] - self.ends[::2]).sum())

    def has(self, numbers: np.ndarray) -> np.ndarray:
        """Return a mask of the numbers that are in the set."""
        mask: np.ndarray = np.searchsorted(self.ends, numbers, "right") % 2 == 1
        return mask

    def add(self, others: Numbers) -> None:
        """Add numbers that are not in the set."""
        self.ends = self._toggled(others)

    def below(self, n: int) -> Numbers:
        """Return the numbers below n that are not in the set, none of which is larger."""
        made = Numbers()
        made.ends = self._toggled(Numbers((0, n)))
        return made

    def _toggled(self, others: Numbers) -> np.ndarray:
        """Return the ends of the ranges of numbers that are in one of two sets."""
        ends, times = np.unique(np.concatenate([self.ends, others.ends]), return_counts=True)
        toggled: np.ndarray = ends[times == 1]
        return toggled

    def blocks(self, size: int) -> Iterator[np.ndarray]:
        """Yield the numbers in their order, some at a time."""
        begins = self.ends[::2]
        before = np.cumsum(self.ends[1::2] - begins)
        for first in range(0, len(self), size):
            places = np.arange(first, min(first + size, len(self)))
            ranges = np.searchsorted(before, places, "right")
            yield self.ends[1::2][ranges] - before[ranges] + places
