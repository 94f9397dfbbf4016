"""modelDescription.xml, as far as it follows from the ports.

Whatever runs a component, PythonFMU or a library, adds its own elements and attributes.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from fmus.ports.port import Port, Value
from fmus.ports.units import UNITS

_CAPABILITIES = {
    "needsExecutionTool": "false",
    "canHandleVariableCommunicationStepSize": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}


def complete(root: Element, ports: Sequence[Port]) -> Element:
    """Fill in what the ports of a component say.

    Args:
        root: fmiModelDescription with the elements CoSimulation, ModelVariables and
            ModelStructure.
        ports: all, in the order of their value references.

    """
    implementation = root.find("CoSimulation")
    variables = root.find("ModelVariables")
    structure = root.find("ModelStructure")
    assert implementation is not None and variables is not None and structure is not None
    implementation.attrib.update(_CAPABILITIES)
    variables[:] = [_variable(reference, port) for reference, port in enumerate(ports)]
    structure[:] = _structure(ports)
    units = sorted({port.unit for port in ports if port.unit})
    root.insert(1, _unit_definitions(units))
    root.insert(2, _type_definitions(units))
    return root


def _variable(reference: int, port: Port) -> Element:
    variable = Element(
        "ScalarVariable",
        name=port.name,
        valueReference=str(reference),
        description=port.description,
        causality=port.causality,
        variability=port.variability,
    )
    # The standard forbids `initial` on inputs.
    if port.causality != "input":
        variable.set("initial", "calculated" if port.causality == "output" else "exact")
    value = SubElement(variable, port.kind)
    if port.unit is not None:
        value.set("declaredType", UNITS[port.unit].type_name)
        value.set("unit", port.unit)
    for attribute, number in (("start", port.start), ("min", port.minimum), ("max", port.maximum)):
        if number is not None:
            value.set(attribute, literal(number))
    return variable


def literal(value: Value) -> str:
    """A value as XML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.16g}" if isinstance(value, float) else str(value)


def _unit_definitions(units: Sequence[str]) -> Element:
    definitions = Element("UnitDefinitions")
    for unit in units:
        base = {name: str(exponent) for name, exponent in UNITS[unit].exponents.items()}
        SubElement(SubElement(definitions, "Unit", name=unit), "BaseUnit", base)
    return definitions


def _type_definitions(units: Sequence[str]) -> Element:
    definitions = Element("TypeDefinitions")
    for unit in units:
        name = UNITS[unit].type_name
        simple_type = SubElement(definitions, "SimpleType", name=name)
        SubElement(simple_type, "Real", quantity=name, unit=unit)
    return definitions


def _structure(ports: Sequence[Port]) -> tuple[Element, Element]:
    """Outputs with their direct feedthrough; InitialUnknowns with the parameters as well."""
    index = {port.name: str(i) for i, port in enumerate(ports, start=1)}
    parameters = [index[port.name] for port in ports if port.causality == "parameter"]
    outputs, initial_unknowns = Element("Outputs"), Element("InitialUnknowns")
    for port in ports:
        if port.causality == "output":
            inputs = [index[name] for name in port.feedthrough]
            # fault is false at the start whatever is set, unless that is refused.
            initial = [*inputs, *parameters] if port.kind == "Real" else []
            for parent, known in ((outputs, inputs), (initial_unknowns, initial)):
                SubElement(
                    parent,
                    "Unknown",
                    index=index[port.name],
                    dependencies=" ".join(known),
                    dependenciesKind=" ".join(["dependent"] * len(known)),
                )
    return outputs, initial_unknowns
