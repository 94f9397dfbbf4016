"""Values sorted into bins of an axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Up to so many different values have a bin each.
_GRID = 40

#: An axis is logarithmic if its values are positive, and a large one, larger than this share of
#: them, is so many times a small one.
_LARGE, _WIDE = 0.95, 10.0


@dataclass(frozen=True)
class Bins:
    """The bins of an axis.

    Attributes:
        edges: one more than there are bins.
        centres: of the bins; of a grid, its values.
        is_logarithmic: whether the axis is.

    """

    edges: np.ndarray
    centres: np.ndarray
    is_logarithmic: bool

    def places(self, values: np.ndarray) -> np.ndarray:
        """The number of the bin of each value."""
        places: np.ndarray = np.searchsorted(self.edges[1:-1], values, side="right")
        return places


def is_logarithmic(values: np.ndarray) -> bool:
    """Whether values are spread so far that only a logarithmic axis shows them all."""
    values = values[np.isfinite(values)]
    if not values.size or values.min() <= 0.0:
        return False
    small, large = np.quantile(values, (1.0 - _LARGE, _LARGE))
    return bool(large >= _WIDE * small)


def bins_of(values: np.ndarray, most: int, *, are_full: bool = False) -> Bins:
    """Bins for some values, at least one of which is finite.

    Args:
        values: of a grid, or anywhere.
        most: how many bins there are for values that are no grid.
        are_full: whether these have as many values each, and not the same width.

    """
    values = values[np.isfinite(values)]
    wide = is_logarithmic(values)
    places = np.unique(np.log(values) if wide else values)
    if len(places) > _GRID:
        even = np.linspace(0.0, 1.0, most + 1)
        edges = np.quantile(places, even) if are_full else np.interp(even, (0, 1), places[[0, -1]])
        centres = 0.5 * (edges[1:] + edges[:-1])
    else:
        between = 0.5 * (places[1:] + places[:-1])
        # The outer bins are as wide as they would be with one more neighbour.
        first, last = (between[0], between[-1]) if between.size else (places + 0.5, places - 0.5)
        edges = np.hstack((2.0 * places[0] - first, between, 2.0 * places[-1] - last))
        centres = places
    if wide:
        edges, centres = np.exp(edges), np.exp(centres)
    return Bins(edges, centres, wide)


def grouped(places: np.ndarray, values: np.ndarray, n: int) -> list[np.ndarray]:
    """The finite values of each of n bins.

    Args:
        places: the number of the bin of each value.
        values: to be grouped.
        n: how many bins there are.

    """
    finite = np.isfinite(values)
    places, values = places[finite], values[finite]
    order = np.argsort(places, kind="stable")
    return np.split(values[order], np.searchsorted(places[order], np.arange(1, n)))
