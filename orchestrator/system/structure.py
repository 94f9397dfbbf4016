"""The system that is simulated: components, connections and parameters, as an SSP holds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import Any

import fmpy
from fmpy.model_description import ModelDescription, ModelVariable

from orchestrator.errors import InputError


@dataclass(frozen=True)
class PortName:
    """A port of a component in a system."""

    component: str
    port: str

    def __str__(self) -> str:
        """`component.port`, as in files and on the command line."""
        return f"{self.component}.{self.port}"


def port_name(text: str) -> PortName:
    """`component.port`, taken apart at the first dot.

    Raises:
        InputError: there is no dot.

    """
    component, dot, port = text.partition(".")
    if not (component and dot and port):
        raise InputError(f"{text!r}: write component.port")
    return PortName(component, port)


@dataclass(frozen=True)
class Connection:
    """One value that goes from an output to an input."""

    source: PortName
    target: PortName


@dataclass(frozen=True)
class Component:
    """An FMU and what its description says about it."""

    name: str
    fmu: Path
    description: ModelDescription

    @property
    def variables(self) -> dict[str, ModelVariable]:
        """The FMU's variables by name."""
        return {variable.name: variable for variable in self.description.modelVariables}

    def variable(self, name: str) -> ModelVariable:
        """One variable of the FMU.

        Raises:
            InputError: there is no such variable.

        """
        variables = self.variables
        if name not in variables:
            near = get_close_matches(name, variables, n=3)
            hint = f"; did you mean {' or '.join(near)}?" if near else ""
            raise InputError(f"{self.name} has no port or parameter {name!r}{hint}")
        return variables[name]

    def has_feedthrough(self, output: str) -> bool:
        """Whether an output depends on an input of the same instant.

        An FMU that does not say must be taken to have it (FMI 2.0.4, section 2.2.8).
        """
        for unknown in self.description.outputs:
            if unknown.variable.name == output:
                known = unknown.dependencies
                return known is None or any(v.causality == "input" for v in known)
        return False


@dataclass(frozen=True)
class System:
    """Components, how they are connected, and the values of their parameters."""

    name: str
    components: Mapping[str, Component]
    connections: tuple[Connection, ...]
    parameters: Mapping[PortName, str | float | bool] = field(default_factory=dict)
    stop_time: float | None = None
    step: float | None = None

    def with_parameters(self, values: Mapping[PortName, Any]) -> System:
        """The same system with further values, which win over its own."""
        return replace(self, parameters={**self.parameters, **values})

    def parameters_of(self, component: str) -> dict[str, Any]:
        """Values that this system sets in one component, in the types of its variables.

        Raises:
            InputError: a parameter does not exist or is of the wrong type.

        """
        described = self.component(component)
        return {
            target.port: typed(str(target), described.variable(target.port), value)
            for target, value in self.parameters.items()
            if target.component == component
        }

    def component(self, name: str) -> Component:
        """One component of the system.

        Raises:
            InputError: there is no such component.

        """
        if name not in self.components:
            raise InputError(
                f"the system has no component {name!r}; it has {', '.join(self.components)}"
            )
        return self.components[name]

    def check(self) -> None:
        """Check connections and parameters against the descriptions of the FMUs.

        Raises:
            InputError: a port does not exist, or two ports do not fit.

        """
        fed: dict[PortName, PortName] = {}
        for connection in self.connections:
            self._check_connection(connection)
            if connection.target in fed:
                raise InputError(
                    f"{connection.target} is fed by {fed[connection.target]} and by "
                    f"{connection.source}; an input takes one connection"
                )
            fed[connection.target] = connection.source
        for target in self.parameters:
            causality = self.component(target.component).variable(target.port).causality
            if causality == "input" and target in fed:
                raise InputError(f"{target} is fed by {fed[target]} and cannot be set")
            if causality not in ("parameter", "input"):
                raise InputError(f"{target} is a {causality} and cannot be set")

    def _check_connection(self, connection: Connection) -> None:
        source, target = connection.source, connection.target
        a = self.component(source.component).variable(source.port)
        b = self.component(target.component).variable(target.port)
        if a.causality != "output":
            raise InputError(f"{source} -> {target}: {source} is a {a.causality}, not an output")
        if b.causality != "input":
            raise InputError(f"{source} -> {target}: {target} is a {b.causality}, not an input")
        if a.type != b.type or a.type == "String":
            raise InputError(f"{source} -> {target}: cannot feed {a.type} into {b.type}")
        unit_a, unit_b = unit_of(a), unit_of(b)
        if unit_a and unit_b and unit_a != unit_b:
            raise InputError(f"{source} -> {target}: units differ, {unit_a} and {unit_b}")


def unit_of(variable: ModelVariable) -> str | None:
    """The unit of a variable, its own or that of its type."""
    declared = variable.declaredType
    unit: str | None = variable.unit or (declared.unit if declared is not None else None)
    return unit


def read_component(name: str, fmu: Path) -> Component:
    """An FMU as a component.

    Raises:
        InputError: the file is missing or is no FMI 2.0 co-simulation FMU.

    """
    if not fmu.is_file():
        raise InputError(f"{fmu}: no such FMU")
    try:
        description = fmpy.read_model_description(fmu)
    except Exception as error:
        reason = str(error).strip().splitlines()[0] if str(error).strip() else repr(error)
        raise InputError(f"{fmu}: not a readable FMU: {reason}") from error
    if description.fmiVersion != "2.0" or description.coSimulation is None:
        raise InputError(f"{fmu}: not an FMI 2.0 co-simulation FMU")
    return Component(name, fmu, description)


#: What FMI's Integers can hold.
_INTEGERS = -(2**31), 2**31 - 1


def typed(name: str, variable: ModelVariable, value: Any) -> Any:
    """A value, or its text from a command line or file, in the variable's type.

    Raises:
        InputError: it is not of that type, not finite, or outside the range of the variable.

    """
    text = str(value).strip()
    try:
        if variable.type == "Boolean":
            return {"true": True, "1": True, "false": False, "0": False}[text.lower()]
        if variable.type == "String":
            return text
        number = float(text) if variable.type == "Real" else int(text)
    except (KeyError, ValueError):
        raise InputError(f"{name} = {text}: not a {variable.type}") from None
    if not isfinite(number):
        raise InputError(f"{name} = {text}: must be finite")
    lower, upper = variable.min, variable.max
    if variable.type != "Real":
        lower, upper = (_INTEGERS[0] if lower is None else lower), (upper or _INTEGERS[1])
    if lower is not None and number < float(lower):
        raise InputError(f"{name} = {text}: must be at least {lower}")
    if upper is not None and number > float(upper):
        raise InputError(f"{name} = {text}: must be at most {upper}")
    return number


def literal(variable: ModelVariable, value: Any) -> str:
    """A value of a variable as XML writes it."""
    return str(value).lower() if variable.type == "Boolean" else str(value)
