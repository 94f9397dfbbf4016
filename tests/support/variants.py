"""Variants of the printed table whose numbers are known by hand."""

from __future__ import annotations

import numpy as np

from orchestrator.paper.choices import (
    END_TIMES,
    FORMULAS,
    ORDERS_OF_EFFORTS,
    PD,
    PROPOSED,
    PUBLISHED,
    SIGNALS,
    Choice,
    Option,
)
from orchestrator.paper.variants import Found, Sensitivity

#: A choice of both controllers, and one of the proposed controller only.
SEA = Choice("sea", (Option("calm"), Option("rough", against="4.1: calm")))
OBSERVER = Choice("observer", (Option("slow"), Option("fast")), of_proposed=True)

APPLIED, COMMANDED = range(len(SIGNALS))
PRINTED_ORDER, EXCHANGED = range(len(ORDERS_OF_EFFORTS))
L2, SUM, SQUARE = range(len(FORMULAS))
T_F = {time: i for i, time in enumerate(END_TIMES)}


def planted(**cells):
    """Ours is twice what is printed everywhere, but where something else is planted.

    So the sum without the step, L2 / sqrt(0.02 T_f), is at 200 s what is printed.
    """
    numbers = {
        PROPOSED: np.full((2, 2, len(SIGNALS), len(END_TIMES), 6), 2.0),
        PD: np.full((2, 1, len(SIGNALS), len(END_TIMES), 6), 2.0),
    }
    for scenario, values in {"proposed": PROPOSED, "pd": PD}.items():
        for where, value in cells.get(scenario, {}).items():
            numbers[values][where] = value
    ways = {PROPOSED: np.full((2, 2, 2), np.nan), PD: np.full((2, 1, 2), np.nan)}
    ways[PROPOSED][0] = 40.0, 1000.0
    ways[PROPOSED][1] = 20.0, 2000.0
    ways[PD][0] = 16.0, 1200.0
    return Sensitivity(
        {scenario: values * PUBLISHED[scenario] for scenario, values in numbers.items()},
        (SEA, OBSERVER),
        ways,
    )


def spread(low, median, high):
    """Quantiles over starts, in parts of what is printed, at every signal and end time."""
    parts = np.array([low, median, high]).reshape(3, 1, 1, 1)
    return {
        scenario: parts * np.broadcast_to(six, (3, len(SIGNALS), len(END_TIMES), 6))
        for scenario, six in PUBLISHED.items()
    }


def found(six):
    """What is printed of variants: the nearest of five is twice what is printed, from 1 to 5."""
    five = planted()
    of_five = five.over_starts(five.ours, spread(1.0, 2.0, 5.0))
    return Found(six, five, (six.ours, six.nearest(True), six.nearest(False), of_five))
