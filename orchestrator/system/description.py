"""What an FMU says about itself in its modelDescription.xml."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import fmpy
from fmpy.model_description import ModelDescription, ValidationError

from orchestrator.machine.errors import InputError, reason, shortened
from orchestrator.system.values import integer, real

_CAUSALITIES = {"parameter", "calculatedParameter", "input", "output", "local", "independent"}

#: Attributes that fmpy reads as Python reads numbers, which takes 1_000, and digits of any script.
_INTEGERS = {
    "kg", "m", "s", "A", "K", "mol", "cd", "rad", "valueReference", "value", "index",
    "dependencies", "derivative", "previous",
}  # fmt: skip
_REALS = {"factor", "offset", "min", "max"}

#: Elements in which the same words may stand for something else.
_OTHERS = {"VendorAnnotations", "Annotations", "Start"}


class Described(NamedTuple):
    """A description, and what is wrong with it; None: it is valid."""

    description: ModelDescription
    flaw: Exception | None

    def remark(self) -> str | None:
        """What is wrong with it, in some words."""
        if isinstance(self.flaw, ValidationError):
            first, *others = map(str, self.flaw.problems)
            return first + f" (and {len(others)} problems more)" * bool(others)
        return None if self.flaw is None else reason(self.flaw)


def read_description(folder: Path) -> Described:
    """The description in the folder of an unpacked FMU, be it valid or not.

    Raises:
        Exception: it cannot be read; whatever it is, it says why.

    """
    try:
        return Described(fmpy.read_model_description(folder), None)
    except Exception as error:
        flaw = error
    try:
        return Described(fmpy.read_model_description(folder, validate=False), flaw)
    except Exception:
        raise flaw from None


@lru_cache(maxsize=256)
def described(fmu: Path, folder: Path, versions: Sequence[str]) -> Described:
    """The description of an FMU for co-simulation, read once.

    Args:
        fmu: the file.
        folder: into which it is unpacked.
        versions: of FMI that it may have.

    Raises:
        InputError: it is no such FMU.

    """
    if not (folder / "modelDescription.xml").is_file():
        raise InputError(f"{fmu}: not a readable FMU: it holds no modelDescription.xml")
    try:
        version = _version(folder / "modelDescription.xml")
        if version not in versions:
            wanted = " or ".join(versions)
            raise InputError(f"{fmu}: is of FMI {version}; only FMUs of FMI {wanted} are supported")
        found = read_description(folder)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{fmu}: not a readable FMU: {reason(error)}") from error
    implementation = found.description.coSimulation
    if implementation is None:
        raise InputError(f"{fmu}: is for model exchange only; only co-simulation is supported")
    if found.description.guid is None:
        raise InputError(f"{fmu}: not a readable FMU: its description has no guid")
    if not re.fullmatch(r"[^/\\]+", implementation.modelIdentifier or ""):
        raise InputError(
            f"{fmu}: its model identifier {implementation.modelIdentifier!r} names no library"
        )
    if found.flaw is not None:
        if any(_contradictions(found.description)):
            raise InputError(f"{fmu}: not a readable FMU: {reason(found.flaw)}")
        for text in _misread(folder / "modelDescription.xml"):
            raise InputError(f"{fmu}: not a readable FMU: {text}")
    return found


def _version(file: Path) -> str | None:
    """The version of FMI that a description says it is of: all else differs between them."""
    root: ElementTree.Element
    _, root = next(ElementTree.iterparse(file, ["start"]))
    return root.get("fmiVersion")


def _contradictions(description: ModelDescription) -> Iterator[str]:
    """Variables of which is left open which one is meant, or what it is for."""
    names = set()
    for variable in description.modelVariables:
        if variable.causality not in _CAUSALITIES or variable.name in names:
            yield variable.name
        names.add(variable.name)


def _misread(file: Path) -> Iterator[str]:
    """Numbers of a description that Python takes for others, or that are none."""
    for element in _elements(ElementTree.parse(file).getroot()):
        for name in ("name", "value") if element.tag == "Item" else ():
            if name not in element.attrib:
                yield f"an <Item> of an enumeration has no {name}"
        for kind, names in ((integer, _INTEGERS), (real, _REALS)):
            for name in names.intersection(element.attrib):
                text = element.attrib[name]
                try:
                    for one in text.split() if name == "dependencies" else [text]:
                        kind(one)
                except ValueError:
                    shown = shortened(repr(text))
                    yield f"{name} of <{element.tag}> is {shown}, which is no number"


def _elements(parent: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """All elements in another one, except some."""
    for element in parent:
        if element.tag not in _OTHERS:
            yield element
            yield from _elements(element)
