"""modelDescription.xml: what PythonFMU writes, completed from the declared ports.

PythonFMU 0.7 writes no units, types, ranges, InitialUnknowns or dependencies. Validators reject
such a file, and hosts cannot derive an order of evaluation from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Callable
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Boolean, Fmi2Causality, Fmi2Initial, Fmi2Variability, Integer, Real, String

from fmus.ports.port import Port
from fmus.ports.units import UNITS

_VARIABLES = {"Real": Real, "Integer": Integer, "Boolean": Boolean, "String": String}

_CAPABILITIES = {
    "needsExecutionTool": "false",
    "canHandleVariableCommunicationStepSize": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
}


def _variable(port: Port) -> Any:
    """PythonFMU's variable of a port."""
    initial = Fmi2Initial.calculated if port.causality == "output" else Fmi2Initial.exact
    return _VARIABLES[port.kind](
        port.name,
        causality=Fmi2Causality[port.causality],
        variability=Fmi2Variability[port.variability],
        # The standard forbids `initial` on inputs.
        initial=None if port.causality == "input" else initial,
        description=port.description,
    )


def describe(slave: Any, ports: Sequence[Port], pythonfmu_xml: Callable[[], Element]) -> Element:
    """The complete model description of a slave.

    Args:
        slave: instance of the component; its variables are registered anew.
        ports: all ports, in the order of their value references.
        pythonfmu_xml: PythonFMU's own `to_xml`, bound to the slave.

    """
    slave.vars.clear()
    for port in ports:
        slave.register_variable(_variable(port), nested=False)
    root = pythonfmu_xml()
    # Two builds of the same sources must be the same bytes; the time of the build is not in them.
    del root.attrib["generationDateAndTime"]
    implementation = root.find("CoSimulation")
    variables = root.find("ModelVariables")
    structure = root.find("ModelStructure")
    assert implementation is not None and variables is not None and structure is not None
    implementation.attrib.update(_CAPABILITIES)
    for element, port in zip(variables, ports):
        _complete_variable(element, port)
    units = sorted({port.unit for port in ports if port.unit})
    root.insert(1, _unit_definitions(units))
    root.insert(2, _type_definitions(units))
    _fill_structure(structure, ports)
    return root


def _complete_variable(element: Element, port: Port) -> None:
    value = element[0]
    if port.unit is not None:
        value.attrib = {
            "declaredType": UNITS[port.unit].type_name,
            "unit": port.unit,
            **value.attrib,
        }
    for attribute, bound in (("min", port.minimum), ("max", port.maximum)):
        if bound is not None:
            value.set(attribute, f"{bound:.16g}")


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


def _fill_structure(structure: Element, ports: Sequence[Port]) -> None:
    """Outputs with their direct feedthrough; InitialUnknowns with the parameters as well."""
    structure.clear()
    index = {port.name: str(i) for i, port in enumerate(ports, start=1)}
    parameters = [index[port.name] for port in ports if port.causality == "parameter"]
    outputs = SubElement(structure, "Outputs")
    initial_unknowns = SubElement(structure, "InitialUnknowns")
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
