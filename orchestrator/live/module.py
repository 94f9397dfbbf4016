"""The module of the live page: the native FMUs of the bundle, compiled to WebAssembly.

All of them are in one module with one C library. The sources are the ones in the FMUs; FMI 2.0 has
a prefix for the names of their functions, and there it is the name of the component.
"""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from fmus.compilers import LIMIT_OF_ZIG, run_compiler
from fmus.discovery import components, package_folder
from fmus.kinds import NATIVE
from orchestrator.machine.cache import made_once
from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError, last_line, reason
from orchestrator.runs.bundle import current_fmus

#: Category in the cache.
CATEGORY = "live-module"

#: The module, and the licences of what the compiler links into it.
MODULE, LICENCES = FILES = "loop.wasm", "licences.txt"

#: Texts of these licences in the package of ziglang. Much of the C library is Zig's own code; the
#: rest is wasi-libc, with parts of cloudlibc and musl.
_NOTICES = {
    "Zig": "LICENSE",
    "wasi-libc": "lib/libc/wasi/LICENSE",
    "wasi-libc, MIT License": "lib/libc/wasi/LICENSE-MIT",
    "cloudlibc": "lib/libc/wasi/libc-bottom-half/cloudlibc/LICENSE",
    "musl": "lib/libc/musl/COPYRIGHT",
}

_HOST = Path(__file__).with_name("host.c")

#: Flags of the native FMUs, but for another machine.
_TARGET = ("-target", "wasm32-wasi")
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fvisibility=hidden")
_LINKED = ("-mexec-model=reactor", "-O2", "-s", "-Wl,--gc-sections")

#: The source file that includes the others of an FMU.
_MAIN = "fmi2.c"

#: Functions that the page calls; the linker drops what they do not need.
_FUNCTIONS = (
    "Instantiate", "FreeInstance", "SetupExperiment", "EnterInitializationMode",
    "ExitInitializationMode", "Reset", "DoStep",
    *(f"{way}{of}" for way in ("Get", "Set") for of in ("Real", "Integer", "Boolean")),
)  # fmt: skip
_HOST_FUNCTIONS = ("malloc", "free", "host_callbacks")


def live_module(hear: Callable[[str], None] = lambda line: None) -> dict[str, Path]:
    """The files by their names, compiled unless they are in the cache.

    Args:
        hear: called with a line before the module is compiled.

    Raises:
        InputError: the module cannot be compiled.

    """
    try:
        return made_once(CATEGORY, key_of(), lambda: compiled(hear))
    except OSError as error:
        raise InputError(
            f"the module of the live page cannot be compiled: {reason(error)}"
        ) from error


def key_of() -> str:
    """Key in the cache: digest of the sources and the flags."""
    made_of = (*FILES, *_NOTICES, *_NOTICES.values(), *_TARGET, *_FLAGS, *_LINKED, *_exports())
    digest = sha256("\0".join(made_of).encode())
    digest.update(_HOST.read_bytes())
    for name, files in _sources().items():
        for file, content in files.items():
            digest.update(f"{name}/{file}\0".encode())
            digest.update(content)
    return digest.hexdigest()[:16]


def compiled(hear: Callable[[str], None] = lambda line: None) -> dict[str, bytes]:
    """The contents of the files by their names, compiled now.

    Args:
        hear: called with a line before the module is compiled.

    Raises:
        InputError: ziglang is not installed.
        OSError: ziglang fails.

    """
    if find_spec("ziglang") is None:
        raise InputError(
            "the live page needs ziglang, which compiles C to WebAssembly: "
            "pip install 'auv-fmu[native]'"
        )
    hear("compiling the FMUs to WebAssembly (only once): this may take a few minutes")
    with TemporaryDirectory(dir=process_folder(), ignore_cleanup_errors=True) as temporary:
        folder = Path(temporary)
        objects = []
        for name, files in _sources().items():
            (folder / name).mkdir()
            for file, content in files.items():
                (folder / name / file).write_bytes(content)
            prefix = f"-DFMI2_FUNCTION_PREFIX={name}_"
            _zig(folder, *_FLAGS, prefix, "-c", f"{name}/{_MAIN}", "-o", f"{name}.o")
            objects.append(f"{name}.o")
        _zig(folder, *_FLAGS, "-c", str(_HOST), "-o", "host.o")
        exports = [f"-Wl,--export={name}" for name in _exports()]
        _zig(folder, *_LINKED, *exports, "host.o", *objects, "-o", MODULE)
        return {MODULE: (folder / MODULE).read_bytes(), LICENCES: _licences().encode()}


def _licences() -> str:
    folder = package_folder("ziglang")
    return "\n\n".join(
        f"{name}, contained in the WebAssembly module\n\n"
        + (folder / path).read_text(encoding="utf-8").strip()
        for name, path in _NOTICES.items()
    )


def _zig(folder: Path, *arguments: str) -> None:
    command = [sys.executable, "-m", "ziglang", "cc", *_TARGET, *arguments]
    process = run_compiler(command, folder, LIMIT_OF_ZIG)
    if process.returncode != 0:
        errors = [line for line in process.stderr.splitlines() if "error" in line]
        raise OSError(f"ziglang: {(errors or [last_line(process.stderr)])[0]}")


def _exports() -> Iterator[str]:
    yield from _HOST_FUNCTIONS
    for name in components():
        for function in _FUNCTIONS:
            yield f"{name}_fmi2{function}"


def _sources() -> Mapping[str, Mapping[str, bytes]]:
    """The sources in each FMU by their names, by the names of the components."""
    folder, found = current_fmus(NATIVE), {}
    for name in components():
        with zipfile.ZipFile(folder / f"{name}.fmu") as archive:
            files = [path for path in archive.namelist() if path.startswith("sources/")]
            found[name] = {Path(path).name: archive.read(path) for path in sorted(files)}
    return found
