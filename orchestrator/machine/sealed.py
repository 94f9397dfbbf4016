"""Records in JSON that carry a checksum over themselves."""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

#: The entry with the checksum.
_SEAL = "sha256"


def sealed(content: Mapping[str, Any]) -> str:
    """The text of a record, with its checksum."""
    return json.dumps({**content, _SEAL: _checksum(content)})


def unsealed(text: str) -> dict[str, Any]:
    """The content of a record that is as it was written.

    Raises:
        ValueError: it is not, or is no such record.

    """
    content = json.loads(text)
    if not isinstance(content, dict) or _SEAL not in content:
        raise ValueError("it has no checksum of its own")
    if content.pop(_SEAL) != _checksum(content) or sealed(content) != text:
        raise ValueError("it is damaged: its checksum differs")
    return content


def _checksum(content: Mapping[str, Any]) -> str:
    return sha256(json.dumps(content).encode()).hexdigest()
