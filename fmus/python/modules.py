"""The modules that an FMU holds: where they are, and their imports under other names."""

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
    """Find the modules that a script needs: those it imports, those that these import and so on.

    Modules in other places, such as installed packages, are left out: the host has them.

    Args:
        text: of the script.
        packages: that may be among them, and the folders that they are in.
        own: folder that its other modules are in; None: there are none.

    Returns:
        The files, by their places below the folder that the script is in.

    Raises:
        SyntaxError: one of them is no Python.

    """
    files: dict[str, Path] = {}
    #: The folders that the modules in each are found in; none, if it is no package.
    places: dict[str, Sequence[str]] = {}

    def imported_by(name: str) -> Iterator[str]:
        """The names that a module imports; it and the packages that it is in are needed."""
        parent, _, last = name.rpartition(".")
        if parent and parent not in places:
            yield from imported_by(parent)
        root = _root(name.partition(".")[0], packages, own)
        within = places.get(parent, () if parent or root is None else [str(root)])
        # By the last part: Python would look up the packages before it, which are not imported.
        found = PathFinder.find_spec(last, [*within])
        places[name] = [*((found and found.submodule_search_locations) or ())]
        file = Path(found.origin) if found and found.origin else None
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
            # Any module of the package may be meant.
            package = name[:-2]
            for place in places.get(package, ()):
                wanted += (f"{package}.{it.stem}" for it in sorted(Path(place).glob("*.py")))
        elif name not in places:
            wanted += imported_by(name)
    return files


def _root(top: str, packages: Mapping[str, Path], own: Path | None) -> Path | None:
    """The folder that a top-level module lies in; None: it is not to be followed."""
    if top in packages:
        return packages[top].parent
    if own is None or top in sys.builtin_module_names:
        return None
    # A folder that is no package gives way to a package elsewhere.
    found = PathFinder.find_spec(top, [str(own), *sys.path])
    places = [*(found.submodule_search_locations or (found.origin,))] if found else []
    return own if any(place and Path(place).parent == own for place in places) else None


def _imported(tree: ast.AST, package: str) -> Iterator[str]:
    """The names that may be of modules in the imports of a module; a star is one of them."""
    for node in _executed(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join(
                [*(parts if node.level else ()), *([node.module] if node.module else [])]
            )
            # Last in, first out: the package before what is in it.
            yield from (f"{base}.{alias.name}" for alias in node.names)
            yield base


def _executed(tree: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a module, without those that only a type checker reads."""
    nodes = [tree]
    for node in nodes:
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            nodes += node.orelse
        else:
            nodes += ast.iter_child_nodes(node)
    return iter(nodes)


# Other names


class _Import(NamedTuple):
    """Where a module is imported, in bytes of UTF-8."""

    top: str  #: the first part of its name
    end: int  #: of the first part
    bound: bytes = b""  #: the name that it has from then on, if that is the first part
    is_within: bool = False  #: whether there are more parts
    whole_end: int = 0  #: of all parts


def with_other_imports(content: bytes, names: Collection[str], suffix: str) -> bytes:
    """The text of a module that imports others under longer names, and has them under their own.

    Args:
        content: as it is in the file.
        names: of top-level modules that have other names.
        suffix: what is added to their names.

    Raises:
        SyntaxError: it is no Python.

    """
    text, added = decode_source(content).encode(), suffix.encode()
    changed = text
    for one in reversed(_imports(text)):
        if one.top not in names:
            continue
        if one.bound and one.is_within:
            more = b", " + one.bound + added + b" as " + one.bound
            changed = changed[: one.whole_end] + more + changed[one.whole_end :]
        name = added + (b" as " + one.bound if one.bound and not one.is_within else b"")
        changed = changed[: one.end] + name + changed[one.end :]
    if changed == text:
        return content
    encoding, _ = tokenize.detect_encoding(io.BytesIO(content).readline)
    return changed.decode().encode(encoding)


_FROM, _NAME = re.compile(rb"from[\s\\]+"), re.compile(rb"[\w\x80-\xff]+")


@lru_cache(maxsize=512)
def _imports(text: bytes) -> list[_Import]:
    """The imports of modules by absolute names, in their order."""
    begins = [0]
    for line in text.split(b"\n"):
        begins.append(begins[-1] + len(line) + 1)
    found = []
    for node in ast.walk(ast.parse(text.decode())):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            keyword = _FROM.match(text, begins[node.lineno - 1] + node.col_offset)
            name = keyword and _NAME.match(text, keyword.end())
            assert name
            found.append(_Import(node.module.partition(".")[0], name.end()))
        for alias in node.names if isinstance(node, ast.Import) else ():
            name = _NAME.match(text, begins[alias.lineno - 1] + alias.col_offset)
            assert name and alias.end_lineno is not None and alias.end_col_offset is not None
            top, _, others = alias.name.partition(".")
            end = begins[alias.end_lineno - 1] + alias.end_col_offset
            bound = b"" if alias.asname else name[0]
            found.append(_Import(top, name.end(), bound, bool(others), end))
    return sorted(found, key=lambda one: one.end)
