"""A file of an archive as elements, read leniently and held against the schemas.

fmpy.ssp is no such reader: it looks for transformations in the wrong namespace, passes over
parameter mappings, units and annotations, does not decode the addresses of files, and reads a file
only if it is valid to the letter. What is harmless is a note here.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import fmpy.ssp
from lxml import etree

from orchestrator.formats.ssp import NAMESPACES

#: Elements in which others than the standard's are at home.
_OPEN = ("Annotations", "MetaData", "Signature")


def read_document(text: bytes, note: Callable[[str], None]) -> Element:
    """The root element of an XML file; tags and attributes are local names, text is left out.

    Args:
        text: the file.
        note: takes what is not as it should be, and can be understood.

    Raises:
        ValueError: it is not well-formed, or not without a document type.

    """
    reader = _Reader(note)
    parser = expat.ParserCreate()
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.StartDoctypeDeclHandler = reader.doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise ValueError(f"not well-formed XML: {error}") from error
    return reader.builder.close()


class _Reader:
    """What is told by the parser, which knows nothing of namespaces.

    Attributes:
        builder: of the elements.

    """

    def __init__(self, note: Callable[[str], None]) -> None:
        self.builder = TreeBuilder()
        self._note = note
        self._scopes: list[dict[str, str]] = [{}]
        self._open = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Take the beginning of an element."""
        scope = self._scopes[-1]
        declared = {
            name.removeprefix("xmlns").removeprefix(":"): value
            for name, value in attributes.items()
            if name == "xmlns" or name.startswith("xmlns:")
        }
        self._scopes.append({**scope, **declared} if declared else scope)
        prefix, _, name = tag.rpartition(":")
        if self._open or name in _OPEN:
            self._open += 1
        self._check(prefix)
        plain = {
            key.rpartition(":")[2]: value
            for key, value in attributes.items()
            if not key.startswith("xmlns")
        }
        self.builder.start(name, plain)

    def end(self, tag: str) -> None:
        """Take the end of an element."""
        self._scopes.pop()
        self._open = max(self._open - 1, 0)
        self.builder.end(tag.rpartition(":")[2])

    def doctype(self, *_: object) -> None:
        """Refuse what could name further files, or unfold into more than memory holds."""
        raise ValueError("it has a document type, which no file of an SSP has")

    def _check(self, prefix: str) -> None:
        namespace = self._scopes[-1].get(prefix)
        if namespace is None and prefix:
            self._note(f"the prefix {prefix!r} is not declared")
        elif not self._open and namespace not in NAMESPACES:
            where = f"the namespace {namespace!r}" if namespace else "no namespace"
            self._note(f"elements are in {where}, which is none of SSP 1.0")


#: Schemas by the root elements of the files that they are for.
_SCHEMAS = {
    "SystemStructureDescription": "SystemStructureDescription.xsd",
    "ParameterSet": "SystemStructureParameterValues.xsd",
    "ParameterMapping": "SystemStructureParameterMapping.xsd",
}


def violations(root: str, text: bytes) -> list[str]:
    """What is not as the schema has it, with the number of its line.

    Args:
        root: name of the root element.
        text: the file.

    """
    if root not in _SCHEMAS:
        return [f"<{root}> is no element of SSP"]
    schema = _schema(_SCHEMAS[root])
    try:
        schema.assertValid(etree.fromstring(text))
    except etree.LxmlError as error:
        said = [(entry.line, entry.message) for entry in error.error_log]
        return [f"line {line}: {re.sub('{[^}]*}', '', message)}" for line, message in said]
    return []


@cache
def _schema(name: str) -> etree.XMLSchema:
    [folder] = fmpy.ssp.__path__
    return etree.XMLSchema(etree.parse(Path(folder, "schema", name)))
