"""Rings of direct feedthroughs: the algebraic loops that FMUs form, solved at one time.

A ring is closed when each input that its components feed equals the value that arrives there.
Values first go round it once; Newton's method on the Real inputs removes the remaining difference,
by setting inputs and getting outputs at the same time. No step is made or taken back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import inf

import numpy as np

from orchestrator.cosim.component import Component
from orchestrator.cosim.connection import Connection, PortName
from orchestrator.cosim.fmi.instance import ComponentFailed, Instance
from orchestrator.cosim.row import Gathering, Row
from orchestrator.cosim.system import System
from orchestrator.cosim.variables import Variable
from orchestrator.machine.errors import shortened
from orchestrator.machine.texts import real

#: Tolerances, relative and absolute: a ring is at rest within the first; iteration stops at the
#: second.
_REST, _ROUNDING = (1e-10, 1e-12), (1e-14, 1e-14)

#: Limits for the rounds of discrete values, the steps of Newton's method, and the halvings of a
#: step.
_MOST_ROUNDS, _MOST_STEPS, _MOST_HALVINGS = 1000, 50, 10

#: Derivatives are used again while each step leaves at most this share of the difference: ones from
#: differences, and exact ones, which cost less and converge faster.
_GOOD_STEP, _EXACT_STEP = 0.1, 1e-3

#: Relative change of an input, or of its nominal value, for differences; the same for a Float32,
#: and the relative tolerance of a Float32.
_CHANGE, _CHANGE_OF_FLOAT32, _GRAIN_OF_FLOAT32 = 1e-7, 1e-3, 2.0**-22

#: Rings with more inputs are not solved: their matrix would take more than 128 MB.
_MOST_INPUTS = 4000


@dataclass(frozen=True)
class _Part:
    """One component of a ring.

    Attributes:
        instance: of the component.
        row: that it is tied to.
        gather: gathers the inputs that are fed within the ring.
        block: indices of the component's derivatives in a matrix of the ring's inputs.
        unknowns, inputs: Reals that the ring feeds, as columns of the row and as variables.
        sources, outputs: Reals that feed the ring's Real inputs, as columns and as variables.

    """

    instance: Instance
    row: Row
    gather: Gathering
    block: tuple[np.ndarray, ...]
    unknowns: np.ndarray
    inputs: list[Variable]
    sources: np.ndarray
    outputs: list[Variable]

    def exchange(self) -> None:
        """Set its inputs and read its outputs, including those that are shown later in a step."""
        self.instance.exchange()
        self.row.show(self.instance.name)

    @property
    def is_exact(self) -> bool:
        """True if its FMU gives its derivatives."""
        return not self.outputs or self.instance.gives_derivatives

    def changes(self) -> np.ndarray:
        """Return derivatives of its outputs by its inputs from differences: (sources, unknowns)."""
        values = self.row.values
        derivatives = np.zeros((len(self.sources), len(self.unknowns)))
        here = values[self.sources]
        for i, (column, variable) in enumerate(zip(self.unknowns, self.inputs, strict=True)):
            held = values[column]
            values[column] = _near(held, variable)
            self.exchange()
            derivatives[:, i] = (values[self.sources] - here) / (values[column] - held)
            values[column] = held
        self.exchange()
        return derivatives

    def derivatives(self) -> np.ndarray:
        """Return derivatives of its outputs by its inputs, from the FMU or from differences."""
        if self.outputs and self.is_exact:
            with suppress(ComponentFailed):
                outputs = [variable.name for variable in self.outputs]
                columns = [
                    self.instance.derivatives(outputs, variable.name) for variable in self.inputs
                ]
                return np.array(columns).reshape(len(self.inputs), len(outputs)).T
        return self.changes()


class Ring:
    """A ring of components that are stepped as one.

    Attributes:
        names: of the components, in the order in which values go round.
        outer: gathers the inputs that other components feed.

    """

    def __init__(
        self, names: Sequence[str], system: System, instances: Mapping[str, Instance], row: Row
    ) -> None:
        """Tie a ring to the row of all values.

        Args:
            names: of its components.
            system: that it belongs to.
            instances: of the components.
            row: that they are tied to.

        """
        self.names = list(names)
        self._values, self._columns = row.values, row.columns
        self._components = system.components
        own = set(names)
        feeding = [connection for name in names for connection in system.feeding[name]]
        connections = [c for c in feeding if c.source.component in own]
        self.outer = Gathering.along(row, [c for c in feeding if c.source.component not in own])
        self._targets, sources = row.places(connections)
        self._ports = [connection.target for connection in connections]
        self._real = np.array([_is_real(system, c) for c in connections], dtype=bool)
        self._reals = np.ix_(self._real, self._real)
        grain = np.array([_grain(system, connection) for connection in connections])
        # A value that is not a Real either equals the other one or differs from it.
        self._rest, self._rounding = (
            (self._real * np.maximum(relative, grain), self._real * absolute)
            for relative, absolute in (_REST, _ROUNDING)
        )
        self._parts: list[_Part] = []
        into: dict[str, list[int]] = {name: [] for name in names}
        out_of: dict[str, list[int]] = {name: [] for name in names}
        for i, connection in enumerate(connections):
            into[connection.target.component].append(i)
            out_of[connection.source.component].append(i)
        for name in names:
            variables, inner = system.components[name].variables, into[name]
            unknowns = [i for i in inner if self._real[i]]
            feeds = [i for i in out_of[name] if self._real[i]]
            self._parts.append(
                _Part(
                    instances[name],
                    row,
                    Gathering.along(row, [connections[i] for i in inner]),
                    np.ix_(feeds, unknowns),
                    self._targets[unknowns],
                    [variables[connections[i].target.port] for i in unknowns],
                    sources[feeds],
                    [variables[connections[i].source.port] for i in feeds],
                )
            )

        is_exact = all(part.is_exact for part in self._parts)
        self._good_step = _EXACT_STEP if is_exact else _GOOD_STEP

    @property
    def gatherings(self) -> list[Gathering]:
        """Everything that the components of the ring take."""
        return [self.outer, *self._inner]

    @property
    def _inner(self) -> list[Gathering]:
        return [part.gather for part in self._parts]

    def unsolved(self) -> dict[str, str]:
        """Return the components that prevent a solution between steps, with reasons."""
        if len(self._targets) > _MOST_INPUTS:
            return dict.fromkeys(self.names, f"it has more than {_MOST_INPUTS} inputs")
        reasons = {
            part.instance.name: why_not_following(
                self._components[part.instance.name], part.instance, part.row
            )
            for part in self._parts
        }
        return {name: why for name, why in reasons.items() if why}

    @property
    def is_closed(self) -> bool:
        """True if each input has the value that arrives there."""
        return not _differ(*self._looked(), self._rest).any()

    def check(self) -> None:
        """Close the ring if a change of its components has opened it."""
        self._exchange()
        if not self.is_closed:
            self.close()

    def renew(self, always: bool = False) -> bool:
        """Take what other components feed the ring now, and close it.

        Args:
            always: if set, also where nothing has changed.

        Returns:
            True if something has changed.

        """
        values, targets = self._values, self.outer.targets
        before = values[targets]
        self.outer(values)
        as_before = before.tobytes() == values[targets].tobytes()
        if not always and as_before and self.is_closed:
            return False
        self.close()
        return True

    def close(self) -> None:
        """Iterate until each input has the value that arrives there.

        Raises:
            ComponentFailed: the values do not converge, or a component fails.

        """
        self._go_round()
        derivative, steps = None, 0
        for _ in range(_MOST_ROUNDS):
            held, arriving = self._looked()
            moving = _differ(held, arriving, self._rounding)
            if not moving.any():
                return
            if (
                moving[~self._real].any()
                or not np.isfinite(arriving).all()
                or len(moving) > _MOST_INPUTS
            ):
                self._go_round()
                derivative = None
                continue
            steps += 1
            if derivative is None:
                derivative = self._derivative()
            near = not _differ(held, arriving, self._rest).any()
            left = self._step(held, arriving, derivative, 1 if near else _MOST_HALVINGS)
            if left >= 1.0 or steps == _MOST_STEPS or (near and left > _GOOD_STEP):
                break
            if left > self._good_step:
                derivative = None
        moving = _differ(*self._looked(), self._rest)
        if moving.any():
            ports = ", ".join(str(self._ports[i]) for i in np.flatnonzero(moving))
            raise ComponentFailed(
                f"an algebraic loop does not converge: the values that still change are "
                f"{shortened(ports)}; start values closer to a solution may help"
            )

    def _exchange(self) -> None:
        for part in self._parts:
            part.exchange()

    def _go_round(self) -> None:
        for part in self._parts:
            part.gather(self._values)
            part.exchange()

    def _looked(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the values of the inputs, and the values that arrive there."""
        values, targets = self._values, self._targets
        held = values[targets]
        for gather in self._inner:
            gather(values)
        arriving = values[targets]
        values[targets] = held
        return held, arriving

    def _derivative(self) -> np.ndarray:
        """Return the derivative of the Real inputs minus the values that arrive there."""
        n = len(self._targets)
        matrix = np.zeros((n, n))
        factors = np.concatenate([gather.factors for gather in self._inner])
        for part in self._parts:
            matrix[part.block] = part.derivatives()
        real = self._reals
        return np.asarray((np.eye(n) - factors[:, np.newaxis] * matrix)[real])

    def _step(
        self, held: np.ndarray, arriving: np.ndarray, derivative: np.ndarray, tries: int
    ) -> float:
        """Make a step of Newton's method, halved until it reduces the difference.

        Returns:
            The remaining share of the difference.

        """
        try:
            change = np.linalg.solve(derivative, (arriving - held)[self._real])
        except np.linalg.LinAlgError:
            return inf
        targets = self._targets[self._real]
        scale = np.maximum(np.abs(held), 1.0)
        before = np.linalg.norm((arriving - held) / scale)
        left = inf
        for halvings in range(tries):
            self._values[targets] = held[self._real] + change / 2**halvings
            self._exchange()
            now, then = self._looked()
            left = float(np.linalg.norm((then - now) / scale) / before)
            if left < 1.0:
                break
        return left


def why_not_following(component: Component, instance: Instance, row: Row) -> str | None:
    """Return why values cannot pass through a component without a step; None: they can.

    They can if any Real output follows any Real input.
    """
    inputs, outputs = (
        {
            row.columns[PortName(component.name, variable.name)]: variable
            for variable in component.having(causality)
            if variable.family == "Real"
        }
        for causality in ("input", "output")
    )
    values, places = row.values, list(outputs)

    def shown() -> np.ndarray:
        instance.exchange()
        row.show(component.name)
        return values[places]

    here = shown()
    follows = False
    for column, variable in inputs.items():
        held = values[column]
        values[column] = _near(held, variable)
        follows = not np.array_equal(shown(), here, equal_nan=True)
        values[column] = held
        if follows:
            break
    shown()
    if follows:
        return None
    return f"no Real output of {component.name} follows a Real input between steps"


def _differ(
    held: np.ndarray, arriving: np.ndarray, by: tuple[np.ndarray, np.ndarray]
) -> np.ndarray:
    # numpy's isclose takes longer than the FMUs. The check of the row reports values that are not
    # finite.
    relative, absolute = by
    differ: np.ndarray = np.abs(arriving - held) > absolute + relative * np.abs(held)
    return differ


def _is_real(system: System, connection: Connection) -> bool:
    """Return True for a connection from a Real to a Real."""
    return all(
        system.components[end.component].variables[end.port].family == "Real"
        for end in (connection.source, connection.target)
    )


def _grain(system: System, connection: Connection) -> float:
    """Return the relative rounding of a value on its way through a connection."""
    ends = (connection.source, connection.target)
    types = [system.components[end.component].variables[end.port].type for end in ends]
    return _GRAIN_OF_FLOAT32 if "Float32" in types else 0.0


def _near(held: float, variable: Variable) -> float:
    """Return a value near the present one of an input."""
    share = _CHANGE_OF_FLOAT32 if variable.type == "Float32" else _CHANGE
    change = share * max(abs(held), abs(_number(variable.nominal, 1.0)) or 1.0)
    return held + (change if held + change <= _number(variable.max, inf) else -change)


def _number(text: str | None, otherwise: float) -> float:
    """Return the number in a description, or another one if there is none."""
    with suppress(ValueError):
        return otherwise if text is None else real(text)
    return otherwise
