"""The rows of a system by brute force: from its description, without a schedule.

Formulas are computed as they stand; no code of the master is used.

Feedthrough order follows from FMI's communication points: there an output is a function
of the states, the inputs and the time (FMI 2.0.4, section 2.2.8), and doStep leads from one point
to the next with the inputs of the first (section 4.2.2). So a row holds what is true at its time:
every input has the value that feeds it, and every output follows from the inputs of its row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from math import floor, fmod, isfinite, log, sin, sqrt, tanh
from typing import Any

import numpy as np

from random_systems.generator import (
    ABSENT,
    ALL,
    UNITS,
    UNLISTED,
    Drawn,
    Fmu,
    Formula,
    Part,
    Variable,
    Wire,
    reached,
)

FEEDTHROUGH, GAUSS_SEIDEL, JACOBI = "feedthrough", "gauss-seidel", "jacobi"
DELAY, SOLVE = "delay", "solve"

#: Rounds of a ring until its values must be at rest, and what counts as rest.
_ROUNDS, _REST = 500, 2e-16

#: Condition of a ring beyond which its solution is not known well enough.
_WORST = 1e5

Port = tuple[str, str]


class NoSolution(Exception):
    """The values of a ring do not come to rest, or the order is not known."""


_OPERATORS: dict[str, Callable[..., Any]] = {
    "+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a,
    b: a / b, "sin": sin, "tanh": tanh, "sqrt": sqrt, "log": log, "max": max, "mod": fmod,
    "floor": floor, ">": lambda a, b: a > b, "or": lambda a, b: bool(a or b),
    "not": lambda a: not a, "same": lambda a, b: a == b, "pick": lambda a, b, c: b if a else c,
}  # fmt: skip


def value_of(formula: Formula, scope: Mapping[Any, Any]) -> Any:
    """Compute a formula from the values of its leaves."""
    operator, *rest = formula
    match operator:
        case "number" | "text":
            return rest[0]
        case "input" | "parameter" | "state":
            return scope[operator, rest[0]]
        case "time" | "length":
            return scope[operator]
    return _OPERATORS[operator](*(value_of(operand, scope) for operand in rest))


def arriving(drawn: Drawn, wire: Wire, value: Any) -> Any:
    """A value at the end of a wire."""
    source = drawn.parts[wire.source[0]].fmu.named(wire.source[1])
    target = drawn.parts[wire.target[0]].fmu.named(wire.target[1])
    if source.unit != target.unit:
        a, b = UNITS[source.unit], UNITS[target.unit]
        value = (a.factor * value + a.offset - b.offset) / b.factor
    if wire.linear is not None:
        value = wire.linear[0] * value + wire.linear[1]
    if wire.mapped:
        value = dict(wire.mapped).get(value, value)
    return typed(target, value)


def typed(variable: Variable, value: Any) -> Any:
    match variable.type:
        case "Real":
            return float(value)
        case "Boolean":
            return bool(value)
        case "String":
            return str(value)
    return int(value)


class Machine:
    """A component during a run."""

    def __init__(self, part: Part, start_time: float) -> None:
        self.fmu, self.time = part.fmu, start_time
        self.values = {
            variable.name: typed(variable, part.values.get(variable.name, variable.start))
            for variable in part.fmu.variables
            if variable.causality != "output"
        }
        self.states = [state.start for state in part.fmu.states]
        # Outputs that are computed only in steps, between these.
        self._held: dict[str, Any] = {}

    def _scope(self, h: float = 0.0) -> dict[Any, Any]:
        scope: dict[Any, Any] = {"time": self.time, "length": h}
        for variable in self.fmu.variables:
            if variable.causality != "output":
                scope[variable.causality, variable.name] = self.values[variable.name]
        for i, state in enumerate(self.states):
            scope["state", i] = state
        return scope

    def output(self, name: str) -> Any:
        """An output with the present inputs, states and time, or as held since the last step."""
        if name in self._held:
            return self._held[name]
        value = value_of(self.fmu.outputs[name], self._scope())
        if isinstance(value, float) and not isfinite(value):
            raise NoSolution(name)
        return typed(self.fmu.named(name), value)

    def step(self, t: float, h: float) -> None:
        """One step, with the inputs that it has."""
        scope = self._scope(h)
        self.states = [value_of(state.next, scope) for state in self.fmu.states]
        self.time = t + h
        self.hold()

    def hold(self) -> None:
        """Compute outputs for the time until the next step, if that is done in steps only."""
        self._held = {}
        if not self.fmu.responds:
            self._held = {
                variable.name: self.output(variable.name) for variable in self.fmu.having("output")
            }


def has_feedthrough(fmu: Fmu, output: str) -> bool:
    """True if an output depends, as declared, on an input of the same instant."""
    if fmu.declares in (ABSENT, UNLISTED):
        return True
    return bool(fmu.having("input") if fmu.declares == ALL else fmu.needs(output))


def follows(fmu: Fmu) -> bool:
    """True if any Real output follows any Real input at once."""
    return fmu.responds and any(
        fmu.named(needed).type == "Real"
        for output in fmu.having("output")
        if output.type == "Real"
        for needed in fmu.needs(output.name)
    )


def default_order(drawn: Drawn) -> str:
    """The order of a run for which none is stated."""
    passing = [
        drawn.parts[a].fmu
        for a, output in {wire.source for wire in drawn.wires}
        if has_feedthrough(drawn.parts[a].fmu, output)
    ]
    return FEEDTHROUGH if all(map(follows, passing)) else GAUSS_SEIDEL


def components(nodes: Sequence[Any], edges: Iterable[tuple[Any, Any]]) -> list[list[Any]]:
    """Strongly connected components of a graph, sources first."""
    reach = reached(nodes, edges)
    left = [{node} | {other for other in reach[node] if node in reach[other]} for node in nodes]
    groups = [sorted(group, key=nodes.index) for group in left]
    groups = [group for i, group in enumerate(groups) if group[0] == nodes[i]]
    found: list[list[Any]] = []
    while groups:
        # The first that no other leads to.
        group = next(
            group
            for group in groups
            if not any(group[0] in reach[other[0]] for other in groups if other is not group)
        )
        groups.remove(group)
        found.append(group)
    return found


def is_ring(group: Sequence[Any], edges: Iterable[tuple[Any, Any]]) -> bool:
    return len(group) > 1 or (group[0], group[0]) in set(edges)


class Evaluation:
    """One run of a system.

    Attributes:
        rows: values of all ports by `component.port`, one for each time.
        rings: the solved rings, as sets of components.

    """

    def __init__(self, drawn: Drawn, order: str | Sequence[str], coupling: str) -> None:
        self.drawn, self.order, self.coupling = drawn, order, coupling
        self.fed = {wire.target: wire for wire in drawn.wires}
        self.machines = {
            name: Machine(part, drawn.start_time) for name, part in drawn.parts.items()
        }
        self.rings = self._solved_rings()
        self.unit = {name: name for name in drawn.parts}
        for ring in self.rings:
            for name in ring:
                self.unit[name] = ring[0]
        self.late = self._late()
        self.rows: list[dict[str, Any]] = []
        self._run()

    # Dependencies

    def _feedthrough(self, wire: Wire) -> bool:
        return has_feedthrough(self.drawn.parts[wire.source[0]].fmu, wire.source[1])

    def _edges(self) -> list[tuple[str, str]]:
        return [
            (wire.source[0], wire.target[0]) for wire in self.drawn.wires if self._feedthrough(wire)
        ]

    def _solved_rings(self) -> list[list[str]]:
        if self.coupling != SOLVE:
            return []
        names, edges = list(self.drawn.parts), self._edges()
        responding = set()
        for ring in components(names, edges):
            if is_ring(ring, edges):
                responding |= {
                    name
                    for name in ring
                    if self.drawn.parts[name].every == 1 and follows(self.drawn.parts[name].fmu)
                }
        rest = [(a, b) for a, b in edges if a in responding and b in responding]
        found = components([name for name in names if name in responding], rest)
        return [sorted(ring, key=names.index) for ring in found if is_ring(ring, rest)]

    def _late(self) -> set[int]:
        """The wires with feedthrough that arrive one step late, by their identities."""
        names = list(self.drawn.parts)
        wires = {
            id(wire): (self.unit[wire.source[0]], self.unit[wire.target[0]])
            for wire in self.drawn.wires
            if self._feedthrough(wire)
            and (
                self.unit[wire.source[0]] != self.unit[wire.target[0]]
                or not any(wire.source[0] in ring for ring in self.rings)
            )
        }
        if self.order == JACOBI:
            return set(wires)
        if not isinstance(self.order, str):
            place: dict[str, int] = {}
            for i, name in enumerate(self.order):
                place.setdefault(self.unit[name], i)
            return {i for i, (a, b) in wires.items() if place[a] >= place[b]}
        units = [name for name in names if self.unit[name] == name]
        late: set[int] = set()
        while True:
            left = {i: ends for i, ends in wires.items() if i not in late}
            opened = set()
            for group in components(units, left.values()):
                if is_ring(group, left.values()):
                    first = min(group, key=names.index)
                    opened |= {i for i, (a, b) in left.items() if b == first and a in group}
            if not opened:
                return late
            late |= opened

    def _batches(self) -> list[list[list[str]]]:
        """Groups of units in the order of their steps; rings without a connection step together."""
        found: list[list[list[str]]] = []
        rings = [set(ring) for ring in self.rings]
        for members in self._sequence():
            if found and set(members) in rings and set(found[-1][-1]) in rings:
                before = {name for other in found[-1] for name in other}
                if not any(a in before and b in members for a, b in self._at_once_along()):
                    found[-1].append(members)
                    continue
            found.append([members])
        return found

    def _at_once_along(self) -> list[tuple[str, str]]:
        """Pairs of components: the second takes new outputs of the first."""
        return [
            (wire.source[0], wire.target[0])
            for wire in self.drawn.wires
            if self._feedthrough(wire) and id(wire) not in self.late
        ]

    def _sequence(self) -> list[list[str]]:
        """Units in the order of their steps: components, and rings as one."""
        names = list(self.drawn.parts)
        members: dict[str, list[str]] = {}
        for name in names:
            members.setdefault(self.unit[name], []).append(name)
        if self.order == JACOBI:
            return list(members.values())
        if not isinstance(self.order, str):
            units = list(dict.fromkeys(self.unit[name] for name in self.order))
            return [members[unit] for unit in units]
        edges = [(self.unit[a], self.unit[b]) for a, b in self._at_once_along()]
        edges = [(a, b) for a, b in edges if a != b]
        # Rings come last among the units that are ready.
        rings = {ring[0] for ring in self.rings}
        left, found = list(members), []
        while left:
            ready = [unit for unit in left if not any(a in left and b == unit for a, b in edges)]
            taken = [unit for unit in ready if unit not in rings] or ready
            left = [unit for unit in left if unit not in taken]
            found += [members[unit] for unit in taken]
        return found

    # Values

    def _hand(self, wire: Wire, value: Any) -> Any:
        """Set an input, and return the value that arrived."""
        arrived = arriving(self.drawn, wire, value)
        self.machines[wire.target[0]].values[wire.target[1]] = arrived
        return arrived

    def _settle(self, wires: Sequence[Wire]) -> None:
        """Set inputs to the outputs that feed them, in the order of their dependencies."""
        by_target = {wire.target: wire for wire in wires}
        sources = list(dict.fromkeys(wire.source for wire in wires))
        edges = [
            (by_target[source[0], needed].source, source)
            for source in sources
            for needed in self.drawn.parts[source[0]].fmu.needs(source[1])
            if (source[0], needed) in by_target
        ]
        for group in components(sources, edges):
            own = [wire for wire in wires if wire.source in group]
            if is_ring(group, edges):
                inner = [
                    wire
                    for wire in own
                    if any(
                        wire.target[0] == name
                        and wire.target[1] in self.drawn.parts[name].fmu.needs(output)
                        for name, output in group
                    )
                ]
                self._close(inner)
            for wire in own:
                self._hand(wire, self.machines[wire.source[0]].output(wire.source[1]))

    def _close(self, wires: Sequence[Wire]) -> None:
        """Close wires that form a ring: in rounds, or else by Newton's method."""
        begin = [self.machines[wire.target[0]].values[wire.target[1]] for wire in wires]
        try:
            for _ in range(_ROUNDS):
                if self._round(wires) <= _REST:
                    return
        except (ArithmeticError, ValueError, NoSolution):
            pass
        for wire, value in zip(wires, begin, strict=True):
            self.machines[wire.target[0]].values[wire.target[1]] = value
        self._newton(wires)

    def _round(self, wires: Sequence[Wire]) -> float:
        """Hand values along the wires once, and return the largest relative change."""
        most = 0.0
        for wire in wires:
            machine, port = self.machines[wire.target[0]], wire.target[1]
            before = machine.values[port]
            now = self._hand(wire, self.machines[wire.source[0]].output(wire.source[1]))
            if isinstance(now, float):
                most = max(most, abs(now - before) / max(abs(now), 1.0))
            elif now != before:
                most = 1.0
        return most

    def _newton(self, wires: Sequence[Wire]) -> None:
        real = [
            wire
            for wire in wires
            if self.drawn.parts[wire.target[0]].fmu.named(wire.target[1]).type == "Real"
        ]
        others = [wire for wire in wires if wire not in real]

        def put(x: np.ndarray) -> None:
            for wire, value in zip(real, x, strict=True):
                self.machines[wire.target[0]].values[wire.target[1]] = float(value)

        def arrived() -> np.ndarray:
            return np.array(
                [
                    arriving(self.drawn, wire, self.machines[wire.source[0]].output(wire.source[1]))
                    for wire in real
                ]
            )

        x = np.array([self.machines[wire.target[0]].values[wire.target[1]] for wire in real])
        for _ in range(100):
            put(x)
            settled = self._round(others) == 0.0
            residual = arrived() - x
            if settled and np.all(np.abs(residual) <= 1e-13 * np.maximum(np.abs(x), 1.0)):
                return
            slopes = np.empty((len(x), len(x)))
            for j in range(len(x)):
                moved = x.copy()
                moved[j] += 1e-6 * max(abs(x[j]), 1.0)
                put(moved)
                slopes[:, j] = (arrived() - moved - residual) / (moved[j] - x[j])
            if np.linalg.cond(slopes) > _WORST:
                raise NoSolution("hardly any solution")
            step = np.linalg.solve(slopes, -residual)
            share = 1.0
            while share > 1e-6:
                put(x + share * step)
                try:
                    if np.abs(arrived() - x - share * step).max() < np.abs(residual).max():
                        break
                except (ArithmeticError, ValueError, NoSolution):
                    pass
                share /= 2.0
            else:
                if np.all(np.abs(residual) <= 1e-11 * np.maximum(np.abs(x), 1.0)):
                    put(x)
                    return
            x = x + share * step
        raise NoSolution(", ".join(f"{wire.source} -> {wire.target}" for wire in real))

    # The run

    def _steps(self) -> list[tuple[float, float]]:
        """Beginning and end of every step."""
        drawn = self.drawn
        times = [drawn.start_time]
        while times[-1] + 1e-6 * drawn.step < drawn.stop_time:
            end = drawn.start_time + len(times) * drawn.step
            times.append(min(end, drawn.stop_time))
        return list(pairwise(times))

    def _run(self) -> None:
        drawn = self.drawn
        self._settle(drawn.wires)
        for machine in self.machines.values():
            machine.hold()
        shown = self._computed(list(drawn.parts))
        self._show(shown)
        if self.order == FEEDTHROUGH:
            self._run_in_feedthrough_order(shown)
            return
        spans, batches = self._steps(), self._batches()
        # Outputs that are shown later, with their times.
        waiting: dict[Port, tuple[int, Any]] = {}
        for k, (t, _) in enumerate(spans):
            before = dict(shown)
            for batch in batches:
                for members in batch:
                    every = drawn.parts[members[0]].every
                    if k % every:
                        continue
                    end = min(k + every, len(spans))
                    self._advance(members, t, spans[end - 1][1], shown, before)
                    for port, value in self._computed(members).items():
                        waiting[port] = end, value
                        if every == 1 or self._at_once(port):
                            shown[port] = value
                for members in batch if self.order != JACOBI else ():
                    self._renew(members, shown)
                for members in batch:
                    if members in self.rings or self._inner(members):
                        shown |= self._computed(members)
            shown |= {port: value for port, (end, value) in waiting.items() if end == k + 1}
            # Every row shows the solution of a ring.
            for ring in self.rings:
                self._renew(ring, shown)
                shown |= self._computed(ring)
            self._show(shown)

    def _is_flat(self, name: str) -> bool:
        """True if no Real output follows a small change of any Real input."""
        machine, found = self.machines[name], []
        outputs = [
            variable.name for variable in machine.fmu.having("output") if variable.type == "Real"
        ]
        for variable in machine.fmu.having("input"):
            if variable.type == "Real":
                held = machine.values[variable.name]
                before = [machine.output(output) for output in outputs]
                machine.values[variable.name] = held + 1e-7 * max(abs(held), 1.0)
                found.append(before == [machine.output(output) for output in outputs])
                machine.values[variable.name] = held
        return all(found)

    def _run_in_feedthrough_order(self, shown: dict[Port, Any]) -> None:
        """Make steps; after each, every input takes the value that feeds it at that time."""
        parts, spans = self.drawn.parts, self._steps()
        for wire in self.drawn.wires:
            if self._feedthrough(wire) and self._is_flat(wire.source[0]):
                raise NoSolution(f"nothing shows that values pass through {wire.source[0]}")
        for k, (t, _) in enumerate(spans):
            for name, part in parts.items():
                if k % part.every == 0:
                    end = spans[min(k + part.every, len(spans)) - 1][1]
                    self.machines[name].step(t, end - t)
            # Others are in the middle of a longer step.
            here = {
                name
                for name, part in parts.items()
                if (k + 1) % part.every == 0 or k + 1 == len(spans)
            }
            shown |= self._computed(list(here))
            before = dict(shown)
            for members in self._sequence():
                if here.issuperset(members):
                    for wire in self._outer(members):
                        self._hand(wire, (before if id(wire) in self.late else shown)[wire.source])
                    self._settle(self._inner(members))
                    shown |= self._computed(members)
            self._show(shown)

    def _advance(
        self,
        members: Sequence[str],
        t: float,
        end: float,
        shown: Mapping[Port, Any],
        before: Mapping[Port, Any],
    ) -> None:
        """Step a component, or the components of a ring as one.

        Args:
            members: the components.
            t, end: of the step.
            shown: outputs as they are seen now.
            before: as they were seen at the beginning of the communication step.

        """
        for wire in self._outer(members):
            new = self._at_once(wire.source) and id(wire) not in self.late
            self._hand(wire, (shown if new else before)[wire.source])
        self._settle(self._inner(members))
        for name in members:
            self.machines[name].step(t, end - t)

    def _computed(self, members: Sequence[str]) -> dict[Port, Any]:
        """The outputs of some components."""
        return {
            (name, variable.name): self.machines[name].output(variable.name)
            for name in members
            for variable in self.drawn.parts[name].fmu.having("output")
        }

    def _at_once(self, port: Port) -> bool:
        """True if an output is seen as soon as it is computed."""
        return self.order != JACOBI and has_feedthrough(self.drawn.parts[port[0]].fmu, port[1])

    def _renew(self, members: Sequence[str], shown: Mapping[Port, Any]) -> None:
        """Give a ring the latest values of its sources."""
        if inner := self._inner(members):
            for wire in self._outer(members):
                self._hand(wire, shown[wire.source])
            self._settle(inner)

    def _inner(self, members: Sequence[str]) -> list[Wire]:
        """The wires of a solved ring."""
        return [
            wire for wire in self.drawn.wires if wire.target[0] in members and self._is_inner(wire)
        ]

    def _outer(self, members: Sequence[str]) -> list[Wire]:
        return [
            wire
            for wire in self.drawn.wires
            if wire.target[0] in members and not self._is_inner(wire)
        ]

    def _is_inner(self, wire: Wire) -> bool:
        return any(wire.source[0] in ring and wire.target[0] in ring for ring in self.rings)

    def _show(self, outputs: Mapping[Port, Any]) -> None:
        row = {".".join(port): value for port, value in outputs.items()}
        for name, machine in self.machines.items():
            for variable in machine.fmu.having("input"):
                row[f"{name}.{variable.name}"] = machine.values[variable.name]
        self.rows.append(row)


def evaluate(
    drawn: Drawn, order: str | Sequence[str] = GAUSS_SEIDEL, coupling: str = DELAY
) -> Evaluation:
    """A run."""
    return Evaluation(drawn, order, coupling)
