"""Ports of MotionPlanner."""

from auv_fmu.motion_planner import ETA_D0, TAU_D
from fmus.base.port import H_MAX, Port, outputs, parameters
from fmus.base.vehicle_ports import CONTROL_POINT, VEHICLE

_AXES = ("x", "y", "z")
_POSITION = dict.fromkeys(_AXES, "m")
_POSTURE = {**_POSITION, "theta": "rad", "psi": "rad"}

PORTS: tuple[Port, ...] = (
    *outputs("y_d", _POSITION, "Desired control point"),
    *outputs("dy_d", dict.fromkeys(_AXES, "m/s"), "Desired velocity"),
    *outputs("ddy_d", dict.fromkeys(_AXES, "m/s2"), "Desired acceleration, in closed form"),
    *outputs("eta_d", _POSTURE, "Posture of the reference vehicle"),
    *parameters("tau_d", TAU_D, {".u": "N", ".q": "N.m", ".r": "N.m"}, "Driving force and moments"),
    *parameters("eta0", ETA_D0, {f".{k}": unit for k, unit in _POSTURE.items()}, "Initial posture"),
    *VEHICLE,
    CONTROL_POINT,
    H_MAX,
)
