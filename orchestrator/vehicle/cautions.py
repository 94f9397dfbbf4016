"""Warnings about numbers that are valid but misleading, known before a run or from its rows.

Among the former: velocities that reach a controller which is meant to work without them.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from math import inf, nan
from typing import NamedTuple

import numpy as np

from auv_fmu.paper.observer import Form
from fmus.ports.reducer import read_reducer
from orchestrator.cosim import Ending, Header, PortName, System, Table, Value
from orchestrator.vehicle.index import observer_step, robust_step, vertical_passed
from orchestrator.vehicle.index.observer_step import Inputs
from orchestrator.vehicle.reduction import reductions_of
from orchestrator.vehicle.signals import (
    STANDARD,
    AllocatedLoop,
    Loop,
    loops_of,
    value_of,
)

#: Largest distance of references that count as the same [m].
_SAME = 1e-6

#: Values of h p above which a mode of Euler's scheme changes its sign in every step, and grows.
_REVERSES, _GROWS = 1.0, 2.0

#: Returns the value of a parameter by its name `component.name`; None if there is none.
ValueOf = Callable[[str], Value | None]

#: Units of a velocity at a port.
_VELOCITY_UNITS = {"m/s", "rad/s"}

#: Kinds of warnings in the table of a study, and their explanations there.
UNSTABLE, CHATTERING, VERTICAL = "unstable observer", "chattering", "vertical passed"
CAUTIONS = {
    UNSTABLE: "k_d is too large for the internal steps of the controller; lower k_d or h_max",
    CHATTERING: "the robust term changes its sign in every step; raise eps_t or reduce the step",
    VERTICAL: "the pitch passes 90 degrees, and what follows depends on rounding; set "
    "plant.roll = true",
}


class Rule(NamedTuple):
    """A rule for a warning.

    Attributes:
        kind: one of :data:`CAUTIONS`.
        number: result of one of :data:`WATCHED`.
        above: value above which it warns.
        text: the warning: `{name}` is the name of a parameter in the loop, and `{name:g}` its
            value, or another result of the same reducer.

    """

    kind: str
    number: str
    above: float
    text: str


RULES = (
    Rule(
        UNSTABLE,
        "observer_step",
        _GROWS,
        "{controller.k_d} = {controller.k_d:g} 1/s is unstable with internal steps of "
        "{internal_step:g} s: the observer's fastest mode has h p = {observer_step:.3g} and grows "
        f"above {_GROWS:g}; lower k_d or h_max",
    ),
    Rule(
        CHATTERING,
        "robust_step",
        _REVERSES,
        "the robust term chatters: its step gain h p is {robust_step:.3g}, and above "
        f"{_REVERSES:g} its sign changes in every step "
        "(theta_hat[1] reaches {largest_bound:.3g} N, {controller.eps_t} = {controller.eps_t:g} W)"
        "; raise eps_t or reduce the step",
    ),
    Rule(
        VERTICAL,
        "vertical_passed",
        -inf,
        "the pitch passes 90 degrees by t = {vertical_passed:g} s, where (1) has a pole: with "
        "{plant.roll} = false what follows depends on rounding, so quote no single run; compare "
        "runs whose {plant.eta0} differs by 1e-6 m, or set {plant.roll} = true",
    ),
)

#: A field in the text of a rule: a name, and the digits of its value.
_FIELD = re.compile(r"\{([\w.]+)(:\.?\d*g)?\}")


class Caution(NamedTuple):
    """A warning about a run.

    Attributes:
        kind: one of :data:`CAUTIONS`.
        text: a line for the user of the run.

    """

    kind: str
    text: str


#: Parameters of a controller from which warnings before a run follow.
OBSERVER = ("k_d", "lambda", "h_max", "observer")


def values_of(system: System) -> ValueOf:
    """Return a function that returns the values of the parameters of a system."""

    def value(name: str) -> Value | None:
        port = PortName.read(name)
        return system.value(port) if system.has(port) else None

    return value


def observer_of(value: ValueOf, controller: str = STANDARD.controller) -> Inputs | None:
    """Return the parameters of a controller's observer, or None."""
    *numbers, form_of = (value(f"{controller}.{name}") for name in OBSERVER)
    if None in numbers:
        return None
    form = Form.EXACT if form_of in ("exact", Form.EXACT) else Form.EULER
    k_d, lambda_, h_max = (float(number or 0.0) for number in numbers)
    return Inputs(k_d, lambda_, h_max, form)


def gain_of_a_step(value: ValueOf, h: float, controller: str = STANDARD.controller) -> float:
    """Return k_d as used in a step of h seconds [1/s]; 0: there is no observer."""
    observer = observer_of(value, controller)
    return observer_step.gain_of(observer, h) if observer else 0.0


def cautions(value: ValueOf, step: float, loops: Sequence[Loop]) -> list[Caution]:
    """Return the warnings before a run with steps of a length [s]."""
    found: list[Caution] = []
    for loop in {loop.controller: loop for loop in loops}.values():
        if (observer := observer_of(value, loop.controller)) is not None:
            found += cautions_of(observer_step.of_step(observer, step)._asdict(), loop, value)
    return found


def cautions_of(numbers: Mapping[str, float], loop: Loop, value: ValueOf) -> Iterator[Caution]:
    """Yield the warnings of the rules whose numbers are given, by the names of the results."""

    def written(field: re.Match[str]) -> str:
        name, digits = field.groups()
        if not digits:
            return loop.port(name)
        number = numbers[name] if name in numbers else value(loop.port(name))
        return format(float(number or 0.0), digits[1:])

    for rule in RULES:
        if numbers.get(rule.number, nan) > rule.above:
            yield Caution(rule.kind, _FIELD.sub(written, rule.text))


def differing_vehicle(system: System) -> str | None:
    """Report values of the vehicle in a controller or planner that differ from the plant's.

    Returns:
        One line; None if there are none.

    """
    texts = (_differing(system, loop) for loop in loops_of(system))
    return "; ".join(filter(None, texts)) or None


def _differing(system: System, loop: Loop) -> str | None:
    texts, others = [], set()
    for text in (loop.ell, *loop.vehicle_parameters, *loop.limits):
        name = system.named(PortName.read(text))
        true, held = _real_parameter(system, name), dict[float, list[str]]()
        for other in (loop.controller, loop.planner):
            same = PortName(other, name.port)
            value = _real_parameter(system, same)
            if true is not None and value is not None and value != true:
                held.setdefault(value, []).append(str(same))
                others.add(other)
        for value, names in held.items():
            texts.append(f"{name} = {true:.12g}, but {' = '.join(names)} = {value:.12g}")
    if not texts:
        return None
    made = "is" if len(others) == 1 else "are"
    return f"{'; '.join(texts)}: {' and '.join(sorted(others))} {made} set for another vehicle"


def samples_too_old(system: System) -> str | None:
    """Report sensors whose samples arrive later than a filter uses them.

    Returns:
        One line; None if there are none.

    """
    texts = []
    for wire in system.connections:
        if wire.target.port.endswith(".age"):
            user = wire.target.component
            delay, most = PortName(wire.source.component, "delay"), PortName(user, "delay_max")
            age, limit = (_real_parameter(system, name) for name in (delay, most))
            if age is not None and limit is not None and age > limit:
                texts.append(
                    f"{delay} = {age:.12g}, but {most} = {limit:.12g}: {user} ignores these "
                    f"samples; raise {most}"
                )
    return "; ".join(texts) or None


def _real_parameter(system: System, name: PortName) -> float | None:
    """Return the value of a Real parameter; None if there is none of the name."""
    if not system.has(name):
        return None
    variable = system.component(name.component).variables[name.port]
    is_one = (variable.causality, variable.family) == ("parameter", "Real")
    value = system.value(name) if is_one else None
    return None if value is None else float(value)


#: Reducers from whose results warnings follow: before a run, and from its rows.
KNOWN_BEFORE = read_reducer(observer_step)
WATCHED = (read_reducer(robust_step), read_reducer(vertical_passed))


class Watch:
    """An observer that collects warnings from the rows of a run."""

    def __init__(self, loops: Sequence[Loop] = (STANDARD,)) -> None:
        """Watch some loops."""
        self._loops = loops

    def begin(self, header: Header) -> None:
        """Select the reducers that the run allows."""
        self._header = header
        self._reductions = reductions_of(WATCHED, self._loops, header)

    def take(self, rows: np.ndarray) -> None:
        """Process rows."""
        for reductions in self._reductions.values():
            for reduction in reductions.values():
                reduction.take(rows)

    def end(self, ending: Ending) -> None:
        """Do nothing: all rows have come."""

    def found(self) -> list[Caution]:
        """Return the warnings that follow from the rows."""
        table = Table.of(self._header, np.empty((0, 1 + len(self._header.columns))))
        return [
            caution
            for loop, reductions in self._reductions.items()
            for caution in cautions_of(
                {
                    name: value
                    for reduction in reductions.values()
                    for name, [value] in reduction.found().items()
                },
                loop,
                partial(value_of, table),
            )
        ]


def follows_vehicle(system: System, loop: Loop) -> bool:
    """Return True if the reference depends on where the vehicle is, as with guidance."""
    if loop.planner not in system.components:
        return False
    wires = system.reaching(loop.planner, until={loop.vehicle})
    return any(wire.source.component == loop.vehicle for wire in wires)


def cautions_beside(
    table: Table, name: str, other: Table, loops: Sequence[Loop] = (STANDARD,)
) -> list[str]:
    """Return lines for the user if references differ between a run and another one of some name."""
    return [line for loop in loops for line in _differing_reference(table, name, other, loop)]


def _differing_reference(table: Table, name: str, other: Table, loop: Loop) -> list[str]:
    if table.missing(loop.y_d) or other.missing(loop.y_d):
        return []
    _, here, there = np.intersect1d(table.time, other.time, return_indices=True)
    away = table.group(*loop.y_d)[here] - other.group(*loop.y_d)[there]
    apart = float(np.linalg.norm(away, axis=1).max(initial=0.0))
    if apart <= _SAME:
        return []
    return [
        f"its reference {loop.planner}.y_d is up to {apart:.3g} m away from {name}'s: the two "
        "runs follow different paths"
    ]


def velocities_reaching(system: System, loop: Loop = STANDARD) -> list[str]:
    """Return the velocities of the vehicle that reach its controller, directly or through others.

    The vehicle is the component that the controller feeds, directly or through an allocation. The
    list is empty for a controller without velocity sensors.
    """
    vehicles = {connection.target.component for connection in system.fed.get(loop.controller, ())}
    if isinstance(loop, AllocatedLoop):
        vehicles = vehicles - {loop.allocation} | {loop.vehicle}
    sources = (connection.source for connection in system.reaching(loop.controller, until=vehicles))
    return sorted(
        {
            str(source)
            for source in sources
            if source.component in vehicles and system.variable(source).unit in _VELOCITY_UNITS
        }
    )
