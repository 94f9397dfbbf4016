"""Ports of MotionPlanner."""

from auv_fmu.control_point import ELL
from auv_fmu.vehicle import Vehicle

from fmus.base.port import H_MAX, POSITIVE, Port, outputs, parameter, parameters

_AXES = ("x", "y", "z")
_POSITION = dict.fromkeys(_AXES, "m")
_POSTURE = {**_POSITION, "theta": "rad", "psi": "rad"}

#: Torques of section 4.1 that make the reference a helix [N, N.m].
_TAU_D = (5.0, 1.0, 2.0)
#: Initial posture of the reference vehicle in section 4.1: x, y, z [m], theta, psi [rad].
_ETA_0 = (0.0, 0.0, -2.0, 0.0, 0.0)

_VEHICLE = Vehicle()

PORTS: tuple[Port, ...] = (
    *outputs("y_d", _POSITION, "Desired control point"),
    *outputs("dy_d", dict.fromkeys(_AXES, "m/s"), "Desired velocity"),
    *outputs("ddy_d", dict.fromkeys(_AXES, "m/s2"), "Desired acceleration, in closed form"),
    *outputs("eta_d", _POSTURE, "Posture of the reference vehicle"),
    *parameters(
        "tau_d", _TAU_D, {".u": "N", ".q": "N.m", ".r": "N.m"}, "Driving force and moments"
    ),
    *parameters(
        "eta0", _ETA_0, {f".{k}": unit for k, unit in _POSTURE.items()}, "Initial posture"
    ),
    *parameters(
        "m",
        _VEHICLE[:5],
        {"11": "kg", "22": "kg", "33": "kg", "55": "kg.m2", "66": "kg.m2"},
        "Mass or inertia with added mass",
        minimum=POSITIVE,
    ),
    *parameters(
        "d",
        _VEHICLE[5:10],
        {"11": "kg/s", "22": "kg/s", "33": "kg/s", "55": "kg.m2/s", "66": "kg.m2/s"},
        "Linear damping",
        minimum=0.0,
    ),
    parameter("righting.pitch", _VEHICLE.righting_pitch, "N.m", "Righting moment in pitch"),
    parameter("ell", ELL, "m", "Distance of the control point", POSITIVE),
    H_MAX,
)
