"""Many simulations of one system side by side, stepped by its program on all cores."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.cosim import Order, PortName, System
from orchestrator.machine.errors import InputError
from orchestrator.machine.workers import cores
from orchestrator.program.session import Place, ProgramSession, stepped_program
from orchestrator.runs.preparation import MANY_STEPS, prepare_options
from orchestrator.runs.request import SystemOptions
from orchestrator.runs.scenario import routes
from orchestrator.simulation.simulation import Settable, ports_of, settables_of

#: Least number of simulations for which a further thread is worth its start.
_WORTH_A_THREAD = 128


class Simulations:
    """Simulations of one system, which are stepped together and differ in values.

        sims = Simulations("fig4", 1000, {"plant.m11": np.linspace(20.0, 30.0, 1000)})
        sims.run(until=10.0)
        sims["plant.eta"]                       # (1000, 6)
        sims["plant.tau.u"] = np.zeros(1000)

    The system is one compiled program, so all its components are in the language of equations.
    Numbers are those of :class:`Simulation`.

    `sims[name]` is an array with a value, or a row for a group, of each simulation: a view of the
    present values, which later steps change; copy what is to stay. `sims[name] = values` overrides
    inputs, or sets tunable parameters, with one value for all or one for each.

    Attributes:
        n: number of simulations.
        step_size: length of a step [s].
        stop_time: end of :meth:`run` [s]; None: there is none.

    """

    def __init__(
        self,
        system: str | Path | Mapping[str, Any] | System,
        n: int,
        parameters: Mapping[str, Any] | None = None,
        *,
        stop_time: float | None = None,
        step: float | None = None,
        order: Order | None = None,
        threads: int | None = None,
    ) -> None:
        """Load a system, and settle the values of all simulations at the start.

        Args:
            system: as for :class:`Simulation`.
            n: number of simulations.
            parameters: values in place of the scenario's, by `component.parameter`; an array of n
                values, or of n rows for a group, has one for each simulation.
            stop_time: end of :meth:`run` [s]; None: the scenario's.
            step: communication step [s]; None: the scenario's.
            order: of the components; None: the scenario's.
            threads: number of threads; None: one for each core.

        Raises:
            ValueError: a name or a value is not usable, a component is not in the language of
                equations, or the scenario has events or a table of inputs.

        """
        if n < 1:
            raise InputError(f"n = {n}: must be at least 1")
        self.n = n
        parameters = dict(parameters or {})
        each = {name: value for name, value in parameters.items() if _has_rows(value, n)}
        same = {name: value for name, value in parameters.items() if name not in each}
        options = SystemOptions(system, same, stop_time=stop_time, step=step, order=order)
        prepared = prepare_options(options, is_open=True)
        if prepared.events or prepared.input_tables:
            raise InputError(f"{prepared.scenario.name}: has events or a table of inputs")
        self._prepared, self._system = prepared, prepared.system
        program = self._program = stepped_program(prepared.plan, is_quick=True)
        self._library = program.library
        experiment = prepared.experiment
        self.step_size, self.stop_time = experiment.step, prepared.stop_time
        self._start_time = experiment.start_time
        self._memory = np.zeros((n, program.size), dtype=np.uint8)
        self._threads = min(threads or cores(), max(n // _WORTH_A_THREAD, 1))
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None
        bounds = np.linspace(0, n, self._threads + 1).astype(int).tolist()
        self._parts = [*pairwise(bounds)]
        members = program.members
        self._made, self._is_passed, self._has_failed = (
            self._view([Place(members[name], is_whole=True)])[:, 0]
            for name in ("made", "is_passed", "has_failed")
        )
        self._factors, self._offsets = (
            self._view([Place(members[name] + 8 * i, False) for i in range(len(program.inputs))])
            for name in ("factors", "offsets")
        )
        self._values = np.tile(program.parameters(prepared.plan), (n, 1))
        self._views: dict[str, np.ndarray] = {}
        self._settables: dict[str, list[Settable]] = {}
        self._is_stale = False
        self.reset(parameters=each)

    def _view(self, places: list[Place]) -> np.ndarray:
        """Return a view of some numbers of all simulations, (n, places), or a copy."""
        first, size = places[0], self._program.size
        apart = places[1].at - first.at if len(places) > 1 else 8
        if all(
            place == Place(first.at + i * apart, first.is_whole) for i, place in enumerate(places)
        ):
            shape = (self.n, len(places))
            return np.ndarray(shape, first.dtype, self._memory, first.at, (size, apart))
        return np.column_stack([self._view([place]) for place in places])

    # Time

    @property
    def time(self) -> np.ndarray:
        """Present times of all simulations [s]."""
        times: np.ndarray = self._start_time + self._made * self.step_size
        return times

    @property
    def failed(self) -> np.ndarray:
        """True for each simulation that a component has stopped; :meth:`reset` begins it again."""
        return self._has_failed.astype(bool)

    def step(self, n_steps: int = 1) -> None:
        """Make steps with all simulations; failed ones stay."""
        self._advance(self._made + np.int32(n_steps))

    def run(self, until: float | None = None) -> None:
        """Make steps with all simulations up to a time [s]; None: :attr:`stop_time`.

        Raises:
            ValueError: the time is not a multiple of the step.

        """
        end = self.stop_time if until is None else until
        if end is None:
            raise InputError(
                f"{self._prepared.scenario.name}: has no stop time; use run(until=...)"
            )
        steps = (end - self._start_time) / self.step_size
        whole = round(steps)
        if abs(steps - whole) > 1e-9 * max(whole, 1):
            raise InputError(f"until = {end:g} s: must be a multiple of {self.step_size:g} s")
        self._advance(np.maximum(self._made, np.int32(whole)))

    def _advance(self, until: np.ndarray) -> None:
        until = np.ascontiguousarray(until, dtype=np.int32)

        def advance(part: tuple[int, int]) -> None:
            first, last = part
            self._library.advance_all(
                self._memory[first:].ctypes.data, last - first, until[first:].ctypes.data
            )

        if self._pool is None:
            advance(self._parts[0])
        else:
            list(self._pool.map(advance, self._parts))
        self._is_stale = False

    # Values

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the present values of a port, parameter or group: a view that cannot be written.

        Raises:
            KeyError: there is no such name; the text has a suggestion.

        """
        if self._is_stale:
            self._library.pass_all(self._memory.ctypes.data, self.n)
            self._is_stale = False
        if name in self._views:
            return self._views[name]
        try:
            ports = ports_of(self._system, name)
        except InputError as error:
            raise KeyError(str(error)) from None
        places = [self._place(port) for port in ports]
        view = self._view(places)
        if self._system.has(PortName.read(name)):
            view = view[:, 0]
        if view.base is not None:
            view.flags.writeable = False
            self._views[name] = view
        return view

    def _place(self, port: PortName) -> Place:
        program = self._program
        if port in program.columns:
            return program.columns[port]
        _, place = program.settables[port]
        return place

    def __setitem__(self, name: str, values: Any) -> None:
        """Override inputs, or set tunable parameters: one value for all, or one for each.

        Raises:
            ValueError: there is no such input or parameter, or it does not take the values.

        """
        if name not in self._settables:
            self._settables[name] = settables_of(self._system, name)
        settables = self._settables[name]
        columns = _columns(name, values, self.n, len(settables))
        for settable, column in zip(settables, columns, strict=True):
            numbers = self._numbers(settable, column)
            if not settable.targets:
                self._tune(settable.port, numbers)
            for target, change in settable.targets:
                arriving = numbers
                if change is not None:
                    arriving = np.array([float(change(value)) for value in numbers.tolist()])
                self._override(target, arriving)
        self._is_stale = True

    def _numbers(self, settable: Settable, values: np.ndarray) -> np.ndarray:
        """Return the numbers of some values of a port.

        Raises:
            InputError: one is not of its type, or out of range.

        """
        if values.dtype.kind in "fiu":
            numbers: np.ndarray = values.astype(float)
            # NaN is not in the range, either.
            if ((settable.least <= numbers) & (numbers <= settable.most)).all():
                return numbers
        number, port = self._program.number, settable.port
        return np.array([number(port, settable.taken(value)) for value in values.tolist()])

    def _override(self, target: PortName, numbers: np.ndarray) -> None:
        i = self._program.inputs[target]
        self._factors[:, i] = 0.0
        self._offsets[:, i] = numbers
        self._is_passed[:] = 0
        if target in self._program.settables:
            # Nothing feeds it.
            self._view([self._program.columns[target]])[:, 0] = numbers

    def _tune(self, port: PortName, numbers: np.ndarray) -> None:
        number, _ = self._program.settables[port]
        before = self[str(port)].astype(float)
        numbers = np.ascontiguousarray(numbers)
        if self._library.tune_all(self._memory.ctypes.data, self.n, number, numbers.ctypes.data):
            self._library.tune_all(self._memory.ctypes.data, self.n, number, before.ctypes.data)
            raise InputError(f"{port}: the component refuses some of the values")

    def __delitem__(self, name: str) -> None:
        """Let inputs take again what feeds them, and unconnected ones the value they had before.

        Raises:
            ValueError: there is no such input.

        """
        for port in ports_of(self._system, name, ("input", "output")):
            for target, _ in routes(self._system, port):
                for i in range(self.n):
                    memory = self._memory[i].ctypes.data
                    self._library.release(memory, self._program.inputs[target])
        self._is_stale = True

    # States

    @property
    def states(self) -> np.ndarray:
        """Whole states, a row of bytes for each simulation, without a copy.

        Copied rows are saved states. Rows may be assigned, within these simulations or to others of
        the same system: `sims.states[:] = sims.states[0]` makes all equal.
        """
        return self._memory

    def reset(self, which: Any = None, parameters: Mapping[str, Any] | None = None) -> None:
        """Begin some simulations again; nothing is overridden in them.

        Args:
            which: their numbers, or a Boolean for each simulation; None: all.
            parameters: in place of their last ones; an array has a value for each of them.

        Raises:
            ValueError: a name or a value is not usable, or a component refuses it.

        """
        numbers = np.arange(self.n, dtype=np.int32)
        if which is not None:
            numbers = np.ascontiguousarray(np.atleast_1d(numbers[which]))
        values = self._values.copy() if parameters else self._values
        for name, given in (parameters or {}).items():
            ports = ports_of(self._system, name, ("parameter", "input"))
            columns = _columns(name, given, len(numbers), len(ports))
            for port, column in zip(ports, columns, strict=True):
                if port not in self._program.settables:
                    raise InputError(f"{port} is not a parameter")
                number, _ = self._program.settables[port]
                settable = Settable.of(self._system, port)
                values[numbers, number] = self._numbers(settable, column)
        end = self._start_time + MANY_STEPS * self.step_size
        self._library.begin_all(
            self._memory.ctypes.data, len(numbers), numbers.ctypes.data, values.ctypes.data,
            self._start_time, self.step_size, end, MANY_STEPS,
        )  # fmt: skip
        self._is_stale = False
        failed = numbers[self.failed[numbers]]
        if len(failed):
            first = int(failed[0])
            why = self._reason(values[first])
            raise InputError(f"simulation {first}: {why}")
        self._values = values

    def _reason(self, values: np.ndarray) -> str:
        """Return the reason why parameters are refused."""
        names = {str(name): values[i].item() for name, (i, _) in self._program.settables.items()}
        try:
            ProgramSession(self._prepared.with_parameters(names).plan)
        except InputError as error:
            return str(error)
        return "a component refuses its parameters"

    def __len__(self) -> int:
        return self.n

    def __repr__(self) -> str:
        """Show the system and the number in one line."""
        return f"<Simulations {self._prepared.scenario.name}: {self.n}>"


def _has_rows(value: object, n: int) -> bool:
    """Tell whether a value is an array with a row for each simulation."""
    return isinstance(value, np.ndarray) and value.ndim > 0 and len(value) == n


def _columns(name: str, values: Any, n: int, n_ports: int) -> np.ndarray:
    """Return the values of each port: one for all, one for each simulation, or one for each member.

    Raises:
        InputError: their number is another one.

    """
    array = np.asarray(values)
    if n_ports > 1 and array.shape in ((n, n_ports), (n_ports,)):
        return np.broadcast_to(array, (n, n_ports)).T
    if array.shape == (n,):
        return np.broadcast_to(array, (n_ports, n))
    if array.ndim:
        shape = f"({n}, {n_ports})" if n_ports > 1 else f"({n},)"
        raise InputError(f"{name}: takes an array of shape {shape}, not {array.shape}")
    return np.broadcast_to(array, (n_ports, n))
