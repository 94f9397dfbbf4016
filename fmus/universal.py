"""Libraries of macOS for several processors in one file, which Apple calls a universal binary."""

from __future__ import annotations

import struct
from collections.abc import Sequence

_MAGIC_FAT, _MAGIC_64 = 0xCAFEBABE, 0xFEEDFACF

#: Each library begins at a multiple of the largest page, as a power of two.
_ALIGNMENT = 14

#: Heads of the file, of a library in it, and of a library.
_FAT, _ENTRY, _THIN = struct.Struct(">2I"), struct.Struct(">5I"), struct.Struct("<3I")


def universal(libraries: Sequence[bytes]) -> bytes:
    """One file of libraries for different processors.

    Raises:
        ValueError: one is no 64-bit Mach-O file.

    """
    head, body = _FAT.pack(_MAGIC_FAT, len(libraries)), b""
    begin = _aligned(_FAT.size + len(libraries) * _ENTRY.size)
    for library in libraries:
        magic, processor, model = _THIN.unpack_from(library)
        if magic != _MAGIC_64:
            raise ValueError("not a 64-bit Mach-O file")
        start = _aligned(begin + len(body))
        head += _ENTRY.pack(processor, model, start, len(library), _ALIGNMENT)
        body = body.ljust(start - begin, b"\0") + library
    return head.ljust(begin, b"\0") + body


def _aligned(offset: int) -> int:
    return -(-offset >> _ALIGNMENT) << _ALIGNMENT
