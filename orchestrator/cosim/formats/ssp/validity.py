"""What the schemas of SSP have against a file.

Only the ones of SSP 1.0 come with fmpy: what 2.0 adds is put into words of 1.0 before.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import fmpy.ssp
from lxml import etree

from orchestrator.cosim.formats.ssp import NAMESPACES
from orchestrator.cosim.system.values import family_of

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
