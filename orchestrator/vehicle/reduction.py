"""Evaluation of reducers, such as indices, over the rows of a run in progress.

Rows come in blocks, and results do not depend on the sizes of the blocks. A reducer is compiled if
it is in the language of equations and there is a compiler; else its hooks are called in Python.
Both give the same numbers, the compiled one far sooner.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from ctypes import CDLL, c_char_p, c_double, c_int, c_size_t, c_void_p, create_string_buffer
from functools import cache, partial
from itertools import product
from math import isnan
from typing import Any, NamedTuple

import numpy as np

from fmus.native.names import RUNTIME
from fmus.ports.groups import SCOPE, compiled, flat, gathered
from fmus.ports.port import Port
from fmus.ports.reducer import Reducer
from orchestrator.cosim import Experiment, Header, Value
from orchestrator.machine.compilers import (
    EXPORTED,
    FLAGS,
    MATHEMATICS,
    compile_text,
    library_key,
    load_library,
    own_compiler,
)
from orchestrator.machine.errors import InputError
from orchestrator.machine.identity import code_of
from orchestrator.machine.lazy import passing_line
from orchestrator.vehicle.signals import Loop

#: Category of the libraries in the cache.
CATEGORY = "indices"

#: The package of the bundled indices, and the packages that determine their libraries.
_OURS = "orchestrator.vehicle.index."
_MADE_OF = ("auv_fmu", "fmus.language", "fmus.native", "fmus.ports", "orchestrator.vehicle")

_OPTIONS = (*FLAGS, *EXPORTED, f"-I{RUNTIME}", "-w", *MATHEMATICS)

#: Expressions that turn a double of a row into a value of a port, by the port's type.
_MADE, _WHOLE = {"Real": "{}", "Boolean": "bool({})"}, "int({})"


class Sources(NamedTuple):
    """Sources of a reducer's inputs in a run.

    Attributes:
        places: columns of the inputs that change, by the names of their ports; time is column 0.
        constants: values of the other inputs.
        missing: names of signals and parameters that the run lacks.

    """

    places: dict[str, int]
    constants: dict[str, Value]
    missing: list[str]


def sources_of(
    reducer: Reducer, loop: Loop, places: Mapping[str, int], values: Mapping[str, Any]
) -> Sources:
    """Find the sources of a reducer's inputs.

    Args:
        reducer: the reducer.
        loop: the loop whose signals it takes.
        places: numbers of the columns of the run, by their names; time is column 0.
        values: parameters of the run.

    Raises:
        InputError: a parameter is not a number.

    """
    sources = Sources({}, {}, [])
    for port in reducer.ports:
        name = loop.port(port.name)
        if port.name in loop.implied:
            sources.constants[port.name] = loop.implied[port.name]
        elif name in places:
            sources.places[port.name] = places[name]
        elif name in values:
            sources.constants[port.name] = _number(port, name, values[name])
        elif port.name in reducer.defaults:
            sources.constants[port.name] = reducer.defaults[port.name]
        else:
            sources.missing.append(name)
    return sources


def _number(port: Port, name: str, value: Any) -> Value:
    """Convert the value of a parameter to the type of a port.

    Raises:
        InputError: it has another type.

    """
    if isinstance(value, str) and value in port.choices:
        return port.choices[value]
    if not isinstance(value, int | float) or port.choices:
        raise InputError(f"{name} is {value!r}, not a number")
    return float(value) if port.type == "Real" else value


def reductions_of(
    reducers: Iterable[Reducer], loops: Sequence[Loop], header: Header
) -> dict[Loop, dict[Reducer, Reduction]]:
    """Start reducers for each vehicle of a run, except those for which the run lacks an input.

    Raises:
        InputError: a parameter that they take is not a number.

    """
    values = {str(name): value for name, value in header.parameters.items()}
    reductions: dict[Loop, dict[Reducer, Reduction]] = {loop: {} for loop in loops}
    for loop, reducer in product(loops, reducers):
        sources = sources_of(reducer, loop, header.place, values)
        if not sources.missing:
            reductions[loop][reducer] = Reduction(reducer, sources, header.experiment)
    return reductions


# Evaluation, in Python or compiled


class Raised(ArithmeticError):
    """An exception of a hook, and the time of the row at which it was raised [s]."""

    def __init__(self, why: str, time: float) -> None:
        """Take the message and the time."""
        super().__init__(why)
        self.time = time


class _Interpreted:
    """A reducer whose hooks are called in Python."""

    def __init__(self, reducer: Reducer, sources: Sources, run: Experiment) -> None:
        self._reducer, self._run = reducer, run
        self._arguments = {name: reducer.arguments(name) for name in reducer.hooks}
        names = {port.name: f"x{i}" for i, port in enumerate(reducer.ports)}
        types = {port.name: port.type for port in reducer.ports}
        made = {name: _MADE.get(types[name], _WHOLE).format(names[name]) for name in sources.places}
        scope = {**SCOPE, **{names[name]: value for name, value in sources.constants.items()}}
        inputs = gathered(reducer.inputs, iter({**names, **made}.values()), scope)
        row = ", ".join(["time", *(names[name] for name in sources.places)])
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
            return self._reducer.hooks[hook](*(given[name] for name in self._arguments[hook]))
        except Exception as error:
            raise Raised(f"{type(error).__name__}: {error}", t) from error

    def take(self, rows: np.ndarray) -> None:
        """Process rows.

        Raises:
            Raised: a hook has raised an exception.

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
        """Return the numbers of the results.

        Raises:
            Raised: a hook has raised an exception.

        """
        return [*map(float, flat(self._call("outputs", self._time)))]


class _Compiled:
    """A compiled reducer."""

    def __init__(
        self,
        library: CDLL,
        reducer: Reducer,
        places: Mapping[str, int],
        constants: Mapping[str, Value],
        run: Experiment,
    ) -> None:
        """Start without rows."""
        self._library, self._reducer, self._run = library, reducer, run
        self._memory = create_string_buffer(library.size_of_rows())
        names = [port.name for port in reducer.ports]
        self._from = np.array([places.get(name, -1) for name in names], dtype=np.intc)
        self._constants = np.array([float(constants.get(name, 0.0)) for name in names])

    def take(self, rows: np.ndarray) -> None:
        """Process rows.

        Raises:
            Raised: a hook has raised an exception.

        """
        rows = np.ascontiguousarray(rows)
        taken = self._library.take_rows(
            self._memory, rows.ctypes.data, len(rows), rows.shape[1], self._from.ctypes.data,
            self._constants.ctypes.data, self._run.acting_row, self._run.start_time,
            self._run.stop_time,
        )  # fmt: skip
        if taken < len(rows):
            raise Raised(self._library.why(self._memory).decode(), float(rows[taken, 0]))

    def found(self) -> list[float]:
        """Return the numbers of the results.

        Raises:
            Raised: a hook has raised an exception.

        """
        array = np.empty(self._reducer.n_results)
        run = self._run
        if self._library.give_numbers(
            self._memory, run.start_time, run.stop_time, array.ctypes.data
        ):
            raise Raised(self._library.why(self._memory).decode(), run.stop_time)
        numbers: list[float] = array.tolist()
        return numbers


@cache
def library_of(reducer: Reducer) -> CDLL | None:
    """Load or compile the library of a reducer; None if it cannot be compiled quickly."""
    module = reducer.hooks["update"].__module__
    # Translating takes far longer than hashing the code that translates.
    made_of = module if module.startswith(_OURS) else _text(reducer)
    if made_of is None:
        return None
    key = library_key(made_of, code_of(*_MADE_OF), *_OPTIONS)
    try:
        library = load_library(CATEGORY, key, "take_rows", partial(_compile, reducer))
    except OSError:
        return None
    library.size_of_rows.restype = c_size_t
    library.why.argtypes, library.why.restype = (c_void_p,), c_char_p
    library.take_rows.argtypes = (
        c_void_p, c_void_p, c_int, c_int, c_void_p, c_void_p, c_int, c_double, c_double,
    )  # fmt: skip
    library.give_numbers.argtypes = (c_void_p, c_double, c_double, c_void_p)
    return library


@cache
def _text(reducer: Reducer) -> str | None:
    """Translate a reducer to C; None if it is outside the language of equations."""
    # Slow to import, and most runs find a library in the cache.
    from fmus.native.reducer import text_over_rows  # noqa: PLC0415

    return text_over_rows(reducer)


def _compile(reducer: Reducer) -> bytes:
    """Compile the library of a reducer.

    Raises:
        OSError: it cannot be compiled.

    """
    compiler, text = own_compiler(), _text(reducer)
    if compiler is None or text is None:
        raise OSError(f"{reducer.name} cannot be compiled")
    with passing_line(f"compiling {reducer.name} (only once) ..."):
        return compile_text(compiler, text, *_OPTIONS)


class Reduction:
    """A reducer of a run in progress.

    Attributes:
        failure: exception of a hook with its time, after which rows are ignored; empty if none.

    """

    def __init__(self, reducer: Reducer, sources: Sources, run: Experiment) -> None:
        """Start without rows."""
        self._reducer, self._sources, self._run = reducer, sources, run
        self._columns = [0, *sources.places.values()]
        self._recent: deque[np.ndarray] = deque()
        self._reducing, self._has_rows = self._begun(), False
        self.failure = ""

    def _begun(self) -> _Interpreted | _Compiled:
        library = library_of(self._reducer)
        if library is None:
            return _Interpreted(self._reducer, self._sources, self._run)
        places = {name: i for i, name in enumerate(self._sources.places, 1)}
        return _Compiled(library, self._reducer, places, self._sources.constants, self._run)

    def take(self, rows: np.ndarray) -> None:
        """Process rows of the run."""
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
        """Return the members of its indices by name; indices that are not a number are left out."""
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
        return {name: members for name, members in values.items() if not all(map(isnan, members))}
