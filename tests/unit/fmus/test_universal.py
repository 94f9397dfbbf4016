"""Universal libraries of macOS, read as Apple's <mach-o/fat.h> describes them."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from fmus.compilers import universal

#: CPU_TYPE_X86_64 with CPU_SUBTYPE_X86_64_ALL, and CPU_TYPE_ARM64 with CPU_SUBTYPE_ARM64_ALL.
PROCESSORS = {"x86_64": (0x01000007, 3), "arm64": (0x0100000C, 0)}

#: Pages of arm64 have 16 KiB, and a part of the file that is not aligned to them is not loaded.
PAGE = 16384


def thin(processor: str, size: int) -> bytes:
    """The head of a 64-bit Mach-O library without load commands, and what may follow."""
    kind, model = PROCESSORS[processor]
    words = (0xFEEDFACF, kind, model, 6, 0, 0, 0, 0)
    return b"".join(word.to_bytes(4, "little") for word in words).ljust(size, b"\x5a")


def read(content: bytes) -> list[tuple[int, int, bytes]]:
    """Processors and libraries of a universal file."""

    def word(place: int) -> int:
        return int.from_bytes(content[4 * place : 4 * place + 4], "big")

    assert word(0) == 0xCAFEBABE
    found, end = [], 8
    for i in range(word(1)):
        kind, model, offset, size, align = (word(2 + 5 * i + k) for k in range(5))
        assert 2**align == PAGE
        assert offset % PAGE == 0
        assert offset >= end, "they do not overlap"
        end = offset + size
        found.append((kind, model, content[offset:end]))
    assert len(content) == end
    return found


@pytest.mark.parametrize("sizes", [(100, 200), (PAGE - 48, PAGE), (3 * PAGE + 1, 1000)])
def test_libraries_come_out_as_they_went_in(sizes):
    libraries = [thin(name, size) for name, size in zip(PROCESSORS, sizes, strict=True)]
    expected = [
        (*processor, library)
        for processor, library in zip(PROCESSORS.values(), libraries, strict=True)
    ]
    assert read(universal(libraries)) == expected


@pytest.mark.parametrize("other", [b"\x7fELF" + bytes(60), b"MZ" + bytes(60)])
def test_other_library_is_refused(other: bytes):
    with pytest.raises(ValueError, match="Mach-O"):
        universal([thin("x86_64", 100), other])


@pytest.mark.skipif(shutil.which("file") is None, reason="there is no command `file`")
def test_command_file_knows_it(tmp_path: Path):
    path = tmp_path / "library"
    path.write_bytes(universal([thin(name, 100) for name in PROCESSORS]))
    said = subprocess.run(["file", path], check=True, capture_output=True, text=True).stdout
    assert "universal binary with 2 architectures" in said
    assert "x86_64" in said
    assert "arm64" in said
