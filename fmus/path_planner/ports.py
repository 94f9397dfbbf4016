"""Ports of PathPlanner."""

from __future__ import annotations

from auv_fmu.path_planner import MOST, Parameters, Waypoints
from fmus.ports.groups import ParameterSet
from fmus.ports.port import POSITIVE, Port, parameter, setting
from fmus.ports.vehicle import CONTROL_POINT, LIMITS, PAPER, VEHICLE, reference

DESCRIPTION = "Path planner: reference through waypoints with velocity and acceleration"
ORIGIN = PAPER

_DEFAULTS, _WAYPOINTS = Parameters(), Waypoints()


def _of_each_waypoint(member: str, unit: str, description: str) -> tuple[Port, ...]:
    starts = getattr(_WAYPOINTS, member)
    return tuple(
        parameter(f"waypoint[{k}].{member}", start, unit, description)
        for k, start in enumerate(starts, start=1)
    )


_X, _Y, _Z = (_of_each_waypoint(axis, "m", f"Waypoint: {axis}") for axis in "xyz")
_T = _of_each_waypoint("t", "s", "Time at which the waypoint is passed, if `timed`")

_COUNT = setting(
    "count",
    _WAYPOINTS.n,
    "Number of waypoints; later ones are not used",
    minimum=2,
    maximum=MOST,
)
_TIMED = setting(
    "timed",
    _WAYPOINTS.timed,
    "Whether waypoints are passed at their times; if not, at the cruise speed",
)
_CRUISE = parameter(
    "cruise", _WAYPOINTS.cruise, "m/s", "Speed between waypoints without times", POSITIVE
)
_ROUNDING = parameter(
    "rounding", _WAYPOINTS.rounding, "s", "Duration of the rounding of a corner", POSITIVE
)

PARAMETERS = ParameterSet(
    Parameters,
    waypoints=ParameterSet(
        Waypoints,
        n=_COUNT,
        x=_X,
        y=_Y,
        z=_Z,
        t=_T,
        timed=_TIMED,
        cruise=_CRUISE,
        rounding=_ROUNDING,
    ),
    vehicle=VEHICLE,
    ell=CONTROL_POINT,
    limits=LIMITS,
    speed_max=parameter("speed_max", _DEFAULTS.speed_max, "m/s", "Largest accepted speed", 0.0),
    turn_max=parameter("turn_max", _DEFAULTS.turn_max, "rad/s", "Largest accepted turn rate", 0.0),
)

_WAYS = (_COUNT, *(port for k in zip(_X, _Y, _Z, _T) for port in k), _TIMED, _CRUISE, _ROUNDING)

PORTS: tuple[Port, ...] = (
    *reference("Posture of a vehicle that points along the path"),
    *_WAYS,
    *(port for port in PARAMETERS.ports if port not in _WAYS),
)
