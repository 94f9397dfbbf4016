"""Pages of stored runs, as their script reads them."""

from __future__ import annotations

import gzip
import json
import re
from base64 import b64decode
from typing import Any

import numpy as np


def unpacked(page: str, element: str) -> list[bytes]:
    """Unpack the content of an element of a page."""
    [text] = re.findall(rf'<script [^>]*id="{element}">(.*?)</script>', page, re.DOTALL)
    return [gzip.decompress(b64decode(word)) for word in text.split()]


def stored(page: str) -> tuple[Any, list[dict[str, np.ndarray]]]:
    """The data of a page, and the columns of each run."""
    data = json.loads(unpacked(page, "data")[0])
    contents = unpacked(page, "binary")
    return data, list(map(_columns, data["loops"], contents))


def _columns(loop: Any, content: bytes) -> dict[str, np.ndarray]:
    names, n = ["time", *loop["doubles"]], loop["rows"]
    wide = 8 * n * len(names)
    doubles = np.frombuffer(content[:wide]).reshape(-1, n)
    singles = np.frombuffer(content[wide:], "<f4").reshape(-1, n)
    return dict(zip((*names, *loop["singles"]), (*doubles, *singles), strict=True))
