"""The native kind: FMUs with libraries and their sources in C."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

from fmus import documentation
from fmus.discovery import Source, digest_of, guid_of, licences, write_archive
from fmus.kinds import FMI_VERSIONS, NATIVE
from fmus.native.derivatives import derivatives, derivatives_of_nothing
from fmus.native.emit import quoted
from fmus.native.names import RUNTIME
from fmus.native.tables import tables
from fmus.native.translator import translated
from fmus.ports.definition import Model
from fmus.ports.description import (
    SOURCES,
    fmi2_description,
    fmi3_build_description,
    fmi3_description,
    variables_of,
)
from fmus.ports.terminals import terminals_of
from orchestrator.machine.compilers import Compiler, Platform, library

_FOLDER = Path(__file__).parent

_IDENTITY = """\
/* The name and GUID of this FMU. */
#ifndef IDENTITY_H
#define IDENTITY_H

#define MODEL_NAME {name}
#define MODEL_GUID "{guid}"

#endif
"""


class Parts(NamedTuple):
    """Parts of a native FMU.

    Attributes:
        model: content of its description.
        equations, tables: the files equations.c and ports.h.
        documents: documentation and reference results, by their paths in the FMU.
        terminals: the file terminalsAndIcons.xml of FMI 3.0.
        arrays: True if vectors and matrices of one unit are array variables of FMI 3.0.
        derivatives: the file derivatives.c; None if there are no derivatives.

    """

    model: Model
    equations: str
    tables: str
    documents: Mapping[str, bytes]
    terminals: bytes
    arrays: bool = False
    derivatives: str | None = None


def _pictures(parts: Parts, fmi: str) -> dict[str, bytes]:
    """Return icons, and for FMI 3.0 the build description and terminals."""
    icon = documentation.ICON.read_bytes()
    if fmi == FMI_VERSIONS[0]:
        return {"model.png": icon}
    build = fmi3_build_description(parts.model.identifier)
    return {
        "sources/buildDescription.xml": build,
        "terminalsAndIcons/terminalsAndIcons.xml": parts.terminals,
        "terminalsAndIcons/icon.png": icon,
        "terminalsAndIcons/terminal.png": (_FOLDER / "terminal.png").read_bytes(),
    }


def sources_of(
    equations: str, ports: str, fmi: str, derivatives: str | None = None
) -> dict[str, str]:
    """Return the C sources for a version of FMI by their file names, except identity.h."""
    others = {name for version, name in SOURCES.items() if version != fmi}
    return {
        **{
            path.name: path.read_text(encoding="utf-8")
            for path in sorted(RUNTIME.glob("*.[ch]"))
            if path.name not in others
        },
        "equations.c": equations,
        "derivatives.c": derivatives or derivatives_of_nothing(),
        "ports.h": ports,
    }


def fmu_entries(
    source: Source,
    fmi: str,
    platforms: Sequence[Platform],
    compiler: Compiler,
    report: Callable[[str], None],
    arrays: bool = False,
) -> dict[str, bytes]:
    """Return the contents of the FMU of a component; `report` gets a line for each library.

    Raises:
        OSError: the compiler fails.

    """
    definition = source.definition
    documents = documentation.fmu_documents(source, NATIVE, fmi)
    if arrays:
        # The reference results are for scalar variables.
        documents = {name: text for name, text in documents.items() if name.endswith(".html")}
    parts = Parts(
        definition,
        translated(definition),
        tables(definition, arrays),
        documents,
        terminals_of({"": [variable.port for variable in variables_of(definition.ports, arrays)]}),
        arrays,
        derivatives(definition),
    )
    return entries_of(parts, fmi, platforms, compiler, report)


def entries_of(
    parts: Parts,
    fmi: str,
    platforms: Sequence[Platform],
    compiler: Compiler,
    report: Callable[[str], None],
) -> dict[str, bytes]:
    """Return the contents of an FMU; `report` gets a line for each library.

    Its GUID follows from its description and its sources, and is the same for all platforms.

    Raises:
        OSError: the compiler fails.

    """
    model, name = parts.model, parts.model.identifier
    has_derivatives = parts.derivatives is not None
    describe = partial(fmi2_description, has_derivatives=has_derivatives)
    if fmi == "3":
        describe = partial(fmi3_description, arrays=parts.arrays, has_derivatives=has_derivatives)
    texts = sources_of(parts.equations, parts.tables, fmi, parts.derivatives)
    written = {name: text.encode() for name, text in texts.items()}
    guid = guid_of(digest_of({**written, "modelDescription.xml": describe(model, "")}))
    written["identity.h"] = _IDENTITY.format(name=quoted(model.name), guid=guid).encode()
    libraries = {}
    for platform in platforms:
        path = f"binaries/{platform.name}/{name}{platform.ending}"
        libraries[path] = library(compiler, platform, name, written, SOURCES[fmi])
        report(f"{model.name} for {platform.name}, FMI {fmi}.0")
    return {
        "modelDescription.xml": describe(model, guid),
        **_pictures(parts, fmi),
        **parts.documents,
        "documentation/licenses/license.txt": licences(NATIVE).encode(),
        **{f"sources/{name}": content for name, content in written.items()},
        **libraries,
    }


@dataclass(frozen=True)
class NativeKind:
    """The native kind for some platforms; `report` gets a line for each compiled library."""

    fmi: str
    platforms: Sequence[Platform]
    compiler: Compiler
    report: Callable[[str], None]
    arrays: bool = False
    name = NATIVE
    #: Number of FMUs that are written in parallel: compilers are separate processes.
    side_by_side = os.cpu_count()

    @property
    def settings(self) -> dict[str, str]:
        """Settings that the FMUs depend on in addition to their sources."""
        return {
            "kind": NATIVE,
            "fmi": self.fmi,
            "platforms": ",".join(platform.name for platform in self.platforms),
            "compiler": self.compiler.name,
            **({"arrays": "true"} if self.arrays else {}),
        }

    def write(self, source: Source, path: Path) -> None:
        """Write the FMU of a component.

        Raises:
            OSError: the compiler fails, or the file cannot be written.

        """
        entries = fmu_entries(
            source, self.fmi, self.platforms, self.compiler, self.report, self.arrays
        )
        write_archive(path, entries)
