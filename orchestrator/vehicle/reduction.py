"""Reducers of a run in progress: what they keep of its rows, and what that comes to.

Rows come in blocks; what is made of them does not depend on the blocks.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from math import isnan
from typing import Any, NamedTuple

import numpy as np

from fmus.ports.groups import SCOPE, compiled, gathered
from fmus.ports.port import Port
from fmus.ports.reducer import Reducer
from orchestrator.cosim import Experiment, Header, Value
from orchestrator.machine.errors import InputError
from orchestrator.vehicle.compiled_reducers import CompiledReduction, Raised, library_of
from orchestrator.vehicle.signals import Loop

#: How a double of a row becomes a value of a port, by its type.
_MADE, _WHOLE = {"Real": "{}", "Boolean": "bool({})"}, "int({})"


class Sources(NamedTuple):
    """Where the inputs of a reducer come from in a run.

    Attributes:
        places: in a row, time first, of those that change, by the names of their ports.
        constants: values of the others.
        missing: what they are called in the run that it lacks.

    """

    places: dict[str, int]
    constants: dict[str, Value]
    missing: list[str]


def sources_of(
    reducer: Reducer, loop: Loop, places: Mapping[str, int], values: Mapping[str, Any]
) -> Sources:
    """Where the inputs of a reducer come from.

    Args:
        reducer: that takes them.
        loop: whose names they have.
        places: of the columns of the run in a row, time first.
        values: of its parameters.

    Raises:
        InputError: a parameter is no number.

    """
    found = Sources({}, {}, [])
    for port in reducer.ports:
        name = loop.port(port.name)
        if port.name in loop.implied:
            found.constants[port.name] = loop.implied[port.name]
        elif name in places:
            found.places[port.name] = places[name]
        elif name in values:
            found.constants[port.name] = _number(port, name, values[name])
        elif port.name in reducer.defaults:
            found.constants[port.name] = reducer.defaults[port.name]
        else:
            found.missing.append(name)
    return found


def _number(port: Port, name: str, value: Any) -> Value:
    """The value of a parameter in the type of a port.

    Raises:
        InputError: it is of another one.

    """
    if isinstance(value, str) and value in port.choices:
        return port.choices[value]
    if not isinstance(value, int | float) or port.choices:
        raise InputError(f"{name} is {value!r}, not a number")
    return float(value) if port.type == "Real" else value


def reductions_of(
    reducers: Iterable[Reducer], loops: Sequence[Loop], header: Header
) -> dict[Loop, dict[Reducer, Reduction]]:
    """Reducers of each vehicle in a run that is about to begin: those that it has all inputs for.

    Raises:
        InputError: a parameter that they take is no number.

    """
    values = {str(name): value for name, value in header.parameters.items()}
    found: dict[Loop, dict[Reducer, Reduction]] = {loop: {} for loop in loops}
    for loop, reducer in product(loops, reducers):
        sources = sources_of(reducer, loop, header.place, values)
        if not sources.missing:
            found[loop][reducer] = Reduction(reducer, sources, header.experiment)
    return found


class _Interpreted:
    """A reducer of rows in Python."""

    def __init__(self, reducer: Reducer, sources: Sources, run: Experiment) -> None:
        self._reducer, self._run = reducer, run
        self._arguments = {name: reducer.arguments(name) for name in reducer.hooks}
        names = {port.name: f"x{i}" for i, port in enumerate(reducer.ports)}
        types = {port.name: port.type for port in reducer.ports}
        made = {one: _MADE.get(types[one], _WHOLE).format(names[one]) for one in sources.places}
        scope = {**SCOPE, **{names[one]: value for one, value in sources.constants.items()}}
        inputs = gathered(reducer.inputs, iter({**names, **made}.values()), scope)
        row = ", ".join(["time", *(names[one] for one in sources.places)])
        self._inputs = compiled("row", f"({row},) = row\n return {inputs}", scope)
        self._state: Any = None
        self._before: Any = None
        self._time = run.start_time

    def _call(self, hook: str, t: float, **given: Any) -> Any:
        """Call a hook.

        Raises:
            Raised: by the hook.

        """
        given |= {"state": self._state, "t": t}
        given |= {"begin": self._run.start_time, "end": self._run.stop_time}
        try:
            return self._reducer.hooks[hook](*(given[one] for one in self._arguments[hook]))
        except Exception as error:
            raise Raised(f"{type(error).__name__}: {error}", t) from error

    def take(self, rows: np.ndarray) -> None:
        """Take some rows into account.

        Raises:
            Raised: by one of them.

        """
        for row in rows.tolist():
            inputs, before, t = self._inputs(row), self._before, row[0]
            if before is None:
                self._state = self._call("start", t, inputs=inputs)
            else:
                acting = inputs if self._run.acting_row else before
                self._state = self._call(
                    "update", t, inputs=inputs, before=before, acting=acting, h=t - self._time
                )
            self._before, self._time = inputs, t

    def found(self) -> list[float]:
        """The numbers of the results.

        Raises:
            Raised: by what gives them.

        """
        return [*_flat(self._call("outputs", self._time))]


class Reduction:
    """A reducer of a run in progress.

    Attributes:
        failure: what a hook has raised, and when; after that it reduces nothing; empty: nothing.

    """

    def __init__(self, reducer: Reducer, sources: Sources, run: Experiment) -> None:
        """Start with no rows."""
        self._reducer, self._sources, self._run = reducer, sources, run
        self._columns = [0, *sources.places.values()]
        self._recent: deque[np.ndarray] = deque()
        self._reducing, self._has_rows = self._begun(), False
        self.failure = ""

    def _begun(self) -> _Interpreted | CompiledReduction:
        library = library_of(self._reducer)
        if library is None:
            return _Interpreted(self._reducer, self._sources, self._run)
        places = {name: i for i, name in enumerate(self._sources.places, 1)}
        return CompiledReduction(library, self._reducer, places, self._sources.constants, self._run)

    def take(self, rows: np.ndarray) -> None:
        """Take some rows of the run into account."""
        rows = rows[:, self._columns]
        if self._reducer.last is None:
            self._reduce(rows)
            return
        self._recent.append(rows)
        while self._recent[0][-1, 0] < rows[-1, 0] - self._reducer.last:
            self._recent.popleft()

    def _reduce(self, rows: np.ndarray) -> None:
        if self.failure or not len(rows):
            return
        self._has_rows = True
        try:
            self._reducing.take(rows)
        except Raised as error:
            self._fail(error)

    def _fail(self, error: Raised) -> None:
        self.failure = f"{self._reducer.name}: at t = {error.time:g} s: {error}"

    def found(self) -> dict[str, list[float]]:
        """The members of its indices by their names; what is not a number is not there."""
        if self._recent and self._reducer.last is not None:
            rows = np.vstack(self._recent)
            self._reducing = self._begun()
            self._reduce(rows[rows[:, 0] >= rows[-1, 0] - self._reducer.last])
        if self.failure or not self._has_rows:
            return {}
        try:
            numbers = iter(self._reducing.found())
        except Raised as error:
            self._fail(error)
            return {}
        results = self._reducer.results.items()
        values = {name: [next(numbers) for _ in ports] for name, ports in results}
        return {name: found for name, found in values.items() if not all(map(isnan, found))}


def _flat(value: Any) -> Iterator[float]:
    """The numbers in a value, in their order."""
    if not isinstance(value, tuple):
        yield float(value)
        return
    for part in value:
        yield from _flat(part)
