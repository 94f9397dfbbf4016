"""The system that is simulated: components, connections and parameters, as an SSP holds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from orchestrator.errors import InputError, did_you_mean
from orchestrator.system.component import Component
from orchestrator.system.names import PortName
from orchestrator.system.transformation import Transformation
from orchestrator.system.values import Value, type_of, typed, unit_of


@dataclass(frozen=True)
class Connection:
    """One value that goes from an output to an input.

    Attributes:
        source, target: its ends.
        transformation: what happens to the value on its way; None: it arrives bit for bit.

    """

    source: PortName
    target: PortName
    transformation: Transformation | None = None


@dataclass(frozen=True)
class System:
    """Components, how they are connected, and the values of their parameters.

    Attributes:
        name: of the system.
        components: by the names of their instances.
        connections: in the order in which they were stated.
        parameters: values that differ from the components' own, in the variables' types.
        start_time, stop_time, step: the experiment that the system asks for [s]; None: it names
            none.
        steps: of components that ask for one of their own [s].

    """

    name: str
    components: Mapping[str, Component]
    connections: tuple[Connection, ...]
    parameters: Mapping[PortName, Value] = field(default_factory=dict)
    stop_time: float | None = None
    step: float | None = None
    start_time: float | None = None
    steps: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        """One line: a system's descriptions are long."""
        return f"<System {self.name}: {', '.join(self.components)}>"

    def with_parameters(self, values: Mapping[PortName, object]) -> System:
        """The same system with further values, which win over its own.

        Args:
            values: by the names of their ports; text is read as the command line reads it.

        Raises:
            InputError: there is no such port, or the value is not of its type or out of range.

        """
        new = {
            target: typed(
                str(target), self.component(target.component).variable(target.port), value
            )
            for target, value in values.items()
        }
        return replace(self, parameters={**self.parameters, **new})

    def has(self, name: PortName) -> bool:
        """Whether there is such a port or parameter."""
        component = self.components.get(name.component)
        return component is not None and name.port in component.variables

    def parameters_of(self, component: str) -> dict[str, Value]:
        """Values that this system sets in one component, by the names of its variables."""
        return {
            target.port: value
            for target, value in self.parameters.items()
            if target.component == component
        }

    def open_inputs(self, component: str) -> list[str]:
        """Inputs of one component that nothing feeds, and for which no value is set."""
        taken = {connection.target for connection in self.connections} | self.parameters.keys()
        return [
            variable.name
            for variable in self.components[component].having("input")
            if PortName(component, variable.name) not in taken
        ]

    def value(self, name: PortName) -> Value | None:
        """The value of a parameter: the one that is set, or else the component's own.

        Raises:
            InputError: there is no such parameter.

        """
        if name in self.parameters:
            return self.parameters[name]
        return self.component(name.component).start(name.port)

    def component(self, name: str) -> Component:
        """One component of the system.

        Raises:
            InputError: there is no such component.

        """
        if name not in self.components:
            raise InputError(
                f"the system has no component {name!r}; it has {', '.join(self.components)}"
                f"{did_you_mean(name, self.components)}"
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
                raise InputError(f"{target} is of causality {causality} and cannot be set")

    def _check_connection(self, connection: Connection) -> None:
        source, target = connection.source, connection.target
        a = self.component(source.component).variable(source.port)
        b = self.component(target.component).variable(target.port)
        for end, variable, wanted in ((source, a, "output"), (target, b, "input")):
            if variable.causality != wanted:
                raise InputError(
                    f"{source} -> {target}: {end} is of causality {variable.causality}, "
                    f"not {wanted}"
                )
        if type_of(a) != type_of(b) or a.type == "String":
            raise InputError(f"{source} -> {target}: cannot feed {a.type} into {b.type}")
        unit_a, unit_b = unit_of(a), unit_of(b)
        if unit_a and unit_b and unit_a != unit_b:
            raise InputError(f"{source} -> {target}: units differ, {unit_a} and {unit_b}")
