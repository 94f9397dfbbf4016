"""An SSP archive or its folder while it is read: its files, and what is found wrong with it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element

from orchestrator.formats.ssp import STRUCTURE
from orchestrator.formats.ssp.document import read_document, violations
from orchestrator.machine.errors import Findings, InputError, did_you_mean, reason
from orchestrator.machine.user_files import check_file, is_folder, unpacked
from orchestrator.system.units import Linear, UndefinedUnit, Unit, conversion
from orchestrator.system.values import finite, integer

_SUFFIX = Path(STRUCTURE).suffix

#: Endings of descriptions that are read where they are, with the files beside them.
LOOSE = (_SUFFIX, ".xml")

#: The version whose words are read; later ones have more of them, of which each is refused.
_VERSION = "1.0"

#: A number, or that there may be none.
_Float = TypeVar("_Float", float, None)

#: Of many names, this many are said.
_MOST_SAID = 5


class Archive:
    """An archive, unpacked, or a description in a folder, and the findings about it.

    Attributes:
        path: of the archive, or of the folder or the description.
        folder: into which it is unpacked, or with the description.
        findings: what is wrong with it.

    """

    def __init__(self, path: Path, findings: Findings) -> None:
        """Unpack what is no folder.

        Raises:
            InputError: it cannot be unpacked.

        """
        self.path, self.findings = path, findings
        is_whole = is_folder(path)
        self._is_packed = not is_whole and path.suffix not in LOOSE
        if self._is_packed:
            self.folder = unpacked(path).folder
        else:
            self.folder = path.resolve() if is_whole else path.resolve().parent

    def problem(self, text: object) -> None:
        """Take note of what makes a run meaningless, or impossible."""
        said = str(text).removeprefix(f"{self.path}: ")
        self.findings.problem(f"{self.path}: {said}")

    def note(self, text: object) -> None:
        """Take note of what changes no number."""
        self.findings.note(f"{self.path}: {text}")

    def structure(self, variant: str | None) -> Element:
        """The description of the system.

        Args:
            variant: name of its file, with or without its ending; None: the default.

        Raises:
            InputError: there is none, or it cannot be read.

        """
        files = {path.stem: path for path in sorted(self.folder.glob(f"*{_SUFFIX}"))}
        default = self.path.name if self.path.suffix == _SUFFIX else STRUCTURE
        name = (default if variant is None else variant).removesuffix(_SUFFIX)
        if name not in files:
            known = f"; it has {', '.join(files)}" if files else ""
            raise InputError(
                f"{self.path}: not a readable SSP: there is no {name}{_SUFFIX} in it{known}"
                f"{did_you_mean(name, files)}"
            )
        return self.read(files[name])

    def read(self, path: Path) -> Element:
        """The root element of a file of the archive.

        Raises:
            InputError: it cannot be read.

        """
        name = path.relative_to(self.folder) if path.is_relative_to(self.folder) else path.name
        remarks: list[str] = []
        try:
            check_file(path)
            text = path.read_bytes()
            root = read_document(text, remarks.append)
        except Exception as error:
            raise InputError(f"{self.path}: not a readable SSP: {name}: {reason(error)}") from error
        version = root.get("version")
        if version != _VERSION:
            stated = "no version" if version is None else f"version {version!r}"
            remarks.append(f"names {stated} of SSP; it is read as {_VERSION}")
        # Of other namespaces and versions the schemas know nothing.
        if not remarks and (wrong := violations(root.tag, text)):
            remarks.append(f"not valid: {listed(wrong, '; ')}")
        for remark in dict.fromkeys(remarks):
            self.note(f"{name}: {remark}")
        return root

    def file(self, source: str, needer: str, base: Path | None = None) -> Path | None:
        """A file that the description names; None, with a problem, if the archive has none.

        Args:
            source: its address, a relative URI.
            needer: what needs it, for the message.
            base: the folder to which the address is relative; None: the description's folder.

        """
        base = self.folder if base is None else base
        if "://" in source:
            self.problem(f"{needer}: {source!r} is elsewhere; a file in the archive is supported")
            return None
        try:
            decoded = unquote(urlsplit(source).path)
        except ValueError:
            self.problem(f"{needer}: {source!r} is no URI")
            return None
        for name in dict.fromkeys((decoded, source, source.replace("\\", "/"))):
            path = Path(os.path.normpath(base / name))
            if self._is_packed and not path.is_relative_to(base):
                self.problem(f"{needer}: {source!r} lies outside of the archive")
                return None
            if path.is_file():
                if name != decoded:
                    self.note(f"{needer}: {source!r} is no URI, in which / separates and % encodes")
                return path
        self.problem(f"holds no {source!r} for {needer}")
        return None

    def conversion(self, source: Unit | None, target: Unit | None) -> Linear | None:
        """From one unit to another, as far as they are defined; None: the value stays as it is.

        Raises:
            InputError: they measure different things.

        """
        try:
            return conversion(source, target)
        except UndefinedUnit as error:
            self.note(f"{error}; values are taken as they are")
            # Said to explain why the units at the ends differ.
            return Linear()

    def required(self, element: Element, name: str, owner: str) -> str:
        """An attribute that an element must have; empty, with a problem, where it has not.

        Args:
            element: with the attribute.
            name: of the attribute.
            owner: of the element, for the message.

        """
        if name not in element.attrib:
            self.problem(f"{owner}: a <{element.tag}> without {name}")
        return element.get(name, "")

    def integer(self, element: Element, name: str) -> int:
        """An attribute that is an integer; zero where it is not stated or, with a problem, none."""
        text = element.get(name, "0")
        try:
            return integer(text)
        except ValueError:
            self.problem(f"{name} {text!r} is no integer")
            return 0

    def number(self, element: Element | None, name: str, otherwise: _Float) -> float | _Float:
        """An attribute that is a number.

        Args:
            element: with the attribute; None: there is none.
            name: of the attribute.
            otherwise: its value where it is not stated, or, with a problem, where it is no number.

        """
        text = None if element is None else element.get(name)
        try:
            return otherwise if text is None else number(name, text)
        except InputError as error:
            self.problem(error)
            return otherwise


def number(name: str, text: str) -> float:
    """The number that an attribute is.

    Raises:
        InputError: it is none, or not finite.

    """
    try:
        return finite(text, name)
    except ValueError as error:
        raise InputError(str(error)) from None


def listed(names: Sequence[str], between: str = ", ") -> str:
    """Names, of many the first, with something between them."""
    more = len(names) - _MOST_SAID
    return between.join(names[:_MOST_SAID]) + (f" and {more} more" if more > 0 else "")
