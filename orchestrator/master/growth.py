"""Values that a delayed ring lets grow without bound."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from orchestrator.machine.errors import InputError
from orchestrator.master.observers.observer import Ending, Header
from orchestrator.system.names import PortName

#: A value grows without bound if it doubles at least so often in each of so many intervals, one
#: after the other, and so often in all of them together. What grows with a power of time does not.
_INTERVALS, _DOUBLINGS, _IN_ALL = 8, 1.0, 24.0

#: Lengths of these intervals, in steps.
_LENGTHS = tuple(2**i for i in range(9))


class Growth:
    """An observer that ends a run in which values of delayed rings grow without bound."""

    def __init__(self, ports: Collection[PortName]) -> None:
        """Watch some ports."""
        self._names = list(map(str, ports))
        self._columns: list[int] = []
        self._rows = 0
        self._last = {length: np.empty((0, len(self._names))) for length in _LENGTHS}

    def begin(self, header: Header) -> None:
        """Find the ports."""
        places = {name: i for i, name in enumerate(header.columns, start=1)}
        self._columns = [places[name] for name in self._names]

    def take(self, rows: np.ndarray) -> None:
        """Look at some rows.

        Raises:
            InputError: a value grows without bound.

        """
        sizes = np.log2(np.abs(rows[:, self._columns]))
        # From zero, everything is infinitely far.
        sizes[np.isinf(sizes)] = np.nan
        for length in _LENGTHS:
            new = sizes[-self._rows % length :: length]
            known = np.concatenate([self._last[length], new])
            self._last[length] = known[-_INTERVALS - 1 :]
            if len(new) and len(known) > _INTERVALS:
                doublings = sliding_window_view(np.diff(known, axis=0), _INTERVALS, axis=0)
                grows = doublings.min(axis=-1) >= _DOUBLINGS
                grows &= doublings.sum(axis=-1) >= _IN_ALL
                if found := np.flatnonzero(grows.any(axis=0)).tolist():
                    raise InputError(
                        f"{self._names[found[0]]} grows without bound, in a ring of direct "
                        "feedthroughs that is delayed by a step; --coupling solve, if its FMUs "
                        "allow it, or another --order may help"
                    )
        self._rows += len(rows)

    def end(self, ending: Ending) -> None:
        """Nothing is kept."""
