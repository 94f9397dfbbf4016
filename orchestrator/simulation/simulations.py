"""Many simulations of one system side by side, stepped by its program on all cores or a card."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.cosim import Linear, Mapped, Order, PortName, System
from orchestrator.machine.errors import InputError
from orchestrator.program.card import Card
from orchestrator.program.many import Beginning, as_array, many_of
from orchestrator.program.session import ProgramSession, stepped_program
from orchestrator.runs.preparation import MANY_STEPS, prepare_options
from orchestrator.runs.request import SystemOptions
from orchestrator.runs.scenario import routes
from orchestrator.simulation.simulation import Settable, ports_of, settables_of


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

    On a graphics card, with `device="cuda"`, values are arrays of CuPy, which torch and jax take
    without a copy (DLPack), as theirs are taken here. Views are not protected from writing there,
    but only `sims[name] = values` makes inputs and parameters follow.

    Attributes:
        n: number of simulations.
        arrays: package of their arrays: numpy, or CuPy.
        device: context that makes the card the current one of CuPy; the first one always is.
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
        device: str | Card | None = None,
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
            threads: number of threads of the processor; None: one for each core.
            device: `cuda` for a graphics card of NVIDIA, `cuda:1` for the second; None or `cpu`:
                the processor.

        Raises:
            ValueError: a name or a value is not usable, a component is not in the language of
                equations, the scenario has events or a table of inputs, or there is no such device.

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
        self._program = stepped_program(prepared.plan, is_quick=True)
        self._many = many_of(self._program, n, threads, device)
        self.arrays, self.device = self._many.arrays, self._many.device
        experiment = prepared.experiment
        self.step_size, self.stop_time = experiment.step, prepared.stop_time
        self._start_time = experiment.start_time
        #: Parameters at the start, and those that are not the same in all, by their numbers.
        self._same = self._program.parameters(prepared.plan)
        self._varied: dict[int, Any] = {}
        self._views: dict[str, Any] = {}
        self._settables: dict[str, list[Settable]] = {}
        self._is_stale = False
        self.reset(parameters=each)

    # Time

    @property
    def time(self) -> np.ndarray:
        """Present times of all simulations [s]."""
        with self.device:
            times: np.ndarray = self._start_time + self._many.made * self.step_size
        return times

    @property
    def failed(self) -> np.ndarray:
        """True for each simulation that a component has stopped; :meth:`reset` begins it again."""
        with self.device:
            failed: np.ndarray = self._many.has_failed.astype(bool)
        return failed

    def step(self, n_steps: int = 1) -> None:
        """Make steps with all simulations; failed ones stay."""
        with self.device:
            self._advance(self._many.made + np.int32(n_steps))

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
        with self.device:
            self._advance(self.arrays.maximum(self._many.made, np.int32(whole)))

    def _advance(self, until: Any) -> None:
        self._many.advance(self.arrays.ascontiguousarray(until, dtype=np.int32))
        self._is_stale = False

    # Values

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the present values of a port, parameter or group: a view that cannot be written.

        Raises:
            KeyError: there is no such name; the text has a suggestion.

        """
        with self.device:
            values: np.ndarray = self._values(name)
        return values

    def _values(self, name: str) -> Any:
        if self._is_stale:
            self._many.pass_on()
            self._is_stale = False
        if name in self._views:
            return self._views[name]
        try:
            ports = ports_of(self._system, name)
        except InputError as error:
            raise KeyError(str(error)) from None
        view = self._many.view(ports)
        is_copy = view.base is None
        if self._system.has(PortName.read(name)):
            view = view[:, 0]
        if not is_copy:
            self._views[name] = view
        return view

    def __setitem__(self, name: str, values: Any) -> None:
        """Override inputs, or set tunable parameters: one value for all, or one for each.

        Raises:
            ValueError: there is no such input or parameter, or it does not take the values.

        """
        if name not in self._settables:
            self._settables[name] = settables_of(self._system, name)
        settables = self._settables[name]
        with self.device:
            columns = self._columns(name, values, self.n, len(settables))
            for settable, column in zip(settables, columns, strict=True):
                numbers = self._numbers(settable, column)
                if not settable.targets:
                    self._tune(settable.port, numbers)
                for target, change in settable.targets:
                    self._many.override(target, _arriving(numbers, change))
        self._is_stale = True

    def _columns(self, name: str, values: Any, n: int, n_ports: int) -> Any:
        """Return the values of each port: one for all, for each simulation, or for each member.

        Raises:
            InputError: their number is another one.

        """
        array = as_array(self.arrays, values)
        is_row = n_ports > 1 and array.shape in ((n, n_ports), (n_ports,))
        if array.ndim and not is_row and array.shape != (n,):
            shape = f"({n}, {n_ports})" if n_ports > 1 else f"({n},)"
            raise InputError(f"{name}: takes an array of shape {shape}, not {array.shape}")
        package = self.arrays if isinstance(array, self.arrays.ndarray) else np
        if is_row:
            return package.broadcast_to(array, (n, n_ports)).T
        return package.broadcast_to(array, (n_ports, n))

    def _numbers(self, settable: Settable, values: Any) -> Any:
        """Return the numbers of some values of a port.

        Raises:
            InputError: one is not of its type, or out of range.

        """
        variable, kind = settable.variable, values.dtype.kind
        least, most = settable.least, settable.most
        if kind in "iu" and variable.family == "Integer" and not variable.items:
            least, most = map(float, variable.range)
        if kind in "fiu":
            numbers = values.astype(float)
            # NaN is not in the range, either.
            if ((least <= numbers) & (numbers <= most)).all():
                return numbers
        number, port = self._program.number, settable.port
        each = [number(port, settable.taken(value)) for value in values.tolist()]
        return self.arrays.asarray(each, dtype=float)

    def _tune(self, port: PortName, numbers: Any) -> None:
        number = self._program.settables[port]
        before = self._values(str(port)).astype(float)
        if self._many.tune(number, numbers):
            self._many.tune(number, before)
            raise InputError(f"{port}: the component refuses some of the values")

    def __delitem__(self, name: str) -> None:
        """Let inputs take again what feeds them, and unconnected ones the value they had before.

        Raises:
            ValueError: there is no such input.

        """
        for port in ports_of(self._system, name, ("input", "output")):
            for target, _ in routes(self._system, port):
                with self.device:
                    self._many.release(target)
        self._is_stale = True

    # States

    @property
    def states(self) -> np.ndarray:
        """Whole states, a row of bytes, or of words on a card, for each simulation, without a copy.

        Copied rows are saved states. Rows may be assigned, within these simulations or to others of
        the same system and device: `sims.states[:] = sims.states[0]` makes all equal.
        """
        states: np.ndarray = self._many.states
        return states

    def reset(self, which: Any = None, parameters: Mapping[str, Any] | None = None) -> None:
        """Begin some simulations again; nothing is overridden in them.

        Args:
            which: their numbers, or a Boolean for each simulation; None: all.
            parameters: in place of their last ones; an array has a value for each of them.

        Raises:
            ValueError: a name or a value is not usable, or a component refuses it.

        """
        with self.device:
            numbers = self._which(which)
            varied = self._varied.copy()
            for name, given in (parameters or {}).items():
                ports = ports_of(self._system, name, ("parameter", "input"))
                columns = self._columns(name, given, len(numbers), len(ports))
                for port, column in zip(ports, columns, strict=True):
                    if port not in self._program.settables:
                        raise InputError(f"{port} is not a parameter")
                    i = self._program.settables[port]
                    varied[i] = (
                        varied[i].copy()
                        if i in varied
                        else self.arrays.full(self.n, float(self._same[i]))
                    )
                    settable = Settable.of(self._system, port)
                    varied[i][numbers] = self._numbers(settable, column)
            self._begin(numbers, varied)
        self._varied = varied

    def _which(self, which: Any) -> Any:
        """Return the numbers of some simulations."""
        arrays = self.arrays
        numbers = arrays.arange(self.n, dtype=np.int32)
        if which is None:
            return numbers
        if isinstance(which, (list, tuple)):
            which = np.arange(self.n)[list(which)]
        if not isinstance(which, slice):
            which = as_array(arrays, which)
        return arrays.ascontiguousarray(arrays.atleast_1d(numbers[which]))

    def _begin(self, numbers: Any, varied: Mapping[int, Any]) -> None:
        values = self.arrays.empty((len(varied), len(numbers)))
        for row, column in zip(values, varied.values(), strict=True):
            row[:] = column[numbers]
        end = self._start_time + MANY_STEPS * self.step_size
        times = self._start_time, self.step_size, end, MANY_STEPS
        self._many.begin(numbers, Beginning(self._same, [*varied], values, *times))
        self._is_stale = False
        failed = self._many.has_failed[numbers]
        if failed.any():
            first = int(numbers[failed.argmax()])
            own = self._same.copy()
            for i, column in varied.items():
                own[i] = float(column[first])
            raise InputError(f"simulation {first}: {self._reason(own)}")

    def _reason(self, values: np.ndarray) -> str:
        """Return the reason why parameters are refused."""
        types: Mapping[str, type] = {"Real": float, "Boolean": bool}
        own = {
            str(name): types.get(self._system.variable(name).family, int)(values[i])
            for name, i in self._program.settables.items()
        }
        try:
            ProgramSession(self._prepared.with_parameters(own).plan)
        except InputError as error:
            return str(error)
        return "a component refuses its parameters"

    def __len__(self) -> int:
        return self.n

    def __repr__(self) -> str:
        """Show the system and the number in one line."""
        return f"<Simulations {self._prepared.scenario.name}: {self.n}>"


def _has_rows(value: Any, n: int) -> bool:
    """Tell whether a value is an array with a row for each simulation."""
    return len(getattr(value, "shape", ())) > 0 and len(value) == n


def _arriving(numbers: Any, change: Linear | Mapped | None) -> Any:
    """Return the numbers that arrive at the end of a connection."""
    if isinstance(change, Mapped):
        arriving = numbers.copy()
        for source, target in change.pairs:
            arriving[numbers == source] = target
        return arriving
    return numbers if change is None else change(numbers)
