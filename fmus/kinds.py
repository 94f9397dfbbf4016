"""What FMUs come as: kinds and versions of FMI.

This is all that `orchestrator` knows of how they are built, so nothing here imports PythonFMU.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, Literal, TypeAlias, get_args

#: What a run can ask for: Python sources that PythonFMU runs, or libraries translated from them.
KindName: TypeAlias = Literal["auto", "python", "native"]

#: Native where available, else Python: the default of runs. The others are kinds of FMUs, and the
#: first of them is the default of a build.
AUTO: Final = "auto"
PYTHON: Final = "python"
NATIVE: Final = "native"
KINDS: tuple[KindName, ...] = tuple(kind for kind in get_args(KindName) if kind != AUTO)

#: Packages besides ours whose code is in the FMUs of each kind.
CONTAINED: Mapping[str, Sequence[str]] = {PYTHON: ("pythonfmu",), NATIVE: ()}

#: The versions of FMI. The Python kind has the first.
FmiVersion: TypeAlias = Literal["2", "3"]
FMI_VERSIONS: tuple[FmiVersion, ...] = get_args(FmiVersion)
