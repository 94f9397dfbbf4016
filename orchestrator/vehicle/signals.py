"""The signals of a vehicle's loop by the paper's names: which port of which component they are.

The master steps any system and knows none of these names. What is drawn, measured and proved here
needs some of them; `Table.missing` tells which a run does not have.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from auv_fmu.attitude import rotation_from_euler
from auv_fmu.control_point import control_point
from auv_fmu.vehicle import Vehicle
from fmus.ports import quantities
from fmus.ports.quantities import member_name
from orchestrator.machine.errors import InputError
from orchestrator.master.observers.table import Table
from orchestrator.system.graph import reaching
from orchestrator.system.names import PortName, file_name, splits
from orchestrator.system.structure import System
from orchestrator.system.values import Value

#: Members of groups of ports, in the paper's order.
ACTUATORS, AXES = tuple(map(str, quantities.TAU)), tuple(map(str, quantities.POSITION))
EULER, DIRECTIONS = tuple(map(str, quantities.EULER)), tuple(map(str, quantities.NU))

#: Columns, and parameters, that something needs: what :meth:`.Table.missing` takes.
Needs = tuple[Sequence[str], Sequence[str]]


def _group(component: str, group: str, members: Iterable[str | int]) -> tuple[str, ...]:
    return tuple(f"{component}.{member_name(group, member)}" for member in members)


@dataclass(frozen=True)
class Loop:
    """A vehicle and what controls it: names of components, and from them those of the signals."""

    vehicle: str = "plant"
    controller: str = "controller"
    planner: str = "planner"
    disturbance: str = "disturbance"

    @property
    def position(self) -> tuple[str, ...]:
        """Centre of mass, earth frame [m]: of eta."""
        return _group(self.vehicle, "eta", AXES)

    @property
    def attitude(self) -> tuple[str, ...]:
        """Euler angles [rad]: of eta."""
        return _group(self.vehicle, "eta", EULER)

    @property
    def posture(self) -> tuple[str, ...]:
        """Position and attitude: eta."""
        return (*self.position, *self.attitude)

    @property
    def nu(self) -> tuple[str, ...]:
        """Velocity in the body frame [m/s, rad/s]."""
        return _group(self.vehicle, "nu", DIRECTIONS)

    @property
    def drift(self) -> tuple[str, ...]:
        """Sway and heave, of which nothing is commanded [m/s]."""
        return _group(self.vehicle, "nu", ("v", "w"))

    @property
    def dy(self) -> tuple[str, ...]:
        """Velocity of the control point [m/s]."""
        return _group(self.vehicle, "dy", AXES)

    @property
    def commanded(self) -> tuple[str, ...]:
        """The control signals as they reach the vehicle [N, N.m]: tau."""
        return _group(self.vehicle, "tau", ACTUATORS)

    @property
    def applied(self) -> tuple[str, ...]:
        """The control signals as (3) lets them through [N, N.m]."""
        return _group(self.vehicle, "tau_applied", ACTUATORS)

    @property
    def y_d(self) -> tuple[str, ...]:
        """The reference [m]."""
        return _group(self.planner, "y_d", AXES)

    @property
    def dy_d(self) -> tuple[str, ...]:
        """Its velocity [m/s]."""
        return _group(self.planner, "dy_d", AXES)

    @property
    def seen_y_d(self) -> tuple[str, ...]:
        """The reference as the controller was given it [m]."""
        return _group(self.controller, "y_d", AXES)

    @property
    def seen_dy_d(self) -> tuple[str, ...]:
        """Its velocity as the controller was given it [m/s]."""
        return _group(self.controller, "dy_d", AXES)

    @property
    def e(self) -> tuple[str, ...]:
        """The tracking error as the controller measures it [m]."""
        return _group(self.controller, "e", AXES)

    @property
    def y_hat(self) -> tuple[str, ...]:
        """Estimate of the control point [m]."""
        return _group(self.controller, "y_hat", AXES)

    @property
    def dy_hat(self) -> tuple[str, ...]:
        """Estimate of its velocity [m/s]."""
        return _group(self.controller, "dy_hat", AXES)

    @property
    def z(self) -> tuple[str, ...]:
        """The error of the estimate as the controller measures it [m]."""
        return _group(self.controller, "z", AXES)

    @property
    def tau(self) -> tuple[str, ...]:
        """The control signals as the controller gives them [N, N.m]."""
        return _group(self.controller, "tau", ACTUATORS)

    @property
    def theta_hat(self) -> tuple[str, ...]:
        """Estimates of the coefficients of rho [N, kg/s, kg/m, kg]."""
        return _group(self.controller, "theta_hat", quantities.THETA)

    @property
    def lower_limits(self) -> tuple[str, ...]:
        """The parameters of (3) for one direction [N, N.m]."""
        return _group(self.vehicle, "tau_min", ACTUATORS)

    @property
    def upper_limits(self) -> tuple[str, ...]:
        """The parameters of (3) for the other direction [N, N.m]."""
        return _group(self.vehicle, "tau_max", ACTUATORS)

    @property
    def limits(self) -> tuple[str, ...]:
        """All parameters of (3)."""
        return (*self.lower_limits, *self.upper_limits)

    @property
    def ell(self) -> str:
        """The parameter ell [m]: how far the control point lies ahead of the centre of mass."""
        return f"{self.vehicle}.ell"

    @property
    def vehicle_parameters(self) -> tuple[str, ...]:
        """The parameters of (2)."""
        return tuple(f"{self.vehicle}.{name.replace('_', '.')}" for name in Vehicle._fields)

    def drawn(self) -> tuple[str, ...]:
        """All signals that stand in figures."""
        return (
            *self.position, *self.nu, *self.dy, *self.commanded, *self.y_d, *self.dy_hat,
            *self.theta_hat, *self.e,
        )  # fmt: skip

    def for_control_point(self) -> Needs:
        """What the control point follows from."""
        return self.posture, (self.ell,)

    def for_tracking(self) -> Needs:
        """What the tracking error follows from."""
        return (*self.posture, *self.y_d), (self.ell,)

    def for_reference(self) -> Needs:
        """What the path of the reference follows from."""
        return self.y_d, ()

    def for_commands(self) -> Needs:
        """What the control signals follow from."""
        return self.commanded, ()

    def for_limits(self) -> Needs:
        """What their limits follow from."""
        return (), self.limits

    def for_parameter_estimates(self) -> Needs:
        """What theta_hat follows from."""
        return self.theta_hat, ()

    def for_velocity_estimates(self) -> Needs:
        """What true and estimated velocities follow from."""
        return (*self.dy, *self.dy_hat), ()


#: The loop of closed_loop.toml, the paper's Fig. 2.
STANDARD = Loop()


def loops_of(system: System) -> tuple[Loop, ...]:
    """The loops of a system, one for each vehicle, found by ports and wires.

    A vehicle takes tau and gives eta; of what feeds it, directly or through others, the controller
    takes y_d, which the planner gives. What one vehicle lacks has the standard name; what one of
    several lacks has a name that no component has.

    Returns:
        At least one loop: where no vehicle is found, the standard one.

    """
    vehicles = [
        name
        for name in system.components
        if _has(system, name, "input", "tau.u") and _has(system, name, "output", "eta.psi")
    ]
    return tuple(_loop(system, vehicle, vehicles) for vehicle in vehicles) or (STANDARD,)


def suffixes(loops: Sequence[Loop]) -> dict[Loop, str]:
    """What the names of files end with that hold one of these loops: of several, the vehicle."""
    return {loop: f"-{file_name(loop.vehicle)}" if len(loops) > 1 else "" for loop in loops}


def _has(system: System, component: str, causality: str, port: str) -> bool:
    variable = system.components[component].variables.get(port)
    return variable is not None and variable.causality == causality


def _loop(system: System, vehicle: str, vehicles: Sequence[str]) -> Loop:
    def feeding(component: str, group: str, role: str, causality: str, port: str) -> str:
        """The nearest component with a port upstream of another, or else what feeds a group."""
        if component in system.components:
            wires = list(reaching(system, component, set(vehicles)))
            group = f"{component}.{group}."
            found = [wire for wire in wires if _has(system, wire.source.component, causality, port)]
            found += [wire for wire in wires if str(wire.target).startswith(group)]
            if found:
                return found[0].source.component
        return role if len(vehicles) == 1 else f"{vehicle}.{role}"

    controller = feeding(vehicle, "tau", "controller", "input", "y_d.x")
    planner = feeding(controller, "y_d", "planner", "output", "y_d.x")
    disturbance = feeding(vehicle, "tau_w", "disturbance", "output", "tau_w.u")
    return Loop(vehicle, controller, planner, disturbance)


def value_of(table: Table, name: str) -> Value | None:
    """The value of a parameter `component.name` in a run; None: there is none."""
    names = (PortName(component, port) for component, port in splits(name))
    return next((table.parameters[one] for one in names if one in table.parameters), None)


def parameter(table: Table, name: str) -> float:
    """The value of a Real parameter `component.name` in a run.

    Raises:
        InputError: the record of the run holds something else.

    """
    value = value_of(table, name)
    if not isinstance(value, int | float):
        raise InputError(f"{name} is {value!r}, not a number")
    return value


def limits(table: Table, loop: Loop = STANDARD) -> tuple[np.ndarray, np.ndarray]:
    """The limits of (3), lower and upper, for u, q, r [N, N.m]."""
    return (
        np.array([parameter(table, name) for name in loop.lower_limits]),
        np.array([parameter(table, name) for name in loop.upper_limits]),
    )


def vehicle(value: Callable[[str], float], loop: Loop = STANDARD) -> Vehicle:
    """The vehicle of (2), whose parameters a function gives by their names `plant.m11`, ..."""
    return Vehicle._make(value(name) for name in loop.vehicle_parameters)


def true_control_point(table: Table, loop: Loop = STANDARD) -> np.ndarray:
    """y without measurement noise: (9) on the vehicle's posture, (rows, 3) [m]."""
    ell = parameter(table, loop.ell)
    return np.array(
        [
            control_point((x, y, z), rotation_from_euler(*euler), ell)
            for x, y, z, *euler in table.group(*loop.posture).tolist()
        ]
    ).reshape(-1, 3)


def tracking_error(table: Table, loop: Loop = STANDARD) -> np.ndarray:
    """e = y - y_d with the true control point, (rows, 3) [m]."""
    error: np.ndarray = true_control_point(table, loop) - table.group(*loop.y_d)
    return error
