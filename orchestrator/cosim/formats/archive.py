"""An SSP archive or its folder while it is read: its files, and the flaws found in it.

Files are read leniently, and checked with the schemas: harmless flaws are notes. fmpy.ssp reads
a file only if it is valid to the letter, and does not decode the addresses of files.
"""

from __future__ import annotations

import os
import re
from functools import cache
from pathlib import Path
from typing import TypeVar
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element

import fmpy.ssp
from lxml import etree

from orchestrator.cosim.connection import Linear, UndefinedUnit, Unit, conversion
from orchestrator.cosim.variables import family_of
from orchestrator.machine.documents import read_document
from orchestrator.machine.errors import Findings, InputError, did_you_mean, listed, reason
from orchestrator.machine.texts import finite, integer
from orchestrator.machine.user_files import check_file, is_folder, unpack

#: The file of an archive that describes its contents.
STRUCTURE = "SystemStructure.ssd"

_SSP = "http://ssp-standard.org/SSP1/SystemStructure"
SSD = f"{_SSP}Description"
SSC = f"{_SSP}Common"
SSV = f"{_SSP}ParameterValues"
SSM = f"{_SSP}ParameterMapping"
SSB = f"{_SSP}SignalDictionary"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"

#: The annotation of ours that names the inputs that are open on purpose.
LEFT_OPEN = "LeftOpen"

#: The one that names the components in their order, where nesting changes it.
ORDER = "Order"

#: Namespaces of the standard's own elements.
NAMESPACES = (SSD, SSC, SSV, SSM, SSB)


#: The versions of SSP that are read, the last one also where a file names another.
VERSIONS = ("1.0", "2.0")

#: Schemas by the root elements of the files that they are for.
_SCHEMAS = {
    "SystemStructureDescription": "SystemStructureDescription.xsd",
    "ParameterSet": "SystemStructureParameterValues.xsd",
    "ParameterMapping": "SystemStructureParameterMapping.xsd",
}

#: Elements that are new in 2.0, with all that is in them.
_ELEMENTS = ("Clock", "Dimension", "MetaData", "Signature", "Value")

#: Attributes that are new in 2.0.
_ATTRIBUTES = ("endIndices", "startIndices", "systemInnerX", "systemInnerY")

#: Values of attributes that are new in 2.0, and what stands for each in 1.0.
_VALUES = {
    ("implementation", "ScheduledExecution"): "any",
    **{
        ("kind", kind): "inout"
        for kind in ("structuralParameter", "constant", "local", "unspecified")
    },
}

#: Types whose values may have spaces in them.
_TEXTS = ("String", "Enumeration", "Binary")

#: An integer that those of 1.0 may not reach.
_LARGE = re.compile(r"[+-]?\d{10,}")


def violations(root: str, text: bytes) -> list[str]:
    """What is not as the schema has it, with the number of its line.

    Args:
        root: name of the root element.
        text: the file, of SSP 1.0 or 2.0.

    """
    if root not in _SCHEMAS:
        return [f"<{root}> is not an element of SSP"]
    try:
        document = etree.fromstring(text)
        if document.get("version") == VERSIONS[-1]:
            _put_into_1_0(document)
        _schema(_SCHEMAS[root]).assertValid(document)
    except etree.LxmlError as error:
        said = [(entry.line, entry.message) for entry in error.error_log]
        return [f"line {line}: {re.sub('{[^}]*}', '', message)}" for line, message in said]
    return []


@cache
def _schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(Path(*fmpy.ssp.__path__, "schema", name)))


def _put_into_1_0(document: etree._Element) -> None:
    """Leave out of a file of SSP 2.0 what 1.0 does not have, or put its like in its place.

    Args:
        document: its root element; lines stay what they are.

    """
    document.set("version", VERSIONS[0])
    for element in list(document.iter(*(f"{{{namespace}}}*" for namespace in NAMESPACES))):
        name, parent = etree.QName(element), element.getparent()
        if name.localname in _ELEMENTS and parent is not None:
            parent.remove(element)
            continue
        of = family_of(name.localname)
        # Annotations may have text, and values of texts were on lines of their own.
        element.tag, element.text = f"{{{name.namespace}}}{of}", None
        if parent is not None and etree.QName(parent).localname == "Parameter":
            # Lists are values of arrays.
            stated = element.get("value", "")
            element.set("value", stated if of in _TEXTS else "".join(stated.split()[:1]))
        for attribute, value in element.items():
            if attribute in _ATTRIBUTES:
                del element.attrib[attribute]
            elif (attribute, value) in _VALUES or _LARGE.fullmatch(value):
                element.set(attribute, _VALUES.get((attribute, value), "0"))
        if of == "Component":
            element.set("source", element.get("source", ""))


_SUFFIX = Path(STRUCTURE).suffix

#: Endings of descriptions that are read where they are, with the files beside them.
_LOOSE = (_SUFFIX, ".xml")

#: A number, or that there may be none.
_Float = TypeVar("_Float", float, None)


class Archive:
    """An archive, unpacked, or a description in a folder, and the findings about it.

    Attributes:
        path: of the archive, or of the folder or the description.
        folder: into which it is unpacked, or with the description.
        findings: what is wrong with it.

    """

    def __init__(self, path: Path, findings: Findings) -> None:
        """Unpack anything but a folder.

        Raises:
            InputError: it cannot be unpacked.

        """
        self.path, self.findings = path, findings
        is_whole = is_folder(path)
        self._is_packed = not is_whole and path.suffix not in _LOOSE
        if self._is_packed:
            self.folder = unpack(path).folder
        else:
            self.folder = path.resolve() if is_whole else path.resolve().parent

    def problem(self, text: object) -> None:
        """Take note of what makes a run meaningless, or impossible."""
        said = str(text).removeprefix(f"{self.path}: ")
        self.findings.problem(f"{self.path}: {said}")

    def note(self, text: object) -> None:
        """Take note of what changes no number."""
        self.findings.note(f"{self.path}: {text}")

    def structure(self, variant: str | None) -> Element:
        """The description of the system.

        Args:
            variant: name of its file, with or without its ending; None: the default.

        Raises:
            InputError: there is none, or it cannot be read.

        """
        files = {path.stem: path for path in sorted(self.folder.glob(f"*{_SUFFIX}"))}
        default = self.path.name if self.path.suffix == _SUFFIX else STRUCTURE
        name = (default if variant is None else variant).removesuffix(_SUFFIX)
        if name not in files:
            known = f"; it has {', '.join(files)}" if files else ""
            raise InputError(
                f"{self.path}: not a readable SSP: there is no {name}{_SUFFIX} in it{known}"
                f"{did_you_mean(name, files)}"
            )
        return self.read(files[name])

    def read(self, path: Path) -> Element:
        """The root element of a file of the archive.

        Raises:
            InputError: it cannot be read.

        """
        name = path.relative_to(self.folder) if path.is_relative_to(self.folder) else path.name
        remarks: list[str] = []
        try:
            check_file(path)
            text = path.read_bytes()
            root = read_document(text, remarks.append, NAMESPACES, "SSP")
        except Exception as error:
            raise InputError(f"{self.path}: not a readable SSP: {name}: {reason(error)}") from error
        version = root.get("version")
        if version not in VERSIONS:
            stated = "no version" if version is None else f"version {version!r}"
            remarks.append(f"names {stated} of SSP; it is read as {VERSIONS[-1]}")
        # Of other namespaces and versions the schemas know nothing.
        if not remarks and (wrong := violations(root.tag, text)):
            remarks.append(f"not valid: {listed(wrong, '; ')}")
        for remark in dict.fromkeys(remarks):
            self.note(f"{name}: {remark}")
        return root

    def file(self, source: str, needer: str, base: Path | None = None) -> Path | None:
        """A file that the description names; None, with a problem, if the archive has none.

        Args:
            source: its address, a relative URI.
            needer: what needs it, for the message.
            base: the folder to which the address is relative; None: the description's folder.

        """
        base = self.folder if base is None else base
        if "://" in source:
            self.problem(
                f"{needer}: {source!r} is elsewhere; only files in the archive are supported"
            )
            return None
        try:
            decoded = unquote(urlsplit(source).path)
        except ValueError:
            self.problem(f"{needer}: {source!r} is not a URI")
            return None
        for name in dict.fromkeys((decoded, source, source.replace("\\", "/"))):
            path = Path(os.path.normpath(base / name))
            if self._is_packed and not path.is_relative_to(base):
                self.problem(f"{needer}: {source!r} lies outside the archive")
                return None
            if path.is_file():
                if name != decoded:
                    self.note(
                        f"{needer}: {source!r} is not a URI, in which / separates and % encodes"
                    )
                return path
        self.problem(f"holds no {source!r} for {needer}")
        return None

    def conversion(self, source: Unit | None, target: Unit | None) -> Linear | None:
        """From one unit to another, as far as they are defined; None: the value stays as it is.

        Raises:
            InputError: they measure different things.

        """
        try:
            return conversion(source, target)
        except UndefinedUnit as error:
            self.note(f"{error}; values are taken as they are")
            # Said to explain why the units at the ends differ.
            return Linear()

    def required(self, element: Element, name: str, owner: str) -> str:
        """An attribute that an element must have; empty, with a problem, where it has not.

        Args:
            element: with the attribute.
            name: of the attribute.
            owner: of the element, for the message.

        """
        if name not in element.attrib:
            self.problem(f"{owner}: a <{element.tag}> without {name}")
        return element.get(name, "")

    def integer(self, element: Element, name: str) -> int:
        """An attribute that is an integer; zero where it is not stated or, with a problem, none."""
        text = element.get(name, "0")
        try:
            return integer(text)
        except ValueError:
            self.problem(f"{name} {text!r} is not an integer")
            return 0

    def number(self, element: Element | None, name: str, otherwise: _Float) -> float | _Float:
        """An attribute that is a number.

        Args:
            element: with the attribute; None: there is none.
            name: of the attribute.
            otherwise: its value where it is not stated or, with a problem, is not a number.

        """
        text = None if element is None else element.get(name)
        try:
            return otherwise if text is None else finite(text, name)
        except ValueError as error:
            self.problem(error)
            return otherwise
