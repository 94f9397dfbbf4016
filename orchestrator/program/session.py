"""A system stepped by its program, as :class:`orchestrator.cosim.Session` steps it by FMUs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from ctypes import (
    CDLL,
    POINTER,
    c_char_p,
    c_double,
    c_int,
    c_void_p,
    create_string_buffer,
    memmove,
)
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from orchestrator.cosim import Ending, Experiment, Header, Observer, Plan, PortName, Value
from orchestrator.machine.errors import InputError
from orchestrator.program.components import definitions_of
from orchestrator.program.library import Program, Source
from orchestrator.program.writer import CALLS, INPUT, STEP, Text
from orchestrator.runs.request import PROGRAM

#: Rows in a block.
_ROWS = 512

#: Members of the simulation whose places the program gives.
_MEMBERS = ("factors", "offsets", "supplied", "made", "shown", "is_passed", "has_failed")


class Place(NamedTuple):
    """The place of a number in the memory of a simulation.

    Attributes:
        at: in bytes.
        is_whole: True for an int, False for a double.

    """

    at: int
    is_whole: bool

    @property
    def dtype(self) -> type[np.int32] | type[np.float64]:
        """Type of the number."""
        return np.int32 if self.is_whole else np.float64


class Places(NamedTuple):
    """The places of the numbers of a simulation, in some memory.

    Attributes:
        columns: of all columns, by port.
        settables: of all parameters and unconnected inputs.
        members: of other members, in bytes.

    """

    columns: Mapping[PortName, Place]
    settables: Mapping[PortName, Place]
    members: Mapping[str, int]

    def of(self, port: PortName) -> Place:
        """Return the place of a column or a parameter."""
        return self.columns[port] if port in self.columns else self.settables[port]


class SteppedProgram:
    """The program of a system for single steps, which is compiled for its first use.

    Attributes:
        plan: of the run, with its order.
        source: of the program.
        columns: names of all columns.
        inputs: numbers of all inputs.
        settables: numbers of all parameters and unconnected inputs.

    """

    def __init__(self, plan: Plan, *, is_quick: bool = False) -> None:
        """Translate the system of a plan.

        Args:
            plan: of the run.
            is_quick: if set, refusals have no reason.

        Raises:
            InputError: it cannot be a program; the message says why.

        """
        text = Text(plan, definitions_of(plan.system), is_stepped=True, is_quick=is_quick)
        self.plan, self.source = text.plan, Source.of(text)
        self.passes, self.components = text.passes, text.components
        self.columns, self.inputs = tuple(text.columns), text.inputs
        self.settables = {name: i for i, name in enumerate(text.parameters)}
        bare = replace(plan.system, parameters={})
        #: Values of parameters and inputs that a system does not set.
        self._starts = np.array([float(text.start(name, bare)) for name in self.settables])

    @cached_property
    def _program(self) -> Program:
        program = Program(self.source)
        for name, arguments in _ARGUMENTS.items():
            getattr(program.library, name).argtypes = arguments
        program.library.reason.restype = c_char_p
        return program

    @property
    def library(self) -> CDLL:
        """The compiled functions.

        Raises:
            InputError: there is no compiler.

        """
        return self._program.library

    @property
    def size(self) -> int:
        """Bytes of a simulation."""
        return self._program.size

    @cached_property
    def places(self) -> Places:
        """Places in the memory of the compiled functions."""
        return self.places_by(lambda *at: self.library.places(*(each.ctypes.data for each in at)))

    def places_by(self, give: Callable[..., object]) -> Places:
        """Return places, which a function writes into three arrays."""
        columns_at, settables_at = (
            np.zeros((len(names), 2), np.uintp) for names in (self.columns, self.settables)
        )
        members_at = np.zeros(len(_MEMBERS), np.uintp)
        give(columns_at, settables_at, members_at)
        columns, settables = (
            {
                name: Place(int(at), bool(whole))
                for name, (at, whole) in zip(names, found, strict=True)
            }
            for names, found in ((self.columns, columns_at), (self.settables, settables_at))
        )
        return Places(columns, settables, dict(zip(_MEMBERS, members_at.tolist(), strict=True)))

    def parameters(self, plan: Plan) -> np.ndarray:
        """Return the values of all parameters and unconnected inputs at the start of a plan."""
        values = self._starts.copy()
        for name, value in plan.system.parameters.items():
            if name in self.settables:
                values[self.settables[name]] = self.number(name, value)
        return values

    def number(self, name: PortName, value: Value) -> float:
        """Return the number of a value of a port; an item of an Enumeration has one."""
        if isinstance(value, str):
            value = int(self.plan.system.variable(name).items[value])
        return float(value)

    def refusal(self, memory: Any, time: float) -> str:
        """Return the component that has refused at a time [s], and its reason."""
        numbers = (c_int * 4)()
        self.library.failure(memory, numbers)
        component = self.components[numbers[0]]
        why = self.library.reason(memory).decode(errors="replace")
        call = CALLS[numbers[1]]
        if call == INPUT:
            ports = [name.port for name in self.inputs if name.component == component]
            why = f"its input {ports[numbers[2]]} is out of range"
        if call == STEP:
            why = f"step refused at t = {time:g} s: {why}"
        return f"{component}: {why}"


_ARGUMENTS: Mapping[str, Sequence[Any]] = {
    "regrid": (c_void_p, c_double, c_double, c_double, c_int, c_int),
    "present": (c_void_p, c_void_p),
    "override": (c_void_p, c_int, c_double),
    "release": (c_void_p, c_int),
    "tune": (c_void_p, c_int, c_double),
    "reason": (c_void_p,),
    "failure": (c_void_p, POINTER(c_int)),
    "places": (c_void_p, c_void_p, c_void_p),
    "begin_all": (
        c_void_p, c_int, c_void_p, c_void_p, c_int, c_void_p, c_void_p,
        c_double, c_double, c_double, c_int,
    ),
    "release_all": (c_void_p, c_int, c_int),
    "advance_all": (c_void_p, c_int, c_void_p),
    "pass_all": (c_void_p, c_int),
    "tune_all": (c_void_p, c_int, c_int, c_void_p),
}  # fmt: skip


def stepped_program(plan: Plan, *, is_quick: bool = False) -> SteppedProgram:
    """Return the program of a plan; it is made once for plans that differ only in parameters.

    Raises:
        InputError: it cannot be a program.

    """
    system = plan.system
    key = (
        is_quick,
        plan.arrangement.order,
        plan.experiment.coupling,
        *((name, part.digest, part.fmu) for name, part in system.components.items()),
        *map(repr, system.connections),
        *plan.decimations.values(),
    )
    if key not in _programs:
        _programs[key] = SteppedProgram(plan, is_quick=is_quick)
        while len(_programs) > _MOST_PROGRAMS:
            _programs.pop(next(iter(_programs)))
    return _programs[key]


#: Programs of this process by the parts of systems that they depend on.
_programs: dict[tuple[object, ...], SteppedProgram] = {}
_MOST_PROGRAMS = 32


class ProgramState(NamedTuple):
    """A state of a session.

    Attributes:
        experiment: grid of the steps.
        memory: of the simulation.

    """

    experiment: Experiment
    memory: bytes


class ProgramSession:
    """A system that its program steps, with the methods of :class:`orchestrator.cosim.Session`."""

    loop = PROGRAM
    remark: str | None = None

    def __init__(self, plan: Plan, observers: Sequence[Observer] = ()) -> None:
        """Compile the program, unless it is known, and settle values at the start.

        Raises:
            InputError: it cannot be a program, or a component refuses its parameters.

        """
        self._program = stepped_program(plan)
        self._library = self._program.library
        self._memory = create_string_buffer(self._program.size)
        self._made, self._shown = (
            c_int.from_buffer(self._memory, self._program.places.members[name])
            for name in ("made", "shown")
        )
        self._observers = observers
        self._rows = np.empty((_ROWS, 1 + len(self._program.columns)))
        self._row = np.empty(1 + len(self._program.columns))
        self._stride = self._rows.strides[0]
        self._take(plan)
        self._begin()

    def __enter__(self) -> ProgramSession:
        return self

    def __exit__(self, *failure: object) -> None:
        """Do nothing: there is nothing to free."""

    def end(self) -> Ending:
        """Tell the observers how the run ended."""
        for observer in self._observers:
            observer.end(self.ending)
        return self.ending

    def _take(self, plan: Plan) -> None:
        """Take the parameters of a plan."""
        program = self._program
        self.plan = plan
        self._experiment = replace(plan.experiment, order=program.plan.experiment.order)
        self._values = program.parameters(plan)
        self.header = Header.of(plan.system, self._experiment, [*program.columns], PROGRAM)

    def _begin(self) -> None:
        self.experiment = experiment = self._experiment
        self.failure: str | None = None
        self._present: np.ndarray | None = None
        if self._library.begin(
            self._memory, self._values.ctypes.data, experiment.start_time, experiment.step,
            experiment.stop_time, experiment.full_steps, experiment.rows - 1,
        ):  # fmt: skip
            raise InputError(self._program.refusal(self._memory, experiment.start_time))
        for observer in self._observers:
            observer.begin(self.header)
        # The number of the first row in the block.
        self._handed = 0
        if not self._program.passes:
            self._run(0)

    @property
    def made(self) -> int:
        """Number of steps on the present grid."""
        return self._made.value

    def regrid(self, experiment: Experiment) -> None:
        """Continue with the steps of an experiment that begins now, or when the present one did."""
        if experiment.start_time != self.experiment.start_time:
            self._handed -= self._made.value
        self._library.regrid(
            self._memory, experiment.start_time, experiment.step, experiment.stop_time,
            experiment.full_steps, experiment.rows - 1,
        )  # fmt: skip
        self.experiment = experiment

    def advance(self, until: int | None = None) -> None:
        """Make steps, up to some number of them on the present grid, or to the end of the run."""
        until = self.experiment.rows - 1 if until is None else until
        self._present = None
        while self.failure is None and self._made.value < until:
            room = _ROWS - (self._shown.value - self._handed)
            if not room:
                self.hand_over()
                room = _ROWS
            self._run(min(until, self._made.value + room))

    def _run(self, until: int) -> None:
        rows = None
        if self._observers:
            rows = self._rows.ctypes.data - self._handed * self._stride
        if self._library.run(self._memory, until, rows):
            self._refused()

    def _refused(self) -> None:
        time = self.experiment.time(self._made.value)
        self.failure = f"stopped at t = {time:.12g} s: {self._program.refusal(self._memory, time)}"

    def take_interrupts(self) -> Sequence[int]:
        """Return the signals that were held back: none."""
        return ()

    def values(self) -> np.ndarray:
        """Return the present values of all columns, as the next row will show them."""
        if self._present is None:
            if self._library.present(self._memory, self._row.ctypes.data):
                self._refused()
            self._present = self._row[1:]
        return self._present

    def override(self, target: PortName, value: Value) -> None:
        """Give an input a value, whatever feeds it."""
        self._present = None
        program = self._program
        self._library.override(self._memory, program.inputs[target], program.number(target, value))

    def release(self, target: PortName) -> None:
        """Let an input take again what feeds it, or the value that it had before."""
        self._present = None
        self._library.release(self._memory, self._program.inputs[target])

    def tune(self, target: PortName, value: Value) -> None:
        """Set a tunable parameter.

        Raises:
            InputError: the component refuses the value.

        """
        self._present = None
        number = self._program.settables[target]
        if self._library.tune(self._memory, number, self._program.number(target, value)):
            time = self.experiment.time(self._made.value)
            raise InputError(self._program.refusal(self._memory, time))

    def parameter(self, name: PortName) -> Value:
        """Return the value of a parameter."""
        at, is_whole = self._program.places.settables[name]
        number: float = (c_int if is_whole else c_double).from_buffer(self._memory, at).value
        is_boolean = self.plan.system.variable(name).family == "Boolean"
        return bool(number) if is_boolean else number

    def save(self) -> ProgramState:
        """Return the present state."""
        return ProgramState(self.experiment, self._memory.raw)

    def restore(self, state: ProgramState) -> None:
        """Go back to a state, of this session or of another one of the same system."""
        memmove(self._memory, state.memory, len(state.memory))
        self.experiment, self.failure, self._present = state.experiment, None, None
        self._handed = self._shown.value

    def reset(self, plan: Plan, _: object = ()) -> None:
        """Begin again, with other parameters of the same system; observers begin again, too.

        Raises:
            InputError: a component refuses a parameter.

        """
        if plan is not self.plan:
            self._take(plan)
        self._begin()

    def hand_over(self) -> None:
        """Give the observers the rows of the block."""
        n = self._shown.value - self._handed
        for observer in self._observers if n else ():
            observer.take(self._rows[:n])
        self._handed = self._shown.value

    @property
    def is_shown(self) -> bool:
        """True if the row of the present time was kept."""
        return self._shown.value > self._made.value

    @property
    def ending(self) -> Ending:
        """The ending of the run, if it ends now."""
        return Ending(self.failure)
