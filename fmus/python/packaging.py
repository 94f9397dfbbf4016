"""The Python kind: an FMU that holds Python sources and has PythonFMU run them."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from dataclasses import dataclass
from modulefinder import ModuleFinder
from pathlib import Path

import pythonfmu

from fmus import documentation
from fmus.archive import licences
from fmus.discovery import package_folder
from fmus.kinds import PYTHON
from fmus.python.loader import compiler, with_loader
from fmus.python.sealing import seal

_FOLDERS = {package: package_folder(package) for package in ("auv_fmu", "fmus")}

#: The script of a component.
_SCRIPT = """\
from {package} import behaviour, ports
from fmus.python.loading import settle
from fmus.python.slave import slave_of

{component} = slave_of("{component}", ports, behaviour)
settle({component}, globals(), locals())
"""

#: How FMUs are loaded: by a library of our own, or by PythonFMU's.
LOADERS = ("native", "plain")


def _stage(text: str, stage: Path, script: str, own: Path | None) -> Path:
    """Lay out a script and the modules it needs the way PythonFMU wants them."""
    path = stage / f"{script}.py"
    path.write_text(text, encoding="utf-8")
    roots = [folder.parent for folder in _FOLDERS.values()]
    finder = ModuleFinder(path=[str(root) for root in (*roots, *([own] if own else []))])
    finder.run_script(str(path))
    for name, found in finder.modules.items():
        source, top = getattr(found, "__file__", None), name.split(".")[0]
        if top in _FOLDERS and source is not None:
            root = _FOLDERS[top].parent
        elif own is not None and source is not None and _lies_in(own, Path(source), top):
            root = own
        else:
            continue
        target = stage / Path(source).relative_to(root)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
    return path


def _lies_in(folder: Path, source: Path, top: str) -> bool:
    """Whether a module's top-level package stands in a folder, and not in one further below."""
    return folder in source.parents and source.relative_to(folder).parts[0] in (top, f"{top}.py")


def fmu_entries(script: str, text: str, loader: str, own: Path | None = None) -> dict[str, bytes]:
    """The contents of an FMU, before it is sealed.

    Args:
        script: name of the FMU's script.
        text: of the script, which settles a slave (:mod:`fmus.python.loading`).
        loader: `native` or `plain`.
        own: folder of modules that go into the FMU beside this package's; None: none.

    Raises:
        OSError: the loader cannot be compiled.

    """
    with tempfile.TemporaryDirectory(prefix="auv_fmu_build_") as temporary:
        stage, built = Path(temporary, "stage"), Path(temporary, "built")
        stage.mkdir()
        path = _stage(text, stage, script, own)
        raw = pythonfmu.FmuBuilder.build_FMU(
            path, dest=built, project_files=set(stage.iterdir()) - {path}
        )
        with zipfile.ZipFile(raw) as archive:
            entries = {name: archive.read(name) for name in archive.namelist()}
    entries["model.png"] = documentation.ICON.read_bytes()
    entries["documentation/licenses/license.txt"] = licences(PYTHON).encode()
    return with_loader(entries) if loader == "native" else entries


def best_loader() -> str:
    """The loader for new files: native where it can be compiled."""
    return "plain" if compiler() is None else "native"


@dataclass(frozen=True)
class PythonKind:
    """The Python kind, with a loader."""

    loader: str
    name = PYTHON

    @property
    def settings(self) -> dict[str, str]:
        """What the FMUs depend on besides their sources."""
        return {"kind": PYTHON, "loader": self.loader}

    def write(self, component: str, package: str, path: Path) -> None:
        """Write the FMU of a component, whose folder is a package.

        Raises:
            OSError: the loader cannot be compiled, or the file cannot be written.

        """
        text = _SCRIPT.format(package=package, component=component)
        entries = fmu_entries(component, text, self.loader)
        page = documentation.html(component, PYTHON)
        entries["documentation/index.html"] = page.encode()
        seal(entries, path)
