"""Ports that vehicle and planners share: parameters of (2) and (3), and the reference."""

from __future__ import annotations

from collections.abc import Sequence

from auv_fmu import __version__
from auv_fmu.actuators import Limits
from auv_fmu.control_point import ELL
from auv_fmu.quantities import ACCELERATION, ETA_WITHOUT_ROLL, POSITION, TAU, VELOCITY
from auv_fmu.vehicle import Vehicle
from fmus.ports.definition import Origin
from fmus.ports.groups import ParameterSet
from fmus.ports.port import POSITIVE, Port, outputs, parameter, parameters

#: The paper that the components implement.
PAPER = Origin(
    "auv-fmu",
    "MIT",
    __version__,
    'Equation numbers are from the paper "Three-dimensional tracking control of autonomous '
    'underwater vehicles with limited torque and without velocity sensors"',
)

_VEHICLE, _LIMITS = Vehicle(), Limits()


def _inertia(name: str, unit: str) -> Port:
    description = f"Mass or inertia including added mass: {name[1:]}"
    return parameter(name, getattr(_VEHICLE, name), unit, description, POSITIVE)


def _damping(name: str, unit: str) -> Port:
    return parameter(name, getattr(_VEHICLE, name), unit, f"Linear damping: {name[1:]}", 0.0)


VEHICLE = ParameterSet(
    Vehicle,
    m11=_inertia("m11", "kg"),
    m22=_inertia("m22", "kg"),
    m33=_inertia("m33", "kg"),
    m55=_inertia("m55", "kg.m2"),
    m66=_inertia("m66", "kg.m2"),
    d11=_damping("d11", "kg/s"),
    d22=_damping("d22", "kg/s"),
    d33=_damping("d33", "kg/s"),
    d55=_damping("d55", "kg.m2/s"),
    d66=_damping("d66", "kg.m2/s"),
    righting_pitch=parameter(
        "righting.pitch", _VEHICLE.righting_pitch, "N.m", "Righting moment in pitch"
    ),
)

LIMITS = ParameterSet(
    Limits,
    tau_max=parameters("tau_max", _LIMITS.tau_max, TAU, "Upper limit of (3)", minimum=0.0),
    tau_min=parameters("tau_min", _LIMITS.tau_min, TAU, "Lower limit of (3)", maximum=0.0),
)

CONTROL_POINT = parameter(
    "ell", ELL, "m", "Distance of the control point from the centre of mass", POSITIVE
)


def reference(
    posture: str, feedthrough: Sequence[Port] = (), initially: Sequence[Port] = ()
) -> tuple[Port, ...]:
    """The outputs of every planner, so that one can take the other's place.

    Args:
        posture: what its posture is.
        feedthrough: inputs that all of them depend on directly.
        initially: inputs that they depend on at the start besides.

    """
    on = (feedthrough, initially)
    return (
        *outputs("y_d", POSITION, "Desired control point", *on),
        *outputs("dy_d", VELOCITY, "Desired velocity", *on),
        *outputs("ddy_d", ACCELERATION, "Desired acceleration, in closed form", *on),
        *outputs("eta_d", ETA_WITHOUT_ROLL, posture, *on),
    )
