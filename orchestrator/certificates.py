"""What the proof speaks of, along a run: Lyapunov function, composite errors, margins.

Everything is computed from the true state of the plant, which the controller does not know.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from auv_fmu.attitude import rotation_from_euler
from auv_fmu.proof.lyapunov import Errors, composite_errors, lyapunov
from auv_fmu.saturation import INTEGRALS, SATURATIONS
from orchestrator.metrics import ACTUATORS, AXES, LIMITS, POSTURE, true_control_point
from orchestrator.result import Result
from orchestrator.system import PortName, System, unit_of
from orchestrator.vehicle_parameters import VEHICLE_PARAMETERS, vehicle

#: Units of a velocity at a port.
_VELOCITY_UNITS = {"m/s", "rad/s"}

COLUMNS = (
    "time",
    "V_without_theta",
    *(f"r_1.{k}" for k in AXES),
    *(f"r_2.{k}" for k in AXES),
    *(f"saturation_margin.{k}" for k in ACTUATORS),
)


def velocities_reaching(system: System, component: str = "controller") -> list[str]:
    """Velocities of the vehicle that reach a component, directly or through others.

    The vehicle is what the component feeds. Follows the connections upstream and stops there.
    Empty for a controller without velocity sensors.
    """
    vehicles = {
        connection.target.component
        for connection in system.connections
        if connection.source.component == component
    }
    found, seen, waiting = [], {component}, [component]
    while waiting:
        name = waiting.pop()
        for connection in system.connections:
            source = connection.source
            if connection.target.component != name:
                continue
            if source.component in vehicles:
                variable = system.components[source.component].variable(source.port)
                if unit_of(variable) in _VELOCITY_UNITS:
                    found.append(str(source))
            elif source.component not in seen:
                seen.add(source.component)
                waiting.append(source.component)
    return sorted(set(found))


def has_certificates(result: Result) -> bool:
    """Whether the run has the ports and parameters of the proposed controller and the plant."""
    columns = [*POSTURE, *(f"plant.dy.{k}" for k in AXES)]
    columns += [
        f"controller.{group}.{k}" for group in ("y_d", "dy_d", "y_hat", "dy_hat", "z") for k in AXES
    ]
    columns += [f"controller.tau.{k}" for k in ACTUATORS]
    gains = ["controller.lambda", "controller.saturation"]
    gains += [f"controller.K2[{i}]" for i in (1, 2, 3)]
    vehicle_parameters = [f"plant.{name}" for name in (*VEHICLE_PARAMETERS, "ell")]
    return result.has(columns, [*gains, *LIMITS, *vehicle_parameters])


def certificates(result: Result) -> np.ndarray:
    """Table with :data:`COLUMNS`, one row for each instant at which the controller was evaluated.

    V is (34), or (55) for another saturation function, without its term in theta - theta_hat:
    theta is unknown. r_1 is (17), r_2 is (19). The margin is the distance of a command from its
    nearer limit, negative beyond it.
    """
    return np.array(list(_rows(result)))


def _rows(result: Result) -> Iterator[list[float]]:
    def parameter(name: str) -> float:
        value: float = result.parameters[PortName("plant", name)]
        return value

    def gain(name: str) -> float:
        value: float = result.parameters[PortName("controller", name)]
        return value

    plant = vehicle(parameter)
    ell, lambda_ = parameter("ell"), gain("lambda")
    K2 = (gain("K2[1]"), gain("K2[2]"), gain("K2[3]"))
    name = str(result.parameters[PortName("controller", "saturation")])
    s, integral = SATURATIONS[name], INTEGRALS[name]
    lower = np.array([parameter(f"tau_min.{k}") for k in ACTUATORS])
    upper = np.array([parameter(f"tau_max.{k}") for k in ACTUATORS])

    # A row holds the controller's values of the beginning of its step: the plant's of the row
    # before.
    y = true_control_point(result)[:-1]
    dy = result.group(*(f"plant.dy.{k}" for k in AXES))[:-1]
    euler = result.group(*(f"plant.eta.{k}" for k in ("phi", "theta", "psi")))[:-1]
    y_d, dy_d, y_hat, dy_hat, z_measured, tau = (
        result.group(*(f"{group}.{k}" for k in members))[1:]
        for group, members in (
            ("controller.y_d", AXES),
            ("controller.dy_d", AXES),
            ("controller.y_hat", AXES),
            ("controller.dy_hat", AXES),
            ("controller.z", AXES),
            ("controller.tau", ACTUATORS),
        )
    )

    e, z, e_z = y - y_d, y - y_hat, y_hat - y_d
    margin = np.minimum(upper - tau, tau - lower)
    for i, t in enumerate(result.time[:-1].tolist()):
        r_1, r_2 = composite_errors(dy[i], dy_d[i], dy_hat[i], e_z[i], z_measured[i], lambda_, s)
        errors = Errors(e[i].tolist(), z[i].tolist(), r_1, r_2)
        rotation = rotation_from_euler(*euler[i].tolist())
        V = lyapunov(plant, rotation, errors, K2, integral, ell)
        yield [t, V, *r_1, *r_2, *margin[i]]


def write_certificates(result: Result, path: Path) -> None:
    """Write the table as CSV."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(certificates(result).tolist())
