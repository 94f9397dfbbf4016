"""An SSP archive or its folder while it is read: its files, and their flaws.

Files are read leniently and checked with the schemas: harmless flaws are notes. fmpy.ssp reads only
files that are perfectly valid, and does not decode the addresses of files.
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

#: The file of an archive that describes the system.
STRUCTURE = "SystemStructure.ssd"

_SSP = "http://ssp-standard.org/SSP1/SystemStructure"
SSD = f"{_SSP}Description"
SSC = f"{_SSP}Common"
SSV = f"{_SSP}ParameterValues"
SSM = f"{_SSP}ParameterMapping"
SSB = f"{_SSP}SignalDictionary"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"

#: Our annotation that names the inputs that are open on purpose.
LEFT_OPEN = "LeftOpen"

#: Our annotation that names the components in order, where nesting changes it.
ORDER = "Order"

#: Namespaces of SSP's elements.
NAMESPACES = (SSD, SSC, SSV, SSM, SSB)


#: Supported versions of SSP; other versions are read as the last one.
VERSIONS = ("1.0", "2.0")

#: Schemas by root elements.
_SCHEMAS = {
    "SystemStructureDescription": "SystemStructureDescription.xsd",
    "ParameterSet": "SystemStructureParameterValues.xsd",
    "ParameterMapping": "SystemStructureParameterMapping.xsd",
}

#: Elements that are new in 2.0; they are left out with their contents.
_ELEMENTS = ("Clock", "Dimension", "MetaData", "Signature", "Value")

#: Attributes that are new in 2.0.
_ATTRIBUTES = ("endIndices", "startIndices", "systemInnerX", "systemInnerY")

#: Values of attributes that are new in 2.0, and their replacements in 1.0.
_VALUES = {
    ("implementation", "ScheduledExecution"): "any",
    **{
        ("kind", kind): "inout"
        for kind in ("structuralParameter", "constant", "local", "unspecified")
    },
}

#: Types whose values may contain spaces.
_TEXTS = ("String", "Enumeration", "Binary")

#: An integer that may be too large for 1.0.
_LARGE = re.compile(r"[+-]?\d{10,}")


def violations(root: str, text: bytes) -> list[str]:
    """Return the violations of the schema, with the numbers of their lines.

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
        entries = [(entry.line, entry.message) for entry in error.error_log]
        return [f"line {line}: {re.sub('{[^}]*}', '', message)}" for line, message in entries]
    return []


@cache
def _schema(name: str) -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(Path(*fmpy.ssp.__path__, "schema", name)))


def _put_into_1_0(document: etree._Element) -> None:
    """Remove or replace the parts of a file of SSP 2.0 that 1.0 does not have.

    Args:
        document: its root element; the numbers of lines stay.

    """
    document.set("version", VERSIONS[0])
    for element in list(document.iter(*(f"{{{namespace}}}*" for namespace in NAMESPACES))):
        name, parent = etree.QName(element), element.getparent()
        if name.localname in _ELEMENTS and parent is not None:
            parent.remove(element)
            continue
        family = family_of(name.localname)
        # Annotations may contain text, and values of texts were on lines of their own.
        element.tag, element.text = f"{{{name.namespace}}}{family}", None
        if parent is not None and etree.QName(parent).localname == "Parameter":
            # Lists are values of arrays.
            stated = element.get("value", "")
            element.set("value", stated if family in _TEXTS else "".join(stated.split()[:1]))
        for attribute, value in element.items():
            if attribute in _ATTRIBUTES:
                del element.attrib[attribute]
            elif (attribute, value) in _VALUES or _LARGE.fullmatch(value):
                element.set(attribute, _VALUES.get((attribute, value), "0"))
        if family == "Component":
            element.set("source", element.get("source", ""))


_SUFFIX = Path(STRUCTURE).suffix

#: Endings of descriptions that are read in place, with the files next to them.
_LOOSE = (_SUFFIX, ".xml")

#: A number or None.
_Float = TypeVar("_Float", float, None)


class Archive:
    """An unpacked archive, or a description in a folder, with findings.

    Attributes:
        path: of the archive, the folder or the description.
        folder: of the unpacked archive, or with the description.
        findings: receives problems and notes.

    """

    def __init__(self, path: Path, findings: Findings) -> None:
        """Unpack the file unless it is a folder or a description.

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
        """Add a problem, which makes a run meaningless or impossible."""
        shown = str(text).removeprefix(f"{self.path}: ")
        self.findings.problem(f"{self.path}: {shown}")

    def note(self, text: object) -> None:
        """Add a note on a flaw that changes no number."""
        self.findings.note(f"{self.path}: {text}")

    def structure(self, variant: str | None) -> Element:
        """Return the root element of the description of the system.

        Args:
            variant: name of its file, with or without ending; None: the default.

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
        """Return the root element of a file of the archive.

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
        # The schemas cover no other namespaces and versions.
        if not remarks and (wrong := violations(root.tag, text)):
            remarks.append(f"not valid: {listed(wrong, '; ')}")
        for remark in dict.fromkeys(remarks):
            self.note(f"{name}: {remark}")
        return root

    def file(self, source: str, needer: str, base: Path | None = None) -> Path | None:
        """Return a file that the description names; None, with a problem, if it is missing.

        Args:
            source: address of the file, a relative URI.
            needer: user of the file, for the message.
            base: folder to which the address is relative; None: the description's folder.

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
        """Return the conversion between two units; None: the value stays as it is.

        Raises:
            InputError: they measure different quantities.

        """
        try:
            return conversion(source, target)
        except UndefinedUnit as error:
            self.note(f"{error}; values are taken as they are")
            # Stated so that the different units at the ends are accepted.
            return Linear()

    def required(self, element: Element, name: str, owner: str) -> str:
        """Return a required attribute of an element; empty, with a problem, if it is missing.

        Args:
            element: with the attribute.
            name: of the attribute.
            owner: of the element, for the message.

        """
        if name not in element.attrib:
            self.problem(f"{owner}: a <{element.tag}> without {name}")
        return element.get(name, "")

    def integer(self, element: Element, name: str) -> int:
        """Return an integer attribute; zero if it is missing or, with a problem, not an integer."""
        text = element.get(name, "0")
        try:
            return integer(text)
        except ValueError:
            self.problem(f"{name} {text!r} is not an integer")
            return 0

    def number(self, element: Element | None, name: str, otherwise: _Float) -> float | _Float:
        """Return a numeric attribute.

        Args:
            element: with the attribute; None: there is no element.
            name: of the attribute.
            otherwise: value if it is missing or, with a problem, not a number.

        """
        text = None if element is None else element.get(name)
        try:
            return otherwise if text is None else finite(text, name)
        except ValueError as error:
            self.problem(error)
            return otherwise
