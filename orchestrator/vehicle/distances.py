"""Distances between the vehicles of a run, per row.

The smallest is the one index of several vehicles together. It is made of all pairs of hundreds of
vehicles, which numpy compares many times as fast as equations in Python do.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from orchestrator.cosim import Table
from orchestrator.vehicle.signals import Loop, Needs

#: The index of several vehicles: its name in files, and in words.
SMALLEST_DISTANCE = "smallest_distance"
SMALLEST_DISTANCE_LABEL = "smallest distance between vehicles"

#: So many numbers are compared at once.
_AT_ONCE = 1_000_000


def size(vectors: np.ndarray) -> np.ndarray:
    """The Euclidean norm of each row, summed in the order of its members."""
    squares = np.zeros(len(vectors))
    for column in vectors.T:
        squares = squares + column * column
    norm: np.ndarray = np.sqrt(squares)
    return norm


def for_distances(loops: Sequence[Loop]) -> Needs:
    """What distances between vehicles follow from."""
    return [column for loop in loops for column in loop.position], ()


def distances(table: Table, loops: Sequence[Loop]) -> dict[tuple[str, str], np.ndarray]:
    """Distance between the centres of mass of each two vehicles, by their names, per row [m]."""
    return {
        (one.name, other.name): size(table.group(*one.position) - table.group(*other.position))
        for one, other in combinations(loops, 2)
    }


def smallest_distances(table: Table, loops: Sequence[Loop]) -> np.ndarray:
    """Distance between the two vehicles that are closest to each other, per row [m]."""
    return smallest_of(np.stack([table.group(*loop.position) for loop in loops], axis=1))


def smallest_of(positions: np.ndarray) -> np.ndarray:
    """The smallest distance of each row [m].

    Args:
        positions: of vehicles, (rows, vehicles, 3) [m].

    """
    rows = max(1, _AT_ONCE // positions.shape[1])
    blocks = np.split(positions, range(rows, len(positions), rows))
    return np.concatenate([_smallest(block) for block in blocks])


def _smallest(positions: np.ndarray) -> np.ndarray:
    """The smallest distance of each row, (rows, vehicles, 3)."""
    squares = np.full(len(positions), np.inf)
    for i in range(1, positions.shape[1]):
        apart = positions[:, i:] - positions[:, :-i]
        squares = np.minimum(squares, (apart**2).sum(axis=2).min(axis=1, initial=np.inf))
    smallest: np.ndarray = np.sqrt(squares)
    return smallest
