"""Ports that the planners share, so that one can take the other's place."""

from __future__ import annotations

from fmus.ports.port import Port, outputs
from fmus.ports.quantities import ACCELERATION, ETA_WITHOUT_ROLL, POSITION, VELOCITY


def reference(posture: str) -> tuple[Port, ...]:
    """The desired motion of the control point, and the posture that is described so."""
    return (
        *outputs("y_d", POSITION, "Desired control point"),
        *outputs("dy_d", VELOCITY, "Desired velocity"),
        *outputs("ddy_d", ACCELERATION, "Desired acceleration, in closed form"),
        *outputs("eta_d", ETA_WITHOUT_ROLL, posture),
    )
