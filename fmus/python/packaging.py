"""The Python kind: FMUs of Python sources, PythonFMU and our loader."""

from __future__ import annotations

import re
import shutil
import sys
import zipfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

import pythonfmu
from pythonfmu.builder import get_model_class

from fmus import documentation
from fmus.discovery import (
    Source,
    digest_of,
    guid_of,
    licences,
    write_archive,
)
from fmus.kinds import PYTHON
from fmus.python.modules import modules_of, with_other_imports
from fmus.script import data_files, import_from, no_component
from orchestrator.machine.compilers import Compiler, compile_library, own_compiler
from orchestrator.machine.identity import package_folder

_FOLDERS = {package: package_folder(package) for package in ("auv_fmu", "fmus")}

#: The script of a component.
_SCRIPT = """\
{imported}
from fmus.python.loading import settle
from fmus.python.slave import slave_of

{component} = slave_of("{component}", {module})
settle({component}, globals(), locals())
"""

#: The script of a user's slave, which may raise exceptions.
_OWN_SCRIPT = """\
from fmus.python.loading import caught, settle
from {module} import {component}

settle(caught({component}), globals(), locals())
"""

#: Libraries that load FMUs: the native loader, or plain PythonFMU.
LOADERS = ("native", "plain")

#: Sources of the native loader, which lets an FMU run in a host that is not a Python program;
#: loader.h describes each file, and fmi2.c includes all others.
LOADER = Path(__file__).parent / "loader"

#: Options of the compiler, which runs in their folder.
LOADER_FLAGS = (
    "-std=gnu11", "-shared", "-fPIC", "-fvisibility=hidden", "-pthread",
    # Python keeps pointers into the library, so it must never be unloaded.
    "-Wl,-z,nodelete",
    "fmi2.c", "-ldl",
)  # fmt: skip

#: Folder of the library; PythonFMU's is renamed when the loader takes its name.
_LINUX = "binaries/linux64/"

_RESOURCES = "resources/"
_SLAVE_MODULE = "resources/slavemodule.txt"
_DESCRIPTION = "modelDescription.xml"

#: File with the GUID for the loader, to which only the folder of resources is passed.
_GUID_FILE = "resources/guid.txt"
_GUID = re.compile(rb'guid="[^"]*"')

#: The time of the build, which PythonFMU writes.
_TIME = re.compile(rb' generationDateAndTime="[^"]*"')


def fmu_entries(name: str, text: str, loader: str, own: Path | None = None) -> dict[str, bytes]:
    """Return the contents of an FMU, before it is sealed.

    Args:
        name: name of the FMU.
        text: text of its script, which calls `settle` (:mod:`fmus.python.loading`).
        loader: `native` or `plain`.
        own: folder of the user's modules, which are included with the data files that they have
            read; None for a bundled component.

    Raises:
        OSError: the loader cannot be compiled.

    """
    with TemporaryDirectory(prefix="auv_fmu_build_") as temporary:
        stage, built = Path(temporary, "stage"), Path(temporary, "built")
        stage.mkdir()
        # Not {name}.py: some file systems do not distinguish Lag.py from a module lag.py.
        path = stage / f"{name}_fmu.py"
        path.write_text(text, encoding="utf-8")
        for place, source in modules_of(text, _FOLDERS, own).items():
            target = stage / place
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
        raw = pythonfmu.FmuBuilder.build_FMU(
            path, dest=built, project_files=set(stage.iterdir()) - {path}
        )
        with zipfile.ZipFile(raw) as archive:
            entries = {entry: archive.read(entry) for entry in archive.namelist()}
    if own is not None:
        data = {f"{_RESOURCES}{name}": file.read_bytes() for name, file in data_files(own).items()}
        entries = {**data, **entries}
    entries["model.png"] = documentation.ICON.read_bytes()
    entries["documentation/licenses/license.txt"] = licences(PYTHON).encode()
    return _with_loader(entries) if loader == "native" else entries


# The loader


def loader_compiler() -> Compiler | None:
    """Return the C compiler for the loader; None if there is none, or this is not Linux."""
    return own_compiler() if sys.platform.startswith("linux") else None


@cache
def compiled_loader() -> bytes:
    """Compile the loader.

    Raises:
        OSError: there is no compiler, or it fails.

    """
    compiler = loader_compiler()
    if compiler is None:
        raise OSError("the native loader needs Linux and a C compiler; build with --loader plain")
    options = ["-O2", "-s", "-Wl,--build-id=none", *LOADER_FLAGS]
    try:
        return compile_library(compiler, *options, folder=LOADER)
    except OSError as error:
        raise OSError(f"the native loader does not compile: {error}") from error


def _with_loader(entries: dict[str, bytes]) -> dict[str, bytes]:
    """Put the loader in the place of PythonFMU's library, which is renamed."""
    changed = dict(entries)
    for name, content in entries.items():
        if name.startswith(_LINUX) and name.endswith(".so"):
            changed[name.replace(".so", "_pythonfmu.so")] = content
            changed[name] = compiled_loader()
    return changed


def best_loader() -> str:
    """Return the default loader: native if it can be compiled."""
    return "plain" if loader_compiler() is None else "native"


# Sealing


def seal(entries: dict[str, bytes], destination: Path) -> None:
    """Write a sealed FMU: reproducible, and isolated from others in its process.

    All PythonFMU FMUs of a process share one interpreter and import their modules by plain names:
    of two FMUs with a module of the same name, the second silently runs the first one's code.
    Sealing adds a hash of the FMU's contents to the name of every top-level module in `resources`,
    and gives the FMU a GUID made from the same hash.
    """
    entries = dict(entries)
    description = _TIME.sub(b"", entries[_DESCRIPTION], count=1)
    entries[_DESCRIPTION] = _GUID.sub(b'guid=""', description, count=1)
    digest = digest_of(entries)
    guid = guid_of(digest).encode()
    entries = _renamed(entries, digest.hex()[:12])
    entries[_DESCRIPTION] = _GUID.sub(b'guid="' + guid + b'"', entries[_DESCRIPTION], count=1)
    entries[_GUID_FILE] = guid
    write_archive(destination, entries)


def _renamed(entries: dict[str, bytes], suffix: str) -> dict[str, bytes]:
    modules = {
        PurePosixPath(name.removeprefix(_RESOURCES)).parts[0].removesuffix(".py")
        for name in entries
        if name.startswith(_RESOURCES) and name.endswith(".py")
    }
    alternatives = "|".join(sorted(map(re.escape, modules)))
    resource = re.compile(rf"^({_RESOURCES}(?:{alternatives}))(?=/|\.py$)")
    renamed = {}
    for name, content in entries.items():
        if name.startswith(_RESOURCES) and name.endswith(".py"):
            content = with_other_imports(content, modules, f"_{suffix}")
        elif name == _SLAVE_MODULE:
            content = content.strip() + f"_{suffix}".encode()
        renamed[resource.sub(rf"\1_{suffix}", name)] = content
    return renamed


@dataclass(frozen=True)
class PythonKind:
    """The Python kind, with a loader."""

    loader: str
    name = PYTHON
    #: Number of FMUs that are written in parallel: PythonFMU imports the modules that it builds.
    side_by_side = 1

    @property
    def settings(self) -> dict[str, str]:
        """Settings that the FMUs depend on in addition to their sources."""
        return {"kind": PYTHON, "loader": self.loader}

    def write(self, source: Source, path: Path) -> None:
        """Write the FMU of a component.

        Raises:
            OSError: the loader cannot be compiled, or the file cannot be written.

        """
        package, _, name = source.module.rpartition(".")
        imported = f"from {package} import {name}" if package else f"import {name}"
        text = _SCRIPT.format(imported=imported, module=name, component=source.name)
        entries = fmu_entries(source.name, text, self.loader, source.root)
        entries |= documentation.fmu_documents(source)
        seal(entries, path)


def build_script(script: Path, destination: Path, loader: str | None = None) -> Path:
    """Build the FMU of a user's script with a class of PythonFMU.

    It contains the modules in the script's folder that are imported, and the data files that were
    read while the script was imported and its slave was made.

    Args:
        script: a Python file with one slave.
        destination: folder of the FMU, which is named after the slave's class.
        loader: `native` or `plain`; None: native if it can be compiled.

    Raises:
        Exception: raised by the script when it is imported or its slave is made.

    """
    own = script.resolve().parent
    import_from(own)
    try:
        component = get_model_class(script).__name__
    except ValueError as error:
        if str(error).startswith("No child class of Fmi2Slave"):
            why = f"{no_component(script)}, and has no class of PythonFMU (Fmi2Slave)"
            raise ValueError(why) from None
        raise
    text = _OWN_SCRIPT.format(module=script.stem, component=component)
    path = destination / f"{component}.fmu"
    seal(fmu_entries(component, text, loader or best_loader(), own), path)
    return path
