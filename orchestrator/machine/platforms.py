"""The platforms that FMI knows, and the machine that runs this."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from typing import NamedTuple

#: Names of machines in FMI 3.0 and for zig, with the oldest glibc that libraries run on.
TARGETS = {
    "x86_64-linux": "x86_64-linux-gnu.2.17",
    "aarch64-linux": "aarch64-linux-gnu.2.17",
    "x86_64-windows": "x86_64-windows-gnu",
    "x86_64-darwin": "x86_64-macos",
    "aarch64-darwin": "aarch64-macos",
}

#: Endings of libraries, by the last part of a machine's name.
_ENDINGS = {"linux": ".so", "windows": ".dll", "darwin": ".dylib"}

#: The machines that a platform stands for: several share one universal library. In FMI 2.0.4
#: darwin64 is for x86-64, and other processors have FMI 3.0's names; but hosts on ARM Macs, fmpy
#: among them, look into darwin64.
_MACHINES: Mapping[str, Mapping[str, Sequence[str]]] = {
    "2": {
        "linux64": ("x86_64-linux",),
        "win64": ("x86_64-windows",),
        "darwin64": ("x86_64-darwin", "aarch64-darwin"),
        "aarch64-linux": ("aarch64-linux",),
        "aarch64-darwin": ("aarch64-darwin",),
    },
    "3": {machine: (machine,) for machine in TARGETS},
}


#: Other names of processors.
_PROCESSORS = {"amd64": "x86_64", "arm64": "aarch64"}


class Platform(NamedTuple):
    """A platform that libraries are made for.

    Attributes:
        name: of its folder in `binaries`.
        machines: keys of :data:`TARGETS`.
        ending: of its file.

    """

    name: str
    machines: Sequence[str]
    ending: str


def platforms(fmi: str, names: str | None = None) -> list[Platform]:
    """Return platforms by their names, each once, in the order of the standard.

    Args:
        fmi: version, `2` or `3`.
        names: with commas between them, or `all`; None: this machine.

    Raises:
        ValueError: FMI has no such platform.

    """
    known = {
        name: Platform(name, machines, _ENDINGS[machines[0].partition("-")[2]])
        for name, machines in _MACHINES[fmi].items()
    }
    if names is None:
        machine = this_machine()
        own = [platform for platform in known.values() if machine in platform.machines]
        if not own:
            raise ValueError(f"there is no platform for this machine, {machine}")
        return own
    if names == "all":
        return list(known.values())
    wanted = {name.strip() for name in names.split(",")}
    for name in sorted(wanted - known.keys()):
        others = [f"; try --fmi {other}" for other, names in _MACHINES.items() if name in names]
        raise ValueError(
            f"FMI {fmi}.0 has no platform {name!r}; there are {', '.join(known)}, or all"
            f"{''.join(others)}"
        )
    return [platform for name, platform in known.items() if name in wanted]


def this_machine() -> str:
    """Name of the machine that runs this, as in FMI 3.0, or formed like those if FMI has none."""
    processor = platform.machine().lower()
    return f"{_PROCESSORS.get(processor, processor)}-{platform.system().lower()}"


def library_ending() -> str:
    """Ending of libraries on the machine that runs this."""
    return _ENDINGS.get(platform.system().lower(), ".so")
