"""FMUs in separate processes, where a failure ends at most the run.

A message between the two processes is a frame of numbers of fixed size, and a note in JSON, with
bytes in base64; the first number of the frame is the length of the note. In a step the note is
empty, so that a message is one write and one read. Only numbers and JSON are read: the process of
an FMU cannot make this one execute anything.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
from base64 import b64decode, b64encode
from codecs import getincrementaldecoder
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from ctypes import c_double
from dataclasses import dataclass
from functools import partial
from math import isfinite
from numbers import Real
from pathlib import Path
from shutil import rmtree
from subprocess import DEVNULL, Popen, TimeoutExpired
from threading import Lock, Thread
from time import monotonic, sleep
from types import MappingProxyType
from typing import Any

import numpy as np
from fmpy.fmi2 import fmi2OK, fmi2Pending, fmi2Warning
from fmpy.model_description import ModelVariable

from orchestrator.cosim.component import Component, read_description
from orchestrator.cosim.fmi.binary import make_binary
from orchestrator.cosim.fmi.instance import (
    MOST_MESSAGES,
    CMember,
    ComponentFailed,
    Ended,
    Instance,
    Log,
    Part,
)
from orchestrator.cosim.fmi.loaded import load_instance
from orchestrator.cosim.fmi.surroundings import Surroundings
from orchestrator.cosim.row import Row
from orchestrator.cosim.stages import member, step_members
from orchestrator.cosim.system import System
from orchestrator.cosim.variables import TYPES, Standing, StringTable, Value, are_of
from orchestrator.machine.errors import (
    InputError,
    StartError,
    escape_unprintable,
    reason,
    shortened,
)
from orchestrator.machine.interrupts import Interrupts
from orchestrator.machine.operating_system import can_isolate, end_first_without_memory

#: Time limit for the start of a process [s].
_START = 60.0

#: Interval of checks for interrupts and for the parent, wait for an FMU after an interrupt, and
#: time for a process to end by itself [s].
_GLANCE, _PATIENCE, _FAREWELL = 0.1, 1.0, 5.0

#: Length limits of a note with the state of an FMU, which may be large, and of other notes [bytes].
LONGEST_STATE, LONGEST_NOTE = 1 << 30, 1 << 25

#: Length limit of a message of an FMU [characters].
_LONGEST_MESSAGE = 10_000

#: Key of an object that holds bytes in a note; no variable has this name.
_BYTES = "\0base64"

#: Valid statuses of a message.
_STATUSES = range(fmi2OK, fmi2Pending + 1)

#: Calls that are steps, as named in error messages.
_STEP, _EXCHANGE = "doStep", "exchanging values"

#: Code of a process: it finds the same modules as this one, and has no main module.
_BEGIN = """
import importlib, json, sys
order = json.loads(sys.argv.pop())
sys.path[:] = order.pop("path")
importlib.import_module("orchestrator.cosim.fmi.isolated").serve(**order)
"""

#: FMUs that allow one instance per process and have it in this one, for runs in several threads.
_taken: set[str] = set()
_LOCK = Lock()


@dataclass(frozen=True)
class Isolation:
    """Settings of FMUs in separate processes.

    Attributes:
        step_timeout: limit for one call of an FMU [s], which may fetch a licence or read maps
            first.

    """

    step_timeout: float = 60.0

    @classmethod
    def of(cls, isolate: bool, step_timeout: float | None) -> Isolation | None:
        """Make the settings from two options of the user.

        Raises:
            InputError: a timeout without isolation: a call in this process cannot be ended.

        """
        if isolate:
            return cls() if step_timeout is None else cls(step_timeout)
        if step_timeout is not None:
            raise InputError(
                "--step-timeout needs --isolate: only an FMU in a separate process can be ended"
            )
        return None

    def __post_init__(self) -> None:
        """Refuse a limit that is not a positive number."""
        seconds = self.step_timeout
        number = isinstance(seconds, Real) and not isinstance(seconds, bool)
        if not (number and isfinite(seconds) and seconds > 0.0):
            raise InputError(f"step timeout {seconds!r}: must be a positive number of seconds")


@contextmanager
def place_instances(
    components: Mapping[str, Component],
    log: Log,
    isolation: Isolation | None,
    interrupts: Callable[[], Interrupts],
) -> Iterator[dict[str, Instance]]:
    """Provide instances of components, by name: all in this process, or each in a separate one.

    Further instances of an FMU that allows one per process always get separate processes.

    Args:
        components: by name.
        log: takes the messages of the FMUs.
        isolation: settings of separate processes; None: instances are in this process.
        interrupts: give the present signals to stop, which end the wait for an FMU.

    Raises:
        InputError: an FMU cannot be loaded.
        StartError: no process can be started.
        ComponentFailed: an FMU has failed in its instantiation.

    """
    with ExitStack() as stack:
        apart: dict[str, Component] = {}
        instances: dict[str, Instance] = {}
        for name, component in components.items():
            if isolation is None and stack.enter_context(_has_room(component)):
                instances[name] = stack.enter_context(load_instance(component, log))
            else:
                apart[name] = component
                # Compiled here, where no time limit applies and warnings are seen.
                make_binary(component, component.folder)
        if apart:
            settings = isolation or Isolation()
            instances |= stack.enter_context(isolate_instances(apart, log, settings, interrupts))
        yield {name: instances[name] for name in components}


@contextmanager
def _has_room(component: Component) -> Iterator[bool]:
    """Reserve room for one more instance in this process, until the end."""
    if not component.is_once_per_process:
        yield True
        return
    guid = component.description.guid
    with _LOCK:
        has_room = guid not in _taken
        _taken.add(guid)
    try:
        yield has_room
    finally:
        if has_room:
            _taken.remove(guid)


@contextmanager
def isolate_instances(
    components: Mapping[str, Component],
    log: Log,
    isolation: Isolation,
    interrupts: Callable[[], Interrupts],
) -> Iterator[dict[str, Instance]]:
    """Provide instances, each in a separate process that ends with the context.

    Raises:
        InputError: this operating system does not support it.
        StartError: no process can be started.

    """
    if not can_isolate():
        raise InputError(
            f"{', '.join(components)}: FMUs cannot be run in separate processes on Windows: leave "
            "out --isolate, and use an FMU that allows one instance per process only once"
        )
    with ExitStack() as stack:
        instances = []
        try:
            reading, writing = os.pipe()
            with os.fdopen(writing, "wb") as output:
                shown = Thread(target=_show_output, args=(reading,), daemon=True)
                shown.start()
                stack.callback(shown.join, _PATIENCE)
                for component in components.values():
                    here, there = socket.socketpair()
                    stack.enter_context(here)
                    with there:
                        process = _Process(component, there.fileno(), output.fileno())
                    stack.callback(process.end)
                    timeout = isolation.step_timeout
                    instances.append(
                        IsolatedInstance(component, here, process.status, log, timeout, interrupts)
                    )
        except (OSError, RuntimeError) as error:
            raise StartError(f"cannot start processes for FMUs: {reason(error)}") from error
        try:
            for instance in instances:
                instance.wait()
            yield {instance.name: instance for instance in instances}
        finally:
            for instance in instances:
                instance.leave()
            for instance in instances:
                instance.farewell()


def _show_output(reading: int) -> None:
    """Show the output of the processes, escaped for the terminal, until all of them have ended."""
    # A character may arrive in two pieces.
    decode = getincrementaldecoder("utf-8")("backslashreplace").decode
    with os.fdopen(reading, "rb", buffering=0) as output:
        while written := output.read(1 << 16):
            text = escape_unprintable(decode(written), "\n\t")
            # The standard error may be closed.
            with suppress(OSError), open(2, "w", encoding="utf-8", closefd=False) as errors:
                errors.write(text)


class _Process:
    """The process of an FMU, in a process group of its own: its children end with it."""

    def __init__(self, component: Component, connection: int, output: int) -> None:
        """Start the process.

        Args:
            component: to instantiate.
            connection: descriptor of the process's end of the connection.
            output: descriptor for its output.

        Raises:
            OSError: it cannot be started.

        """
        order = {
            "path": [entry for entry in sys.path if isinstance(entry, str)],
            "name": component.name,
            "fmu": str(component.fmu),
            "digest": component.digest,
            "folder": str(component.folder),
            "connection": connection,
            "parent": os.getpid(),
        }
        self._process = Popen(
            [sys.executable, "-P", "-c", _BEGIN, json.dumps(order)],
            stdin=DEVNULL,
            stdout=output,
            stderr=output,
            pass_fds=[connection],
            process_group=0,
        )

    def status(self, seconds: float) -> int | None:
        """Wait some seconds for its exit status; None: it is still running."""
        if self._process.returncode is None:
            with suppress(TimeoutExpired):
                self._process.wait(seconds)
                self._kill_group()
        return self._process.returncode

    def end(self) -> None:
        """End the process and its children."""
        if self.status(0.0) is None:
            self._kill_group()
            self.status(_FAREWELL)

    def _kill_group(self) -> None:
        with suppress(OSError):
            os.killpg(self._process.pid, signal.SIGKILL)


class Channel:
    """One end of a connection.

    Attributes:
        outgoing, incoming: numbers of the next message, and of the latest one.

    """

    def __init__(
        self,
        connection: socket.socket,
        outgoing: int,
        incoming: int,
        waited: Callable[[float], None] = lambda _: None,
    ) -> None:
        """Use a connected socket.

        Args:
            connection: its timeout, if any, is the interval between calls of `waited`.
            outgoing, incoming: count of numbers in each message.
            waited: called with the seconds of the wait for a message; may raise.

        """
        self._connection = connection
        self._waited = waited
        self._sent, self._received = np.zeros(1 + outgoing), np.zeros(1 + incoming)
        self._sent_bytes = self._sent.data.cast("B")
        self._received_bytes = self._received.data.cast("B")
        self.outgoing, self.incoming = self._sent[1:], self._received[1:]

    def send(self, note: Mapping[str, Any] = MappingProxyType({})) -> None:
        """Send a message.

        Raises:
            OSError: the other end is closed.

        """
        written = json.dumps(note, default=_as_text, ensure_ascii=False) if note else ""
        text = written.encode(errors="replace")
        self._sent[0] = len(text)
        self._move(self._connection.send, self._sent_bytes)
        if text:
            self._move(self._connection.send, memoryview(text))

    def receive(self, longest: int = LONGEST_STATE) -> Any:
        """Receive a message, and return its note.

        Args:
            longest: length limit of the note [bytes].

        Raises:
            EOFError, OSError: the other end is closed.
            ValueError, RecursionError, MemoryError: it is not a message.

        """
        self._move(self._connection.recv_into, self._received_bytes)
        length = self._received[0]
        if length == 0.0:
            return {}
        if not 1.0 <= length <= longest:
            raise ValueError(f"a message of {length:g} bytes, more than {longest:,}")
        text = bytearray(int(length))
        self._move(self._connection.recv_into, memoryview(text))
        return json.loads(text, object_hook=_from_text)

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def _move(self, move: Callable[[memoryview], int], data: memoryview) -> None:
        """Send or receive all of the bytes."""
        begun = monotonic()
        while True:
            with suppress(TimeoutError):
                n = move(data)
                if n == len(data):
                    return
                if n == 0:
                    raise EOFError
                data = data[n:]
            self._waited(monotonic() - begun)


def _as_text(value: bytes) -> dict[str, str]:
    return {_BYTES: b64encode(value).decode("ascii")}


def _from_text(read: dict[str, Any]) -> Any:
    return b64decode(read[_BYTES], validate=True) if read.keys() == {_BYTES} else read


class IsolatedInstance:
    """An instance in another process: see :class:`.instance.Instance`.

    A step is one message to the process, with the inputs, and one back, with the outputs.
    """

    is_here = False

    def __init__(
        self,
        component: Component,
        connection: socket.socket,
        status: Callable[[float], int | None],
        log: Log,
        timeout: float,
        interrupts: Callable[[], Interrupts],
    ) -> None:
        """Use a process that is about to instantiate a component.

        Args:
            component: of the instance.
            connection: to the process.
            status: waits some seconds for the exit status of the process.
            log: takes the messages of the FMU.
            timeout: limit of a call [s].
            interrupts: give the present signals to stop, which end the wait for a call.

        """
        self.name, self._component = component.name, component
        self.gives_derivatives = component.gives_derivatives
        self.set_inputs: list[Callable[[], int]] = []
        self.get_outputs: list[Callable[[], int]] = [self._take_outputs]
        self._status, self._log = status, log
        self._timeout, self._interrupts = timeout, interrupts
        # The present call, whether it hangs, and whether it is a step.
        self._call, self._hangs, self._steps = "start", False, False
        connection.settimeout(min(timeout, _GLANCE))
        incoming, outgoing = sizes(component)
        self._channel = Channel(connection, outgoing, incoming, self._waited)

    def wait(self) -> None:
        """Wait for the process to start, and to instantiate the FMU.

        Raises:
            InputError: the FMU cannot be instantiated.

        """
        # Nothing foreign runs before the start, which may take long on a busy machine.
        self._receive()
        self._call = "instantiate"
        self._receive()

    def tie(self, values: np.ndarray, parts: Sequence[Part], strings: StringTable) -> None:
        """Tie the instance to its values in the row."""
        first = next((part.place.start for part in parts if part.causality == "output"), 0)
        self._inputs = _Ports(self._component, "input", values, strings)
        self._outputs = _Ports(self._component, "output", values[first:], strings)

    def enter_initialization(self, values: Mapping[str, Value], start_time: float = 0.0) -> None:
        """Set start values and parameters, set up the experiment, and enter that mode."""
        self._ask("enter_initialization", values, start_time)

    def exit_initialization(self) -> None:
        """Leave initialisation mode."""
        self._ask("exit_initialization")

    def exchange(self) -> None:
        """Set all inputs, then read all outputs."""
        self._begin(_EXCHANGE, 0.0, 0.0)
        self._take_outputs()

    def derivatives(self, outputs: Sequence[str], known: str) -> Sequence[float]:
        """Return the derivatives of some outputs by one input at the same time."""
        values = self._ask("derivatives", list(outputs), known)
        self._check(isinstance(values, list) and len(values) == len(outputs))
        self._check(all(type(value) is float for value in values))
        return list(values)

    def read(self, ports: Sequence[str]) -> dict[str, Value]:
        """Return values of some variables, as the FMU holds them."""
        if not ports:
            return {}
        values = self._ask("read", list(ports))
        self._check(isinstance(values, dict) and values.keys() == set(ports))
        variables = self._component.variables
        self._check(all(variables[port].holds(value) for port, value in values.items()))
        return dict(values)

    def tune(self, values: Mapping[str, Value]) -> None:
        """Set tunable parameters between two steps."""
        self._ask("tune", dict(values))

    def reset(self) -> None:
        """Return to the state before the initialisation."""
        self._ask("reset")

    def keep(self) -> None:
        """Keep the present state, to go back to it."""
        self._ask("keep")

    def go_back(self) -> None:
        """Go back to the state that was kept."""
        self._ask("go_back")

    def let_change(self, inputs: Sequence[int], slopes: Sequence[float]) -> None:
        """Let some inputs change linearly in all further steps."""
        self._ask("let_change", list(inputs), list(slopes))

    def state(self) -> bytes:
        """Return the FMU's whole state between two steps."""
        state = self._ask("state")
        self._check(isinstance(state, bytes))
        return bytes(state)

    def restore(self, state: bytes) -> None:
        """Restore a state."""
        self._ask("restore", state)

    def pointers(self) -> CMember:
        """Raise an error: its calls are messages to another process."""
        raise NotImplementedError

    def failed(self, status: int, function: str) -> ComponentFailed:
        """Return the exception for a status; calls of this class raise it at once."""
        return ComponentFailed(f"{self.name}: {function} ended with status {status}")

    def do_step(self, t: c_double, h: c_double, _: int) -> int:
        """Begin a step; the first of `get_outputs` waits for its end."""
        return self._begin(_STEP, t.value, h.value)

    def do_exchange(self, t: c_double, _h: c_double, _: int) -> int:
        """Exchange values with the same message, as a step of no length."""
        return self._begin(_EXCHANGE, t.value, 0.0)

    def _begin(self, call: str, t: float, h: float) -> int:
        self._channel.outgoing[:2] = t, h
        self._call, self._steps = call, True
        self._send(self._inputs.put(self._channel.outgoing[2:]))
        return 0

    def terminate(self) -> None:
        """Terminate and free the FMU, and end its process."""
        try:
            self._ask("terminate")
            self.leave()
            self._call, waited = "freeInstance", 0.0
            while (status := self._status(_GLANCE)) is None:
                waited += _GLANCE
                self._waited(waited)
            if status:
                raise self._lost()
        except ComponentFailed as error:
            self._log.take(fmi2Warning, str(error))
        except KeyboardInterrupt:
            self._log.take(fmi2Warning, f"{self.name}: interrupted in {self._call}")

    def leave(self) -> None:
        """Close the connection: the process then frees the FMU and ends, if it can."""
        self._channel.close()

    def farewell(self) -> None:
        """Give the process some time to end, unless it hangs."""
        if not self._hangs:
            self._status(min(self._timeout, _FAREWELL))

    def _take_outputs(self) -> int:
        if self._steps:
            self._steps = False
            self._receive()
        return 0

    def _ask(self, call: str, *arguments: Any) -> Any:
        if self._steps:
            # Another component has ended the run in this step, whose outputs are not needed.
            with suppress(ComponentFailed, Ended):
                self._take_outputs()
        self._call = call
        self._send({"call": call, "arguments": arguments})
        return self._receive()

    def _send(self, note: dict[str, Any]) -> None:
        try:
            self._channel.send(note)
        except OSError as error:
            raise self._lost() from error

    def _receive(self) -> Any:
        """Return the value in the answer to a request."""
        longest = LONGEST_STATE if self._call == "state" else LONGEST_NOTE
        try:
            return self._read(**self._channel.receive(longest))
        except (EOFError, OSError) as error:
            raise self._lost() from error
        except InputError:
            raise
        # An FMU may have made its process send anything.
        except (ValueError, TypeError, AttributeError, RecursionError, MemoryError) as error:
            raise self._invalid(error) from error

    def _read(
        self,
        value: Any = None,
        messages: Sequence[tuple[int, str]] = (),
        failed: str | None = None,
        fatal: bool = False,
        refused: str | None = None,
        ended: str | None = None,
        values: Sequence[Value] = (),
    ) -> Any:
        for status, text in messages:
            if status not in _STATUSES:
                raise ValueError("it returned a status that FMI does not define")
            self._log.take(int(status), _line(text))
        if failed is not None:
            raise ComponentFailed(_line(failed), bool(fatal))
        if refused is not None and self._call == "instantiate":
            raise InputError(_line(refused))
        if ended is not None and self._call == _STEP:
            raise Ended(_line(ended))
        if refused is not None or ended is not None:
            raise ValueError(f"it cannot end a run in {self._call}")
        if self._call in (_STEP, _EXCHANGE):
            self._outputs.check(self._channel.incoming, values)
            self._outputs.take(self._channel.incoming, values)
        return value

    def _waited(self, seconds: float) -> None:
        # A child of a process that has ended may keep the connection open.
        self._status(0.0)
        if self._interrupts() and seconds >= _PATIENCE:
            self._hangs = True
            raise KeyboardInterrupt
        limit = _START if self._call == "start" else self._timeout
        if seconds >= limit:
            self._hangs = True
            raise ComponentFailed(
                f"{self.name}: {self._call} has not ended within {limit:g} s", fatal=True
            )

    def _check(self, fits: Any) -> None:
        if not fits:
            raise self._invalid()

    def _invalid(self, error: BaseException | None = None) -> ComponentFailed:
        why = "" if error is None else f": {reason(error)}"
        text = f"{self.name}: its process sent an invalid answer in {self._call}{why}"
        return ComponentFailed(text, fatal=True)

    def _lost(self) -> ComponentFailed:
        status = self._status(_FAREWELL)
        text = f"{self.name}: its process {_end_in_words(status)} in {self._call}"
        return ComponentFailed(text, fatal=True)


def sizes(component: Component) -> tuple[int, int]:
    """Return the count of numbers in an answer of a component, and in a request.

    An answer has the outputs, a request the time, the step size and the inputs.
    """
    return len(component.having("output")), 2 + len(component.having("input"))


class _Ports:
    """The inputs or the outputs of a component, in its row and in messages.

    Most values are numbers. Texts and integers that numbers stand for go into the note.

    Attributes:
        numbers: view of the values in the row.

    """

    def __init__(
        self, component: Component, causality: str, values: np.ndarray, strings: StringTable
    ) -> None:
        """Tie the ports to a row.

        Args:
            component: with the ports.
            causality: `input` or `output`.
            values: view of the row from the first port on.
            strings: texts and integers that numbers in the row stand for.

        """
        self._typed: list[tuple[str, slice]] = []
        self._standing: list[tuple[int, ModelVariable, Standing]] = []
        n = 0
        for name, ports in component.by_type(causality).items():
            own = TYPES[name]
            if own.family != "Real":
                self._typed.append((name, slice(n, n + len(ports))))
            if own.stands:
                standing = Standing(name, strings)
                self._standing += [(i, port, standing) for i, port in enumerate(ports, n)]
            n += len(ports)
        self.numbers = values[:n]

    def put(self, numbers: np.ndarray) -> dict[str, Any]:
        """Put the values into a message, and return its note."""
        numbers[:] = self.numbers
        values = [standing.value(numbers[i]) for i, _, standing in self._standing]
        return {"values": values} if values else {}

    def take(self, numbers: np.ndarray, values: Sequence[Value]) -> None:
        """Take the values from a message and its note."""
        for (i, _, standing), value in zip(self._standing, values, strict=True):
            numbers[i] = standing.number(value)
        self.numbers[:] = numbers

    def check(self, numbers: np.ndarray, values: Sequence[Value]) -> None:
        """Check the values in a message.

        Raises:
            ValueError: a port cannot have its value.

        """
        held = zip(self._standing, values, strict=True)
        if not all(port.holds(value) for (_, port, _), value in held):
            raise ValueError("an output cannot have its value")
        if not all(are_of(fmi_type, numbers[place]).all() for fmi_type, place in self._typed):
            raise ValueError("an output cannot have its value")


def _line(text: str) -> str:
    # Half of a UTF-16 pair is not text.
    text.encode()
    return "; ".join(text.splitlines())


def _end_in_words(status: int | None) -> str:
    if status is None:
        return "no longer answers"
    if status >= 0:
        return f"exited with status {status}"
    names = {number.value: number.name for number in signal.Signals}
    name = names.get(-status, f"signal {-status}")
    memory = ", perhaps for lack of memory" if -status == signal.SIGKILL else ""
    return f"was ended by {name} ({signal.strsignal(-status)}{memory})"


@np.errstate(all="ignore")
def serve(name: str, fmu: str, digest: str, folder: str, connection: int, parent: int) -> None:
    """Run a process: instantiate an FMU, and answer requests until the connection is closed.

    Args:
        name: of the component.
        fmu: the file, for messages.
        digest: of the file.
        folder: of the unpacked FMU.
        connection: descriptor of the socket to the parent.
        parent: process id of the parent.

    """
    # The parent decides when to stop.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    end_first_without_memory()
    os.set_inheritable(connection, False)
    Thread(target=_end_with, args=(parent, Path(folder).parent), daemon=True).start()
    component = Component(name, Path(fmu), read_description(Path(folder)).description, digest)
    channel = Channel(socket.socket(fileno=connection), *sizes(component))
    Served(component, channel).answer_all(Path(folder))


def _end_with(parent: int, temporary: Path) -> None:
    """End this process with its parent in any case, and remove the parent's temporary files."""
    while os.getppid() == parent:
        sleep(_GLANCE)
    rmtree(temporary, ignore_errors=True)
    os.killpg(0, signal.SIGKILL)


class Served:
    """An FMU that answers requests.

    A request without a call is a step; if its length is zero, it only exchanges values. An answer
    without a note reports success; otherwise the note has messages of the FMU, the result of a
    call, or the reason of its failure. Both may have values that numbers stand for.
    """

    def __init__(self, component: Component, channel: Channel) -> None:
        """Serve a component through a channel."""
        self._component, self._channel = component, channel
        self._messages: list[tuple[int, str]] = []
        self._surroundings = Surroundings()

    def take(self, status: int, text: str) -> None:
        """Take a message of the FMU; the log of the run keeps no more of them."""
        if status >= fmi2Warning and len(self._messages) < MOST_MESSAGES:
            self._messages.append((status, shortened(text, _LONGEST_MESSAGE)))

    def answer_all(self, folder: Path) -> None:
        """Report the start, instantiate the FMU, and answer until the other end closes.

        Args:
            folder: of the unpacked FMU.

        """
        with suppress(EOFError, OSError):
            self._channel.send()
            try:
                with load_instance(self._component, self, folder) as instance:
                    self._begin(instance)
                    # No call follows a fatal one.
                    going_on = self._answer(lambda: None)
                    while going_on:
                        going_on = self._answer(self._asked())
            except InputError as error:
                self._channel.send({"refused": str(error)})

    def _begin(self, instance: Instance) -> None:
        name = self._component.name
        row = Row(System(name, {name: self._component}, ()), {name: instance})
        self._instance, self._member = instance, member(instance)
        self._inputs = _Ports(self._component, "input", row.values, row.strings)
        first = len(self._inputs.numbers)
        self._outputs = _Ports(self._component, "output", row.values[first:], row.strings)

    def _asked(self) -> Callable[[], Any]:
        """Return the call of the next request."""
        request = self._channel.receive()
        if "call" in request:
            return partial(getattr(self._instance, request["call"]), *request["arguments"])
        self._inputs.take(self._channel.incoming[2:], request.get("values", ()))
        t, h = self._channel.incoming[:2]
        if h:
            return partial(step_members, [self._member], c_double(t), c_double(h))
        return self._instance.exchange

    def _answer(self, call: Callable[[], Any]) -> bool:
        note: dict[str, Any] = {}
        try:
            value = call()
            if value is not None:
                note["value"] = value
        except Ended as end:
            note["ended"] = str(end)
        except ComponentFailed as error:
            note |= {"failed": str(error), "fatal": error.fatal}
        except Exception as error:
            note |= {"failed": f"{self._component.name}: {reason(error)}", "fatal": True}
        self._surroundings.end_copy()
        if self._messages:
            note["messages"], self._messages = self._messages, []
        self._channel.send(note | self._outputs.put(self._channel.outgoing))
        return not note.get("fatal")
