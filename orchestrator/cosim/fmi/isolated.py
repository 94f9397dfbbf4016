"""FMUs in processes of their own: what they do there ends a run at most, and nothing else."""

from __future__ import annotations

import signal
import socket
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from ctypes import c_double
from dataclasses import dataclass
from math import inf, isfinite
from numbers import Real
from typing import Any

import numpy as np
from fmpy.fmi2 import fmi2OK, fmi2Pending, fmi2Warning

from orchestrator.cosim.fmi.instance import ComponentFailed, Ended, Log, Part
from orchestrator.cosim.fmi.transfer import CMember
from orchestrator.cosim.fmi.worker import LONGEST_NOTE, LONGEST_STATE, Channel, sizes
from orchestrator.cosim.system.component import Component
from orchestrator.cosim.system.values import TYPES, Standing, StringTable, Value, are_of
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.interrupts import Interrupts

#: How long a call may take by default [s]: an FMU may fetch a licence or read maps first.
STEP_TIMEOUT = 60.0

#: How long a process may take to begin [s].
_START = 60.0

#: How often the wait for an FMU looks about [s], how long it still waits when the user wants to
#: stop [s], and how long an FMU has to be freed when the run has failed [s].
_GLANCE, _PATIENCE, FAREWELL = 0.1, 1.0, 5.0

#: Statuses that a message can have.
_STATUSES = range(fmi2OK, fmi2Pending + 1)


@dataclass(frozen=True)
class Isolation:
    """How FMUs are run in processes of their own.

    Attributes:
        step_timeout: how long one call of an FMU may take [s].

    """

    step_timeout: float = STEP_TIMEOUT

    def __post_init__(self) -> None:
        """Refuse what cannot be waited for."""
        seconds = self.step_timeout
        number = isinstance(seconds, Real) and not isinstance(seconds, bool)
        if not (number and isfinite(seconds) and seconds > 0.0):
            raise InputError(f"step timeout {seconds!r}: must be a positive number of seconds")


def isolation_of(isolate: bool, step_timeout: float | None) -> Isolation | None:
    """What a user asks for.

    Raises:
        InputError: a timeout without isolation: a call in this process cannot be ended.

    """
    if isolate:
        return Isolation() if step_timeout is None else Isolation(step_timeout)
    if step_timeout is not None:
        raise InputError(
            "--step-timeout needs --isolate: only an FMU in a separate process can be ended"
        )
    return None


class IsolatedInstance:
    """An instance in another process: see :class:`.instance.Instance`.

    A step is one message there, with the inputs, and one back, with the outputs.
    """

    is_here = False

    def __init__(
        self,
        component: Component,
        connection: socket.socket,
        status: Callable[[float], int | None],
        log: Log,
        timeout: float,
        interrupts: Interrupts,
    ) -> None:
        """Use a process that instantiates a component now.

        Args:
            component: that it is an instance of.
            connection: to the process.
            status: gives the exit status of the process, for which it waits some seconds.
            log: takes what the FMU says.
            timeout: how long a call may take [s].
            interrupts: that end the wait for a call.

        """
        self.name, self._component = component.name, component
        self.gives_derivatives = component.gives_derivatives
        self.set_inputs: list[Callable[[], int]] = []
        self.get_outputs: list[Callable[[], int]] = [self._take_outputs]
        self._status, self._log = status, log
        self._timeout, self._interrupts = timeout, interrupts
        self._doing, self._hangs, self._steps = "start", False, False
        connection.settimeout(min(timeout, _GLANCE))
        self._inputs, self._outputs = np.zeros(0), np.zeros(0)
        # Where numbers may stand for values, in the run and in the process, and outputs by types.
        self._standing: dict[str, list[tuple[int, Standing, Standing]]] = {
            "input": [],
            "output": [],
        }
        self._typed_outputs: list[tuple[str, slice]] = []
        # What numbers stand for in the process, which has its own, and how many of them both know.
        self._theirs, self._told = StringTable(), len(StringTable())
        inputs, outputs = sizes(component)
        self._channel = Channel(connection, 2 + inputs, outputs, self._waited)

    def wait(self) -> None:
        """Wait for the process to begin, and to instantiate the FMU.

        Raises:
            InputError: it cannot be.

        """
        # Before it begins nothing foreign is run, and a busy machine may take its time.
        self._receive()
        self._doing = "instantiate"
        self._receive()

    def tie(self, values: np.ndarray, parts: Sequence[Part], strings: StringTable) -> None:
        """Say where its values are."""
        inputs, outputs = len(self._channel.outgoing) - 2, len(self._channel.incoming)
        first = next((part.place.start for part in parts if part.causality == "output"), inputs)
        self._inputs, self._outputs = values[:inputs], values[first : first + outputs]
        for part in parts:
            of, is_input = TYPES[part.fmi_type], part.causality == "input"
            begin = part.place.start - (0 if is_input else first)
            end = begin + part.place.stop - part.place.start
            if of.stands:
                ours, theirs = (Standing(part.fmi_type, s) for s in (strings, self._theirs))
                self._standing[part.causality] += [(i, ours, theirs) for i in range(begin, end)]
            if not is_input and of.family != "Real":
                self._typed_outputs.append((part.fmi_type, slice(begin, end)))

    def enter_initialization(self, values: Mapping[str, Value], start_time: float = 0.0) -> None:
        """Set start values and parameters, set up the experiment, and enter that mode."""
        self._ask("enter_initialization", values, start_time)

    def exit_initialization(self) -> None:
        """Get ready for the first step."""
        self._ask("exit_initialization")

    def exchange(self) -> None:
        """Set all inputs, then read all outputs."""
        self._put_inputs()
        self._ask("exchange")
        self._read_outputs()

    def derivatives(self, outputs: Sequence[str], of: str) -> Sequence[float]:
        """How some outputs change with one input at the same time."""
        found = self._ask("derivatives", list(outputs), of)
        if not (isinstance(found, list) and len(found) == len(outputs)):
            raise self._nonsense()
        if not all(type(value) is float for value in found):
            raise self._nonsense()
        return found

    def read(self, ports: Sequence[str]) -> dict[str, Value]:
        """Values of some variables, as the FMU holds them."""
        if not ports:
            return {}
        values = self._ask("read", list(ports))
        if not (isinstance(values, dict) and values.keys() == set(ports)):
            raise self._nonsense()
        variables = self._component.variables
        if not all(variables[port].holds(value) for port, value in values.items()):
            raise self._nonsense()
        return values

    def tune(self, values: Mapping[str, Value]) -> None:
        """Set tunable parameters between two steps."""
        self._ask("tune", dict(values))

    def reset(self) -> None:
        """Return to the state before the initialisation."""
        self._ask("reset")

    def keep(self) -> None:
        """Keep the state of now, to go back to it."""
        self._ask("keep")

    def go_back(self) -> None:
        """Go back to the state that was kept."""
        self._ask("go_back")

    def let_change(self, inputs: Sequence[int], slopes: Sequence[float]) -> None:
        """Let some inputs change linearly in the steps from now on."""
        self._ask("let_change", list(inputs), list(slopes))

    def state(self) -> bytes:
        """The FMU's whole state between two steps."""
        state = self._ask("state")
        if not isinstance(state, bytes):
            raise self._nonsense()
        return state

    def restore(self, state: bytes) -> None:
        """Take on a state."""
        self._ask("restore", state)

    def pointers(self) -> CMember:
        """There are none: its calls are messages to another process."""
        raise NotImplementedError

    def failed(self, status: int, function: str) -> ComponentFailed:
        """What to raise after a call that has ended with a status; its own calls raise at once."""
        return ComponentFailed(f"{self.name}: {function} ended with status {status}")

    def do_step(self, t: c_double, h: c_double, _: int) -> int:
        """Have a step begun, whose end the first of `get_outputs` waits for."""
        return self._begin("doStep", t.value, h.value)

    def do_exchange(self, t: c_double, _h: c_double, _: int) -> int:
        """Have values exchanged, in the same way; the step has no length."""
        return self._begin("exchanging values", t.value, 0.0)

    def _begin(self, what: str, t: float, h: float) -> int:
        self._channel.outgoing[:2] = t, h
        self._put_inputs()
        self._doing, self._steps = what, True
        self._send({})
        return 0

    def terminate(self) -> None:
        """Let the FMU finish what it has begun, free it, and end its process."""
        try:
            self._ask("terminate")
            self.leave()
            self._doing, waited = "freeInstance", 0.0
            while (status := self._status(_GLANCE)) is None:
                waited += _GLANCE
                self._waited(waited)
            if status:
                raise self._lost()
        except ComponentFailed as error:
            self._log.take(fmi2Warning, str(error))
        except KeyboardInterrupt:
            self._log.take(fmi2Warning, f"{self.name}: interrupted in {self._doing}")

    def leave(self) -> None:
        """Want nothing more: the process frees the FMU and ends, if it can."""
        self._channel.close()

    def farewell(self) -> None:
        """Give the process some time to end; it is no use waiting for one that hangs."""
        if not self._hangs:
            self._status(min(self._timeout, FAREWELL))

    def _take_outputs(self) -> int:
        # Outputs of a step that has ended the run are there already.
        if self._steps:
            self._steps = False
            try:
                self._receive()
            except Ended:
                self._read_outputs()
                raise
            self._read_outputs()
        return 0

    def _put_inputs(self) -> None:
        """Have the inputs go with the next message."""
        inputs = self._channel.outgoing[2:]
        inputs[:] = self._inputs
        for i, ours, theirs in self._standing["input"]:
            inputs[i] = theirs.number(ours.value(inputs[i]))

    def _read_outputs(self) -> None:
        """Take the outputs that have come with a message."""
        outputs = self._channel.incoming
        if not all(are_of(of, outputs[place]).all() for of, place in self._typed_outputs):
            raise self._nonsense()
        try:
            for i, ours, theirs in self._standing["output"]:
                outputs[i] = ours.number(theirs.value(outputs[i]))
        except (ValueError, OverflowError) as error:
            raise self._nonsense(error) from error
        self._outputs[:] = outputs

    def _ask(self, call: str, *arguments: Any) -> Any:
        if self._steps:
            # Another component has ended the run in this step, and its outputs are not wanted.
            with suppress(ComponentFailed, Ended):
                self._take_outputs()
        self._doing = call
        self._send({"call": call, "arguments": arguments})
        return self._receive()

    def _send(self, note: dict[str, Any]) -> None:
        """Send a note, with the texts that are new there."""
        if news := self._theirs.since(self._told):
            note["strings"] = news
            self._told += len(news)
        try:
            self._channel.send(note or None)
        except OSError as error:
            raise self._lost() from error

    def _receive(self) -> Any:
        """The value in the answer to a request."""
        longest = LONGEST_STATE if self._doing == "state" else LONGEST_NOTE
        try:
            note = self._channel.receive(longest)
            return None if note is None else self._read(**note)
        except (EOFError, OSError) as error:
            raise self._lost() from error
        except InputError:
            raise
        # Whatever an FMU has made its process send.
        except (ValueError, TypeError, AttributeError, RecursionError, MemoryError) as error:
            raise self._nonsense(error) from error

    def _read(
        self,
        value: Any = None,
        messages: Sequence[tuple[int, str]] = (),
        failed: str | None = None,
        fatal: bool = False,
        refused: str | None = None,
        ended: str | None = None,
        until: float = -inf,
        strings: Sequence[str] = (),
    ) -> Any:
        for text in strings:
            self._theirs.number(_text(text))
        self._told = len(self._theirs)
        for status, text in messages:
            if status not in _STATUSES:
                raise ValueError("it returned a status that FMI does not define")
            self._log.take(int(status), _line(text))
        if failed is not None:
            raise ComponentFailed(_line(failed), bool(fatal))
        if refused is not None and self._doing == "instantiate":
            raise InputError(_line(refused))
        if ended is not None and self._doing == "doStep":
            raise Ended(_line(ended), self.name, float(until))
        if refused is not None or ended is not None:
            raise ValueError(f"it cannot end a run in {self._doing}")
        return value

    def _waited(self, seconds: float) -> None:
        if self._interrupts and seconds >= _PATIENCE:
            self._hangs = True
            raise KeyboardInterrupt
        limit = _START if self._doing == "start" else self._timeout
        if seconds >= limit:
            self._hangs = True
            raise ComponentFailed(
                f"{self.name}: {self._doing} has not ended within {limit:g} s", fatal=True
            )

    def _nonsense(self, error: BaseException | None = None) -> ComponentFailed:
        why = "" if error is None else f": {reason(error)}"
        text = f"{self.name}: its process sent an invalid answer in {self._doing}{why}"
        return ComponentFailed(text, fatal=True)

    def _lost(self) -> ComponentFailed:
        status = self._status(FAREWELL)
        return ComponentFailed(
            f"{self.name}: its process {_how_it_ended(status)} in {self._doing}", fatal=True
        )


def _text(value: str) -> str:
    """A text that has come, if it is one that can be written."""
    value.encode()
    return value


def _line(value: str) -> str:
    return "; ".join(_text(value).splitlines())


def _how_it_ended(status: int | None) -> str:
    if status is None:
        return "no longer answers"
    if status >= 0:
        return f"exited with status {status}"
    names = {number.value: number.name for number in signal.Signals}
    name = names.get(-status, f"signal {-status}")
    memory = ", perhaps for lack of memory" if -status == signal.SIGKILL else ""
    return f"was ended by {name} ({signal.strsignal(-status)}{memory})"
