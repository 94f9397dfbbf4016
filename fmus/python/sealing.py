"""Turn an FMU as PythonFMU builds it into one that is reproducible and alone in its process.

All PythonFMU FMUs of a process share one interpreter and import their modules by bare name:
of two FMUs that bundle a module of the same name, the second silently runs the first one's
code. Sealing gives every top-level module in `resources` a name that carries a hash of the
FMU's contents, and the FMU a GUID made from the same hash.
"""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

from fmus.archive import digest_of, guid_of, write_archive

_RESOURCES = "resources/"
_SLAVE_MODULE = "resources/slavemodule.txt"
_DESCRIPTION = "modelDescription.xml"

#: Where the loader finds the GUID: a library knows only the folder of resources.
_GUID_FILE = "resources/guid.txt"
_GUID = re.compile(rb'guid="[^"]*"')

#: `import`, and the modules after it.
_IMPORT = re.compile(r"^(\s*import\s+)([\w., \t]*\w)", re.MULTILINE)


def seal(entries: dict[str, bytes], destination: Path) -> None:
    """Write an FMU sealed.

    Args:
        entries: of the FMU, by their names.
        destination: file to write.

    """
    entries = dict(entries)
    entries[_DESCRIPTION] = _GUID.sub(b'guid=""', entries[_DESCRIPTION], count=1)
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
    from_module = re.compile(rf"^(\s*from\s+(?:{alternatives}))\b", re.MULTILINE)
    imported = re.compile(rf"^({alternatives})((?:\.\w+)*)(\s+as\s+\w+)?$")

    def import_statement(found: re.Match[str]) -> str:
        """The same modules, and the names that the script has for them."""
        wanted = [
            imported.sub(lambda one: _under_its_name(one, suffix), name.strip())
            for name in found[2].split(",")
        ]
        return found[1] + ", ".join(wanted)

    resource = re.compile(rf"^({_RESOURCES}(?:{alternatives}))(?=/|\.py$)")
    renamed = {}
    for name, content in entries.items():
        if name.startswith(_RESOURCES) and name.endswith(".py"):
            text = from_module.sub(rf"\1_{suffix}", content.decode("utf-8"))
            content = _IMPORT.sub(import_statement, text).encode()
        elif name == _SLAVE_MODULE:
            content = content.strip() + f"_{suffix}".encode()
        renamed[resource.sub(rf"\1_{suffix}", name)] = content
    return renamed


def _under_its_name(imported: re.Match[str], suffix: str) -> str:
    """One module of an import statement, so that it is still found under its own name."""
    top, below, other_name = imported.groups(default="")
    sealed = f"{top}_{suffix}"
    if other_name:
        return f"{sealed}{below}{other_name}"
    return f"{sealed}{below}, {sealed} as {top}" if below else f"{sealed} as {top}"
