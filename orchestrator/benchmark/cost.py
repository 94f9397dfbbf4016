"""The cost of a run, for which gains are searched and by which laws are ranked."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

#: A run has failed if a component refuses, or the vehicle is this far from its reference in the
#: second half [m]; and its cost [m].
LOST, FAILED = 5.0, 5.0

#: Cost of a saturated step, per share of the steps [m], and of chatter [m.s].
SATURATED, CHATTER = 0.2, 0.01

#: The columns of a run that its cost is made of.
COLUMNS = ("error", "largest", "saturated", "chatter")


def has_failed(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return a mask of runs that have failed; a refused run has no numbers."""
    mask: np.ndarray = ~(columns["largest"] <= LOST)
    return mask


def costs(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the cost of each run [m]: its late error, plus saturation and chatter."""
    cost = columns["error"] + SATURATED * columns["saturated"] + CHATTER * columns["chatter"]
    limited: np.ndarray = np.where(has_failed(columns), FAILED, np.minimum(cost, FAILED))
    return limited
