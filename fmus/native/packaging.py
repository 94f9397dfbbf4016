"""The native kind: an FMU that holds libraries, and their sources in C."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from fmus import documentation, native
from fmus.archive import digest_of, guid_of, licences, write_archive
from fmus.compilers import Compiler, library
from fmus.kinds import NATIVE, Platform
from fmus.ports import description_fmi2, description_fmi3
from fmus.ports.port import Port
from fmus.ports.terminals import terminals_and_icons

Ports = Sequence[Port]

_PICTURES = Path(__file__).parent


def _fmi2_files(name: str, ports: Ports) -> dict[str, bytes]:
    return {"model.png": documentation.ICON.read_bytes()}


def _fmi3_files(name: str, ports: Ports) -> dict[str, bytes]:
    folder = "terminalsAndIcons"
    return {
        "sources/buildDescription.xml": description_fmi3.fmi3_build_description(name),
        f"{folder}/terminalsAndIcons.xml": terminals_and_icons(ports),
        f"{folder}/icon.png": documentation.ICON.read_bytes(),
        f"{folder}/terminal.png": (_PICTURES / "terminal.png").read_bytes(),
    }


class Version(NamedTuple):
    """A version of FMI.

    Attributes:
        describe: writes modelDescription.xml.
        files: that an FMU of this version has besides, from its name and ports.

    """

    describe: Callable[[str, str, str, Ports], bytes]
    files: Callable[[str, Ports], dict[str, bytes]]


_VERSIONS = {
    "2": Version(description_fmi2.fmi2_description, _fmi2_files),
    "3": Version(description_fmi3.fmi3_description, _fmi3_files),
}

_IDENTITY = """\
/* Which FMU this is. */
#ifndef IDENTITY_H
#define IDENTITY_H

#define MODEL_NAME "{name}"
#define MODEL_GUID "{guid}"

#endif
"""


def fmu_entries(
    component: str, package: str, fmi: str, platforms: Sequence[Platform], compiler: Compiler
) -> dict[str, bytes]:
    """The contents of an FMU.

    Its GUID follows from its description and its sources, and is the same for all platforms.

    Args:
        component: its name, and its libraries' name.
        package: that its folder is.
        fmi: version.
        platforms: that it has libraries for.
        compiler: that makes them.

    Raises:
        OSError: the compiler fails.

    """
    declared = import_module(f"{package}.ports")
    version = _VERSIONS[fmi]
    written = native.sources(package, fmi)
    sources = {name: content.encode() for name, content in written.items()}

    def description(guid: str) -> bytes:
        return version.describe(component, declared.DESCRIPTION, guid, declared.PORTS)

    guid = guid_of(digest_of({**sources, "modelDescription.xml": description("")}))
    identity = _IDENTITY.format(name=component, guid=guid)
    sources["identity.h"] = identity.encode()
    page = documentation.html(component, NATIVE, fmi)
    return {
        "modelDescription.xml": description(guid),
        **version.files(component, declared.PORTS),
        "documentation/index.html": page.encode(),
        "documentation/licenses/license.txt": licences(NATIVE).encode(),
        **{f"sources/{name}": content for name, content in sources.items()},
        **{
            f"binaries/{platform.name}/{component}{platform.ending}": library(
                compiler, platform, component, sources, native.MAIN[fmi]
            )
            for platform in platforms
        },
    }


@dataclass(frozen=True)
class NativeKind:
    """The native kind, for some platforms."""

    fmi: str
    platforms: Sequence[Platform]
    compiler: Compiler
    name = NATIVE

    @property
    def settings(self) -> dict[str, str]:
        """What the FMUs depend on besides their sources."""
        return {
            "kind": NATIVE,
            "fmi": self.fmi,
            "platforms": ",".join(platform.name for platform in self.platforms),
            "compiler": self.compiler.name,
        }

    def write(self, component: str, package: str, path: Path) -> None:
        """Write the FMU of a component, whose folder is a package.

        Raises:
            OSError: the compiler fails, or the file cannot be written.

        """
        entries = fmu_entries(component, package, self.fmi, self.platforms, self.compiler)
        write_archive(path, entries)
