"""Ports of MotionPlanner."""

from fmus.ports.port import H_MAX, Port, outputs, parameters
from fmus.ports.vehicle import CONTROL_POINT, VEHICLE

_AXES = ("x", "y", "z")
_POSITION = dict.fromkeys(_AXES, "m")
_POSTURE = {**_POSITION, "theta": "rad", "psi": "rad"}

#: Torques of section 4.1 that make the reference a helix [N, N.m].
_TAU_D = (5.0, 1.0, 2.0)
#: Initial posture of the reference vehicle in section 4.1: x, y, z [m], theta, psi [rad].
_ETA_0 = (0.0, 0.0, -2.0, 0.0, 0.0)

PORTS: tuple[Port, ...] = (
    *outputs("y_d", _POSITION, "Desired control point"),
    *outputs("dy_d", dict.fromkeys(_AXES, "m/s"), "Desired velocity"),
    *outputs("ddy_d", dict.fromkeys(_AXES, "m/s2"), "Desired acceleration, in closed form"),
    *outputs("eta_d", _POSTURE, "Posture of the reference vehicle"),
    *parameters(
        "tau_d", _TAU_D, {".u": "N", ".q": "N.m", ".r": "N.m"}, "Driving force and moments"
    ),
    *parameters("eta0", _ETA_0, {f".{k}": unit for k, unit in _POSTURE.items()}, "Initial posture"),
    *VEHICLE,
    CONTROL_POINT,
    H_MAX,
)
