"""Choice of the compiler, its error messages, platforms, and universal libraries of macOS."""

from __future__ import annotations

import os
import platform
import shutil
import signal
import subprocess
import sys
import threading
from importlib.util import find_spec
from pathlib import Path

import pytest

from fmus.language.mathematics import FUNCTIONS
from fmus.python import packaging
from orchestrator.machine import compilers
from orchestrator.machine.compilers import (
    COMPILERS,
    ROUNDED,
    compiler_for,
    library,
    platforms,
    this_machine,
    universal,
)
from support.tiers import slow

OWN = "/usr/bin/own-cc"

needs_compiler = pytest.mark.skipif(
    compilers.machines_compiler() is None, reason="there is no C compiler"
)
needs_zig = pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed")

SOURCES = {
    "main.c": b'#include "other.h"\nOTHER int answer(void) { return ANSWER; }\n',
    "other.h": b'#define ANSWER 42\n#define OTHER __attribute__((visibility("default")))\n',
}


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """An x86-64 Linux with a compiler of its own and without ziglang."""
    monkeypatch.setattr(compilers, "this_machine", lambda: "x86_64-linux")
    monkeypatch.setattr(compilers, "machines_compiler", lambda: OWN)
    monkeypatch.setattr(compilers, "_version_of", lambda command: command)
    monkeypatch.setattr(compilers, "find_spec", lambda name: None)
    return monkeypatch


def with_zig(machine: pytest.MonkeyPatch) -> None:
    machine.setattr(compilers, "find_spec", lambda name: object())
    machine.setattr("importlib.metadata.version", lambda name: "0.99")


@pytest.mark.parametrize("zig", [False, True])
def test_this_machine_has_its_own_compiler(machine: pytest.MonkeyPatch, zig: bool):
    if zig:
        with_zig(machine)
    assert compiler_for(platforms("2", "linux64")).command[0] == OWN


@pytest.mark.parametrize("names", ["win64", "linux64,win64", "darwin64", "all"])
def test_other_machines_have_zig_for_all(machine: pytest.MonkeyPatch, names: str):
    with pytest.raises(OSError, match=r"no C compiler for .*pip install 'auv-fmu\[native\]'"):
        compiler_for(platforms("2", names))
    with_zig(machine)
    assert compiler_for(platforms("2", names)).name == "ziglang 0.99"


def test_only_platforms_without_a_compiler_are_named(machine: pytest.MonkeyPatch):
    with pytest.raises(OSError, match="no C compiler for win64: "):
        compiler_for(platforms("2", "linux64,win64"))


def test_apples_compiler_makes_what_a_mac_runs(machine: pytest.MonkeyPatch):
    machine.setattr(compilers, "this_machine", lambda: "aarch64-darwin")
    for fmi, name in (("2", "darwin64"), ("3", "aarch64-darwin"), ("3", "x86_64-darwin")):
        made = compiler_for(platforms(fmi, name))
        assert made.command == [OWN], "none of the options of Linux"
        assert made.targets["aarch64-darwin"] == ("-arch", "arm64")
    with pytest.raises(OSError, match="no C compiler for linux64: pip install"):
        compiler_for(platforms("2", "linux64,darwin64"))


@pytest.mark.skipif(packaging.loader_compiler() is None, reason="there is no C compiler")
@pytest.mark.parametrize("name", [COMPILERS[0], *slow(*COMPILERS[1:])])
def test_any_compiler_is_enough(name, tmp_path, monkeypatch):
    """A compiler is found under any of its names."""
    real = compilers.machines_compiler()
    assert real is not None
    wrapper = tmp_path / name
    wrapper.write_text(f'#!/bin/sh\nPATH={os.environ["PATH"]} exec {real} "$@"\n')
    wrapper.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert compilers.machines_compiler() == str(wrapper)
    [own] = platforms("2" if compilers.this_machine() == "x86_64-linux" else "3")
    assert library(compiler_for([own]), own, "Answer", SOURCES, "main.c")
    packaging.compiled_loader.cache_clear()
    assert b"fmi2DoStep" in packaging.compiled_loader()


@pytest.mark.skipif(os.name != "posix", reason="signals are sent as POSIX has them")
def test_an_interrupt_is_raised_although_the_compiler_has_ended():
    """Python waits a quarter of a second for it, and it ends in that time."""
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        compilers.Compiler([sys.executable]).run("-c", "import time; time.sleep(0.6)")


def test_machine_without_a_compiler(machine: pytest.MonkeyPatch):
    machine.setattr(compilers, "machines_compiler", lambda: None)
    with pytest.raises(
        OSError, match="no C compiler for linux64: install gcc or clang, or pip install"
    ):
        compiler_for(platforms("2", "linux64"))
    with_zig(machine)
    assert compiler_for(platforms("2", "linux64")).name == "ziglang 0.99"


def test_operations_are_never_contracted_nor_reordered():
    assert "-ffp-contract=off" in compilers.FLAGS
    assert not any("fast" in flag for flag in compilers.FLAGS)


@needs_compiler
def test_error_of_a_compiler_is_reported_in_one_line():
    [own] = platforms("2" if compilers.this_machine() == "x86_64-linux" else "3")
    sources = {**SOURCES, "other.h": b"#error on purpose\n"}
    with pytest.raises(OSError, match=r"makes no Answer for .*other.h.*on purpose") as error:
        library(compiler_for([own]), own, "Answer", sources, "main.c")
    assert "\n" not in str(error.value)


#: First bytes of a library, and the offset and bytes of the number of its processor.
HEADS = {
    "x86_64-linux": (b"\x7fELF\x02\x01", 18, (0x3E).to_bytes(2, "little")),
    "aarch64-linux": (b"\x7fELF\x02\x01", 18, (0xB7).to_bytes(2, "little")),
    "x86_64-darwin": (b"\xcf\xfa\xed\xfe", 4, (0x01000007).to_bytes(4, "little")),
    "aarch64-darwin": (b"\xcf\xfa\xed\xfe", 4, (0x0100000C).to_bytes(4, "little")),
}


@pytest.mark.slow
@needs_zig
@pytest.mark.parametrize("name", HEADS)
def test_zig_makes_libraries_for_other_machines(name: str, tmp_path, monkeypatch):
    found = platforms("3", name)
    zig = compiler_for([*found, *platforms("3", "x86_64-windows")])
    monkeypatch.chdir(tmp_path)
    made = library(zig, found[0], "Answer", SOURCES, "main.c")
    magic, place, processor = HEADS[name]
    assert made.startswith(magic)
    assert made[place : place + len(processor)] == processor
    assert b"answer" in made
    assert str(tmp_path).encode() not in made
    assert list(tmp_path.iterdir()) == []


#: CPU_TYPE_X86_64 with CPU_SUBTYPE_X86_64_ALL, and CPU_TYPE_ARM64 with CPU_SUBTYPE_ARM64_ALL.
PROCESSORS = {"x86_64": (0x01000007, 3), "arm64": (0x0100000C, 0)}

#: Pages of arm64 have 16 KiB, and a part of the file that is not aligned to them is not loaded.
PAGE = 16384


def thin(processor: str, size: int) -> bytes:
    """Return the header of a 64-bit Mach-O library without load commands, and some bytes."""
    kind, model = PROCESSORS[processor]
    words = (0xFEEDFACF, kind, model, 6, 0, 0, 0, 0)
    return b"".join(word.to_bytes(4, "little") for word in words).ljust(size, b"\x5a")


def read(content: bytes) -> list[tuple[int, int, bytes]]:
    """Return the processors and libraries of a universal file."""

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
def test_libraries_are_unchanged_in_a_universal_file(sizes):
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


@pytest.mark.skipif(shutil.which("file") is None, reason="file is not installed")
def test_command_file_knows_it(tmp_path: Path):
    path = tmp_path / "library"
    path.write_bytes(universal([thin(name, 100) for name in PROCESSORS]))
    output = subprocess.run(["file", path], check=True, capture_output=True, text=True).stdout
    assert "universal binary with 2 architectures" in output
    assert "x86_64" in output
    assert "arm64" in output


def test_compilers_evaluate_no_function_whose_result_is_rounded():
    rounded = {
        name for name, function in FUNCTIONS.items() if function.is_rounded and not function.factor
    }
    assert set(ROUNDED) == rounded


# Platforms

#: Names of folders in `binaries`: FMI 2.0.4, section 2.3, has its own names for x86 and refers to
#: FMI 3.0.1, section 2.5.1.4.1, for other processors.
FOLDERS = {
    "2": {
        "linux64": ".so",
        "win64": ".dll",
        "darwin64": ".dylib",
        "aarch64-linux": ".so",
        "aarch64-darwin": ".dylib",
    },
    "3": {
        "x86_64-linux": ".so",
        "aarch64-linux": ".so",
        "x86_64-windows": ".dll",
        "x86_64-darwin": ".dylib",
        "aarch64-darwin": ".dylib",
    },
}

#: Names of platforms in both versions of FMI, by the processor and system that Python reports.
MACHINES = {
    ("x86_64", "Linux"): (["linux64"], ["x86_64-linux"]),
    ("aarch64", "Linux"): (["aarch64-linux"], ["aarch64-linux"]),
    ("AMD64", "Windows"): (["win64"], ["x86_64-windows"]),
    ("x86_64", "Darwin"): (["darwin64"], ["x86_64-darwin"]),
    # Hosts look into one or the other.
    ("arm64", "Darwin"): (["darwin64", "aarch64-darwin"], ["aarch64-darwin"]),
    ("riscv64", "Linux"): ([], []),
}


@pytest.mark.parametrize("fmi", FOLDERS)
def test_all_platforms_have_the_names_of_the_standard(fmi: str):
    assert {platform.name: platform.ending for platform in platforms(fmi, "all")} == FOLDERS[fmi]


@pytest.mark.parametrize("machine", MACHINES, ids=" ".join)
@pytest.mark.parametrize("fmi", FOLDERS)
def test_default_platform_is_this_machine(fmi, machine, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(platform, "machine", lambda: machine[0])
    monkeypatch.setattr(platform, "system", lambda: machine[1])
    names = MACHINES[machine][list(FOLDERS).index(fmi)]
    if names:
        assert [platform.name for platform in platforms(fmi)] == names
        assert all(this_machine() in platform.machines for platform in platforms(fmi))
    else:
        with pytest.raises(ValueError, match=f"no platform for this machine, {machine[0]}-"):
            platforms(fmi)


def test_names_may_be_given_in_any_order_and_twice():
    wanted = platforms("2", "win64, linux64,win64")
    assert [platform.name for platform in wanted] == ["linux64", "win64"]


def test_library_of_macos_is_for_both_of_its_processors():
    [darwin] = platforms("2", "darwin64")
    assert darwin.machines == ("x86_64-darwin", "aarch64-darwin")


@pytest.mark.parametrize(
    ("fmi", "names", "complaint"),
    [
        (
            "2",
            "win32",
            "FMI 2.0 has no platform 'win32'; there are linux64, win64, darwin64, aarch64-linux, "
            "aarch64-darwin, or all$",
        ),
        ("2", "linux64,", "no platform ''"),
        ("2", "all,linux64", "no platform 'all'"),
        ("2", "x86_64-linux", "no platform 'x86_64-linux'.*; try --fmi 3$"),
        ("3", "linux64", "FMI 3.0 has no platform 'linux64'.*; try --fmi 2$"),
    ],
)
def test_unknown_platform_is_named(fmi: str, names: str, complaint: str):
    with pytest.raises(ValueError, match=complaint):
        platforms(fmi, names)
