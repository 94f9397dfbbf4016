"""Signals of a vehicle's loop: from the paper's names to ports of components.

The master steps any system and uses none of these names. Figures, indices and certificates need
some of them; `Table.missing` lists those that a run lacks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from math import inf

import numpy as np

from auv_fmu.language import quantities
from auv_fmu.language.quantities import member_name
from auv_fmu.paper.attitude import rotation_from_euler
from auv_fmu.paper.control_point import control_point
from auv_fmu.paper.vehicle import Vehicle
from orchestrator.cosim import PortName, System, Table, Value
from orchestrator.machine.disk import file_name
from orchestrator.machine.errors import InputError

#: Members of groups of ports, in the paper's order.
ACTUATORS, AXES = tuple(map(str, quantities.TAU)), tuple(map(str, quantities.POSITION))
EULER, DIRECTIONS = tuple(map(str, quantities.EULER)), tuple(map(str, quantities.NU))

#: Columns and parameters that a figure or computation needs: arguments of :meth:`.Table.missing`.
Needs = tuple[Sequence[str], Sequence[str]]


class _Group:
    """The names of a group of ports or parameters at a component of a loop."""

    def __init__(self, role: str, group: str, members: Iterable[str | int]) -> None:
        self._role = role
        self._names = tuple(member_name(group, m) if group else m for m in members)

    def __get__(self, loop: Loop, owner: type[Loop] | None = None) -> tuple[str, ...]:
        component = getattr(loop, self._role)
        return tuple(f"{component}.{name}" for name in self._names)


@dataclass(frozen=True)
class Loop:
    """A vehicle and its controller: names of components, and the names of signals from them."""

    vehicle: str = "plant"
    controller: str = "controller"
    planner: str = "planner"
    disturbance: str = "disturbance"

    #: eta: centre of mass [m] and Euler angles [rad], earth frame.
    position, attitude = _Group("vehicle", "eta", AXES), _Group("vehicle", "eta", EULER)
    posture = _Group("vehicle", "eta", (*AXES, *EULER))
    #: The parameters of position [m] and heading [rad] at the start.
    start = _Group("vehicle", "eta0", (*AXES, "psi"))
    #: nu [m/s, rad/s], body frame.
    nu = _Group("vehicle", "nu", DIRECTIONS)
    #: Velocity of the control point [m/s].
    dy = _Group("vehicle", "dy", AXES)
    #: tau as commanded, and after the limits of (3) [N, N.m].
    commanded = _Group("vehicle", "tau", ACTUATORS)
    applied = _Group("vehicle", "tau_applied", ACTUATORS)
    #: y_d and its velocity: outputs of the planner, and inputs of the controller.
    y_d, dy_d = _Group("planner", "y_d", AXES), _Group("planner", "dy_d", AXES)
    seen_y_d, seen_dy_d = _Group("controller", "y_d", AXES), _Group("controller", "dy_d", AXES)
    #: Errors, estimates and command of the controller.
    e, z = _Group("controller", "e", AXES), _Group("controller", "z", AXES)
    y_hat, dy_hat = _Group("controller", "y_hat", AXES), _Group("controller", "dy_hat", AXES)
    theta_hat = _Group("controller", "theta_hat", quantities.THETA)
    tau = _Group("controller", "tau", ACTUATORS)
    #: The parameters of (3), and of (2).
    lower_limits = _Group("vehicle", "tau_min", ACTUATORS)
    upper_limits = _Group("vehicle", "tau_max", ACTUATORS)
    vehicle_parameters = _Group("vehicle", "", (name.replace("_", ".") for name in Vehicle._fields))

    @property
    def name(self) -> str:
        """Name of the vehicle: `auv1`, if its component is `auv1.plant`."""
        return self.vehicle.removesuffix(f".{type(self).vehicle}")

    @property
    def limits(self) -> tuple[str, ...]:
        """All parameters of (3)."""
        return (*self.lower_limits, *self.upper_limits)

    @property
    def ell(self) -> str:
        """The parameter ell [m]: distance of the control point ahead of the centre of mass."""
        return f"{self.vehicle}.ell"

    @property
    def seed(self) -> str:
        """The parameter noise.seed."""
        return f"{self.vehicle}.noise.seed"

    def port(self, name: str) -> str:
        """Return the name in this loop of a signal or parameter of the standard loop."""
        component, _, port = name.partition(".")
        role = _ROLES.get(component)
        return f"{getattr(self, role)}.{port}" if role else name

    @property
    def implied(self) -> Mapping[str, float]:
        """Parameters that the kind of loop determines, by their names in the standard loop."""
        return {}

    def drawn(self) -> tuple[str, ...]:
        """Return all signals in figures."""
        return (
            *self.position, *self.nu, *self.dy, *self.commanded, *self.y_d, *self.dy_hat,
            *self.theta_hat, *self.e,
        )  # fmt: skip

    def for_control_point(self) -> Needs:
        """Return what the control point is computed from."""
        return self.posture, (self.ell,)

    def for_tracking(self) -> Needs:
        """Return what the tracking error is computed from."""
        return (*self.posture, *self.y_d), (self.ell,)

    def for_reference(self) -> Needs:
        """Return the signals of the reference path."""
        return self.y_d, ()

    def for_commands(self) -> Needs:
        """Return the commanded signals."""
        return self.commanded, ()

    def for_limits(self) -> Needs:
        """Return the parameters of the limits of (3)."""
        return (), self.limits

    def for_parameter_estimates(self) -> Needs:
        """Return the signals of theta_hat."""
        return self.theta_hat, ()

    def for_velocity_estimates(self) -> Needs:
        """Return the signals of the true and estimated velocities."""
        return (*self.dy, *self.dy_hat), ()


@dataclass(frozen=True)
class AllocatedLoop(Loop):
    """A loop whose vehicle has no input tau: an allocation turns tau into its inputs."""

    allocation: str = "allocation"

    commanded = _Group("allocation", "tau", ACTUATORS)

    def port(self, name: str) -> str:
        """Return the name in this loop of a signal or parameter of the standard loop."""
        if name in STANDARD.commanded:
            return f"{self.allocation}.{name.partition('.')[2]}"
        return super().port(name)

    @property
    def implied(self) -> Mapping[str, float]:
        """Lags of the actuators: the applied signal follows from a state, as with a lag."""
        return {f"plant.actuator.T.{actuator}": inf for actuator in ACTUATORS}


#: The loop of closed_loop.toml, the paper's Fig. 2.
STANDARD = Loop()

#: Roles of components by their names in the standard loop.
_ROLES = {getattr(STANDARD, field.name): field.name for field in fields(STANDARD)}


def loop_of(names: Mapping[str, str]) -> Loop:
    """Make a loop from the names of its components, by their roles."""
    return AllocatedLoop(**names) if "allocation" in names else Loop(**names)


def loops_of(system: System) -> tuple[Loop, ...]:
    """Find the loops of a system, one for each vehicle, by ports and connections.

    A vehicle has the output eta, and the input tau or the output tau_applied. Among the components
    upstream of it, the controller has the input y_d, and the planner the output y_d; if the vehicle
    has no input tau, an allocation has it. A missing component of a single vehicle gets the
    standard name; one of several vehicles gets a name that no component has.

    Returns:
        At least one loop: without a vehicle, the standard one.

    """
    vehicles = [
        name
        for name in system.components
        if _has(system, name, "output", "eta.psi")
        and (_has(system, name, "input", "tau.u") or _has(system, name, "output", "tau_applied.u"))
    ]
    return tuple(_loop(system, vehicle, vehicles) for vehicle in vehicles) or (STANDARD,)


def suffixes(loops: Sequence[Loop]) -> dict[Loop, str]:
    """Return suffixes for names of files about one loop: with several, the vehicle's name."""
    if len(loops) == 1:
        return {loops[0]: ""}
    endings: dict[Loop, str] = {}
    for loop in loops:
        endings[loop] = f"-{file_name(loop.name, [name[1:] for name in endings.values()])}"
    return endings


def _has(system: System, component: str, causality: str, port: str) -> bool:
    variable = system.components[component].variables.get(port)
    return variable is not None and variable.causality == causality


def _loop(system: System, vehicle: str, vehicles: Sequence[str]) -> Loop:
    def feeding(component: str, group: str, role: str, causality: str, port: str) -> str:
        """Find the nearest component upstream with a port, else the one that feeds a group."""
        if component in system.components:
            wires = list(system.reaching(component, set(vehicles)))
            group = f"{component}.{group}."
            feeders = [
                wire for wire in wires if _has(system, wire.source.component, causality, port)
            ]
            feeders += [wire for wire in wires if str(wire.target).startswith(group)]
            if feeders:
                return feeders[0].source.component
        return role if len(vehicles) == 1 else f"{vehicle}.{role}"

    controller = feeding(vehicle, "tau", "controller", "input", "y_d.x")
    planner = feeding(controller, "y_d", "planner", "output", "y_d.x")
    disturbance = feeding(vehicle, "tau_w", "disturbance", "output", "tau_w.u")
    names = vehicle, controller, planner, disturbance
    if _has(system, vehicle, "input", "tau.u"):
        return Loop(*names)
    return AllocatedLoop(*names, feeding(vehicle, "tau", "allocation", "input", "tau.u"))


def value_of(table: Table, name: str) -> Value | None:
    """Return the value of a parameter `component.name` in a run; None if there is none."""
    names = (PortName(component, port) for component, port in PortName.splits(name))
    return next((table.parameters[key] for key in names if key in table.parameters), None)


def real_parameter(table: Table, name: str) -> float:
    """Return the value of a Real parameter `component.name` in a run.

    Raises:
        InputError: it is missing or has another type.

    """
    value = value_of(table, name)
    if not isinstance(value, int | float):
        raise InputError(f"{name} is {value!r}, not a number")
    return value


def limits(table: Table, loop: Loop = STANDARD) -> tuple[np.ndarray, np.ndarray]:
    """Return the limits of (3), lower and upper, for u, q, r [N, N.m]."""
    return (
        np.array([real_parameter(table, name) for name in loop.lower_limits]),
        np.array([real_parameter(table, name) for name in loop.upper_limits]),
    )


def applied(table: Table, loop: Loop = STANDARD) -> np.ndarray:
    """Return tau as applied in each step, (rows - 1, 3) [N, N.m].

    Actuators with a lag have a state, so for them the value at the end of the step counts.
    """
    at_once = table.step_values(*loop.applied)
    if not (late := _with_lag(table, loop)).any():
        return at_once
    return np.where(late, table.group(*loop.applied)[1:], at_once)


def _with_lag(table: Table, loop: Loop) -> np.ndarray:
    """Return True for each actuator with a lag: all, if the vehicle has an allocation."""
    if isinstance(loop, AllocatedLoop):
        return np.ones(len(ACTUATORS), bool)
    names = (PortName(loop.vehicle, f"actuator.T.{actuator}") for actuator in ACTUATORS)
    return np.array([bool(table.parameters.get(name)) for name in names])


def vehicle(value: Callable[[str], float], loop: Loop = STANDARD) -> Vehicle:
    """Make the vehicle of (2) from a function of the names of its parameters: `plant.m11`, ..."""
    return Vehicle._make(value(name) for name in loop.vehicle_parameters)


def waypoints(table: Table, loop: Loop = STANDARD) -> np.ndarray:
    """Return the waypoints of a planner, (n, 3) [m]; n is 0 without waypoints."""
    n = value_of(table, f"{loop.planner}.count")
    names = (f"{loop.planner}.waypoint[{k}]" for k in range(1, int(n or 0) + 1))
    return np.array(
        [[real_parameter(table, f"{name}.{axis}") for axis in AXES] for name in names]
    ).reshape(-1, 3)


def true_control_point(table: Table, loop: Loop = STANDARD) -> np.ndarray:
    """Return y without measurement noise: (9) for the vehicle's posture, (rows, 3) [m]."""
    ell = real_parameter(table, loop.ell)
    return np.array(
        [
            control_point((x, y, z), rotation_from_euler(*euler), ell)
            for x, y, z, *euler in table.group(*loop.posture).tolist()
        ]
    ).reshape(-1, 3)


def tracking_error(table: Table, loop: Loop = STANDARD) -> np.ndarray:
    """Return e = y - y_d with the true control point, both of the same row, (rows, 3) [m]."""
    error: np.ndarray = true_control_point(table, loop) - table.group(*loop.y_d)
    return error
