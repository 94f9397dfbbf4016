"""A progress bar for a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from orchestrator.cosim import Ending, Header
from orchestrator.machine.lazy import progress_bar

#: Shortest run for which a bar appears [s].
_DELAY = 0.5


class Progress:
    """An observer that shows how far a run has come, in simulated seconds, on a terminal."""

    def __init__(self, name: str) -> None:
        """Show the name of the run in front of the bar."""
        self._name = name

    def begin(self, header: Header) -> None:
        """Start the clock."""
        self._start = header.experiment.start_time
        self._bar: Any = progress_bar(
            total=header.experiment.stop_time - header.experiment.start_time,
            desc=self._name,
            unit="s",
            delay=_DELAY,
            disable=None,
            bar_format="{l_bar}{bar}| {n:.0f}/{total:.0f} s [{elapsed}<{remaining}]",
        )

    def take(self, rows: np.ndarray) -> None:
        """Move on to the time of the last row."""
        self._bar.update(rows[-1, 0] - self._start - self._bar.n)

    def end(self, ending: Ending) -> None:
        """Leave the bar where it is."""
        self._bar.close()
