"""Of a long run, the rows that can be seen in a figure."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from orchestrator.analysis.signals import DRAWN
from orchestrator.master.observer import Ending, Header
from orchestrator.master.table import Table

#: Runs of no more rows than this are kept whole.
_WHOLE = 20_000

#: Times into which a longer run is divided: finer than what a figure resolves.
_DIVISIONS = 400

#: Candidates that are gathered before the extremes among them are chosen.
_CANDIDATES = 4096


class VisibleRows(Table):
    """An observer that keeps the rows that can be seen, so that figures of long runs cost no more.

    Of each division of the time it keeps the rows in which one of the drawn signals is smallest or
    largest, so the envelope of noise and chatter stays, and with each row the one before it, so
    that steps stay whole. Memory does not grow with the length of the run.
    """

    def __init__(self, watched: Collection[str] = DRAWN, n: int | None = None) -> None:
        """Start without rows.

        Args:
            watched: columns whose extremes are kept.
            n: how many rows there will be; None: as many as the experiment has.

        """
        super().__init__()
        self._watched_names, self._expected = watched, n

    def begin(self, header: Header) -> None:
        """Find out how many rows share a division."""
        n = header.experiment.rows if self._expected is None else self._expected
        if n <= _WHOLE:
            self._per_division = 0
            self._enter(header, np.empty((n, 1 + len(header.columns))))
            return
        self._enter(header, np.empty((0, 1 + len(header.columns))))
        self._per_division = -(-n // _DIVISIONS)
        self._watched = [
            i for i, name in enumerate(header.columns, 1) if name in self._watched_names
        ]
        self._last = np.empty((0, 1 + len(header.columns)))
        self._seen = 0
        self._candidates: list[np.ndarray] = []
        self._chosen: list[np.ndarray] = []

    def take(self, rows: np.ndarray) -> None:
        """Keep what can be seen of some rows."""
        if not self._per_division:
            super().take(rows)
            return
        rows = np.vstack((rows[:1] if not self._seen else self._last, rows))
        self._last = rows[-1:]
        pairs = np.stack((rows[:-1], rows[1:]), axis=1)
        while len(pairs):
            room = self._per_division - self._seen % self._per_division
            self._candidates.append(self._extremes(pairs[:room]))
            self._seen += len(pairs[:room])
            pairs = pairs[room:]
            is_full = self._seen % self._per_division == 0
            if is_full or sum(map(len, self._candidates)) > _CANDIDATES:
                self._candidates = [self._extremes(np.concatenate(self._candidates))]
            if is_full:
                self._chosen += self._candidates
                self._candidates = []

    def end(self, ending: Ending) -> None:
        """Put the rows in order."""
        super().end(ending)
        if self._per_division:
            last = np.stack((self._last, self._last), axis=1)
            pairs = np.concatenate([*self._chosen, *self._candidates, last])
            rows = pairs.reshape(-1, pairs.shape[-1])
            _, first = np.unique(rows[:, 0], return_index=True)
            self._rows, self._n = rows[first], len(first)
            self._chosen, self._candidates = [], []

    def _extremes(self, pairs: np.ndarray) -> np.ndarray:
        """The pairs with a smallest or largest watched value in their second row, and the ends."""
        watched = pairs[:, 1, self._watched]
        found = {0, len(pairs) - 1, *watched.argmin(axis=0), *watched.argmax(axis=0)}
        return pairs[sorted(found)]
