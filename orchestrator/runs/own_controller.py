"""A controller of the user's own: a folder to begin with, and the FMU of its script."""

from __future__ import annotations

import keyword
import re
import shutil
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from orchestrator.machine.disk import process_folder
from orchestrator.machine.errors import InputError
from orchestrator.runs.bundle import run_fmus
from orchestrator.runs.folder import replaced

_TEMPLATES = Path(__file__).with_name("templates")

#: What a script can stand on: plain PythonFMU, or the base that the bundle's components have.
BASES = ("plain", "hardened")

#: Names in the templates that give way to the user's own.
_CLASS, _MODULE = "OwnController", "own_controller"


def new_controller(name: str, folder: Path | None = None, base: str = BASES[0]) -> list[Path]:
    """Make a folder with a controller that runs in the closed loop.

    Args:
        name: of the controller, `MyLaw` or `my_law`.
        folder: made if it does not exist; None: one with the name, in the current folder.
        base: one of :data:`BASES`.

    Returns:
        The script, the scenario, the README and the FMU.

    Raises:
        InputError: the name is not usable, the folder is not empty or cannot be written.

    """
    module, class_name = _names(name)
    folder = Path(name) if folder is None else folder
    contents = {
        f"{module}.py": f"{base}.py.txt",
        "scenario.toml": "scenario.toml",
        "README.md": "README.md",
    }
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(f"{folder}: is not empty, and nothing in it is replaced")
    with replaced(folder, contents) as unfinished:
        for target, template in contents.items():
            text = (_TEMPLATES / template).read_text(encoding="utf-8")
            text = text.replace(_CLASS, class_name).replace(_MODULE, module)
            (unfinished / target).write_text(text, encoding="utf-8")
    return [*(folder / target for target in contents), build_own(folder / f"{module}.py")]


def build_own(
    script: Path,
    folder: Path | None = None,
    loader: str | None = None,
    *,
    force: bool = False,
) -> Path:
    """Build the FMU of a user's script.

    Args:
        script: a Python file with one slave.
        folder: of the FMU, which gets the name of the slave's class; None: the script's own.
        loader: `native` or `plain`; None: native where it can be compiled.
        force: move aside a file of the user's that has the name of the FMU.

    Raises:
        InputError: the script is missing or fails, or the folder cannot be written.

    """
    if not (script.is_file() and script.suffix == ".py"):
        raise InputError(f"{script}: no such Python file")
    options = [str(script), *(("--loader", loader) if loader else ())]
    with TemporaryDirectory(dir=process_folder()) as temporary:
        [built] = run_fmus("python.own", Path(temporary), *options)
        place = script.parent if folder is None else folder
        with replaced(place, [built.name], force=force) as unfinished:
            shutil.copyfile(built, unfinished / built.name)
    return place / built.name


def _names(name: str) -> tuple[str, str]:
    """Names of the module and of the class.

    Raises:
        InputError: Python would not take them, or has such a module already.

    """
    if not (name.isascii() and name.isidentifier() and name[0].isalpha()):
        raise InputError(
            f"{name!r}: not a name for a controller; use letters, digits and underscores, a "
            "letter first"
        )
    module = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()
    words = [word for word in module.split("_") if word]
    class_name = name if name[0].isupper() else "".join(word.capitalize() for word in words)
    if keyword.iskeyword(module) or keyword.iskeyword(class_name) or find_spec(module):
        raise InputError(f"{name!r}: {module} is taken in Python; choose another name")
    return module, class_name
