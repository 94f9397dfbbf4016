"""Kinds of FMUs, and versions of FMI.

`orchestrator` imports this module, so nothing here may import PythonFMU.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, Literal, TypeAlias, get_args

#: Kinds for a run: Python sources that PythonFMU runs, or libraries translated from them.
KindName: TypeAlias = Literal["auto", "python", "native"]

#: The default of runs: native where available, else Python. The others are kinds of FMUs, and the
#: first of them is the default of a build.
AUTO: Final = "auto"
PYTHON: Final = "python"
NATIVE: Final = "native"
KINDS: tuple[KindName, ...] = tuple(kind for kind in get_args(KindName) if kind != AUTO)

#: Third-party packages whose code is in the FMUs of each kind.
CONTAINED: Mapping[str, Sequence[str]] = {PYTHON: ("pythonfmu",), NATIVE: ()}

#: The versions of FMI. The Python kind supports only the first.
FmiVersion: TypeAlias = Literal["2", "3"]
FMI_VERSIONS: tuple[FmiVersion, ...] = get_args(FmiVersion)
