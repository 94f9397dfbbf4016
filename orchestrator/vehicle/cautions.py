"""What may give numbers that are not meant: known before a run, or seen in it."""

from __future__ import annotations

import numpy as np

from auv_fmu.observer import EXACT, FORMS, exact_gain
from auv_fmu.proof.gain_conditions import bounds
from auv_fmu.proof.sampling import observer_rate, robust_rate
from orchestrator.master.experiment import Experiment
from orchestrator.master.observers.table import Table
from orchestrator.system.graph import reaching
from orchestrator.system.names import PortName, port_name
from orchestrator.system.structure import System
from orchestrator.system.values import unit_of
from orchestrator.vehicle.signals import (
    ATTITUDE,
    CONTROLLER,
    ELL,
    LIMITS,
    PLANNER,
    THETA_HAT,
    VEHICLE,
    Y_D,
    parameter,
    vehicle,
)

_K_D, _LAMBDA, _EPS_T = "controller.k_d", "controller.lambda", "controller.eps_t"
_H_MAX, _OBSERVER = "controller.h_max", "controller.observer"

_PITCH, _ROLL = ATTITUDE[1], "plant.roll"

#: Columns whose extremes :func:`cautions_after` looks at.
WATCHED = (THETA_HAT[0], _PITCH)

#: References that are farther apart are not the same [m].
_SAME = 1e-6

#: h p beyond which a mode of Euler's scheme changes its sign in every step, and grows.
_REVERSES, _GROWS = 1.0, 2.0


def gain_of_a_step(system: System, h: float) -> float:
    """k_d as a step of h seconds takes it [1/s]: the form of the observer may change it."""
    k_d, form = float(system.value(port_name(_K_D)) or 0.0), port_name(_OBSERVER)
    is_exact = system.has(form) and FORMS.get(str(system.value(form))) == EXACT
    return exact_gain(k_d, h) if is_exact else k_d


def cautions(system: System, experiment: Experiment) -> list[str]:
    """What can be said before a run, in lines for the user."""
    if not all(system.has(port_name(name)) for name in (_K_D, _LAMBDA, _H_MAX)):
        return []

    def value(name: str) -> float:
        return float(system.value(port_name(name)) or 0.0)

    h = min(experiment.step, value(_H_MAX))
    h_p = h * observer_rate(value(_LAMBDA), gain_of_a_step(system, h))
    if h_p <= _GROWS:
        return []
    return [
        f"{_K_D} = {value(_K_D):g} 1/s is unstable with internal steps of {h:g} s: the observer's "
        f"fastest mode has h p = {h_p:.3g} and grows above {_GROWS:g}; lower k_d or h_max"
    ]


def differing_vehicle(system: System) -> str | None:
    """Where controller or planner hold other values of the vehicle than the plant, in words.

    Returns:
        One line; None: nowhere.

    """
    texts, others = [], set()
    for name in map(port_name, (ELL, *VEHICLE, *LIMITS)):
        true, held = _parameter(system, name), dict[float, list[str]]()
        for other in (CONTROLLER, PLANNER):
            same = PortName(other, name.port)
            value = _parameter(system, same)
            if true is not None and value is not None and value != true:
                held.setdefault(value, []).append(str(same))
                others.add(other)
        for value, names in held.items():
            texts.append(f"{name} = {true:.12g}, but {' = '.join(names)} = {value:.12g}")
    if not texts:
        return None
    made = "is" if len(others) == 1 else "are"
    return f"{'; '.join(texts)}: {' and '.join(sorted(others))} {made} set for another vehicle"


def _parameter(system: System, name: PortName) -> float | None:
    """The value of a parameter that is a number; None: there is none of the name."""
    if not system.has(name):
        return None
    variable = system.component(name.component).variables[name.port]
    is_one = (variable.causality, variable.type) == ("parameter", "Real")
    value = system.value(name) if is_one else None
    return None if value is None else float(value)


def cautions_after(table: Table) -> list[str]:
    """What a run has shown, in lines for the user."""
    return [*_of_the_robust_term(table), *_of_the_vertical(table)]


def _of_the_robust_term(table: Table) -> list[str]:
    """Whether it chatters; theta_hat[1] is the part of rho_hat that is there at any speed."""
    if len(table) < 2 or table.missing(THETA_HAT[:1], (_EPS_T, _H_MAX, ELL, *VEHICLE)):
        return []
    rho_hat, eps_t = float(table[THETA_HAT[0]].max()), parameter(table, _EPS_T)
    plant = vehicle(lambda name: parameter(table, name))
    lambda_m2 = bounds(plant, parameter(table, ELL)).lambda_m2
    h = min(table.header.experiment.step, parameter(table, _H_MAX))
    h_p = h * robust_rate(rho_hat, eps_t, lambda_m2)
    if h_p <= _REVERSES:
        return []
    return [
        f"the robust term chatters: with theta_hat[1] up to {rho_hat:.3g} N and {_EPS_T} = "
        f"{eps_t:g} W it has h p = {h_p:.3g} and reverses in every step above {_REVERSES:g}; "
        "raise eps_t or take smaller steps"
    ]


def _of_the_vertical(table: Table) -> list[str]:
    """Whether a vehicle of five degrees of freedom has passed it."""
    if not len(table) or table.missing((_PITCH,), (_ROLL,)):
        return []
    beyond = np.cos(table[_PITCH]) * np.cos(table[_PITCH][0]) <= 0.0
    if table.parameters[port_name(_ROLL)] is not False or not beyond.any():
        return []
    return [
        f"the pitch passes 90 degrees by t = {table.time[beyond.argmax()]:g} s, where (1) has a "
        f"pole: with {_ROLL} = false what follows depends on rounding, so quote no single run; "
        f"compare runs whose plant.eta0 differs by 1e-6 m, or set {_ROLL} = true"
    ]


def cautions_beside(table: Table, name: str, other: Table) -> list[str]:
    """What a run has shown beside the one that it is compared with, in lines for the user.

    Args:
        table: of the run.
        name: of the one that it is compared with.
        other: of that one.

    """
    if table.missing(Y_D) or other.missing(Y_D):
        return []
    _, here, there = np.intersect1d(table.time, other.time, return_indices=True)
    away = table.group(*Y_D)[here] - other.group(*Y_D)[there]
    apart = float(np.linalg.norm(away, axis=1).max(initial=0.0))
    if apart <= _SAME:
        return []
    return [
        f"its reference planner.y_d is up to {apart:.3g} m away from that of {name}: the two runs "
        "follow different paths"
    ]


#: Units of a velocity at a port.
_VELOCITY_UNITS = {"m/s", "rad/s"}


def velocities_reaching(system: System, component: str = CONTROLLER) -> list[str]:
    """Velocities of the vehicle that reach a component, directly or through others.

    The vehicle is what the component feeds. Empty for a controller without velocity sensors.
    """
    vehicles = {c.target.component for c in system.connections if c.source.component == component}
    sources = (connection.source for connection in reaching(system, component, until=vehicles))
    return sorted(
        {
            str(source)
            for source in sources
            if source.component in vehicles
            and unit_of(system.component(source.component).variable(source.port)) in _VELOCITY_UNITS
        }
    )
