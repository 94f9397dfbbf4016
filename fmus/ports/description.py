"""modelDescription.xml of both versions of FMI, and buildDescription.xml.

The root element is written by PythonFMU or here; its content follows from the ports.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count, groupby
from operator import itemgetter
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from auv_fmu import __version__
from fmus.ports.definition import DefaultExperiment, Model
from fmus.ports.port import FAULT, TIME, Port, Value
from fmus.ports.units import unit_of

#: Attribute that is true if steps may differ in size.
_ANY_STEP = "canHandleVariableCommunicationStepSize"

#: Capabilities with the same name in all versions of FMI.
_CAPABILITIES = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    _ANY_STEP: "true",
}

#: The source file that includes all others, by version of FMI.
SOURCES: Mapping[str, str] = {"2": "fmi2.c", "3": "fmi3.c"}

#: Statuses of messages that have a category.
_LOGGED = ("Warning", "Discard", "Error", "Fatal")

#: Attribute `initial` by causality; the standard forbids it for other causalities.
_INITIAL = {"output": "calculated", "parameter": "exact", "local": "calculated"}


class Dependency(NamedTuple):
    """Dependencies of an output, by indices in FMI 2.0 and by value references in FMI 3.0."""

    number: int  #: number of the output
    direct: list[int]  #: variables that it depends on at once, and continuous states
    initial: list[int] | None  #: variables that its initial value depends on; None: on all


def _literal(value: Value) -> str:
    """Write a value as in XML."""
    if isinstance(value, bool):
        return str(value).lower()
    # repr keeps all bits; float() because numpy's numbers have another repr.
    return repr(float(value)).removesuffix(".0") if isinstance(value, float) else str(value)


def _capabilities(model: Model, known: Mapping[str, str]) -> dict[str, str]:
    """Return capabilities, with the one that depends on the model."""
    return {**known, _ANY_STEP: str(model.experiment.takes_any_step).lower()}


def _root(version: str, model: Model, **identity: str) -> Element:
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


def document(root: Element) -> bytes:
    """Write a document, whose bytes depend only on its elements."""
    indent(root)
    content: bytes = tostring(root, encoding="utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + content + b"\n"


class Local(NamedTuple):
    """Numbers of the variables of model exchange, and of those that they depend on."""

    states: list[int]
    rates: list[int]
    switches: list[int]
    known: list[int]  #: variables that rates may depend on
    initial: list[int]  #: variables that states and rates may depend on at the start


def local_in(ports: Sequence[Port], numbers: Iterable[int] | None = None) -> Local:
    """Return the numbers of local variables; ports are numbered as for `dependencies`."""
    states = {port.derivative for port in ports}
    takes_time = any(port.derivative and port.feedthrough for port in ports)
    found = Local([], [], [], [], [])
    for port, number in zip(ports, numbers or count(1)):
        if port.causality == "local":
            kind = found.states if port.name in states else found.switches
            (found.rates if port.derivative else kind).append(number)
        is_known = port.causality == "input" or (port == TIME and takes_time)
        if is_known or port.name in states:
            found.known.append(number)
        if is_known or port.causality == "parameter":
            found.initial.append(number)
    return found


def _variable_attributes(reference: int, port: Port) -> dict[str, str]:
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


def _units(ports: Sequence[Port]) -> list[str]:
    """Return the units of ports, each once."""
    return sorted({port.unit for port in ports if port.unit})


def unit_definitions(units: Sequence[str]) -> Element:
    """Write units in terms of base units."""
    definitions = Element("UnitDefinitions")
    for unit in units:
        defined, parsed = SubElement(definitions, "Unit", name=unit), unit_of(unit)
        if parsed.exponents is None:
            continue
        base = {name: str(exponent) for name, exponent in parsed.exponents.items()}
        if parsed.factor != 1.0:
            base["factor"] = _literal(parsed.factor)
        if parsed.offset:
            base["offset"] = _literal(parsed.offset)
        # Some tools cannot read an element without attributes; a factor of 1 is the default.
        SubElement(defined, "BaseUnit", base or {"factor": "1"})
    return definitions


def _type_definitions(ports: Sequence[Port], add: Callable[..., Element]) -> Element:
    """Write the types of units and enumerations; `add` adds the element of a type."""
    definitions = Element("TypeDefinitions")
    for unit in _units(ports):
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
    states = local_in(ports, places.values()).states
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
            known = direct if port == FAULT else [*direct, *states]
            yield Dependency(places[port.name], known, initial)


def _dependent_on(known: Sequence[int] | None) -> dict[str, str]:
    """Return the attributes of an output that depends on these variables; None: on all."""
    if known is None:
        return {}
    return {
        "dependencies": " ".join(map(str, known)),
        "dependenciesKind": " ".join(["dependent"] * len(known)),
    }


def _log_categories(fmi: str) -> Element:
    """Write the categories of messages; `fmi` is the prefix of statuses, such as `fmi2`."""
    categories = Element("LogCategories")
    for status in _LOGGED:
        described = f"Log messages with {fmi}{status} status."
        SubElement(categories, "Category", name=f"logStatus{status}", description=described)
    SubElement(categories, "Category", name="logAll", description="Log all messages.")
    return categories


def _default_experiment(experiment: DefaultExperiment) -> Element:
    """Write the default experiment."""
    times = {
        "startTime": experiment.start,
        "stopTime": experiment.stop,
        "stepSize": experiment.step,
    }
    return Element("DefaultExperiment", {name: str(time) for name, time in times.items()})


# FMI 2.0

_CAPABILITIES_2 = {
    **_CAPABILITIES,
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
    "canNotUseMemoryManagementFunctions": "true",
}


def fmi2_description(model: Model, guid: str, has_derivatives: bool = False) -> bytes:
    """Write the description of a model whose library contains the GUID."""
    root = _root("2.0", model, guid=guid)
    for interface in ("ModelExchange", "CoSimulation") if model.local else ("CoSimulation",):
        element = SubElement(root, interface, modelIdentifier=model.identifier)
        SubElement(SubElement(element, "SourceFiles"), "File", name=SOURCES["2"])
    root.extend((_log_categories("fmi2"), _default_experiment(model.experiment)))
    SubElement(root, "ModelVariables")
    SubElement(root, "ModelStructure")
    complete(root, (*model.ports, FAULT, *model.local))
    implementation = _element(root, "CoSimulation")
    implementation.attrib.update(_capabilities(model, implementation.attrib))
    if model.local:
        root.attrib["numberOfEventIndicators"] = str(len(local_in(model.local).switches))
        of_exchange = {name: value for name, value in _CAPABILITIES_2.items() if name != _ANY_STEP}
        _element(root, "ModelExchange").attrib.update(of_exchange)
    if has_derivatives:
        for element in root.iterfind("*[@modelIdentifier]"):
            element.attrib["providesDirectionalDerivative"] = "true"
    return document(root)


def _element(root: Element, name: str) -> Element:
    """Return an element that is there."""
    element = root.find(name)
    assert element is not None
    return element


def complete(root: Element, ports: Sequence[Port]) -> Element:
    """Fill in the elements that depend on the ports.

    Args:
        root: fmiModelDescription with the elements CoSimulation, ModelVariables and
            ModelStructure.
        ports: all ports, in the order of their value references.

    """
    implementation = _element(root, "CoSimulation")
    implementation.attrib.update(_CAPABILITIES_2)
    places = {port.name: place for place, port in enumerate(ports, start=1)}
    variables = [_variable(places[port.name], port, places) for port in ports]
    _element(root, "ModelVariables")[:] = variables
    _element(root, "ModelStructure")[:] = _structure(ports)
    types = _type_definitions(ports, _add_type)
    at = [*root].index(implementation) + 1
    if units := _units(ports):
        root.insert(at, unit_definitions(units))
    if len(types):
        root.insert(at + bool(units), types)
    return root


def _variable(place: int, port: Port, places: Mapping[str, int]) -> Element:
    """Return a variable whose value reference is its index, one less than its place."""
    variable = Element("ScalarVariable", _variable_attributes(place - 1, port))
    values = value_attributes(port)
    if port.derivative:
        values["derivative"] = str(places[port.derivative])
    SubElement(variable, port.type, values)
    return variable


def _add_type(parent: Element, kind: str, name: str, **attributes: str) -> Element:
    return SubElement(SubElement(parent, "SimpleType", name=name), kind, attributes)


def _structure(ports: Sequence[Port]) -> list[Element]:
    """Write Outputs with direct feedthrough, and InitialUnknowns with parameters, too."""
    outputs, initial_unknowns = Element("Outputs"), Element("InitialUnknowns")
    derivatives, local = Element("Derivatives"), local_in(ports)
    for output in dependencies(ports):
        for parent, known in ((outputs, output.direct), (initial_unknowns, output.initial)):
            SubElement(parent, "Unknown", _dependent_on(known), index=str(output.number))
    for number in local.rates:
        SubElement(derivatives, "Unknown", _dependent_on(local.known), index=str(number))
    for number in (*local.states, *local.rates):
        SubElement(initial_unknowns, "Unknown", _dependent_on(local.initial), index=str(number))
    return [outputs, *([derivatives] if local.rates else []), initial_unknowns]


# FMI 3.0

#: Names of types in FMI 3.0.
TYPES = {
    "Real": "Float64", "Integer": "Int32", "Boolean": "Boolean", "Enumeration": "Enumeration",
}  # fmt: skip

_CAPABILITIES_3 = {**_CAPABILITIES, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}

#: The platforms in the build description.
_PLATFORMS = ("x86_64-linux", "aarch64-linux", "x86_64-windows", "x86_64-darwin", "aarch64-darwin")


def fmi3_description(
    model: Model, token: str, arrays: bool = False, has_derivatives: bool = False
) -> bytes:
    """Write the description of a model whose library contains the token.

    With `arrays`, vectors and matrices of one unit are array variables.
    """
    ports = (*model.ports, FAULT, TIME, *model.local)
    variables = variables_of(ports, arrays)
    root = _root("3.0", model, instantiationToken=token)
    capabilities = _capabilities(model, _CAPABILITIES_3)
    if has_derivatives:
        names = ("providesDirectionalDerivatives", "providesAdjointDerivatives")
        capabilities |= dict.fromkeys(names, "true")
    if model.local:
        of_exchange = {name: value for name, value in capabilities.items() if name != _ANY_STEP}
        SubElement(root, "ModelExchange", of_exchange, modelIdentifier=model.identifier)
    SubElement(root, "CoSimulation", capabilities, modelIdentifier=model.identifier)
    root.extend(
        (
            unit_definitions(_units(ports)),
            _type_definitions(ports, _add_type_3),
            _log_categories("fmi3"),
            _default_experiment(model.experiment),
            _variables(variables),
            _structure_3(variables),
        )
    )
    return document(root)


def fmi3_build_description(name: str) -> bytes:
    """Write the build description: one file to compile, with any compiler and no options."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    for platform in _PLATFORMS:
        built = SubElement(root, "BuildConfiguration", modelIdentifier=name, platform=platform)
        sources = SubElement(built, "SourceFileSet", language="C99")
        SubElement(sources, "SourceFile", name=SOURCES["3"])
        if platform.endswith("-linux"):
            # On Linux the mathematical library is separate.
            SubElement(built, "Library", name="m", external="true")
    return document(root)


def _add_type_3(parent: Element, kind: str, name: str, **attributes: str) -> Element:
    return SubElement(parent, f"{TYPES[kind]}Type", {"name": name, **attributes})


class _Variable(NamedTuple):
    """A scalar or an array; an array has the value reference of its first element."""

    reference: int
    port: Port
    elements: Sequence[Port]


def variables_of(ports: Sequence[Port], arrays: bool = False) -> list[_Variable]:
    """Return ports as variables; with `arrays`, the ports of an array are one variable."""
    if not arrays:
        ports = [replace(port, array=None) for port in ports]
    names = {port.name: port.array.name if port.array else port.name for port in ports}
    keyed = [(names[port.name], place, port) for place, port in enumerate(ports, start=1)]
    variables = []
    for name, group in groupby(keyed, itemgetter(0)):
        members = [*group]
        _, reference, first = members[0]
        elements = [port for _, _, port in members]
        described = first.array.description if first.array else first.description
        direct = tuple(_names(names, (name for port in elements for name in port.feedthrough)))
        initial = _names(names, (name for port in elements for name in port.initially or ()))
        later = tuple(variable for variable in initial if variable not in direct)
        whole = replace(
            first,
            name=name,
            description=described,
            feedthrough=direct,
            initially=None if first.initially is None else later,
        )
        variables.append(_Variable(reference, whole, elements))
    return variables


def _names(names: Mapping[str, str], scalars: Iterable[str]) -> dict[str, None]:
    """Return the names of variables for names of scalars, each once."""
    return dict.fromkeys(names.get(name, name) for name in scalars)


def _variables(variables: Sequence[_Variable]) -> Element:
    root = Element("ModelVariables")
    references = {port.name: reference for reference, port, _ in variables}
    for reference, port, elements in variables:
        attributes = {**_variable_attributes(reference, port), **value_attributes(port)}
        if port.start is not None:
            attributes["start"] = " ".join(
                value_attributes(element)["start"] for element in elements
            )
        if port.derivative:
            attributes["derivative"] = str(references[port.derivative])
        variable = SubElement(root, TYPES[port.type], attributes)
        for size in port.array.shape if port.array else ():
            SubElement(variable, "Dimension", start=str(size))
    return root


def _structure_3(variables: Sequence[_Variable]) -> Element:
    """Write Outputs with direct feedthrough, and InitialUnknowns with parameters, too."""
    ports = [variable.port for variable in variables]
    numbers = [variable.reference for variable in variables]
    outputs = [*dependencies(ports, numbers)]
    local = local_in(ports, numbers)
    structure = Element("ModelStructure")

    def add(name: str, number: int, known: list[int] | None = None) -> None:
        attributes = _dependent_on(known)
        SubElement(structure, name, attributes, valueReference=str(number))

    for output in outputs:
        add("Output", output.number, output.direct)
    for number in local.rates:
        add("ContinuousStateDerivative", number, local.known)
    for output in outputs:
        add("InitialUnknown", output.number, output.initial)
    for number in (*local.states, *local.rates):
        add("InitialUnknown", number, local.initial)
    for number in local.switches:
        add("EventIndicator", number)
    return structure
