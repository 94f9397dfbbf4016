"""Components of the user's own: templates, and their FMUs.

`auv-fmu new` writes a folder from the templates, `auv-fmu build` builds the FMU of its script.

"""

from __future__ import annotations

import keyword
import os
import re
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Unpack
from zipfile import BadZipFile, ZipFile

from fmus.discovery import ORIGIN, name_of, origin_of
from orchestrator.machine.disk import temporary_folder
from orchestrator.machine.errors import InputError
from orchestrator.runs.bundle import BuildFailed, Form, run_fmus, words_of
from orchestrator.runs.folder import replace_files

_TEMPLATES = Path(__file__).with_name("templates")

#: Templates of a component, each with the setting and the output in its README.
_EXAMPLES = {
    "controller": ("K=4", "command"),
    "plant": ("a=0.002", "level"),
    "filter": ("f=0.5", "y"),
    "empty": ("x0=1", "x"),
}
LIKENESSES = tuple(_EXAMPLES)

#: Time between two checks for changes [s].
_INTERVAL = 0.2


def new_controller(name: str, folder: Path | None = None, *, python: bool = False) -> list[Path]:
    """Create a folder with a controller that runs in the closed loop.

    Args:
        name: of the controller, `MyLaw` or `my_law`.
        folder: made if it does not exist; None: one with the name of its module.
        python: write a class of PythonFMU in any Python, instead of a component in the language
            of equations.

    Returns:
        The script, its tests if it is a component, the scenario, the README and the FMU.

    Raises:
        InputError: the name is not usable, the folder is not empty or cannot be written.

    """
    module, class_name = _names(name, "controller")
    form = "python" if python else "equations"
    contents = {
        f"{module}.py": f"{form}.py.txt",
        **({} if python else {f"test_{module}.py": "test.py.txt"}),
        f"{module}.toml": "own_controller.toml",
        "README.md": f"{form}.md",
    }
    texts = {target: _template(f"controller/{file}") for target, file in contents.items()}
    component = class_name if python else name_of(module)
    names = {"OwnController": component, "own_controller": module}
    files = _write(folder or Path(module), texts, names)
    return [*files, build_own(files[0])]


def new_component(
    name: str,
    folder: Path | None = None,
    like: str = LIKENESSES[0],
    source: Path | None = None,
) -> list[Path]:
    """Create a folder with a component, whose file becomes both kinds of FMU.

    Args:
        name: of the component, `WaterTank` or `water_tank`.
        folder: made if it does not exist; None: one with the name of its module.
        like: one of :data:`LIKENESSES`.
        source: file of a neural network that it computes instead, or of a track that it follows.

    Returns:
        The component, its tests, the scenario and the README.

    Raises:
        InputError: the name is not usable, the folder is not empty or cannot be written, or the
            source cannot be read.

    """
    module, _ = _names(name, "component")
    names = {"OwnComponent": name_of(module), "own_component": module}
    if source is None:
        text = _template(f"component/{like}.py.txt")
        setting, output = _EXAMPLES[like]
    elif source.suffix == ".csv":
        # Only tracks and networks need numpy.
        from orchestrator.runs.tracks import planner_text, read_track  # noqa: PLC0415

        like, setting, output = "track", "speed_max=2", "y_d.x"
        text = planner_text(name_of(module), read_track(source), source.name)
    else:
        from orchestrator.runs.networks import component_text, read_network  # noqa: PLC0415

        like, layers = "network", read_network(source)
        text = component_text(name_of(module), layers, source.name)
        names["own_input"] = layers.input_port
        setting, output = f"'{layers.input_port}[1]=0.5'", f"{layers.output_port}[1]"
    texts = {
        f"{module}.py": text,
        f"test_{module}.py": _template(f"component/test_{like}.py.txt"),
        f"{module}.toml": _template(f"component/{like}.toml"),
        "README.md": _template("component/README.md"),
    }
    names |= {"own_setting": setting, "own_output": output}
    return _write(folder or Path(module), texts, names)


def _template(file: str) -> str:
    return (_TEMPLATES / file).read_text(encoding="utf-8")


def _write(folder: Path, texts: Mapping[str, str], names: Mapping[str, str]) -> list[Path]:
    """Write texts into a new folder, and replace names in them."""
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(f"{folder}: is not empty; choose a new or empty folder")
    with replace_files(folder, texts) as staging:
        for target, text in texts.items():
            for name, own in names.items():
                text = text.replace(name, own)
            (staging / target).write_text(text, encoding="utf-8")
    return [folder / target for target in texts]


def _names(name: str, what: str) -> tuple[str, str]:
    """Return the names of the module and of the class of a component.

    Raises:
        InputError: Python does not allow them, or has such a module already.

    """
    if not (name.isascii() and name.isidentifier() and name[0].isalpha()):
        raise InputError(
            f"{name!r}: not a name for a {what}; use letters, digits and underscores, a "
            "letter first"
        )
    module = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name).lower()
    words = [word for word in module.split("_") if word]
    class_name = name if name[0].isupper() else "".join(word.capitalize() for word in words)
    for word in (module, class_name):
        if keyword.iskeyword(word):
            raise InputError(f"{name!r}: {word} is a keyword of Python; choose another name")
    # Not sys.modules: a module of the user's may be imported there already.
    if module in sys.stdlib_module_names or PathFinder.find_spec(module):
        raise InputError(f"{name!r}: {module} is already a module of Python; choose another name")
    return module, class_name


def build_own(
    script: Path,
    folder: Path | None = None,
    *,
    force: bool = False,
    hear: Callable[[str], None] = lambda line: None,
    **form: Unpack[Form],
) -> Path:
    """Build the FMU of a user's component.

    Args:
        script: a component in one Python file, a script with a slave of PythonFMU, or a folder with
            one of them.
        folder: of the FMU, which is named after the component; None: the script's own.
        force: move aside a file of the user's with the name of the FMU.
        hear: called with a line when a library is made.
        form: of the FMU.

    Raises:
        InputError: the script is missing or fails, or the folder cannot be written.

    """
    options = [str(script), *words_of(form)]
    with temporary_folder() as temporary:
        own = script if script.is_dir() else script.parent
        place = own if folder is None else folder
        try:
            run_fmus("build", temporary, *options, *_from_option(own, place), hear=hear)
        except BuildFailed as error:
            removed = [path.name for path in _built_from(script, place)]
            for name in removed:
                (place / name).unlink()
            gone = f"; {', '.join(removed)} of an earlier build is removed" * bool(removed)
            raise InputError(f"{error}{gone}") from None
        [built] = temporary.glob("*.fmu")
        with replace_files(place, [built.name], force=force) as staging:
            shutil.copyfile(built, staging / built.name)
    return place / built.name


def _from_option(script: Path, fmu: Path) -> Sequence[str]:
    """Return the option that records the path from an FMU to the folder of its script.

    It is omitted if a folder is outside of the project, which is the current folder.

    """
    here, folders = Path.cwd(), (script.resolve(), fmu.resolve())
    is_within = all(here in (folder, *folder.parents) for folder in folders)
    return ["--from", Path(os.path.relpath(*folders)).as_posix()] if is_within else []


def _built_from(script: Path, folder: Path) -> Iterator[Path]:
    """Find FMUs in a folder that were built from a script and have kept their names."""
    names = [script.name]
    if script.is_dir():
        names = [f"{script.resolve().name}.py", ""]
    for path in folder.glob("*.fmu"):
        with suppress(OSError, KeyError, BadZipFile), ZipFile(path) as archive:
            origin = origin_of(archive.read(ORIGIN))
            if origin and origin.script in names and origin.fmu == path.name:
                yield path


def changes(script: Path) -> Iterator[None]:
    """Yield at once, and then each time that a script, or a module beside it, has changed."""
    seen = None
    while True:
        now = _versions(script)
        if now == seen:
            time.sleep(_INTERVAL)
            continue
        # An editor may write in several steps.
        time.sleep(0.0 if seen is None else _INTERVAL)
        if seen is None or _versions(script) == now:
            seen = now
            yield


def _versions(script: Path) -> dict[Path, tuple[int, int]]:
    """Return times and sizes of the modules of a script, beside it and in folders beside it."""
    folder = script if script.is_dir() else script.parent
    versions = {}
    for path in (*folder.glob("*.py"), *folder.glob("*/*.py")):
        # It may just have been removed.
        with suppress(OSError):
            status = path.stat()
            versions[path] = (status.st_mtime_ns, status.st_size)
    return versions
