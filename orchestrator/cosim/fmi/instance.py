"""The calls of a component in a run, wherever its FMU is, its failures and its messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from ctypes import c_double
from typing import Any, NamedTuple, Protocol

import numpy as np
from fmpy.fmi2 import fmi2Discard, fmi2Warning

from orchestrator.cosim.fmi.transfer import CMember
from orchestrator.cosim.system.values import StringTable, Value

#: Calls of a component in every step, in their order.
CALLS = SET_INPUTS, DO_STEP, GET_OUTPUTS = "setting inputs", "doStep", "getting outputs"

#: Messages that are kept: an FMU may have something to say in every step.
MOST_MESSAGES = 100


class ComponentFailed(Exception):
    """A component failed to do what it was asked to; the text names it and says why.

    Attributes:
        fatal: whether it is lost: FMI's status fatal, or its process has ended or hangs.

    """

    def __init__(self, text: str, fatal: bool = False) -> None:
        """Say what happened."""
        super().__init__(text)
        self.fatal = fatal


class Ended(Exception):
    """The run ends with the last step that was made, and well; the text says why."""


class Part(NamedTuple):
    """Ports of one component that have the same causality and type.

    Attributes:
        causality: `input` or `output`.
        fmi_type: one of :data:`.values.TYPES`.
        references: value references, one for each array.
        place: of their values among the component's.

    """

    causality: str
    fmi_type: str
    references: list[int]
    place: slice


class Instance(Protocol):
    """An instantiated FMU whose inputs and outputs live in a row of floats.

    In every step the calls of `set_inputs`, then `do_step` with time and step size, then the calls
    of `get_outputs` are made, the last once all components of a stage have been stepped.
    Each returns FMI's status: `failed` is for one that is worse than a warning.

    Attributes:
        name: of the component.
        is_here: whether its FMU is in this process, so that there are pointers to its functions.
        gives_derivatives: whether its FMU can say how outputs change with inputs.

    """

    name: str
    is_here: bool
    gives_derivatives: bool
    set_inputs: list[Callable[[], int]]
    get_outputs: list[Callable[[], int]]

    @property
    def do_exchange(self) -> Callable[[c_double, c_double, int], int] | None:
        """The call in place of doStep where values only pass; None: there is none."""

    @property
    def do_step(self) -> Callable[[c_double, c_double, int], int]:
        """FMI's doStep, to be called with time, step size and one."""

    def pointers(self) -> CMember:
        """The same calls as pointers, for an FMU in this process."""

    def failed(self, status: int, function: str) -> ComponentFailed | Ended:
        """Make the exception for a call that has ended with a status.

        Args:
            status: worse than a warning.
            function: one of :data:`CALLS`.

        """

    def tie(self, values: np.ndarray, parts: Sequence[Part], strings: StringTable) -> None:
        """Say where its values are: a view of the row, with the inputs first, and its parts.

        Args:
            values: of the row, from its first on.
            parts: of them.
            strings: what numbers there stand for.

        """

    def enter_initialization(self, values: Mapping[str, Value], start_time: float = 0.0) -> None:
        """Set start values and parameters, set up the experiment, and enter that mode.

        What may be set in that mode is set there once more: some FMUs take on their own values
        when they enter it.
        """

    def exit_initialization(self) -> None:
        """Get ready for the first step."""

    def exchange(self) -> None:
        """Set all inputs, then read all outputs."""

    def derivatives(self, outputs: Sequence[str], of: str) -> Sequence[float]:
        """Derivatives of some outputs with one input at the same time.

        Raises:
            ComponentFailed: the FMU does not say it.

        """

    def read(self, ports: Sequence[str]) -> dict[str, Value]:
        """Values of some variables, as the FMU holds them."""

    def tune(self, values: Mapping[str, Value]) -> None:
        """Set tunable parameters between two steps."""

    def reset(self) -> None:
        """Return to the state before the initialisation, which can then be entered again."""

    def keep(self) -> None:
        """Keep the state of now, to go back to it."""

    def go_back(self) -> None:
        """Go back to the state that was kept; what the row holds is left as it is."""

    def let_change(self, inputs: Sequence[int], slopes: Sequence[float]) -> None:
        """Let some inputs, by their value references, change linearly in the steps from now on."""

    def state(self) -> bytes:
        """The FMU's whole state between two steps, from which another instance can go on.

        Raises:
            ComponentFailed: it cannot be had; see :attr:`.component.Component.gives_state`.

        """

    def restore(self, state: bytes) -> None:
        """Take on a state; what the row holds of this instance is left as it is."""

    def terminate(self) -> None:
        """Let the FMU finish what it has begun."""


class Listener(Protocol):
    """Something that takes messages."""

    def take(self, status: int, text: str) -> None:
        """Take a message with the status that it was given by FMI, and its component's name."""


class Log:
    """Messages of the FMUs with status warning or worse, and remarks on the FMUs.

    Attributes:
        refusals: the first of it with status discard: a value was not taken, though the call went
            well.

    """

    def __init__(self) -> None:
        """Start empty."""
        self._remarks: list[str] = []
        self._said: list[str] = []
        self._n = 0
        self.refusals: list[str] = []

    def remark(self, text: str) -> None:
        """Note a remark on an FMU: no flood of its messages hides that."""
        self._remarks.append(text)

    def take(self, status: int, text: str) -> None:
        """Take a message."""
        if status >= fmi2Warning:
            self._n += 1
            self._said += [text] * (len(self._said) < MOST_MESSAGES)
        if status == fmi2Discard:
            self.refusals += [text] * (len(self.refusals) < MOST_MESSAGES)

    @property
    def messages(self) -> tuple[str, ...]:
        """All remarks, the first messages, and the number of the others."""
        more = self._n - len(self._said)
        return (*self._remarks, *self._said, *([f"and {more} more messages"] * (more > 0)))

    def state(self) -> dict[str, Any]:
        """The content, as JSON has it."""
        return {
            "remarks": self._remarks,
            "said": self._said,
            "n": self._n,
            "refusals": self.refusals,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Take on what another one has taken."""
        self._remarks, self.refusals = state["remarks"], state["refusals"]
        self._said, self._n = state["said"], state["n"]
