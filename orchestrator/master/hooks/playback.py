"""Inputs that follow a table over time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np

from orchestrator.master.hooks.hook import NEVER, Run
from orchestrator.system.names import PortName


@dataclass(frozen=True)
class InputTable:
    """Values of some inputs over time.

    Attributes:
        targets: inputs that nothing feeds.
        times: that grow [s].
        values: of each input at each time, (times, targets).
        linear: which inputs go from one value to the next in a straight line; the others hold a
            value until the next.

    """

    targets: tuple[PortName, ...]
    times: np.ndarray
    values: np.ndarray
    linear: np.ndarray

    @property
    def digest(self) -> str:
        """Another one for other values."""
        names = " ".join(map(str, self.targets)).encode()
        arrays = (self.times, self.values, self.linear)
        return sha256(names + b"".join(array.tobytes() for array in arrays)).hexdigest()

    def at(self, time: float, row: int) -> np.ndarray:
        """The values at a time [s], of which a row is the last that is not after it."""
        row = max(row, 0)
        here, following = self.values[row], self.values[min(row + 1, len(self.values) - 1)]
        length = self.times[min(row + 1, len(self.times) - 1)] - self.times[row]
        passed = min(max(time - self.times[row], 0.0) / length, 1.0) if length else 0.0
        if self._is_steep:
            line = (1.0 - passed) * here + passed * following
        else:
            line = here + passed * (following - here)
        between: np.ndarray = np.where(self.linear, line, here)
        return between

    @cached_property
    def _is_steep(self) -> bool:
        """Whether two values that follow each other lie farther apart than any number is large."""
        with np.errstate(over="ignore"):
            return not np.isfinite(np.diff(self.values, axis=0)).all()


class Playback:
    """A hook that supplies inputs with what they have at the beginning of each step.

    Before the first time of the table they have its first values, after the last its last.
    """

    def __init__(self, input_table: InputTable) -> None:
        """Take the table that is followed."""
        self._input_table = input_table
        self._steps = np.empty(0, dtype=int)

    def act(self, run: Run) -> int:
        """Supply the values of now."""
        input_table = self._input_table
        if not len(self._steps):
            self._steps = np.array([run.experiment.reaching(time) for time in input_table.times])
        row = int(np.searchsorted(self._steps, run.made, side="right")) - 1
        for target, value in zip(input_table.targets, input_table.at(run.time, row), strict=True):
            run.overrides.supply(target, float(value))
        if row + 1 == len(self._steps):
            return NEVER
        return run.made + 1 if input_table.linear.any() else int(self._steps[row + 1])
