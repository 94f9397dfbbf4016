"""An SSP archive while it is read: its files, and what is found wrong with it."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import unquote, urlsplit
from xml.etree.ElementTree import Element

from orchestrator.errors import InputError, did_you_mean, reason
from orchestrator.findings import Findings
from orchestrator.system.ssp import STRUCTURE
from orchestrator.system.ssp.document import read_document
from orchestrator.system.unpacking import unpacked
from orchestrator.system.values import real

_SUFFIX = Path(STRUCTURE).suffix


class Archive:
    """An archive, unpacked, and the findings about it.

    Attributes:
        path: of the archive.
        folder: into which it is unpacked.
        findings: what is wrong with it.

    """

    def __init__(self, path: Path, findings: Findings) -> None:
        """Unpack it.

        Raises:
            InputError: it cannot be unpacked.

        """
        self.path, self.findings = path, findings
        self.folder = unpacked(path)

    def problem(self, text: object) -> None:
        """Take note of what makes a run meaningless, or impossible."""
        self.findings.problem(f"{self.path}: {text}")

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
        name = Path(STRUCTURE).stem if variant is None else variant.removesuffix(_SUFFIX)
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
        try:
            root = read_document(path.read_bytes(), lambda text: self.note(f"{name}: {text}"))
        except Exception as error:
            raise InputError(f"{self.path}: not a readable SSP: {name}: {reason(error)}") from error
        version = root.get("version")
        if version is None:
            self.note(f"{name}: names no version; it is read as 1.0")
        elif version not in ("1.0", "2.0"):
            self.problem(f"{name}: of version {version!r} of SSP; 1.0 is supported")
        elif version == "2.0":
            self.note(f"{name}: of version 2.0 of SSP; it is read as 1.0, which has the same words")
        return root

    def file(self, source: str, needer: str, base: Path | None = None) -> Path | None:
        """A file that the description names; None, with a problem, if the archive has none.

        Args:
            source: its address, a relative URI.
            needer: what needs it, for the message.
            base: the folder to which the address is relative; None: that of the description.

        """
        base = self.folder if base is None else base
        written = source.replace("\\", "/")
        decoded = unquote(urlsplit(written).path)
        for name in (decoded, written):
            path = Path(os.path.normpath(base / name))
            # What leads out of the archive is not there for any other reader either.
            if path.is_relative_to(base) and path.is_file():
                if name != source:
                    self._check_address(source, needer, name == decoded)
                return path
        self.problem(f"holds no {source!r} for {needer}")
        return None

    def _check_address(self, source: str, needer: str, is_decoded: bool) -> None:
        if "\\" in source:
            self.note(f"{needer}: {source!r} is no URI; write / for \\")
        if not is_decoded:
            self.note(f"{needer}: {source!r} is no URI; its special characters are not encoded")

    def number(self, element: Element | None, name: str, otherwise: float | None) -> float | None:
        """An attribute that is a number.

        Args:
            element: with the attribute; None: there is none.
            name: of the attribute.
            otherwise: its value where it is not stated, or, with a problem, where it is no number.

        """
        text = None if element is None else element.get(name)
        try:
            return otherwise if text is None else real(text)
        except ValueError:
            self.problem(f"{name} {text!r} is no number")
            return otherwise
