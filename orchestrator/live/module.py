"""The modules of the live page: programs of systems and indices, compiled to WebAssembly.

The functions of each have its name before theirs.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path

from orchestrator.live.programs import Source
from orchestrator.machine.cache import made_once
from orchestrator.machine.compilers import SAME_NUMBERS, zig
from orchestrator.machine.disk import temporary_folder
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.identity import package_folder

#: Category in the cache.
CATEGORY = "live-module"

#: The module, and the licences of what the compiler links into it.
MODULE, LICENCES = FILES = "programs.wasm", "licences.txt"

#: Texts of these licences in the package of ziglang. Much of the C library is Zig's own code; the
#: rest is wasi-libc, with parts of cloudlibc and musl.
_NOTICES = {
    "Zig": "LICENSE",
    "wasi-libc": "lib/libc/wasi/LICENSE",
    "wasi-libc, MIT License": "lib/libc/wasi/LICENSE-MIT",
    "cloudlibc": "lib/libc/wasi/libc-bottom-half/cloudlibc/LICENSE",
    "musl": "lib/libc/musl/COPYRIGHT",
}

_TARGET = ("-target", "wasm32-wasi")
_FLAGS = ("-std=c99", "-O2", "-fno-math-errno", *SAME_NUMBERS, "-fvisibility=hidden")

#: Equations are functions that programs share.
_SHARED = ("-DAPART=",)

#: The page has to know where memory is free.
_LINKED = ("-mexec-model=reactor", "-O2", "-s", "-Wl,--gc-sections")
_FREE = "__heap_base"


def live_module(
    sources: Mapping[str, Source], hear: Callable[[str], None] = lambda line: None
) -> dict[str, Path]:
    """The files by their names, compiled unless they are in the cache.

    Args:
        sources: of the module, by their names.
        hear: called with a line before the module is compiled.

    Raises:
        InputError: the module cannot be compiled.

    """
    try:
        return made_once(CATEGORY, key_of(sources), lambda: compiled(sources, hear))
    except OSError as error:
        raise InputError(
            f"the module of the live page cannot be compiled: {reason(error)}"
        ) from error


def key_of(sources: Mapping[str, Source]) -> str:
    """Key in the cache: digest of the sources and the flags."""
    flags = (*_TARGET, *_FLAGS, *_SHARED, *_LINKED, *_exports(sources))
    made_of = (*FILES, *_NOTICES, *_NOTICES.values(), *flags)
    digest = sha256("\0".join(made_of).encode())
    for name, source in sources.items():
        digest.update(f"\0{name}\0{source.text}\0{source.others}".encode())
    return digest.hexdigest()[:16]


def compiled(
    sources: Mapping[str, Source], hear: Callable[[str], None] = lambda line: None
) -> dict[str, bytes]:
    """The contents of the files by their names, compiled now.

    Args:
        sources: of the module, by their names.
        hear: called with a line before the module is compiled.

    Raises:
        InputError: ziglang is not installed.
        OSError: ziglang fails.

    """
    compiler = zig(*_TARGET)
    if compiler is None:
        raise InputError(
            "the live page needs ziglang, which compiles C to WebAssembly: "
            "pip install 'auv-fmu[native]'"
        )
    hear("compiling the page's programs to WebAssembly (only once): this may take a minute")
    with temporary_folder() as folder:

        def compile_source(name: str) -> str:
            made, (text, called, others) = f"{name}.o", sources[name]
            (folder / f"{name}.c").write_text(text, encoding="utf-8")
            names = (f"-D{one}={name}_{one}" for one in (*called, *others))
            options = [*_FLAGS, *_SHARED, *names]
            compiler.run(*options, "-c", f"{name}.c", "-o", made, folder=folder)
            return made

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            objects = list(pool.map(compile_source, sources))
        exports = [f"-Wl,--export={name}" for name in _exports(sources)]
        compiler.run(*_LINKED, *exports, *objects, "-o", MODULE, folder=folder)
        return {MODULE: (folder / MODULE).read_bytes(), LICENCES: _licences().encode()}


def _licences() -> str:
    folder = package_folder("ziglang")
    return "\n\n".join(
        f"{name}, contained in the WebAssembly module\n\n"
        + (folder / path).read_text(encoding="utf-8").strip()
        for name, path in _NOTICES.items()
    )


def _exports(sources: Mapping[str, Source]) -> Iterator[str]:
    yield _FREE
    for name, source in sources.items():
        yield from (f"{name}_{one}" for one in source.called)
