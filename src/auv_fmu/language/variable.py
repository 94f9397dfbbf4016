"""What a field of a class says of the variables that it is in an FMU."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

#: Smallest value of what must be positive. FMI knows only inclusive bounds.
POSITIVE = 1e-9


class Refusal(Exception):
    """A value or a step that a component does not accept; the text says why."""


@dataclass(frozen=True)
class Variable:
    """A variable of FMI, or several, noted at a field that has their type and start value.

        K: Annotated[float, Variable("N", "Gain", minimum=0.0)] = 10.0
        y: Annotated[Vector3, Variable({"x": "m", "y": "m", "z": "m"}, "Position")]

    gives the variables `K`, `y.x`, `y.y` and `y.z`.

    Attributes:
        unit: of a float, as :mod:`fmus.ports.units` reads it; "1" for none, "" if it is not known;
            or the members of a vector or a tuple, with the unit of each.
        description: one line.
        minimum, maximum: inclusive bounds of an input or a parameter.
        tunable: whether a parameter may change during a run.
        members: of a vector or a tuple: names or numbers of its elements; without them these are
            counted from 1.
        feedthrough: of an output: the inputs, by their fields or ports, that it depends on without
            a state between, or `time`; in it `{}` stands for the member; None: all that the hook
            `outputs` takes.
        initially: of an output: the inputs that it depends on at the start besides; None: all, if
            the hook `start` takes them.
        name: other than that of the field; in it `{}` stands for the member. Of a field that is a
            NamedTuple: what the names of its fields begin with, "" for nothing.

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

    def __hash__(self) -> int:
        """Units by members have none."""
        return hash((self.description, self.name))
