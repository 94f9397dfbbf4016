"""Ports of AuvPlant."""

from auv_fmu.plant import RollAxis
from fmus.ports.port import H_MAX, POSITIVE, Port, inputs, outputs, parameter, parameters
from fmus.ports.vehicle import CONTROL_POINT, VEHICLE

_TAU = {"u": "N", "q": "N.m", "r": "N.m"}
_TAU_W = {"u": "N", "v": "N", "w": "N", "p": "N.m", "q": "N.m", "r": "N.m"}
_POSITION = {"x": "m", "y": "m", "z": "m"}
_EULER = {"phi": "rad", "theta": "rad", "psi": "rad"}
_NU = {"u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "q": "rad/s", "r": "rad/s"}

#: Limits of section 4.1 [N, N.m].
_TAU_MAX = 80.0
#: Initial posture of section 4.1: x, y, z [m], phi, theta, psi [rad].
_ETA_0 = (2.0, 6.0, 0.0, 0.0, 0.0, 0.0)
#: Standard deviation of the measured position [m]; the paper gives none.
_NOISE_STD = 0.001

_ROLL = RollAxis()
_COMMAND = inputs("tau", _TAU, "Commanded force and moments")


def _dotted(units: dict[str, str]) -> dict[str, str]:
    return {f".{member}": unit for member, unit in units.items()}


PORTS: tuple[Port, ...] = (
    *_COMMAND,
    *inputs("tau_w", _TAU_W, "Disturbance, with the sign of (2)"),
    *outputs("eta", {**_POSITION, **_EULER}, "Position of the centre of mass and Euler angles"),
    *outputs("nu", _NU, "Velocity in the body frame"),
    *outputs("y", _POSITION, "Measured control point, with noise"),
    *outputs("dy", dict.fromkeys(_POSITION, "m/s"), "True velocity of the control point"),
    *outputs("tau_applied", _TAU, "Force and moments after the limits of (3)", _COMMAND),
    *VEHICLE,
    parameter("m44", _ROLL.m44, "kg.m2", "Roll inertia with added inertia", POSITIVE),
    parameter("d44", _ROLL.d44, "kg.m2/s", "Linear damping of roll", minimum=0.0),
    parameter(
        "righting.roll",
        _ROLL.righting_roll,
        "N.m",
        "Righting moment in roll; the paper gives none, ours is that of pitch",
    ),
    CONTROL_POINT,
    *parameters("tau_max", 3 * (_TAU_MAX,), _dotted(_TAU), "Upper limit of (3)", minimum=0.0),
    *parameters("tau_min", 3 * (-_TAU_MAX,), _dotted(_TAU), "Lower limit of (3)", maximum=0.0),
    *parameters("eta0", _ETA_0, _dotted({**_POSITION, **_EULER}), "Initial posture"),
    *parameters("nu0", 6 * (0.0,), _dotted(_NU), "Initial velocity in the body frame"),
    parameter(
        "noise.std",
        _NOISE_STD,
        "m",
        "Standard deviation of each measured coordinate; the paper gives none",
        minimum=0.0,
    ),
    Port("noise.seed", "parameter", "fixed", "Integer", "Seed of the noise", start=1),
    H_MAX,
)
