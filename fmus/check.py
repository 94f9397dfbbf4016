"""List all mistakes in a user's component or index: `python -m fmus.check SCRIPT`.

Each mistake is printed on a line, with its file and line: errors in declarations, and code outside
the language of equations. For a component without mistakes the FMUs of both kinds are written, the
native one without libraries, and the compiler checks its C. The command runs in a separate process,
because it imports the script.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FunctionType

from fmus.discovery import Source, write_archive
from fmus.kinds import FMI_VERSIONS, NATIVE, PYTHON
from fmus.language.build import Program, Untranslatable, position
from fmus.language.types import PLACED
from fmus.native.packaging import fmu_entries
from fmus.ports import reducer
from fmus.ports.behaviour import HOOKS
from fmus.ports.description import SOURCES
from fmus.python.packaging import PythonKind
from fmus.script import is_component, message_of, no_component, script_in, source_of_script
from orchestrator.machine.compilers import Compiler, check_sources


def mistakes(path: Path, folder: Path, is_index: bool = False) -> list[str]:
    """Return all mistakes in a component or an index, sorted by file and line.

    Args:
        path: its script, or the folder of its name.
        folder: folder for its FMUs, which are written if there are no mistakes.
        is_index: True for an index; otherwise its hooks decide.

    Raises:
        ValueError: it is not a component.

    """
    script = script_in(path)
    if not is_index and not is_component(script):
        raise ValueError(
            f"{no_component(script)}; if it has a class of PythonFMU, build it and check its FMU: "
            f"auv-fmu build {script}"
        )
    texts: dict[str, str] = {}
    try:
        for text in _mistakes(script, folder, is_index):
            # Report the first problem of each line only: others follow from it.
            place = PLACED.match(text)
            texts.setdefault(place[0] if place else text, text)
    except RecursionError as error:
        texts[""] = message_of(error, script)
    return sorted(texts.values(), key=position)


def _mistakes(script: Path, folder: Path, is_index: bool) -> Iterator[str]:
    source = source_of_script(script)
    try:
        module = import_module(source.module)
    except Exception as error:
        yield message_of(error, script)
        return
    is_index = is_index or reducer.is_reducer(module)
    hooks = (getattr(module, name, None) for name in (reducer.HOOKS if is_index else HOOKS))
    program = Program(*(hook for hook in hooks if isinstance(hook, FunctionType)))
    for mistake in program.mistakes:
        yield message_of(Untranslatable(mistake), script)
    try:
        if is_index:
            reducer.read_reducer(module)
            return
        source.definition  # noqa: B018
        if not program.mistakes:
            write(source, folder)
    except Exception as error:
        yield message_of(error, script)


def write(source: Source, folder: Path) -> None:
    """Write the FMUs of a component for all versions of FMI, the native ones without libraries.

    Raises:
        Exception: as a build would.

    """
    for fmi in FMI_VERSIONS:
        entries = fmu_entries(source, fmi, (), Compiler((), label="none"), print)
        head = "sources/"
        texts = {
            name.removeprefix(head): text for name, text in entries.items() if name.startswith(head)
        }
        check_sources(source.name, texts, SOURCES[fmi])
        write_archive(folder / f"{NATIVE}-{fmi}.fmu", entries)
    PythonKind("plain").write(source, folder / f"{PYTHON}.fmu")


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m fmus.check", description=__doc__)
    parser.add_argument("script", type=Path)
    parser.add_argument("--index", action="store_true", help="it is an index of a study")
    parser.add_argument("--out", type=Path, help="folder to write FMUs into; default: none")
    options = parser.parse_args()
    try:
        # Keep the component's own output apart from the list.
        with TemporaryDirectory() as folder, redirect_stdout(sys.stderr):
            lines = mistakes(options.script, options.out or Path(folder), options.index)
        print("".join(f"{text}\n" for text in lines), end="")
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
