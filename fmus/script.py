"""A user's component: its script, modules and data files, and messages about its mistakes.

It is a script with the function `outputs`, or a folder that contains such a script with its name.
Any other script is taken for a slave of PythonFMU.
"""

from __future__ import annotations

import ast
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import suppress
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    ExtensionFileLoader,
    FileFinder,
    SourceFileLoader,
)
from keyword import iskeyword
from pathlib import Path
from types import CodeType

from fmus.discovery import Source, lies_in, name_of
from fmus.ports.port import Misdeclared

#: The function that a component has, and a slave of PythonFMU lacks.
_FUNCTION = "outputs"


def script_in(path: Path) -> Path:
    """Return the script at a path: the file itself, or the one in a folder with its name.

    Raises:
        ValueError: there is none.

    """
    if path.is_dir():
        script = path / f"{path.resolve().name}.py"
        if not script.is_file():
            raise ValueError(f"{path}: has no {script.name}")
        return script
    if not (path.is_file() and path.suffix == ".py"):
        raise ValueError(f"{path}: no such Python file")
    return path


def is_component(path: Path) -> bool:
    """Return True if a script is a component, and not a slave of PythonFMU.

    A script with a syntax error is taken for a component, so that the error is reported.
    """
    try:
        tree = ast.parse(path.read_bytes())
    except (RecursionError, SyntaxError, ValueError):
        return True
    names = {name for node in tree.body for name in _defined(node)}
    return _FUNCTION in names


def no_component(path: Path) -> str:
    """Return the message about a script that is not a component."""
    return f"{path}: not a component: it has no function outputs() (see `auv-fmu new`)"


def _defined(node: ast.stmt) -> Iterator[str]:
    if isinstance(node, ast.FunctionDef):
        yield node.name
    elif isinstance(node, ast.ImportFrom):
        yield from (alias.asname or alias.name for alias in node.names)


def source_of_script(path: Path) -> Source:
    """Return the source of a component, and let its modules be imported from now on.

    Raises:
        ValueError: its name cannot be the name of a module.

    """
    place = path.resolve()
    stem, root = place.stem, place.parent
    if iskeyword(stem):
        raise ValueError(f"{path}: {stem} is a word of Python; choose another name")
    if not (stem.isascii() and stem.isidentifier() and stem[0].isalpha()):
        raise ValueError(
            f"{path}: {stem} is not a name for a component; use letters, digits and underscores, "
            "a letter first"
        )
    known = sys.modules.get(stem)
    is_other = known is not None and not _is_of(known, place)
    if stem in sys.stdlib_module_names or is_other:
        raise ValueError(f"{path}: {stem} is already a module of Python; choose another name")
    import_from(root)
    return Source(name_of(stem), stem, root, root)


class _Text(SourceFileLoader):
    """A loader that reads the source only: byte code is neither read nor written."""

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        code: CodeType = self.source_to_code(self.get_data(path), path)
        return code


def import_from(root: Path) -> None:
    """Let modules of a folder be imported from their sources, before all other modules.

    From then on, data files that they read in the folder are recorded.
    """

    def finder(folder: str) -> FileFinder:
        here = Path(folder)
        homes = [home for home in map(Path, sys.path) if home in (here, *here.parents)]
        if max(homes, key=lambda home: len(home.parts), default=None) != root:
            raise ImportError(f"{folder} is not in {root}")
        loaders = (ExtensionFileLoader, EXTENSION_SUFFIXES), (_Text, SOURCE_SUFFIXES)
        return FileFinder(folder, *loaders)

    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    sys.path_hooks.insert(0, finder)
    sys.path_importer_cache.pop(str(root), None)
    _watch(root)


def _is_of(module: object, place: Path) -> bool:
    """Return True if a module or package has its file or folder at a place."""
    file, folders = getattr(module, "__file__", None), getattr(module, "__path__", ())
    return str(place) in map(str, (file, *folders))


# Data files

#: Data files that were read in folders of scripts, by their paths relative to the folder.
_read: dict[Path, dict[str, Path]] = {}

#: Suffixes of modules and of files made from them, which are not data.
_NO_DATA = (".py", ".pyc", ".pyi", ".fmu")


def _watch(root: Path) -> None:
    """Record from now on the data files that are read in the folder of a script, and below it."""
    if not _read:
        sys.addaudithook(_see)
    _read.setdefault(root, {})


def data_files(root: Path) -> dict[str, Path]:
    """Return the data files that modules of a folder have read in it, by their relative paths."""
    return {name: path for name, path in _read.get(root, {}).items() if path.is_file()}


def _see(event: str, arguments: tuple[object, ...]) -> None:
    """Record a file that Python opens: an audit hook.

    Raises:
        ValueError: its path is relative to the current folder, which is another one in a host.

    """
    if event != "open" or not isinstance(arguments[0], (str, bytes, os.PathLike)):
        return
    name, flags = Path(os.fsdecode(arguments[0])), arguments[2]
    if isinstance(flags, int) and flags & (os.O_WRONLY | os.O_RDWR):
        return
    is_relative = False
    with suppress(OSError, ValueError):
        path = Path(os.path.normpath(Path.cwd() / name))
        for root, found in _read.items():
            if root in path.parents and _is_data(path, root) and _is_open_in(root):
                found[path.relative_to(root).as_posix()] = path
                is_relative = not name.is_absolute() and path.is_file()
    if is_relative:
        raise ValueError(
            f"{name} is read from the current folder, which is another one where the FMU runs: "
            f"write Path(__file__).with_name({name.name!r})"
        )


def _is_open_in(root: Path) -> bool:
    """Return True if code of a module in a folder is on the stack."""
    return any(
        lies_in(root, Path(frame.f_code.co_filename), str(frame.f_globals.get("__name__")))
        for frame, _ in traceback.walk_stack(None)
    )


def _is_data(path: Path, root: Path) -> bool:
    """Return True for a file in a folder that is neither a module nor in an installed package."""
    parts = path.relative_to(root).parts
    if path.suffix in _NO_DATA or any(part.startswith((".", "__pycache__")) for part in parts):
        return False
    others = {Path(folder) for folder in sys.path} - {root}
    return others.isdisjoint(path.parents[: len(parts)])


# Mistakes


def message_of(error: BaseException, path: Path) -> str:
    """Return the message of an error in a component, on one line with its file and line."""
    text, frames, root = str(error), _frames(error, path), path.resolve().parent
    is_ours = isinstance(error, (OSError, TypeError, ValueError)) or _is_our_own(error)
    place, message = str(path), text if is_ours else f"{type(error).__name__}: {text}"
    if isinstance(error, Misdeclared):
        place = _place_of(error.place, path)
    elif isinstance(error, SyntaxError):
        place = f"{shown(error.filename or '', path)}:{error.lineno}"
        message = f"SyntaxError: {error.msg}"
    elif isinstance(error, RecursionError) and not frames:
        message = "an expression is too long: take it apart"
    elif frames and not _is_our_own(error):
        place, message = frames[-1], f"{type(error).__name__}: {text}"
    elif text.startswith((f"{path}:", f"{root}{os.sep}")):
        # The message has its place already.
        folder = str(path.parent / "x")[:-1]
        return " ".join(text.replace(f"{root}{os.sep}", folder).split())
    return " ".join(f"{place}: {message}".split())


def _is_our_own(error: BaseException) -> bool:
    return type(error).__module__.partition(".")[0] == "fmus"


def shown(file: str, path: Path) -> str:
    """Return the path of a file in the script's folder as the user would give it."""
    root = path.resolve().parent
    is_inside = Path(file).is_relative_to(root)
    return str(path.parent / Path(file).relative_to(root)) if is_inside else file


def _frames(error: BaseException, path: Path) -> list[str]:
    """Return the places in the user's files through which an error passed, the innermost last."""
    root = path.resolve().parent
    return [
        f"{shown(file, path)}:{line}"
        for frame, line in traceback.walk_tb(error.__traceback__)
        for file in [frame.f_code.co_filename]
        if lies_in(root, Path(file), str(frame.f_globals.get("__name__")))
    ]


def _place_of(place: tuple[str, ...], path: Path) -> str:
    """Return the file and line of a class or function, or of its field or argument."""
    for node in ast.parse(path.read_bytes()).body if place else ():
        if not isinstance(node, (ast.ClassDef, ast.FunctionDef)) or node.name != place[0]:
            continue
        if isinstance(node, ast.FunctionDef):
            lines = {argument.arg: argument.lineno for argument in node.args.args}
            lines["return"] = (node.returns or node).lineno
        else:
            lines = dict(_fields(node))
        return f"{path}:{lines.get(place[-1], node.lineno)}"
    return str(path)


def _fields(node: ast.ClassDef) -> Iterator[tuple[str, int]]:
    """Yield the fields or members of a class, and their lines."""
    for part in node.body:
        targets = getattr(part, "targets", [getattr(part, "target", None)])
        yield from ((name.id, part.lineno) for name in targets if isinstance(name, ast.Name))
