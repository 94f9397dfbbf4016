"""Serialised states of both kinds, and changes that an FMU must refuse."""

from __future__ import annotations

import json
from binascii import crc32
from struct import pack, unpack
from typing import Any

CHECKSUM = "checksum"

#: First bytes of a state of an FMU in C: the length of a text, and the text.
_MAGIC = b"FMU state 3"
_HEAD = pack("<I", len(_MAGIC)) + _MAGIC


def read(content: bytes) -> dict[str, Any] | None:
    """Read a state in JSON; None: the bytes are no such state."""
    try:
        state = json.loads(content)
    except (ValueError, RecursionError):
        return None
    return state if isinstance(state, dict) else None


def without_fault(content: bytes) -> Any:
    """Parts of a state that a refusal does not change."""
    if content.startswith(_HEAD):
        return content[:-8]  # the last words are the fault and the checksum
    state = read(content)
    return state and {key: state[key] for key in state if key not in ("fault", CHECKSUM)}


def sealed(state: dict[str, Any]) -> bytes:
    """Bytes of a state in JSON with a checksum that fits."""
    rest = {key: value for key, value in state.items() if key != CHECKSUM}
    return json.dumps({**rest, CHECKSUM: crc32(json.dumps(rest).encode())}).encode()


def changed(content: bytes, change: str) -> bytes:
    """Change the bytes of a state into bytes that an FMU must refuse.

    Args:
        content: of a good state.
        change: `noise`, `cut`, `changed` (another number than the checksum is for) or `impossible`
            (a mode that there is not, with a checksum that fits).

    """
    middle = len(content) // 2
    if change in ("noise", "cut"):
        return b"[" * 5000 if change == "noise" else content[:middle]
    if content.startswith(_HEAD):
        if change == "changed":
            return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]
        # The mode is the word after two texts.
        [length] = unpack("<I", content[len(_HEAD) : len(_HEAD) + 4])
        place = len(_HEAD) + 4 + length
        rest = content[:place] + pack("<I", 7) + content[place + 4 : -4]
        return rest + pack("<I", crc32(rest))
    state = read(content)
    if state is None:
        return b"{}"
    if change == "changed":
        return json.dumps({**state, "start_time": 17.5}).encode()
    return sealed({**state, "mode": "bogus"})
