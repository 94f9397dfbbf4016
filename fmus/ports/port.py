"""A port of a component: its description, and the values that it accepts."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Union

from auv_fmu.language.variable import POSITIVE, Refusal

Value = Union[float, int, bool]

#: Python types of values, by types of FMI.
_TYPES = {"Real": (float, int), "Integer": (int,), "Boolean": (bool,), "Enumeration": (int,)}

_LARGEST = sys.float_info.max

#: A structured name of FMI, such as `tau.u` or `K[1,2]`.
_NAME = re.compile(r"[A-Za-z_]\w*(\[\d+(,\d+)*\])?(\.[A-Za-z_]\w*(\[\d+(,\d+)*\])?)*", re.ASCII)

#: Characters that a line of text in XML cannot contain.
_UNWRITABLE = re.compile("[^\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class Misdeclared(TypeError):
    """An invalid declaration of a component; the text gives the reason.

    Attributes:
        place: names of the class or function, and of its field.

    """

    def __init__(self, why: str, *place: str) -> None:
        """Take the reason and the place."""
        self.place = place
        super().__init__(why)


class Array(NamedTuple):
    """An array whose elements are scalar variables."""

    name: str
    description: str
    shape: tuple[int, ...]


@dataclass(frozen=True)
class Port:
    """One scalar variable of a component.

    Attributes:
        name: structured name, for example `tau.u`.
        causality: `input`, `output`, `parameter`, `local` of a variable of model exchange, or
            `independent`, which is the time.
        variability: `continuous`, `discrete`, `fixed` or `tunable`.
        type: of FMI: `Real`, `Integer`, `Boolean` or `Enumeration`.
        unit: unit of a Real, in the form that :mod:`fmus.ports.units` reads.
        start: value before anything is set; None for outputs and local variables.
        description: one line.
        minimum, maximum: inclusive bounds of a number.
        choices: values of an Enumeration by their names.
        enumeration: name of the type of an Enumeration.
        feedthrough: inputs, and the time, on which an output depends without a state in between.
        initially: further inputs on which the initial value of an output depends; None if it
            depends on everything that is set.
        array: the array that it is an element of, if any; all its elements have one unit.
        derivative: name of the continuous state that this is the rate of, if it is one.
        terminal: name of the terminal of an input, if it is not that of its group.

    """

    name: str
    causality: str
    variability: str
    type: str
    description: str
    unit: str | None = None
    start: Value | None = None
    minimum: float | None = None
    maximum: float | None = None
    choices: Mapping[str, int] = field(default_factory=dict)
    enumeration: str = ""
    feedthrough: tuple[str, ...] = ()
    initially: tuple[str, ...] | None = ()
    array: Array | None = None
    derivative: str = ""
    terminal: str = ""

    def __post_init__(self) -> None:
        """Refuse what the description of an FMU cannot express."""
        for why in self._flaws():
            raise Misdeclared(f"{self.name} {why}")

    def _flaws(self) -> Iterator[str]:
        if not _NAME.fullmatch(self.derivative or self.name):
            yield "is not a name of FMI; use the letters a to z, digits and _"
        if not is_line(self.description):
            yield f"has the description {self.description!r:.40}; write one line of text"
        if self.unit is not None and not (is_line(self.unit) and " " not in self.unit):
            yield f"has the unit {self.unit!r:.40}; write it without spaces, such as kg.m2/s3"
        for word, bound in (("minimum", self.minimum), ("maximum", self.maximum)):
            if bound is None:
                continue
            if self.type not in ("Real", "Integer"):
                yield f"has a {word}, which is for a float or an int"
            elif not _is_bound(bound, self.type):
                yield f"has the {word} {bound!r:.40}, which is not a finite {self.type}"
        for text, number in self.choices.items():
            if not (is_line(text) and is_int32(number)):
                yield f"has the choice {text!r:.40} = {number:d}; write a line and 32 bits"
        if None not in (self.minimum, self.maximum) and not self.minimum <= self.maximum:  # type: ignore[operator]
            yield f"has the minimum {self.minimum!r:.40} above the maximum {self.maximum!r:.40}"

    def checked(self, value: Value) -> Value:
        """Return a value, if this port can take it.

        Raises:
            Refusal: it is of another type, not finite, out of range, or not one of the choices.

        """
        self.check_type(value)
        if self.minimum is not None and value < self.minimum:
            raise Refusal(f"{self.name} = {value:g}: must be at least {self.minimum:g}")
        if self.maximum is not None and value > self.maximum:
            raise Refusal(f"{self.name} = {value:g}: must be at most {self.maximum:g}")
        return value

    def check_type(self, value: Value) -> None:
        """Refuse a value that has another type, or is not finite, or is not a choice.

        Raises:
            Refusal: it is of another type, not finite, or not one of the choices.

        """
        if type(value) not in _TYPES[self.type]:
            article = "an" if self.type[0] in "IE" else "a"
            raise Refusal(f"{self.name} = {value!r:.20}: must be {article} {self.type}")
        if not -_LARGEST <= value <= _LARGEST:
            raise Refusal(f"{self.name} = {value!r:.20}: must be finite")
        if self.type == "Integer" and not is_int32(value):
            raise Refusal(f"{self.name} = {value!r:.20}: must fit into 32 bits")
        if self.choices and value not in self.choices.values():
            known = ", ".join(f"{number:d} ({name})" for name, number in self.choices.items())
            raise Refusal(f"{self.name} = {value}: use one of {known}")


def is_line(text: object) -> bool:
    """Return True for a line of text that XML can contain."""
    return isinstance(text, str) and _UNWRITABLE.search(text) is None


def is_int32(value: float) -> bool:
    """Return True if a whole number fits into 32 bits."""
    return -(2**31) <= value < 2**31


def _is_bound(bound: object, fmi_type: str) -> bool:
    if fmi_type == "Integer":
        return type(bound) is int and is_int32(bound)
    is_number = isinstance(bound, (float, int)) and not isinstance(bound, bool)
    return is_number and -_LARGEST <= bound <= _LARGEST  # type: ignore[operator]


#: Name of the parameter for the largest internal step.
H_MAX = "h_max"


def largest_step(h_max: float) -> Port:
    """Return the parameter for the largest internal step, with its start value [s]."""
    return Port(
        H_MAX,
        "parameter",
        "fixed",
        "Real",
        "Largest internal step; longer steps are split evenly",
        "s",
        h_max,
        POSITIVE,
    )


#: Present in every component.
FAULT = Port(
    "fault",
    "output",
    "discrete",
    "Boolean",
    "True once the component has refused an input, a parameter or a step",
)

#: The independent variable, which is a variable only in FMI 3.0.
TIME = Port("time", "independent", "continuous", "Real", "Time", "s")
