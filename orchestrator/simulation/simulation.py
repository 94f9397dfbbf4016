"""A simulation that is stepped: inputs set, values read, states saved between any two steps."""

from __future__ import annotations

import signal
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any, Literal, NamedTuple, cast, get_args

import numpy as np

from fmus.kinds import PYTHON
from orchestrator.cosim import (
    Experiment,
    Header,
    Linear,
    Mapped,
    PortName,
    Session,
    System,
    Value,
    Variable,
)
from orchestrator.machine.errors import InputError, did_you_mean
from orchestrator.program.session import ProgramSession
from orchestrator.runs.preparation import MANY_STEPS, Prepared, prepare_options
from orchestrator.runs.request import PROGRAM, SystemOptions, method_takes_keywords, option
from orchestrator.runs.result import Result
from orchestrator.runs.scenario import routes

#: Loops of a simulation.
Loop = Literal["auto", "program", "compiled", "python"]


class SimulationFailed(RuntimeError):
    """A simulation that cannot continue; the text says when and why it stopped."""


@dataclass(frozen=True, kw_only=True)
class SimulationOptions(SystemOptions):
    """Arguments of :class:`Simulation`."""

    loop: Loop = option(  # type: ignore[assignment]
        "auto",
        "stepping loop: program (the system as one compiled program, of components in the language "
        "of equations), compiled (FMUs, loop in C) or python (FMUs), with the same numbers; "
        "default: auto (the first that is available; for the file of an FMU, the FMU)",
    )
    keep: bool = option(True, "keep a row for each step, for `result`")


class _Link(NamedTuple):
    """Rows, and those before them: simulations that go back share rows."""

    before: _Link | None
    rows: np.ndarray

    def __reduce__(self) -> tuple[Any, ...]:
        """Return all rows as one link: a chain may be too long for pickle."""
        return _Link, (None, all_rows(self))


def all_rows(link: _Link | None) -> np.ndarray:
    """Return the rows up to a link."""
    parts = []
    while link is not None:
        parts.append(link.rows)
        link = link.before
    return np.concatenate(parts[::-1]) if parts else np.empty((0, 0))


class _Rows:
    """An observer that keeps rows.

    Attributes:
        kept: the latest link; None: there are no rows.

    """

    kept: _Link | None = None

    def begin(self, header: Header) -> None:
        self.kept = None

    def take(self, rows: np.ndarray) -> None:
        self.kept = _Link(self.kept, rows.copy())

    def end(self, ending: object) -> None:
        pass


class Settable(NamedTuple):
    """An input, an output or a parameter that is set.

    Attributes:
        port: its name.
        variable: its description.
        least, most: range of floats that need no other check; empty for other types.
        targets: inputs that take the value, each with the transformation of its connection.

    """

    port: PortName
    variable: Variable
    least: float
    most: float
    targets: Sequence[tuple[PortName, Linear | Mapped | None]]

    @classmethod
    def of(cls, system: System, port: PortName) -> Settable:
        """Describe a port of a system."""
        variable = system.variable(port)
        least, most = inf, -inf
        if variable.family == "Real" and variable.type != "Float32":
            least, most = variable.range
        is_parameter = variable.causality == "parameter"
        return cls(port, variable, least, most, [] if is_parameter else routes(system, port))

    def taken(self, value: Any) -> Value:
        """Return a value in the type of the port.

        Raises:
            InputError: it is not of the type, or out of range.

        """
        if isinstance(value, np.generic):
            value = value.item()
        if type(value) is float and self.least <= value <= self.most:
            return value
        return self.variable.typed(value, str(self.port))


#: Causalities of ports with values.
_VALUED = ("output", "input", "parameter")


def ports_of(system: System, name: str, causalities: Sequence[str] = _VALUED) -> list[PortName]:
    """Return the port of a name, or the members of a group.

    Args:
        system: with the ports.
        name: of a port, a parameter or a group.
        causalities: of groups; the first that a group has counts.

    Raises:
        InputError: there is none; the message has a suggestion.

    """
    if "." in name:
        port = system.named(PortName.read(name))
        if system.has(port) and system.variable(port).causality in _VALUED:
            return [port]
        for causality in causalities:
            if members := system.members(name, (causality,)):
                return members
    known = [
        f"{component.name}.{variable.name}"
        for component in system.components.values()
        for variable in component.variables.values()
        if variable.causality in _VALUED
    ]
    raise InputError(f"no port or parameter {name!r}{did_you_mean(name, known)}")


def settables_of(system: System, name: str) -> list[Settable]:
    """Return the ports of a name that can be set between two steps.

    Raises:
        InputError: there are none.

    """
    ports = ports_of(system, name, ("input", "output", "parameter"))
    for port in ports:
        variable = system.variable(port)
        if variable.causality == "parameter" and variable.variability != "tunable":
            raise InputError(
                f"{port} is a {variable.variability} parameter: reset({{{str(port)!r}: ...}}) "
                "begins again with another value"
            )
    return [Settable.of(system, port) for port in ports]


def _close(session: Session | ProgramSession) -> None:
    """End a session, and free its FMUs."""
    with session:
        session.end()


class State(NamedTuple):
    """A state of a simulation: see :meth:`Simulation.save`."""

    columns: tuple[str, ...]
    loop: str
    session: Any
    rows: _Link | None
    held: Mapping[PortName, Value]


class Simulation:
    """A system that is stepped, with its inputs and parameters in your hands.

        with Simulation("fig4", {"plant.noise.std": 0.0}) as sim:
            sim["plant.tau.u"] = 12.0
            sim.run(until=10.0)
            print(sim.time, sim["plant.eta"], sim["controller.theta_hat[1]"])
            result = sim.result()

    `sim[name]` is the present value of a port or parameter, a group such as `plant.eta` an array.
    `sim[name] = value` overrides an input, whatever feeds it, or all inputs that an output feeds,
    until `del sim[name]`; an unconnected input keeps the value. A tunable parameter changes at
    once. In feedthrough order, a change shows at once in everything that depends on it.

    The end of a `with` statement, or :meth:`close`, frees FMUs. Several threads may step
    simulations of their own.

    Attributes:
        loop: that makes the steps: `program`, `compiled` or `python`.
        step_size: length of a step [s].
        stop_time: end of :meth:`run` [s]; None: there is none.

    """

    @method_takes_keywords(SimulationOptions)
    def __init__(self, options: SimulationOptions) -> None:
        """Load a system, and settle its values at the start.

        Args:
            {arguments}

        Raises:
            ValueError: a name, a value or a file is not usable; the message says what to change.

        """
        loops = get_args(Loop)
        if options.loop not in loops:
            raise InputError(f"loop {options.loop!r}: use one of {', '.join(loops)}")
        self._options = options
        self._start(prepare_options(options, is_open=True))

    def _start(self, prepared: Prepared) -> None:
        self._prepared = self._now = prepared
        self._rows = _Rows()
        self._session = self._opened()
        self.loop = cast(Loop, self._session.loop)
        self.step_size, self.stop_time = prepared.experiment.step, prepared.stop_time
        components = prepared.system.components
        #: Events, tables and components that need whole steps of the same length.
        self._rigid = [
            *(["the scenario's events"] if prepared.events else []),
            *(["tables of inputs"] if prepared.input_tables else []),
            *(name for name, n in prepared.plan.decimations.items() if n > 1),
            *(name for name, component in components.items() if not component.takes_any_step),
        ]
        self._has_hooks = bool(prepared.events or prepared.input_tables)
        self._closing = weakref.finalize(self, _close, self._session)
        self._names: dict[str, Any] = {}
        self._settables: dict[str, list[Settable]] = {}
        self._begin()

    def _opened(self) -> Session | ProgramSession:
        """Return the session of the best loop that can be had."""
        prepared, options = self._prepared, self._options
        observers = [self._rows] if options.keep else []
        why = None
        # Who names the file of an FMU means this file.
        is_fmu = isinstance(options.system, str | Path) and Path(options.system).suffix == ".fmu"
        if options.loop == PROGRAM or (options.loop == "auto" and not is_fmu):
            if prepared.events or prepared.input_tables:
                why = "it has no events and tables of inputs"
            elif options.isolate or options.kind == PYTHON:
                why = "it runs no FMUs: leave out kind and isolate"
            else:
                try:
                    return ProgramSession(prepared.plan, observers)
                except InputError as error:
                    # Wrong parameters are refused by FMUs, too.
                    why = str(error)
        if options.loop == PROGRAM:
            raise InputError(f"loop {PROGRAM!r}: {why}")
        return Session(prepared.plan, observers, prepared.hooks()).open()

    def _begin(self) -> None:
        """Act on the first row, and leave the end open."""
        session = self._session
        self._held: dict[PortName, Value] = {}
        self._places = {name: i for i, name in enumerate(session.header.columns)}
        session.advance(0)
        if not self._rigid:
            self._regrid(session.experiment.start_time, self.step_size)

    # Time

    @property
    def time(self) -> float:
        """Present time [s]."""
        session = self._session
        return session.experiment.time(session.made)

    def step(self, h: float | None = None) -> None:
        """Make a step.

        Args:
            h: its length [s]; None: :attr:`step_size`.

        Raises:
            ValueError: a component does not take steps of this length.
            SimulationFailed: a component fails, or has ended the run.

        """
        session = self._open()
        length = self.step_size if h is None else h
        if length != session.experiment.step:
            self._check_free(f"a step of {length:g} s")
            self._regrid(self.time, length)
        elif self._rigid and session.made >= session.experiment.full_steps:
            self._check_free("a step after the stop time")
        self._advance(session.made + 1)

    def run(self, until: float | None = None) -> None:
        """Make steps up to a time; the last one is shorter if it has to be.

        Args:
            until: end [s]; None: :attr:`stop_time`.

        Raises:
            ValueError: the time has passed, or a component does not take such steps.
            SimulationFailed: a component fails, or has ended the run.
            KeyboardInterrupt: Ctrl-C, after a whole step; the simulation can continue.

        """
        session = self._open()
        end, now = self.stop_time if until is None else until, self.time
        if end is None:
            raise InputError(f"{self._now.scenario.name}: has no stop time; use run(until=...)")
        if not end >= now:
            raise InputError(f"until = {end:g} s: the simulation has reached {now:g} s")
        if end == now:
            return
        if session.experiment.step != self.step_size:
            self._regrid(now, self.step_size)
        grid = replace(session.experiment, stop_time=end)
        if self._rigid:
            is_end = end == session.experiment.stop_time
            if not is_end and (
                grid.has_short_step or grid.full_steps > session.experiment.full_steps
            ):
                self._check_free(f"a run until {end:g} s")
            self._advance(grid.rows - 1)
            return
        self._advance(grid.full_steps)
        if grid.has_short_step:
            session.regrid(grid)
            self._advance(grid.rows - 1)
            self._regrid(end, self.step_size)

    def _check_free(self, what: str) -> None:
        """Refuse steps that components, events or tables do not allow."""
        if self._rigid:
            end = self._session.experiment.stop_time
            raise InputError(
                f"{what}: {self._rigid[0]} allows whole steps of {self.step_size:g} s only, up to "
                f"stop_time, {end:g} s"
            )

    def _regrid(self, start: float, step: float) -> None:
        """Continue with steps of a length, without an end."""
        experiment = self._session.experiment
        end = start + MANY_STEPS * step
        self._session.regrid(replace(experiment, start_time=start, step=step, stop_time=end))

    def _advance(self, until: int) -> None:
        session = self._session
        if self._held and self._has_hooks:
            # Events change inputs, too.
            while session.made < until and session.failure is None and session.remark is None:
                session.advance(session.made + 1)
                for port, value in self._held.items():
                    session.override(port, value)
        else:
            session.advance(until)
        self._check()

    def _check(self) -> None:
        """Raise an exception if no step can follow."""
        session = self._session
        if (failure := session.failure or session.remark) is None:
            return
        # Held back while the FMUs computed; now they act as usual.
        for number in session.take_interrupts():
            signal.raise_signal(number)
        raise SimulationFailed(failure)

    def _open(self) -> Session | ProgramSession:
        if not self._closing.alive:
            raise InputError("the simulation is closed")
        self._check()
        return self._session

    # Values

    def __getitem__(self, name: str) -> Any:
        """Return the present value of a port or a parameter, of a group an array.

        Raises:
            KeyError: there is no such name; the text has a suggestion.

        """
        place = self._names.get(name)
        if place is None:
            place = self._names[name] = self._found(name)
        if isinstance(place, int):
            return float(self._values()[place])
        if isinstance(place, np.ndarray):
            return self._values()[place]
        value: Callable[[], Any] = place
        return value()

    def _values(self) -> np.ndarray:
        session = self._session
        values = session.values()
        if session.failure is not None:
            self._check()
        return values

    def _found(self, name: str) -> Any:
        """Return the column of a name, the columns of a group, or a function for its value."""
        if name == "time":
            return lambda: self.time
        system, header = self._now.system, self._session.header
        try:
            ports = ports_of(system, name)
        except InputError as error:
            raise KeyError(str(error)) from None
        is_group = not system.has(PortName.read(name))
        if str(ports[0]) in self._places:
            places = [self._places[str(port)] for port in ports]
            if is_group:
                return np.array(places)
            if str(ports[0]) in header.types:
                return lambda: header.values(str(ports[0]), self._as_row())[0]
            return places[0]
        if is_group:
            return lambda: np.array([self._session.parameter(port) for port in ports])
        variable = system.variable(ports[0])
        return lambda: variable.shown(self._session.parameter(ports[0]))

    def _as_row(self) -> np.ndarray:
        return np.concatenate(([self.time], self._values()))[np.newaxis]

    def __setitem__(self, name: str, value: Any) -> None:
        """Override inputs, or set tunable parameters; of a group, with one value or one for each.

        Raises:
            ValueError: there is no such input or parameter, or it does not take the value.

        """
        session, settables = self._open(), self._settable(name)
        values = [value] * len(settables)
        if len(settables) > 1 and np.ndim(value):
            values = np.asarray(value).tolist()
            if len(values) != len(settables):
                raise InputError(f"{name}: takes {len(settables)} values, not {len(values)}")
        for settable, each in zip(settables, values, strict=True):
            taken = settable.taken(each)
            if not settable.targets:
                session.tune(settable.port, taken)
            for target, change in settable.targets:
                arriving = taken if change is None else change(taken)  # type: ignore[arg-type]
                session.override(target, arriving)
                self._held[target] = arriving

    def __delitem__(self, name: str) -> None:
        """Let inputs take again what feeds them, and unconnected ones the value they had before.

        Raises:
            ValueError: there is no such input, or it is not overridden.

        """
        session = self._open()
        targets = [target for settable in self._settable(name) for target, _ in settable.targets]
        for target in targets:
            if target not in self._held:
                raise InputError(f"{target} is not overridden")
        for target in targets:
            session.release(target)
            del self._held[target]

    def _settable(self, name: str) -> list[Settable]:
        """Return the ports of a name that can be set.

        Raises:
            InputError: there are none.

        """
        if name in self._settables:
            return self._settables[name]
        settables = settables_of(self._now.system, name)
        self._settables[name] = settables
        return settables

    # States

    def save(self) -> State:
        """Return the present state, with the rows so far, for :meth:`restore`.

        Raises:
            ValueError: an FMU does not provide its state.

        """
        session = self._open()
        if self._options.keep:
            session.hand_over()
        columns = session.header.columns
        return State(columns, self.loop, session.save(), self._rows.kept, dict(self._held))

    def restore(self, state: State) -> None:
        """Go back, or forward, to a saved state of this simulation or of a copy of it.

        Raises:
            ValueError: it is the state of another system or of another loop.

        """
        session = self._session
        if not self._closing.alive:
            raise InputError("the simulation is closed")
        if (state.columns, state.loop) != (session.header.columns, self.loop):
            raise InputError("this state belongs to another system, or to another loop")
        if self._options.keep:
            session.hand_over()
        session.restore(state.session)
        self._rows.kept, self._held = state.rows, dict(state.held)

    def copy(self) -> Simulation:
        """Return another simulation in the same state, which goes its own way.

        Raises:
            ValueError: an FMU does not provide its state.

        """
        state = self.save()
        twin = object.__new__(Simulation)
        twin._options = (
            self._options
            if self._options.loop == PROGRAM
            else replace(self._options, loop=self.loop)
        )
        twin._start(self._prepared)
        if self._now is not self._prepared:
            twin._restart(self._now)
        twin.restore(state)
        return twin

    def reset(self, parameters: Mapping[str, object] | None = None) -> None:
        """Begin again without loading again: nothing is overridden, and rows are gone.

        Args:
            parameters: in place of those at the start; None: none.

        Raises:
            ValueError: a name or a value is not usable.

        """
        if not self._closing.alive:
            raise InputError("the simulation is closed")
        prepared = self._prepared
        self._restart(prepared.with_parameters(parameters) if parameters else prepared)

    def _restart(self, prepared: Prepared) -> None:
        self._session.reset(prepared.plan, prepared.hooks())
        self._now = prepared
        self._begin()

    # Results

    def result(self) -> Result:
        """Return the rows so far, as :func:`simulate` does.

        Raises:
            ValueError: rows are not kept.

        """
        if not self._options.keep:
            raise InputError("no rows are kept, as keep=False asks for")
        session = self._session
        session.hand_over()
        rows = all_rows(self._rows.kept)
        if not session.is_shown:
            row = np.concatenate(([self.time], session.values()))[np.newaxis]
            if np.isfinite(row).all():
                rows = np.concatenate((rows, row)) if len(rows) else row
        experiment: Experiment = session.header.experiment
        if self.time > experiment.start_time:
            experiment = replace(experiment, stop_time=self.time)
        result = Result(self._now.scenario, self._now.loops, self._now)
        result.hold(replace(session.header, experiment=experiment), rows, session.ending)
        return result

    def close(self) -> None:
        """Free the FMUs; nothing follows but :meth:`result`."""
        if self._closing.alive:
            # The last row needs FMUs to which values pass.
            self._session.values()
            self._closing()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        """Show the system, the time and the loop in one line."""
        state = "" if self._closing.alive else ", closed"
        return f"<Simulation {self._now.scenario.name}: t = {self.time:g} s, {self.loop}{state}>"
