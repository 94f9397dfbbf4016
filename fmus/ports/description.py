"""What modelDescription.xml says in every version of FMI and for both kinds of component."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from auv_fmu import __version__
from auv_fmu.euler import STEP
from fmus.ports.port import Port, Value

#: About every component, by the names of the attributes.
ABOUT = {"author": "auv-fmu", "license": "MIT", "version": __version__}

#: What wrote the description of a component that no other tool has built.
GENERATION_TOOL = f"auv-fmu {__version__}"

#: Start, end and step of an experiment when the host names none [s].
EXPERIMENT = (0.0, 100.0, STEP)

#: What a component can do, where all versions of FMI have the same word for it.
CAPABILITIES = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canHandleVariableCommunicationStepSize": "true",
}

#: Statuses that messages are logged with and that have a category.
_LOGGED = ("Warning", "Discard", "Error", "Fatal")

#: How a variable gets its value at the start time; the standard forbids to say so of others.
_INITIAL = {"output": "calculated", "parameter": "exact"}


class Unit(NamedTuple):
    """A unit, the name of the type that variables of this unit have, and its base units."""

    type_name: str
    exponents: Mapping[str, int]


#: SI units of the ports.
UNITS: dict[str, Unit] = {
    "1": Unit("Dimensionless", {}),
    "1/s": Unit("Rate", {"s": -1}),
    "s": Unit("Time", {"s": 1}),
    "m": Unit("Length", {"m": 1}),
    "m/s": Unit("Velocity", {"m": 1, "s": -1}),
    "m/s2": Unit("Acceleration", {"m": 1, "s": -2}),
    "rad": Unit("Angle", {"rad": 1}),
    "rad/s": Unit("AngularVelocity", {"rad": 1, "s": -1}),
    "N": Unit("Force", {"kg": 1, "m": 1, "s": -2}),
    "N.m": Unit("Torque", {"kg": 1, "m": 2, "s": -2}),
    "W": Unit("Power", {"kg": 1, "m": 2, "s": -3}),
    "kg": Unit("Mass", {"kg": 1}),
    "kg/s": Unit("LinearDamping", {"kg": 1, "s": -1}),
    "N/m": Unit("Stiffness", {"kg": 1, "s": -2}),
    "kg/m": Unit("QuadraticDamping", {"kg": 1, "m": -1}),
    "kg.m2": Unit("MomentOfInertia", {"kg": 1, "m": 2}),
    "kg.m2/s": Unit("AngularDamping", {"kg": 1, "m": 2, "s": -1}),
}


class Dependency(NamedTuple):
    """What an output depends on, all by places among the variables, of which the first is 1.

    FMI 2.0 calls a place an index; in FMI 3.0 it is the value reference, which hosts take for one.
    """

    place: int  #: of the output
    direct: list[int]  #: what its value depends on without a state between
    initial: list[int]  #: what its value at the start time depends on


def literal(value: Value) -> str:
    """A value as XML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.16g}" if isinstance(value, float) else str(value)


def text(root: Element) -> bytes:
    """A document, whose bytes depend on nothing but its elements."""
    indent(root)
    content: bytes = tostring(root, encoding="utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + content + b"\n"


def variable_attributes(reference: int, port: Port) -> dict[str, str]:
    """What is said of a variable apart from its values."""
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


def bounds(port: Port) -> dict[str, str]:
    """The range of a variable's values."""
    limits = {"min": port.minimum, "max": port.maximum}
    return {name: literal(limit) for name, limit in limits.items() if limit is not None}


def units_of(ports: Sequence[Port]) -> list[str]:
    """The units that ports have, each once."""
    return sorted({port.unit for port in ports if port.unit})


def unit_definitions(units: Sequence[str]) -> Element:
    """Units by the base units that they are made of."""
    definitions = Element("UnitDefinitions")
    for unit in units:
        base = {name: str(exponent) for name, exponent in UNITS[unit].exponents.items()}
        # Some readers cannot do with an element without attributes; one is the default.
        SubElement(SubElement(definitions, "Unit", name=unit), "BaseUnit", base or {"factor": "1"})
    return definitions


def dependencies(ports: Sequence[Port]) -> Iterator[Dependency]:
    """What each output depends on: its direct feedthrough, and at the start the parameters too."""
    places = {port.name: place for place, port in enumerate(ports, start=1)}
    parameters = [places[port.name] for port in ports if port.causality == "parameter"]
    for port in ports:
        if port.causality == "output":
            # FMI 2.0 has no variable for the time.
            direct = [places[name] for name in port.feedthrough if name in places]
            # fault is false at the start, unless what is set is refused.
            start = [places[name] for name in port.initially]
            initial = [*direct, *start, *parameters] if port.kind == "Real" else []
            yield Dependency(places[port.name], direct, initial)


def log_categories(fmi: str) -> Element:
    """The categories of messages, with the statuses of a version of FMI such as `fmi2`."""
    categories = Element("LogCategories")
    for status in _LOGGED:
        described = f"Log messages with {fmi}{status} status."
        SubElement(categories, "Category", name=f"logStatus{status}", description=described)
    SubElement(categories, "Category", name="logAll", description="Log all messages.")
    return categories


def default_experiment() -> Element:
    """The experiment that a host runs if nothing else is asked for."""
    start, stop, step = map(str, EXPERIMENT)
    return Element("DefaultExperiment", startTime=start, stopTime=stop, stepSize=step)
