"""Declaration of ports: the one place where a component says which it has.

modelDescription.xml, the checks of the slave, the connectors of the SSP, the tables in the
documentation and the tests all read these declarations, directly or through the built FMU.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Union

from auv_fmu.euler import STEP
from fmus.ports.quantities import Members, member_name

Value = Union[float, int, bool, str]

#: Python's types of the values of FMI's types.
_TYPES = {"Real": (float, int), "Integer": (int,), "Boolean": (bool,), "String": (str,)}

_LARGEST = sys.float_info.max

#: Smallest value of a parameter that must be positive. FMI knows only inclusive bounds.
POSITIVE = 1e-9


class Refusal(Exception):
    """A value or a step that a component does not accept; the text says why."""


class Misdeclared(TypeError):
    """A component that cannot be; the text says why.

    Attributes:
        place: the names of a class or a function, and of its field, that it is about.

    """

    def __init__(self, why: str, *place: str) -> None:
        """Say what is wrong, and where."""
        self.place = place
        super().__init__(why)


@dataclass(frozen=True)
class Port:
    """One scalar variable of a component.

    Attributes:
        name: structured name, for example `tau.u`.
        causality: `input`, `output`, `parameter`, or `independent`, which is the time.
        variability: `continuous`, `discrete`, `fixed` or `tunable`.
        type: of FMI: `Real`, `Integer`, `Boolean` or `String`.
        unit: of a Real, as :mod:`fmus.ports.units` reads it.
        start: value before anything is set. Outputs have none.
        description: one line.
        minimum, maximum: inclusive bounds of a number.
        choices: values that a String may have, with what each stands for in the equations; of an
            Integer what each number is called that it may have.
        feedthrough: of an output, what it depends on without a state between: inputs, the time.
        initially: of an output, inputs that its value at the start depends on besides.

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
    choices: Mapping[str, Any] = field(default_factory=dict)
    feedthrough: tuple[str, ...] = ()
    initially: tuple[str, ...] = ()

    def checked(self, value: Value) -> Value:
        """The value, if this port can take it.

        Raises:
            Refusal: it is of another type, not finite, out of range, or not one of the choices.

        """
        self.sound(value)
        if isinstance(value, str):
            return value
        if self.minimum is not None and value < self.minimum:
            raise Refusal(f"{self.name} = {value:g}: must be at least {self.minimum:g}")
        if self.maximum is not None and value > self.maximum:
            raise Refusal(f"{self.name} = {value:g}: must be at most {self.maximum:g}")
        return value

    def sound(self, value: Value) -> None:
        """Refuse what is no value of this port, in whatever range it has.

        Raises:
            Refusal: it is of another type, not finite, or not one of the choices.

        """
        if type(value) not in _TYPES[self.type]:
            raise Refusal(f"{self.name} = {value!r:.20}: must be a {self.type}")
        if isinstance(value, str):
            if value not in self.choices:
                raise Refusal(f"{self.name} = {value!r}: use one of {', '.join(self.choices)}")
        elif not -_LARGEST <= value <= _LARGEST:
            raise Refusal(f"{self.name} = {value!r:.20}: must be finite")
        elif self.type == "Integer" and not -(2**31) <= value < 2**31:
            raise Refusal(f"{self.name} = {value!r:.20}: must fit into 32 bits")
        elif self.choices and value not in self.choices.values():
            numbers = ", ".join(f"{number:d}" for number in self.choices.values())
            raise Refusal(f"{self.name} = {value}: use one of {numbers}")

    def meaning(self, value: Value) -> object:
        """What the equations take for a value of this port."""
        return self.choices[str(value)] if self.type == "String" else value


def inputs(group: str, members: Members, description: str) -> tuple[Port, ...]:
    """Real inputs, one for each member of a group, starting at zero."""
    about = ("input", "continuous", "Real")
    return tuple(
        Port(member_name(group, member), *about, f"{description}: {member}", unit, start=0.0)
        for member, unit in members.items()
    )


def outputs(
    group: str,
    members: Members,
    description: str,
    feedthrough: Sequence[Port] = (),
    initially: Sequence[Port] = (),
) -> tuple[Port, ...]:
    """Real outputs, one for each member of a group, each depending directly on the given inputs."""
    return tuple(
        Port(
            member_name(group, member),
            "output",
            "continuous",
            "Real",
            f"{description}: {member}",
            unit,
            feedthrough=tuple(port.name for port in feedthrough),
            initially=tuple(port.name for port in initially),
        )
        for member, unit in members.items()
    )


def parameter(
    name: str,
    start: float,
    unit: str,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
    tunable: bool = False,
) -> Port:
    """A Real parameter."""
    variability = "tunable" if tunable else "fixed"
    return Port(name, "parameter", variability, "Real", description, unit, start, minimum, maximum)


def setting(
    name: str,
    start: int | str,
    description: str,
    choices: Mapping[str, object] | None = None,
    minimum: int | None = None,
    maximum: int | None = None,
) -> Port:
    """A fixed parameter that is not a Real: it has the type of its start value."""
    fmi_type = {bool: "Boolean", int: "Integer", str: "String"}[type(start)]
    about = ("parameter", "fixed", fmi_type, description, None)
    return Port(name, *about, start, minimum, maximum, choices or {})


def parameters(
    group: str,
    starts: Sequence[float],
    members: Members,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
    tunable: bool = False,
) -> tuple[Port, ...]:
    """Real parameters, one for each member of a group."""
    if len(starts) != len(members):
        raise TypeError(f"{group}: {len(starts)} start values for {len(members)} members")
    return tuple(
        parameter(
            member_name(group, member),
            start,
            unit,
            f"{description}: {member}",
            minimum,
            maximum,
            tunable,
        )
        for start, (member, unit) in zip(starts, members.items())
    )


#: Largest internal step of components with a state (see `Component.do_step`).
H_MAX = parameter(
    "h_max", STEP, "s", "Largest internal step; longer steps are split evenly", POSITIVE
)

#: Present in every component.
FAULT = Port(
    "fault",
    "output",
    "discrete",
    "Boolean",
    "True once the component has refused an input, a parameter or a step",
)

#: The independent variable. A variable only in FMI 3.0.
TIME = Port("time", "independent", "continuous", "Real", "Time", "s")
