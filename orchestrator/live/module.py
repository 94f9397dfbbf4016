"""The WebAssembly modules of the live page: a program per system, and the indices.

All programs of a module share their equations. Indices are not part of a program: they are computed
from its rows, as for a run of FMUs. Functions are exported with the name of their source as prefix.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from fmus.ports.definition import Definition
from orchestrator.machine.cache import made_once
from orchestrator.machine.compilers import SAME_NUMBERS, zig
from orchestrator.machine.disk import temporary_folder
from orchestrator.machine.errors import InputError, reason
from orchestrator.machine.identity import package_folder
from orchestrator.program.components import definitions_of
from orchestrator.program.writer import EXPORTED, Equations, Text, Unsupported
from orchestrator.runs.preparation import Prepared
from orchestrator.vehicle.cautions import KNOWN_BEFORE, WATCHED
from orchestrator.vehicle.indices import metrics

#: Category in the cache.
CATEGORY = "live-module"

#: The module, and the licences of the code that the compiler links into it.
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

#: Functions of components are not static, as programs share them.
_SHARED = ("-DAPART=",)

#: The page needs the address from which memory is free.
_LINKED = ("-mexec-model=reactor", "-O2", "-s", "-Wl,--gc-sections")
_FREE = "__heap_base"

#: Reducers of all indices, and of warnings.
REDUCERS = tuple(dict.fromkeys((*(i.reducer for i in metrics()), KNOWN_BEFORE, *WATCHED)))


class Source(NamedTuple):
    """A source of a module.

    Attributes:
        text: text in C.
        called: functions that the page calls.
        others: other functions whose names several sources have.

    """

    text: str
    called: Sequence[str] = ()
    others: Sequence[str] = ()


#: Functions of a program, and of an index.
OF_PROGRAM = (
    ("size_of_simulation", "begin", "run_with_events", "rows_shown", "failure", "restarts"),
    ("run", "set"),
)
_OF_INDEX = ("reduce",), ("size_of_rows", "take_rows", "give_numbers")


class Programs:
    """Programs of several runs, which share their equations.

    Runs of the same system have the same program, even with different parameters.
    """

    def __init__(self, runs: Sequence[Prepared]) -> None:
        """Write the programs.

        Raises:
            InputError: a system cannot be a program, with the reason.

        """
        definitions = [_definitions_of(run) for run in runs]
        try:
            all_definitions = chain.from_iterable(map(dict.values, definitions))
            self._equations = Equations(all_definitions, REDUCERS, is_tuned=True)
        except Unsupported as error:
            name = runs[0].scenario.name
            raise InputError(f"{name}: the live page cannot run {error}") from None
        self._numbers: dict[str, int] = {}
        #: Runs with their numbers and texts, by `id`; the run is kept so that no other has its id.
        self._known: dict[int, tuple[Prepared, int, Text]] = {}
        for run, of_run in zip(runs, definitions, strict=True):
            text = self._text(run, of_run)
            number = self._numbers.setdefault(text.apart(), len(self._numbers))
            self._known[id(run)] = run, number, text

    @cached_property
    def sources(self) -> Mapping[str, Source]:
        """Sources by name: equations, programs and indices."""
        equations = self._equations
        sources = {"equations": Source(equations.apart())}
        sources |= {f"p{n}": Source(text, *OF_PROGRAM) for text, n in self._numbers.items()}
        for reducer in REDUCERS:
            index = equations.reducers[id(reducer)].over_run()
            text = "\n\n".join((equations.header, EXPORTED, index))
            sources[reducer.name] = Source(text, *_OF_INDEX)
        return sources

    def find(self, run: Prepared) -> tuple[int, Text] | None:
        """Return the number and the text of a run's program; None: it is not among these."""
        if id(run) in self._known:
            _, number, text = self._known[id(run)]
            return number, text
        definitions = _definitions_of(run)
        if not self._equations.kinds.keys() >= {*definitions.values()}:
            return None
        text = self._text(run, definitions)
        written = text.apart()
        return (self._numbers[written], text) if written in self._numbers else None

    def _text(self, run: Prepared, definitions: Mapping[str, Definition]) -> Text:
        return Text(run.plan, definitions, has_events=True, shared=self._equations)


def _definitions_of(run: Prepared) -> dict[str, Definition]:
    """Return the definitions of a run's components.

    Raises:
        InputError: one is not in the language of equations.

    """
    try:
        return definitions_of(run.plan.system)
    except InputError as error:
        raise InputError(f"{run.scenario.name}: the live page cannot run {error}") from None


def live_module(
    sources: Mapping[str, Source], hear: Callable[[str], None] = lambda line: None
) -> dict[str, Path]:
    """Return the paths of the files by name; compile the module unless it is in the cache.

    Args:
        sources: sources of the module, by name.
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
    """Return the key in the cache: digest of the sources and the flags."""
    flags = (*_TARGET, *_FLAGS, *_SHARED, *_LINKED, *_exports(sources))
    made_of = (*FILES, *_NOTICES, *_NOTICES.values(), *flags)
    digest = sha256("\0".join(made_of).encode())
    for name, source in sources.items():
        digest.update(f"\0{name}\0{source.text}\0{source.others}".encode())
    return digest.hexdigest()[:16]


def compiled(
    sources: Mapping[str, Source], hear: Callable[[str], None] = lambda line: None
) -> dict[str, bytes]:
    """Compile the module, and return the contents of the files by name.

    Args:
        sources: sources of the module, by name.
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
            target, (text, called, others) = f"{name}.o", sources[name]
            (folder / f"{name}.c").write_text(text, encoding="utf-8")
            names = (f"-D{function}={name}_{function}" for function in (*called, *others))
            options = [*_FLAGS, *_SHARED, *names]
            compiler.run(*options, "-c", f"{name}.c", "-o", target, folder=folder)
            return target

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
        yield from (f"{name}_{function}" for function in source.called)
