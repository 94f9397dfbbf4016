"""List all that is wrong with a component of the user's own: `python -m fmus.check SCRIPT`.

A line for each mistake: what is outside the language of equations, what is wrong with its
declaration, and what has no counterpart in C, each with its file and line. It runs in a separate
process, because it imports the component.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from fmus.discovery import lies_in
from fmus.native.functions import function_in_c
from fmus.native.language import foreign
from fmus.native.program import Program, Untranslatable
from fmus.native.tables import tables
from fmus.native.translator import translated
from fmus.script import is_component, no_component, script_in, shown, source_of_script, told

#: Where a line says that it is about.
_PLACE = re.compile(r"^(.+?:\d+): ")


def mistakes(path: Path) -> list[str]:
    """All that is wrong with a component, by file and line.

    Args:
        path: of its script, or of its folder.

    Raises:
        ValueError: it is no component.

    """
    script = script_in(path)
    if not is_component(script):
        raise ValueError(
            f"{no_component(script)}; if it has a class of PythonFMU, build it and check its FMU: "
            f"auv-fmu build {script}"
        )
    found: dict[str, str] = {}
    try:
        for text in _mistakes(script):
            # One line of the script has one mistake: others follow from it.
            place = _PLACE.match(text)
            found.setdefault(place[1] if place else text, text)
    except RecursionError as error:
        found[""] = told(error, script)
    return sorted(found.values(), key=_order)


def _order(text: str) -> tuple[str, int]:
    """Line by line of each file; what has no place comes first."""
    place = _PLACE.match(text)
    file, _, line = place[1].rpartition(":") if place else ("", "", "0")
    return file, int(line)


def _mistakes(script: Path) -> Iterator[str]:
    source = source_of_script(script)
    files = [script] if script.is_file() else sorted(script.glob("*.py"))
    try:
        for name in source.modules:
            import_module(name)
    except Exception as error:
        yield from (text for file in files for text in _foreign(file, script))
        yield told(error, script)
        return
    for file in _files_of(script.resolve().parent, files):
        yield from _foreign(file, script)
    try:
        definition = source.definition
    except Exception as error:
        yield told(error, script)
        return
    for hook in filter(None, definition.behaviour.hooks.values()):
        try:
            Program(function_in_c).function(hook)
        except (Untranslatable, TypeError) as error:
            yield told(error, script)
    try:
        translated(definition)
        tables(definition)
    except (Untranslatable, TypeError) as error:
        yield told(error, script)


def _files_of(root: Path, files: list[Path]) -> list[Path]:
    """The files of a component, and of the modules beside it that it has imported."""
    known = {file.resolve() for file in files}
    beside = {
        Path(file)
        for name, module in [*sys.modules.items()]
        if (file := getattr(module, "__file__", None)) and lies_in(root, Path(file), name)
    }
    return [*files, *sorted(beside - known)]


def _foreign(file: Path, script: Path) -> list[str]:
    """What is outside the language in a file, which is named as the user would."""
    if file.name == "ports.py":
        return []  # it declares, and is no part of what is translated
    return [
        text.replace(str(file), shown(str(file.resolve()), script), 1) for text in foreign(file)
    ]


def main() -> int:
    """Command line of the module."""
    parser = argparse.ArgumentParser(prog="python -m fmus.check", description=__doc__)
    parser.add_argument("script", type=Path)
    try:
        for text in mistakes(parser.parse_args().script):
            print(text)
    except ValueError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
