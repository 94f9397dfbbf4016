"""Files of an archive held against the schemas of SSP 1.0, which fmpy brings along."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import fmpy.ssp
from lxml import etree

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
