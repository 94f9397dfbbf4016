"""Ports of MotionPlanner."""

from __future__ import annotations

from typing import NamedTuple

from auv_fmu.types import Vector3, Vector5
from auv_fmu.vehicle import Vehicle
from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, Port, outputs, parameters
from fmus.ports.quantities import ACCELERATION, ETA_WITHOUT_ROLL, POSITION, TAU, VELOCITY
from fmus.ports.vehicle import CONTROL_POINT, VEHICLE

#: Torques of section 4.1 that make the reference a helix [N, N.m].
_TAU_D = (5.0, 1.0, 2.0)
#: Initial posture of the reference vehicle in section 4.1: x, y, z [m], theta, psi [rad].
_ETA_0 = (0.0, 0.0, -2.0, 0.0, 0.0)


class Parameters(NamedTuple):
    """What the parameters of MotionPlanner mean."""

    tau_d: Vector3
    eta0: Vector5
    vehicle: Vehicle
    ell: float


PARAMETERS = ParameterSet(
    Parameters,
    tau_d=parameters("tau_d", _TAU_D, TAU, "Driving force and moments"),
    eta0=parameters("eta0", _ETA_0, ETA_WITHOUT_ROLL, "Initial posture"),
    vehicle=VEHICLE,
    ell=CONTROL_POINT,
)

PORTS: tuple[Port, ...] = (
    *outputs("y_d", POSITION, "Desired control point"),
    *outputs("dy_d", VELOCITY, "Desired velocity"),
    *outputs("ddy_d", ACCELERATION, "Desired acceleration, in closed form"),
    *outputs("eta_d", ETA_WITHOUT_ROLL, "Posture of the reference vehicle"),
    *PARAMETERS.ports,
    H_MAX,
)
