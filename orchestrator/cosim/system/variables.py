"""The variables of an FMU as a system knows them: arrays as their elements, without a few."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from functools import lru_cache
from itertools import product
from math import prod
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from fmpy.model_description import ModelDescription, ModelVariable

from orchestrator.cosim.system.values import TYPES
from orchestrator.machine.errors import InputError

#: An array has no more elements than this: each is a column.
MOST_ELEMENTS = 1_000_000

#: What stands between the start values of an array of texts: no text holds it.
_BETWEEN = "\0"


class Variables(NamedTuple):
    """The variables of an FMU.

    Attributes:
        known: those that can be connected, set and recorded, by name. An element of an array is
            one of them, with the array's shape, its neighbours in their order beside it.
        left_alone: why others cannot, by name.
        other_names: what to write instead of names that stand for known ones.

    """

    known: Mapping[str, ModelVariable]
    left_alone: Mapping[str, str]
    other_names: Mapping[str, str]


@lru_cache(maxsize=256)
def variables_of(description: ModelDescription) -> Variables:
    """The variables of an FMU."""
    known: dict[str, ModelVariable] = {}
    left_alone: dict[str, str] = {}
    other_names: dict[str, str] = {}
    names = {variable.name for variable in description.modelVariables}
    for variable in description.modelVariables:
        if reason := _reason(variable):
            left_alone[variable.name] = reason
            continue
        first = next(element_names(variable.name, variable.shape or ()))
        if variable.shape and first in names:
            left_alone[variable.name] = (
                f"is an array, but its element {first} is another variable's name"
            )
        elif variable.alias is not None:
            other_names[variable.name] = f"is another name of {variable.alias.name}: use that one"
        elif variable.shape:
            other_names[variable.name] = f"is an array: name an element, as {first}"
            known |= {element.name: element for element in _elements(variable)}
        else:
            known[variable.name] = variable
    return Variables(known, left_alone, other_names)


def _reason(variable: ModelVariable) -> str:
    """Why a variable is left alone; empty: it is not."""
    if variable.type not in TYPES:
        return f"is of type {variable.type}, which is not supported"
    if variable.clocks:
        return "belongs to a Clock, and Clocks are not supported"
    if any(length < 1 for length in variable.shape or ()):
        return "is an array without elements"
    if prod(variable.shape or ()) > MOST_ELEMENTS:
        return f"is an array of more than {MOST_ELEMENTS:,} elements"
    return ""


def element_names(array: str, shape: Sequence[int]) -> Iterator[str]:
    """The names of an array's elements by FMI's naming convention, in their order.

    Args:
        array: its name.
        shape: its lengths, of which indices begin with 1; empty: it is a scalar.

    """
    for indices in product(*(range(1, length + 1) for length in shape)):
        yield f"{array}[{','.join(map(str, indices))}]" if indices else array


def _elements(variable: ModelVariable) -> Iterator[ModelVariable]:
    n = prod(variable.shape)
    starts = _starts(variable)
    if len(starts) == 1:
        # It is for all.
        starts *= n
    for place, name in enumerate(element_names(variable.name, variable.shape)):
        element = copy(variable)
        element.name = name
        element.start = starts[place] if place < len(starts) else None
        yield element


def _starts(variable: ModelVariable) -> list[str]:
    if variable.start is None:
        return []
    starts: list[str] = variable.start.split(_BETWEEN if variable.type == "String" else None)
    return starts


def array_of(variable: ModelVariable) -> str:
    """The name by which an FMU knows a variable, or the array that it is an element of."""
    name: str = variable.name
    return name.rpartition("[")[0] if variable.shape else name


def references_of(variables: Sequence[ModelVariable]) -> list[int]:
    """Value references of some variables, one for all elements of an array."""
    found, place = [], 0
    while place < len(variables):
        found.append(variables[place].valueReference)
        place += prod(variables[place].shape or ())
    return found


def complete(description: ModelDescription, root: ElementTree.Element) -> None:
    """Add what fmpy does not read of a description of FMI 3.0.

    Args:
        description: as fmpy has read it.
        root: element of the file.

    """
    if description.coSimulation is not None:
        stated = root.find("CoSimulation")
        assert stated is not None
        gives = stated.get("providesDirectionalDerivatives")
        description.coSimulation.providesDirectionalDerivative = gives in ("true", "1")
        # A capability of FMI 2.0.
        description.coSimulation.canInterpolateInputs = False
    elements = {element.get("name"): element for element in root.findall("ModelVariables/*")}
    for variable in description.modelVariables:
        element = elements.get(variable.name)
        if element is None:
            continue
        if variable.type.startswith("UInt"):
            variable.min, variable.max = element.get("min"), element.get("max")
        if variable.shape and variable.type == "String":
            texts = [start.get("value", "") for start in element.findall("Start")]
            variable.start = _BETWEEN.join(texts) if texts else None


_MEMBER = "TerminalMemberVariable"

#: Matching rules of terminals: those with which all members are connected, and the other one.
COMPLETE, BUS = ("plug", "sequence"), "bus"


class Terminal(NamedTuple):
    """Variables that are connected as one thing.

    Attributes:
        rule: which of its members are connected: all of a plug, by their names; of a bus the ones
            that the other terminal has; all of a sequence, by their places, which are its names.
        members: names of variables by the names of the members.
        flows: members that are no signals: sums and signs count as well where these are joined.

    """

    rule: str
    members: Mapping[str, str]
    flows: Sequence[str]


def terminals_of(folder: Path) -> dict[str, Terminal]:
    """The terminals of an unpacked FMU by their names; one within another has a dotted name.

    Raises:
        InputError: the file that lists them cannot be read.

    """
    file = folder / "terminalsAndIcons" / "terminalsAndIcons.xml"
    if not file.is_file():
        return {}
    try:
        root = ElementTree.parse(file).getroot()
    except ElementTree.ParseError as error:
        raise InputError(f"{file.name} is not well-formed XML: {error}") from None
    return dict(_terminals(root.find("Terminals"), ""))


def _terminals(parent: ElementTree.Element | None, outer: str) -> Iterator[tuple[str, Terminal]]:
    for element in () if parent is None else parent.findall("Terminal"):
        name, rule = outer + element.get("name", ""), element.get("matchingRule", "")
        members = [
            (member.get("memberName", ""), member.get("variableName", ""))
            for member in element.findall(_MEMBER)
        ]
        if rule == "sequence":
            members = [(str(place), variable) for place, (_, variable) in enumerate(members)]
        flows = [
            member.get("variableName") or member.get("inStreamVariableName") or ""
            for member in element
            if member.tag == "TerminalStreamMemberVariable"
            or (member.tag == _MEMBER and member.get("variableKind") != "signal")
        ]
        yield name, Terminal(rule, dict(members), flows)
        yield from _terminals(element, f"{name}.")
