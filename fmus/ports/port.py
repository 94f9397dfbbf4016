"""Declaration of ports: the one place where a component says what it has.

modelDescription.xml, the checks of the slave, the connectors of the SSP, the tables in the
documentation and the tests all read these declarations, directly or through the built FMU.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Union

Value = Union[float, int, bool, str]

#: Smallest value of a parameter that must be positive. FMI knows only inclusive bounds.
POSITIVE = 1e-9


class Refusal(Exception):
    """A value or a step that a component does not accept; the text says why."""


@dataclass(frozen=True)
class Port:
    """One scalar variable of a component.

    Attributes:
        name: structured name, for example `tau.u`.
        causality: `input`, `output` or `parameter`.
        variability: `continuous`, `discrete`, `fixed` or `tunable`.
        kind: FMI type: `Real`, `Integer`, `Boolean` or `String`.
        unit: of a Real, a key of :data:`fmus.ports.units.UNITS`.
        start: value before anything is set. Outputs have none.
        description: one line.
        minimum, maximum: inclusive bounds of a number.
        choices: values that a String may have.
        feedthrough: of an output, the inputs it depends on without a state between.

    """

    name: str
    causality: str
    variability: str
    kind: str
    description: str
    unit: str | None = None
    start: Value | None = None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    feedthrough: tuple[str, ...] = ()

    def checked(self, value: Value) -> Value:
        """The value, if this port can take it.

        Raises:
            Refusal: it is not finite, out of range, or not one of the choices.

        """
        if self.kind == "String":
            if value not in self.choices:
                raise Refusal(f"{self.name} = {value!r}: use one of {', '.join(self.choices)}")
            return value
        number = float(value)
        if not isfinite(number):
            raise Refusal(f"{self.name} = {number}: must be finite")
        if self.minimum is not None and number < self.minimum:
            raise Refusal(f"{self.name} = {number:g}: must be at least {self.minimum:g}")
        if self.maximum is not None and number > self.maximum:
            raise Refusal(f"{self.name} = {number:g}: must be at most {self.maximum:g}")
        return value


def inputs(group: str, units: Mapping[str, str], description: str) -> tuple[Port, ...]:
    """Real inputs `group.member`, one for each member and its unit, starting at zero."""
    return tuple(
        Port(
            f"{group}.{member}",
            "input",
            "continuous",
            "Real",
            f"{description}: {member}",
            unit=unit,
            start=0.0,
        )
        for member, unit in units.items()
    )


def outputs(
    group: str,
    units: Mapping[str, str],
    description: str,
    feedthrough: Sequence[Port] = (),
) -> tuple[Port, ...]:
    """Real outputs `group.member`, each depending directly on the given inputs."""
    return tuple(
        Port(
            f"{group}.{member}",
            "output",
            "continuous",
            "Real",
            f"{description}: {member}",
            unit=unit,
            feedthrough=tuple(port.name for port in feedthrough),
        )
        for member, unit in units.items()
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


def parameters(
    group: str,
    starts: Sequence[float],
    members: Mapping[str, str],
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
    tunable: bool = False,
) -> tuple[Port, ...]:
    """Real parameters `group + member`, with the members' units; a member brings its own dot."""
    return tuple(
        parameter(
            f"{group}{member}",
            start,
            unit,
            f"{description}: {member.strip('.[]')}",
            minimum,
            maximum,
            tunable,
        )
        for start, (member, unit) in zip(starts, members.items())
    )


#: Largest internal step of components with a state (see `Component.do_step`).
H_MAX = parameter(
    "h_max", 0.02, "s", "Largest internal step; longer steps are split evenly", POSITIVE
)

#: Present in every component.
FAULT = Port(
    "fault",
    "output",
    "discrete",
    "Boolean",
    "True from the moment the component refused an input, a parameter or a step",
)
