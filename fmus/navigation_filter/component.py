"""Navigation filter: an error-state Kalman filter of IMU, depth, attitude, DVL and fixes."""

from __future__ import annotations

from auv_fmu import __author__, __license__, __version__
from auv_fmu.navigation import navigation_filter
from auv_fmu.navigation.navigation_filter import (
    Estimates,
    Filtered,
    FilterState,
    Parameters,
    Samples,
)

SAMPLED = True


def start(parameters: Parameters, inputs: Samples, t: float) -> FilterState:
    """Return the state at the start."""
    return navigation_filter.begin(parameters, inputs, t)


def derive(parameters: Parameters, state: FilterState, inputs: Samples, t: float) -> Filtered:
    """Return the state after the samples of time t."""
    return navigation_filter.advance(parameters, state, inputs, t)


def update(derived: Filtered) -> FilterState:
    """Return the state after a step."""
    return derived.state


def outputs(parameters: Parameters, derived: Filtered) -> Estimates:
    """Return the estimates."""
    return navigation_filter.estimates(parameters, derived)
