"""Declaration of the variables of an FMU at the fields of a class."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

#: Smallest positive value, because FMI has only inclusive bounds.
POSITIVE = 1e-9


class Refusal(Exception):
    """A value or a step that a component does not accept; the text says why."""


@dataclass(frozen=True)
class Variable:
    """One or more variables of an FMU, declared at a field with their type and start value.

        K: Annotated[float, Variable("N", "Gain", minimum=0.0)] = 10.0
        y: Annotated[Vector3, Variable({"x": "m", "y": "m", "z": "m"}, "Position")]

    gives the variables `K`, `y.x`, `y.y` and `y.z`.

    Attributes:
        unit: unit of a float, in the form of :mod:`fmus.ports.units`; "1" for none, "" if it is not
            known; or the members of a vector or a tuple, with their units.
        description: one line.
        minimum, maximum: inclusive bounds of an input or a parameter.
        tunable: True if a parameter may change during a run.
        members: names or numbers of the elements of a vector or a tuple; by default 1, 2 ...
        feedthrough: for an output: inputs (fields or ports) or `time` that it directly depends on;
            `{}` stands for the member; None: everything that the hook `outputs` takes.
        initially: for an output: further inputs that it depends on at the start; None: all, if the
            hook `start` takes them.
        name: name of the port, if it is not the field's; `{}` stands for the member. For a field
            that is a NamedTuple: prefix of the names of its fields, "" for none.
        terminal: for an input: the terminal of FMI 3.0 that it is meant to be connected with; None:
            one with the name of its group.

    """

    unit: str | Mapping[str | int, str] = "1"
    description: str = ""
    minimum: float | None = None
    maximum: float | None = None
    tunable: bool = False
    members: tuple[str | int, ...] = ()
    feedthrough: tuple[str, ...] | None = None
    initially: tuple[str, ...] | None = None
    name: str | None = None
    terminal: str | None = None

    def __hash__(self) -> int:
        """Hash of the parts that are hashable."""
        return hash((self.description, self.name))
