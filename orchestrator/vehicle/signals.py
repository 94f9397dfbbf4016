"""The loop's signals by the paper's names: the one place that says which port holds which.

The master steps any system and knows none of these names. What is drawn, measured and proved here
needs some of them; `Table.missing` tells which a system does not have.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from auv_fmu.attitude import rotation_from_euler
from auv_fmu.control_point import control_point
from auv_fmu.vehicle import Vehicle
from orchestrator.machine.errors import InputError
from orchestrator.master.observers.table import Table
from orchestrator.system.names import PortName

#: Members of groups of ports, in the paper's order.
ACTUATORS = ("u", "q", "r")
AXES = ("x", "y", "z")
EULER = ("phi", "theta", "psi")
DIRECTIONS = ("u", "v", "w", "p", "q", "r")


def _group(name: str, members: Iterable[str]) -> tuple[str, ...]:
    return tuple(f"{name}.{member}" for member in members)


#: eta: centre of mass [m] and Euler angles [rad], earth frame.
POSITION, ATTITUDE = _group("plant.eta", AXES), _group("plant.eta", EULER)
POSTURE = (*POSITION, *ATTITUDE)
#: nu [m/s, rad/s], body frame.
NU = _group("plant.nu", DIRECTIONS)
#: Sway and heave, of which nothing is commanded.
DRIFT = _group("plant.nu", ("v", "w"))
#: Velocity of the control point [m/s].
DY = _group("plant.dy", AXES)
#: tau as commanded, and as (3) lets it through [N, N.m].
COMMANDED, APPLIED = _group("plant.tau", ACTUATORS), _group("plant.tau_applied", ACTUATORS)
#: y_d and its velocity.
Y_D, DY_D = _group("planner.y_d", AXES), _group("planner.dy_d", AXES)
#: What the controller was given and what it has estimated.
SEEN_Y_D, SEEN_DY_D = _group("controller.y_d", AXES), _group("controller.dy_d", AXES)
Y_HAT, DY_HAT = _group("controller.y_hat", AXES), _group("controller.dy_hat", AXES)
Z = _group("controller.z", AXES)
TAU = _group("controller.tau", ACTUATORS)
THETA_HAT = tuple(f"controller.theta_hat[{i}]" for i in range(1, 5))
THETA_UNITS = ("N", "kg/s", "kg/m", "kg")

#: The parameters of (3), ell, and those of (2).
LOWER_LIMITS, UPPER_LIMITS = _group("plant.tau_min", ACTUATORS), _group("plant.tau_max", ACTUATORS)
LIMITS = (*LOWER_LIMITS, *UPPER_LIMITS)
ELL = "plant.ell"
VEHICLE = _group("plant", (name.replace("_", ".") for name in Vehicle._fields))

#: Signals in figures.
DRAWN = frozenset(
    (*POSITION, *NU, *DY, *COMMANDED, *Y_D, *DY_HAT, *THETA_HAT, *_group("controller.e", AXES))
)

#: What the control point and the tracking error follow from.
CONTROL_POINT = (POSTURE, (ELL,))
TRACKING = ((*POSTURE, *Y_D), (ELL,))

#: The component that commands the vehicle, and the one that gives the reference.
CONTROLLER, PLANNER = "controller", "planner"


#: Units of the members of groups, by the group's name at whichever component.
_UNITS = {
    **dict.fromkeys(("y", "y_d", "y_hat", "e", "z"), dict.fromkeys(AXES, "m")),
    **dict.fromkeys(("dy", "dy_d", "dy_hat"), dict.fromkeys(AXES, "m/s")),
    "ddy_d": dict.fromkeys(AXES, "m/s²"),
    **dict.fromkeys(("eta", "eta_d"), dict.fromkeys(AXES, "m") | dict.fromkeys(EULER, "rad")),
    "nu": dict.fromkeys(DIRECTIONS[:3], "m/s") | dict.fromkeys(DIRECTIONS[3:], "rad/s"),
    **dict.fromkeys(
        ("tau", "tau_applied", "tau_w"),
        dict.fromkeys(DIRECTIONS[:3], "N") | dict.fromkeys(DIRECTIONS[3:], "N·m"),
    ),
}


def unit_of(column: str) -> str:
    """The unit of a signal of the loop; empty for others."""
    _, _, port = column.partition(".")
    group, _, member = port.rpartition(".")
    return _UNITS.get(group, {}).get(member, "")


def parameter(table: Table, name: str) -> float:
    """The value of a Real parameter `component.name` in a run.

    Raises:
        InputError: the record of the run holds something else.

    """
    component, port = name.split(".", 1)
    value = table.parameters[PortName(component, port)]
    if not isinstance(value, int | float):
        raise InputError(f"{name} is {value!r}, not a number")
    return value


def limits(table: Table) -> tuple[np.ndarray, np.ndarray]:
    """The limits of (3), lower and upper, for u, q, r [N, N.m]."""
    return (
        np.array([parameter(table, name) for name in LOWER_LIMITS]),
        np.array([parameter(table, name) for name in UPPER_LIMITS]),
    )


def vehicle(value: Callable[[str], float]) -> Vehicle:
    """The vehicle of (2), whose parameters a function gives by their names `plant.m11`, ..."""
    return Vehicle._make(value(name) for name in VEHICLE)


def true_control_point(table: Table) -> np.ndarray:
    """y without measurement noise: (9) on the plant's posture, (rows, 3) [m]."""
    ell = parameter(table, ELL)
    return np.array(
        [
            control_point((x, y, z), rotation_from_euler(*euler), ell)
            for x, y, z, *euler in table.group(*POSTURE).tolist()
        ]
    ).reshape(-1, 3)


def tracking_error(table: Table) -> np.ndarray:
    """e = y - y_d with the true control point, (rows, 3) [m]."""
    error: np.ndarray = true_control_point(table) - table.group(*Y_D)
    return error
