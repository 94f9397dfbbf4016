"""The modules in an FMU: finding them, and importing them under other names."""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from importlib.machinery import SOURCE_SUFFIXES, PathFinder
from importlib.util import decode_source
from pathlib import Path
from typing import NamedTuple


def modules_of(text: str, packages: Mapping[str, Path], own: Path | None) -> dict[str, Path]:
    """Find the modules that a script imports, directly or through others.

    Modules in other places, such as installed packages, are left out: the host must have them.

    Args:
        text: text of the script.
        packages: packages that are included, and their folders.
        own: folder of the script's other modules, if any.

    Returns:
        The files, by their paths relative to the script's folder.

    Raises:
        SyntaxError: a module is not valid Python.

    """
    files: dict[str, Path] = {}
    #: Folders of the modules in each package; empty for a module.
    places: dict[str, Sequence[str]] = {}

    def imported_by(name: str) -> Iterator[str]:
        """Add a module and its parent packages to the files, and yield the names they import."""
        parent, _, last = name.rpartition(".")
        if parent and parent not in places:
            yield from imported_by(parent)
        root = _root(name.partition(".")[0], packages, own)
        within = places.get(parent, () if parent or root is None else [str(root)])
        # Search for the last part only: Python would import the packages before it.
        spec = PathFinder.find_spec(last, [*within])
        places[name] = [*((spec and spec.submodule_search_locations) or ())]
        file = Path(spec.origin) if spec and spec.origin else None
        if root is None or file is None or root not in file.parents:
            return
        files[file.relative_to(root).as_posix()] = file
        if file.suffix in SOURCE_SUFFIXES:
            tree = ast.parse(decode_source(file.read_bytes()), filename=str(file))
            yield from _imported(tree, name if places[name] else parent)

    wanted = [*_imported(ast.parse(text), "")]
    while wanted:
        name = wanted.pop()
        if name.endswith(".*"):
            # A star may stand for any module of the package.
            package = name[:-2]
            for place in places.get(package, ()):
                wanted += (f"{package}.{path.stem}" for path in sorted(Path(place).glob("*.py")))
        elif name not in places:
            wanted += imported_by(name)
    return files


def _root(top: str, packages: Mapping[str, Path], own: Path | None) -> Path | None:
    """Return the folder of a top-level module; None if the module is not included."""
    if top in packages:
        return packages[top].parent
    if own is None or top in sys.builtin_module_names:
        return None
    # A package elsewhere comes before a folder without __init__.py.
    spec = PathFinder.find_spec(top, [str(own), *sys.path])
    places = [*(spec.submodule_search_locations or (spec.origin,))] if spec else []
    return own if any(place and Path(place).parent == own for place in places) else None


def _imported(tree: ast.AST, package: str) -> Iterator[str]:
    """Yield the names in the imports of a module that may be modules, including stars."""
    for node in _executed(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join(
                [*(parts if node.level else ()), *([node.module] if node.module else [])]
            )
            # The last name is processed first: the package before its members.
            yield from (f"{base}.{alias.name}" for alias in node.names)
            yield base


def _executed(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a module, except those for type checkers only."""
    nodes = [tree]
    for node in nodes:
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            nodes += node.orelse
        else:
            nodes += ast.iter_child_nodes(node)
    return iter(nodes)


# Other names


class _Import(NamedTuple):
    """An import of a module; positions are in bytes of UTF-8."""

    top: str  #: first part of the module's name
    end: int  #: end of the first part
    bound: bytes = b""  #: name that the import binds, if that is the first part
    is_within: bool = False  #: true if there are more parts
    whole_end: int = 0  #: end of all parts


def with_other_imports(content: bytes, names: Collection[str], suffix: str) -> bytes:
    """Change the imports of a module to longer names, which are bound to the original ones.

    Args:
        content: bytes of the module.
        names: top-level modules with longer names.
        suffix: suffix of the longer names.

    Raises:
        SyntaxError: the module is not valid Python.

    """
    text, added = decode_source(content).encode(), suffix.encode()
    changed = text
    for imported in reversed(_imports(text)):
        if imported.top not in names:
            continue
        if imported.bound and imported.is_within:
            more = b", " + imported.bound + added + b" as " + imported.bound
            changed = changed[: imported.whole_end] + more + changed[imported.whole_end :]
        name = added + (
            b" as " + imported.bound if imported.bound and not imported.is_within else b""
        )
        changed = changed[: imported.end] + name + changed[imported.end :]
    if changed == text:
        return content
    encoding, _ = tokenize.detect_encoding(io.BytesIO(content).readline)
    return changed.decode().encode(encoding)


_FROM, _NAME = re.compile(rb"from[\s\\]+"), re.compile(rb"[\w\x80-\xff]+")


@lru_cache(maxsize=512)
def _imports(text: bytes) -> list[_Import]:
    """Return the imports of modules by absolute names, in order."""
    begins = [0]
    for line in text.split(b"\n"):
        begins.append(begins[-1] + len(line) + 1)
    imports = []
    for node in ast.walk(ast.parse(text.decode())):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            keyword = _FROM.match(text, begins[node.lineno - 1] + node.col_offset)
            name = keyword and _NAME.match(text, keyword.end())
            assert name
            imports.append(_Import(node.module.partition(".")[0], name.end()))
        for alias in node.names if isinstance(node, ast.Import) else ():
            name = _NAME.match(text, begins[alias.lineno - 1] + alias.col_offset)
            assert name and alias.end_lineno is not None and alias.end_col_offset is not None
            top, _, others = alias.name.partition(".")
            end = begins[alias.end_lineno - 1] + alias.end_col_offset
            bound = b"" if alias.asname else name[0]
            imports.append(_Import(top, name.end(), bound, bool(others), end))
    return sorted(imports, key=lambda imported: imported.end)
