"""AllTypes as FMUs, without the pages that FMUs of the bundle have."""

from __future__ import annotations

import subprocess
from pathlib import Path

import fmpy

from fmus.discovery import write_archive
from fmus.native.derivatives import derivatives
from fmus.native.packaging import sources_of
from fmus.native.tables import tables
from fmus.native.translator import translated
from fmus.ports.definition import Definition, define
from fmus.ports.description import SOURCES, fmi2_description, fmi3_description
from fmus.python.packaging import fmu_entries, seal
from support.all_types import component, prompt, sampled
from support.hosts import MEMORY

NAME = "AllTypes"

_GUID = "{all types}"

#: Components, by when their outputs are computed.
VARIANTS = {"read": component, "sampled": sampled, "prompt": prompt}

_SCRIPT = """\
from all_types import component, prompt, sampled
from fmus.python.loading import settle
from fmus.python.slave import slave_of

AllTypes = slave_of("AllTypes", {module})
settle(AllTypes, globals(), locals())
"""

_FLAGS = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-ffp-contract=off", "-fPIC",
          "-shared", "-fvisibility=hidden", "-g")  # fmt: skip

_DESCRIBE = {"2": fmi2_description, "3": fmi3_description}


def definition(variant: str = "read") -> Definition:
    """Definition of a variant of the component."""
    return define(NAME, VARIANTS[variant])


def sources(definition: Definition, fmi: str = "2") -> dict[str, str]:
    """Return the C sources of a component by their file names, except identity.h."""
    written = translated(definition), tables(definition), fmi, derivatives(definition)
    return sources_of(*written)


def native(
    folder: Path,
    fmi: str = "2",
    sanitizers: str = "",
    compiler: str = "cc",
    component: Definition | None = None,
) -> Path:
    """The FMU in C for this machine, unpacked into a folder, and beside it as a file.

    Args:
        folder: to be made.
        fmi: version.
        sanitizers: as the compiler names them.
        compiler: that makes it.
        component: another one.

    """
    component = component or definition()
    platform = "linux64" if fmi == "2" else fmpy.platform_tuple
    library = folder / f"binaries/{platform}/{component.name}.so"
    library.parent.mkdir(parents=True)
    (folder / "sources").mkdir()
    identity = f'#define MODEL_NAME "{component.name}"\n#define MODEL_GUID "{_GUID}"\n'
    for name, text in {**sources(component, fmi), "identity.h": identity}.items():
        (folder / "sources" / name).write_text(text, encoding="utf-8")
    (folder / "modelDescription.xml").write_bytes(_DESCRIBE[fmi](component, _GUID))
    watched = ["-O1", f"-fsanitize={sanitizers}", "-fno-sanitize-recover"]
    options = watched if sanitizers else ["-O2"]
    command = [compiler, *_FLAGS, *options, "-o", library, SOURCES[fmi], "-lm"]
    subprocess.run(command, cwd=folder / "sources", check=True)
    files = [path for path in folder.rglob("*") if path.is_file()]
    entries = {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
    write_archive(folder.with_suffix(".fmu"), entries)
    return folder


def sanitized(folder: Path) -> Path:
    """The same with sanitizers of memory and arithmetic."""
    return native(folder, sanitizers=MEMORY, compiler="gcc")


def python(folder: Path, variant: str = "read") -> Path:
    """Its FMU in Python, unpacked into a folder, and beside it as a file."""
    support = Path(__file__).parents[1]
    script = _SCRIPT.format(module=VARIANTS[variant].__name__.rpartition(".")[2])
    seal(fmu_entries(f"{NAME}_fmu", script, "native", support), folder.with_suffix(".fmu"))
    return Path(fmpy.extract(folder.with_suffix(".fmu"), folder))
