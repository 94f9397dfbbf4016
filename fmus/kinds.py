"""The kinds of FMU that a component comes as."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

#: Python sources that PythonFMU runs, or libraries translated from them. The first is the default.
KINDS = PYTHON, NATIVE = "python", "native"


class Kind(Protocol):
    """How FMUs of one kind are built."""

    @property
    def sources(self) -> Sequence[str]:
        """The packages that they are made of."""

    @property
    def settings(self) -> Mapping[str, str]:
        """What they depend on besides their sources."""

    def write(self, component: str, package: str, path: Path) -> None:
        """Write the FMU of a component, whose folder is a package.

        Raises:
            OSError: it cannot be built or written.

        """
