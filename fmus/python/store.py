"""The values of one instance, by value reference, and what may be done with them."""

from __future__ import annotations

from collections.abc import Sequence

from fmus.ports.port import FAULT, Port, Refusal, Value

#: What a reference gets that belongs to no port of its type.
MISSING: dict[str, Value] = {"Real": 0.0, "Integer": 0, "Boolean": False, "String": ""}

#: Types that can be read as numbers: hosts read all outputs with fmi2GetReal.
_NUMBERS = ("Real", "Integer", "Boolean")


class Store:
    """Values of all ports.

    A port's value reference is its place among the ports. All Real inputs and all Real outputs lie
    in lists of their own, in their order, so that a host that passes them all in one call costs
    one comparison instead of one look-up a value.

    Attributes:
        ports: of the component, `fault` last.
        input_references, output_references: of the Real inputs and outputs.
        inputs, outputs: their values.
        parameters: by name.
        fault: whether a value or a step was discarded.

    """

    def __init__(self, ports: Sequence[Port]) -> None:
        self.ports = (*ports, FAULT)
        self.input_references = self._references("input")
        self.output_references = self._references("output")
        self.fault_references = [len(ports)]
        self.inputs = [0.0] * len(self.input_references)
        self.outputs = [0.0] * len(self.output_references)
        self.parameters: dict[str, Value] = {
            port.name: port.start
            for port in ports
            if port.causality == "parameter" and port.start is not None
        }
        self.fault = False

    def _references(self, causality: str) -> list[int]:
        return [
            reference
            for reference, port in enumerate(self.ports)
            if port.causality == causality and port.kind == "Real"
        ]

    def port(self, reference: int, *kinds: str) -> Port:
        """The port of one of some types that has a value reference.

        Raises:
            Refusal: there is none.

        """
        if not 0 <= reference < len(self.ports) or self.ports[reference].kind not in kinds:
            # PythonFMU hands references from 2^31 over as negative numbers.
            raise Refusal(f"no {kinds[0]} has the value reference {reference % 2**32}")
        return self.ports[reference]

    def get(self, reference: int, kind: str) -> Value:
        """The value of a port.

        Raises:
            Refusal: no port with the reference has a value of this type.

        """
        if kind == "Real":
            return float(self._value(reference, self.port(reference, *_NUMBERS)))
        return self._value(reference, self.port(reference, kind))

    def _value(self, reference: int, port: Port) -> Value:
        if port is FAULT:
            return self.fault
        if port.causality == "parameter":
            return self.parameters[port.name]
        if port.causality == "input":
            return self.inputs[self.input_references.index(reference)]
        return self.outputs[self.output_references.index(reference)]
