"""Ports of MotionPlanner."""

from __future__ import annotations

from auv_fmu.motion_planner import ETA_D0, NU_D0, TAU_D, Parameters
from auv_fmu.quantities import ETA_WITHOUT_ROLL, NU_WITHOUT_ROLL, TAU
from fmus.ports.groups import ParameterSet
from fmus.ports.port import H_MAX, Port, parameters
from fmus.ports.vehicle import CONTROL_POINT, PAPER, VEHICLE, reference

DESCRIPTION = "Motion planner: helical reference with velocity and acceleration"
ORIGIN = PAPER

_NU0 = parameters("nu0", NU_D0, NU_WITHOUT_ROLL, "Initial velocity in the body frame")

PARAMETERS = ParameterSet(
    Parameters,
    tau_d=parameters("tau_d", TAU_D, TAU, "Driving force and moments"),
    eta0=parameters("eta0", ETA_D0, ETA_WITHOUT_ROLL, "Initial posture"),
    vehicle=VEHICLE,
    ell=CONTROL_POINT,
    nu0=_NU0,
)

PORTS: tuple[Port, ...] = (
    *reference("Posture of the reference vehicle"),
    *PARAMETERS.before(*_NU0),
    H_MAX,
    *_NU0,
)
