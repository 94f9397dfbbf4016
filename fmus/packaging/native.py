"""The native kind: an FMU that holds libraries, and their sources in C."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from auv_fmu import __version__
from fmus import native
from fmus.packaging import documentation
from fmus.packaging.compilers import Compiler, library
from fmus.packaging.kinds import NATIVE
from fmus.packaging.platforms import Platform
from fmus.packaging.sealing import digest_of, guid_of, write_archive
from fmus.ports import description_fmi2, description_fmi3
from fmus.ports.description_fmi2 import fmi2_description
from fmus.ports.description_fmi3 import fmi3_build_description, fmi3_description
from fmus.ports.port import Port
from fmus.ports.terminals import terminals_and_icons

_TERMINAL = Path(__file__).with_name("terminal.png")

_IDENTITY = """\
/* Which FMU this is. */
#ifndef IDENTITY_H
#define IDENTITY_H

#define MODEL_NAME "{name}"
#define MODEL_GUID "{guid}"
#define MODEL_VERSION "{version}"
#define MODEL_PREFIX {name}_

#endif
"""


class _Version(NamedTuple):
    """What differs between the versions of FMI.

    Attributes:
        main: the source that is compiled and includes the others.
        description: writes modelDescription.xml from name, one line, GUID and ports.
        others: gives files that this version alone has, from name and ports.

    """

    main: str
    description: Callable[[str, str, str, Sequence[Port]], bytes]
    others: Callable[[str, Sequence[Port]], dict[str, bytes]]


def _fmi2_files(name: str, ports: Sequence[Port]) -> dict[str, bytes]:
    return {"model.png": documentation.ICON.read_bytes()}


def _fmi3_files(name: str, ports: Sequence[Port]) -> dict[str, bytes]:
    return {
        "sources/buildDescription.xml": fmi3_build_description(name),
        "terminalsAndIcons/terminalsAndIcons.xml": terminals_and_icons(ports),
        "terminalsAndIcons/icon.png": documentation.ICON.read_bytes(),
        "terminalsAndIcons/terminal.png": _TERMINAL.read_bytes(),
    }


_VERSIONS = {
    "2": _Version(description_fmi2.SOURCE, fmi2_description, _fmi2_files),
    "3": _Version(description_fmi3.SOURCE, fmi3_description, _fmi3_files),
}


def fmu_entries(
    component: str, module: str, fmi: str, platforms: Sequence[Platform], compiler: Compiler
) -> dict[str, bytes]:
    """The contents of an FMU.

    Its GUID follows from its description and its sources, and is the same for all platforms.

    Args:
        component: its name, and that of its libraries.
        module: of its slave, in the same folder as its ports.
        fmi: version.
        platforms: that it has libraries for.
        compiler: that makes them.

    Raises:
        OSError: the compiler fails.

    """
    package = module.rpartition(".")[0]
    declared = import_module(f"{package}.ports")
    version = _VERSIONS[fmi]
    foreign = {other.main for other in _VERSIONS.values()} - {version.main}
    sources = {
        name: content.encode()
        for name, content in native.sources(package).items()
        if name not in foreign
    }

    def description(guid: str) -> bytes:
        return version.description(component, declared.DESCRIPTION, guid, declared.PORTS)

    guid = guid_of(digest_of({**sources, "modelDescription.xml": description("")}))
    identity = _IDENTITY.format(name=component, guid=guid, version=__version__)
    sources["identity.h"] = identity.encode()
    return {
        "modelDescription.xml": description(guid),
        "documentation/index.html": documentation.html(component, NATIVE, fmi).encode(),
        "documentation/licenses/license.txt": documentation.licences(NATIVE).encode(),
        **version.others(component, declared.PORTS),
        **{f"sources/{name}": content for name, content in sources.items()},
        **{
            f"binaries/{platform.name}/{component}{platform.ending}": library(
                compiler, platform, component, sources, version.main
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
    sources = ("auv_fmu", "fmus")

    @property
    def settings(self) -> dict[str, str]:
        """What the FMUs depend on besides their sources."""
        return {
            "kind": NATIVE,
            "fmi": self.fmi,
            "platforms": ",".join(platform.name for platform in self.platforms),
            "compiler": self.compiler.name,
        }

    def write(self, component: str, module: str, path: Path) -> None:
        """Write the FMU of a component.

        Raises:
            OSError: the compiler fails, or the file cannot be written.

        """
        entries = fmu_entries(component, module, self.fmi, self.platforms, self.compiler)
        write_archive(path, entries, zipfile.ZIP_DEFLATED)
