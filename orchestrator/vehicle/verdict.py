"""The verdict on a run in a line, from its indices only."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import ceil, floor, hypot, isfinite, isnan, log10, nan

from orchestrator.vehicle.index.tracking import REACHED

#: Numbers of a run by the names of their indices.
Found = Mapping[str, Sequence[float]]

#: Digits of a length, and units of lengths in m, the smallest first.
_DIGITS, _UNITS = 2, (("mm", 1e-3), ("cm", 1e-2), ("m", 1.0))

#: Part of a step of rounding by which a number may lie beyond it.
_ROUNDING = 1e-9

#: Smallest share that is shown as a number, and the one from which on it is rounded down [%].
_SMALL_SHARE, _NEARLY_ALL = 0.1, 99.0


def verdict(vehicles: Sequence[Found], actuators: Sequence[str], apart: float = nan) -> str:
    """Say how well vehicles follow their references, how often they saturate, how close they come.

    Args:
        vehicles: indices of each vehicle; those that a run lacks are not spoken of.
        actuators: names of the members of `saturated_fraction`.
        apart: smallest distance between two of them [m].

    Returns:
        A line; empty if the run has none of these indices.

    """
    parts = [*_tracking(vehicles), *_saturation(vehicles, actuators)]
    if not isnan(apart):
        parts.append(f"vehicles at least {_length(apart, floor)} apart")
    return ", ".join(parts)


def _tracking(vehicles: Sequence[Found]) -> list[str]:
    """Return the time from which vehicles are near their references, and their last errors."""
    if not all("final_error" in found for found in vehicles):
        return []
    far = max(hypot(*found["final_error"]) for found in vehicles)
    # A vehicle that is not near its reference at the end has no settling time.
    times = [found.get("time_to_settle", (nan,))[0] for found in vehicles]
    many = len(vehicles) > 1
    target = "their references" if many else "the reference"
    if any(map(isnan, times)):
        lost = f"{sum(map(isnan, times))} of {len(times)} vehicles " if many else ""
        return [f"{lost}up to {_length(far, ceil)} from {target} at the end"]
    near = f"{'all ' * many}within {REACHED:g} m of {target}"
    since = ceil(10.0 * max(times) - _ROUNDING) / 10.0
    when = f"from {since:g} s on" if since else "from the start"
    return [f"{near} {when}", f"within {_length(far, ceil)} at the end"]


def _saturation(vehicles: Sequence[Found], actuators: Sequence[str]) -> list[str]:
    """Return the shares of steps in which actuators saturate, of several vehicles the largest."""
    name = "saturated_fraction"
    if not all(name in found for found in vehicles):
        return []
    shares = [max(each) for each in zip(*(found[name] for found in vehicles), strict=True)]
    texts = [
        f"{_share(share)} ({actuator})"
        for actuator, share in zip(actuators, shares, strict=True)
        if share
    ]
    most = "up to " * (len(vehicles) > 1)
    return [f"saturation in {most}{', '.join(texts)} of the steps" if texts else "no saturation"]


def _share(share: float) -> str:
    percent = 100.0 * share
    if percent < _SMALL_SHARE:
        return f"under {_SMALL_SHARE:g} %"
    # A few steps fewer than all are not all.
    shown = f"{percent:.{_DIGITS}g}" if percent < _NEARLY_ALL else f"{floor(percent)}"
    return f"{shown} %"


def _length(metres: float, rounded: Callable[[float], int]) -> str:
    """Return a length with few digits, rounded up or down, in a unit in which it is at least 1."""
    unit, size = next((each for each in reversed(_UNITS) if metres >= each[1]), _UNITS[0])
    number = metres / size
    if isfinite(number):
        scale = 10.0 ** (_DIGITS - 1 - floor(log10(max(number, 1.0))))
        number = rounded(number * scale) / scale
    return f"{number:g} {unit}"
