"""modelDescription.xml of FMI 2.0 for both kinds of FMU, and the parts common to all versions.

The root element is written by PythonFMU or here; its content follows from the ports.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import count
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from auv_fmu import __version__
from fmus.ports.definition import DefaultExperiment, Model
from fmus.ports.port import FAULT, Port, Value
from fmus.ports.units import unit_of

#: Attribute that is true if steps may differ in size.
_ANY_STEP = "canHandleVariableCommunicationStepSize"

#: Capabilities with the same name in all versions of FMI.
CAPABILITIES = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    _ANY_STEP: "true",
}

#: Statuses of messages that have a category.
_LOGGED = ("Warning", "Discard", "Error", "Fatal")

#: Attribute `initial` by causality; the standard forbids it for other causalities.
_INITIAL = {"output": "calculated", "parameter": "exact"}


class Dependency(NamedTuple):
    """Dependencies of an output, by indices in FMI 2.0 and by value references in FMI 3.0."""

    number: int  #: number of the output
    direct: list[int]  #: variables that it depends on without a state in between
    initial: list[int] | None  #: variables that its initial value depends on; None: on all


def _literal(value: Value) -> str:
    """Write a value as in XML."""
    if isinstance(value, bool):
        return str(value).lower()
    # repr keeps all bits; float() because numpy's numbers have another repr.
    return repr(float(value)).removesuffix(".0") if isinstance(value, float) else str(value)


def capabilities_of(model: Model, known: Mapping[str, str]) -> dict[str, str]:
    """Return capabilities, with the one that depends on the model."""
    return {**known, _ANY_STEP: str(model.experiment.takes_any_step).lower()}


def root_of(version: str, model: Model, **identity: str) -> Element:
    """Make the root of a description; `identity` is the guid or token."""
    attributes = {
        "fmiVersion": version,
        "modelName": model.name,
        **identity,
        "description": model.description,
        **model.about,
        "generationTool": f"auv-fmu {__version__}",
        "variableNamingConvention": "structured",
    }
    return Element("fmiModelDescription", attributes)


def text(root: Element) -> bytes:
    """Write a document, whose bytes depend only on its elements."""
    indent(root)
    content: bytes = tostring(root, encoding="utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + content + b"\n"


def variable_attributes(reference: int, port: Port) -> dict[str, str]:
    """Return the attributes of a variable that do not describe its values."""
    attributes = {
        "name": port.name,
        "valueReference": str(reference),
        "description": port.description,
        "causality": port.causality,
        "variability": port.variability,
    }
    if port.causality in _INITIAL:
        attributes["initial"] = _INITIAL[port.causality]
    return attributes


def value_attributes(port: Port) -> dict[str, str]:
    """Return the attributes of a variable's values."""
    declared = unit_of(port.unit).type_name if port.unit else port.enumeration
    texts = {"declaredType": declared, "unit": port.unit}
    values = {
        "start": port.start,
        "min": port.minimum,
        "max": port.maximum,
    }
    return {
        **{name: text for name, text in texts.items() if text},
        **{name: _literal(value) for name, value in values.items() if value is not None},
    }


def units_of(ports: Sequence[Port]) -> list[str]:
    """Return the units of ports, each once."""
    return sorted({port.unit for port in ports if port.unit})


def unit_definitions(units: Sequence[str]) -> Element:
    """Write units in terms of base units."""
    definitions = Element("UnitDefinitions")
    for unit in units:
        defined, said = SubElement(definitions, "Unit", name=unit), unit_of(unit)
        if said.exponents is None:
            continue
        base = {name: str(exponent) for name, exponent in said.exponents.items()}
        if said.factor != 1.0:
            base["factor"] = _literal(said.factor)
        if said.offset:
            base["offset"] = _literal(said.offset)
        # Some tools cannot read an element without attributes; a factor of 1 is the default.
        SubElement(defined, "BaseUnit", base or {"factor": "1"})
    return definitions


def type_definitions(ports: Sequence[Port], add: Callable[..., Element]) -> Element:
    """Write the types of units and enumerations; `add` adds the element of a type."""
    definitions = Element("TypeDefinitions")
    for unit in units_of(ports):
        name = unit_of(unit).type_name
        add(definitions, "Real", name, quantity=name, unit=unit)
    for name, choices in {port.enumeration: port.choices for port in ports if port.choices}.items():
        enumeration = add(definitions, "Enumeration", name)
        for item, value in choices.items():
            SubElement(enumeration, "Item", name=item, value=str(int(value)))
    return definitions


def dependencies(
    ports: Sequence[Port], numbers: Iterable[int] | None = None
) -> Iterator[Dependency]:
    """Yield the dependencies of outputs: direct feedthrough, and at the start also parameters.

    By default ports are numbered from one, as in FMI 2.0.
    """
    places = {port.name: place for port, place in zip(ports, numbers or count(1))}
    parameters = [places[port.name] for port in ports if port.causality == "parameter"]
    for port in ports:
        if port.causality == "output":
            # FMI 2.0 has no variable for the time.
            direct = [places[name] for name in port.feedthrough if name in places]
            # fault is false at the start, unless a value is refused.
            initial: list[int] | None = None
            if port == FAULT:
                initial = []
            elif port.initially is not None:
                start = [places[name] for name in port.initially]
                initial = [*direct, *start, *parameters]
            yield Dependency(places[port.name], direct, initial)


def dependent_on(known: Sequence[int] | None) -> dict[str, str]:
    """Return the attributes of an output that depends on these variables; None: on all."""
    if known is None:
        return {}
    return {
        "dependencies": " ".join(map(str, known)),
        "dependenciesKind": " ".join(["dependent"] * len(known)),
    }


def log_categories(fmi: str) -> Element:
    """Write the categories of messages; `fmi` is the prefix of statuses, such as `fmi2`."""
    categories = Element("LogCategories")
    for status in _LOGGED:
        described = f"Log messages with {fmi}{status} status."
        SubElement(categories, "Category", name=f"logStatus{status}", description=described)
    SubElement(categories, "Category", name="logAll", description="Log all messages.")
    return categories


def default_experiment(one: DefaultExperiment) -> Element:
    """Write the default experiment."""
    times = {"startTime": one.start, "stopTime": one.stop, "stepSize": one.step}
    return Element("DefaultExperiment", {name: str(time) for name, time in times.items()})


# FMI 2.0

_CAPABILITIES = {
    **CAPABILITIES,
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
    "canNotUseMemoryManagementFunctions": "true",
}

#: The source file that includes all others.
SOURCE = "fmi2.c"


def fmi2_description(model: Model, guid: str) -> bytes:
    """Write the description of a model; its library is named after its identifier.

    Args:
        model: the model.
        guid: the GUID that is compiled into the library.

    """
    root = root_of("2.0", model, guid=guid)
    implementation = SubElement(root, "CoSimulation", modelIdentifier=model.identifier)
    SubElement(SubElement(implementation, "SourceFiles"), "File", name=SOURCE)
    root.extend((log_categories("fmi2"), default_experiment(model.experiment)))
    SubElement(root, "ModelVariables")
    SubElement(root, "ModelStructure")
    complete(root, (*model.ports, FAULT))
    implementation.attrib.update(capabilities_of(model, implementation.attrib))
    return text(root)


def complete(root: Element, ports: Sequence[Port]) -> Element:
    """Fill in the elements that depend on the ports.

    Args:
        root: fmiModelDescription with the elements CoSimulation, ModelVariables and
            ModelStructure.
        ports: all ports, in the order of their value references.

    """
    implementation = root.find("CoSimulation")
    variables = root.find("ModelVariables")
    structure = root.find("ModelStructure")
    assert implementation is not None and variables is not None and structure is not None
    implementation.attrib.update(_CAPABILITIES)
    variables[:] = [_variable(reference, port) for reference, port in enumerate(ports)]
    structure[:] = _structure(ports)
    types = type_definitions(ports, _add_type)
    if units := units_of(ports):
        root.insert(1, unit_definitions(units))
    if len(types):
        root.insert(1 + bool(units), types)
    return root


def _variable(reference: int, port: Port) -> Element:
    variable = Element("ScalarVariable", variable_attributes(reference, port))
    SubElement(variable, port.type, value_attributes(port))
    return variable


def _add_type(parent: Element, kind: str, name: str, **said: str) -> Element:
    return SubElement(SubElement(parent, "SimpleType", name=name), kind, said)


def _structure(ports: Sequence[Port]) -> tuple[Element, Element]:
    """Write Outputs with direct feedthrough, and InitialUnknowns with parameters, too."""
    outputs, initial_unknowns = Element("Outputs"), Element("InitialUnknowns")
    for output in dependencies(ports):
        for parent, known in ((outputs, output.direct), (initial_unknowns, output.initial)):
            SubElement(parent, "Unknown", dependent_on(known), index=str(output.number))
    return outputs, initial_unknowns
