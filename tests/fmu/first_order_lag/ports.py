"""Ports of FirstOrderLag."""

from __future__ import annotations

from fmus.first_order_lag.behaviour import Lag

from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, POSITIVE, Port, inputs, outputs, parameter

DESCRIPTION = "First-order lag, measured with noise"

_LAG = Lag()

PARAMETERS = ParameterSet(
    Lag,
    T=parameter("T", _LAG.T, "s", "Time constant", POSITIVE, tunable=True),
    x0=parameter("x0", _LAG.x0, "m", "Initial value"),
    std=parameter("std", _LAG.std, "m", "Standard deviation of the noise", 0.0, 1e6),
    seed=Port("seed", "parameter", "fixed", "Integer", "Seed of the noise", start=_LAG.seed),
)

PORTS: tuple[Port, ...] = (
    *inputs("u", {"x": "m"}, "What it follows"),
    *outputs("x", {"x": "m"}, "Its value"),
    *outputs("y", {"x": "m"}, "Its value, measured"),
    *PARAMETERS.ports,
    H_MAX,
)
