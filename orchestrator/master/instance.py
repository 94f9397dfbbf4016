"""What a run asks of a component, wherever its FMU is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from orchestrator.master import layout
from orchestrator.system.values import Value


class ComponentFailed(Exception):
    """A component did not do what it was asked for; the text names it and says why.

    Attributes:
        fatal: whether it is lost: FMI's fmi2Fatal, or its process has ended or hangs.

    """

    def __init__(self, text: str, fatal: bool = False) -> None:
        """Say what happened."""
        super().__init__(text)
        self.fatal = fatal


class Ended(Exception):
    """The run ends here, and well; the text says why."""


class Part(NamedTuple):
    """Ports of one component that have the same causality and kind.

    Attributes:
        causality: `input` or `output`.
        kind: one of :data:`orchestrator.master.transfer.KINDS`.
        references: value references.
        place: of their values among those of the component.

    """

    causality: str
    kind: str
    references: list[int]
    place: slice


class Instance(Protocol):
    """An instantiated FMU whose inputs and outputs live in a row of floats.

    In every step the calls of `set_inputs`, then `do_step` with time and step size, then those of
    `get_outputs` are made; those of `get_outputs` once all components of a stage have been stepped.
    Each returns FMI's status: `failed` is for one that is worse than a warning.
    """

    name: str
    set_inputs: list[Callable[[], int]]
    get_outputs: list[Callable[[], int]]

    @property
    def do_step(self) -> Callable[[float, float, int], int]:
        """FMI's doStep, to be called with time, step size and one."""

    def pointers(self) -> layout.Member:
        """The same calls as pointers, for an FMU in this process."""

    def failed(self, status: int, function: str) -> ComponentFailed:
        """What to raise after a call that has ended with a status."""

    def tie(self, values: np.ndarray, parts: Sequence[Part]) -> None:
        """Say where its values are: a view of the row, with the inputs first, and its parts."""

    def enter_initialization(self, values: Mapping[str, Value], stop_time: float) -> None:
        """Set start values and parameters, set up the experiment, and enter that mode."""

    def exit_initialization(self) -> None:
        """Get ready for the first step."""

    def exchange(self) -> None:
        """Set all inputs, then read all outputs."""

    def parameters(self) -> dict[str, Any]:
        """Values of all parameters, as the FMU reports them."""

    def terminate(self) -> None:
        """Let the FMU end what it has begun."""
