"""The cells of docs/reference/fmi-answers.md, tried in a process that may crash."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import addressof, c_int, c_void_p
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fmus.kinds import PYTHON
from support.calls import MANY
from support.cells import check, company_of
from support.fmi3 import Fmi3Library
from support.raw import MODEL_EXCHANGE, Host, Library, Status, harmless, instance
from support.status_table import CREATION, WITHOUT_AN_INSTANCE, creations, without_an_instance

#: Beside the kinds: FMUs in C of FMI 3.0, behind the functions of FMI 2.0.
FMI3 = "FMI 3.0"

#: A row and a column.
Place = tuple[tuple[str, str], str]

_NOT_UTF_8 = b"ta\xffnh"

#: Arguments of fmi2Instantiate that differ from those of a good call.
CREATIONS: dict[str, dict[str, Any]] = {
    "everything as it should be": {},
    "a name that is empty": {"name": b""},
    "a name of white space": {"name": b" \t\n"},
    "a name of 100,000 characters": {"name": b"n" * MANY},
    "a name that is NULL": {"name": None},
    "a name that is not UTF-8": {"name": _NOT_UTF_8},
    "the type fmi2ModelExchange": {"kind": MODEL_EXCHANGE},
    "a GUID that is NULL": {"guid": None},
    "a GUID that is empty": {"guid": b""},
    "a GUID of another FMU": {"guid": b"{8c4e810f-3df3-4a00-8276-176fa3c9f9e0}"},
    "a GUID that is not UTF-8": {"guid": _NOT_UTF_8},
    "a resource location that is NULL": {"location": None},
    "a resource location that does not exist": {"location": b"file:///nowhere/to/be/found"},
    "a resource location that is not UTF-8": {"location": b"file:///" + _NOT_UTF_8},
    "callbacks that are NULL": {"callbacks": "none"},
    "callbacks without a logger": {"callbacks": "no logger"},
    "logging off": {"logging": False},
}


def trials(folder: Path, other: Path, kind: str = PYTHON) -> Callable[[Place], str]:
    """Prepare a process for trials on an FMU.

    Args:
        folder: of the unpacked FMU.
        other: of another one.
        kind: of both, or :data:`FMI3`.

    Returns:
        What tells what is wrong with a cell, empty: nothing.

    """
    load = Fmi3Library if kind == FMI3 else Library
    library = load(folder)
    company = company_of(library, load(other))

    def trial(cell: Place) -> str:
        (function, case), state = cell
        try:
            if function == CREATION:
                _check_creation(library, case, creations(kind)[case])
            elif function == WITHOUT_AN_INSTANCE:
                _check_without_an_instance(library, case)
            else:
                check(library, (function, case), state, company)
        except Exception as error:  # PythonFMU may leave one behind that is not of this trial.
            return f"{type(error).__name__}: {error}".splitlines()[0]
        return ""

    return trial


@contextmanager
def _location(library: Library, case: str) -> Iterator[dict[str, Any]]:
    """Folders that are not what a resource location should be."""
    resources = library.folder / "resources"
    with TemporaryDirectory(prefix="auv_fmu_resources_") as folder:
        made = Path(folder, "resources")
        if case == "a resource location that is a plain path":
            made = resources
        elif case == "a resource location that is an empty folder":
            made.mkdir()
        elif case == "a resource location whose slavemodule.txt is garbage":
            _copied(resources, made)
            (made / "slavemodule.txt").write_bytes(b"\xff\x00/../garbage\n")
        elif case == "a resource location whose script raises":
            _copied(resources, made)
            (made / "raising.py").write_text("raise RuntimeError('on purpose')\n")
            (made / "slavemodule.txt").write_text("raising")
        else:
            yield CREATIONS[case]
            return
        plain = case == "a resource location that is a plain path"
        yield {"location": str(made).encode() if plain else made.as_uri().encode()}


def _copied(resources: Path, made: Path) -> None:
    if resources.exists():
        shutil.copytree(resources, made)
    else:
        made.mkdir()


def _check_creation(library: Library, case: str, possible: bool) -> None:
    host = Host(library)
    with _location(library, case) as arguments:
        made = host.instantiate(**arguments)
    assert made == possible, "an instance" if made else "no instance"
    if made:
        assert host.setup() == host.enter() == host.exit() == host.step(0.0, 0.02) == Status.OK
        host.free()
    else:
        said = [message.text for message in host.messages]
        assert len(said) == 1, f"{len(said)} messages: {said}"
        assert "\n" not in said[0]
    with instance(library) as after:
        assert after.setup() == Status.OK, "no instance can be made any more"


def _check_without_an_instance(library: Library, case: str) -> None:
    with instance(library) as witness:
        assert witness.setup() == Status.OK
        before = witness.content()
        target: int | None = None
        memory = (c_int * 64)()
        if case == "an instance that was freed":
            gone = Host(library)
            assert gone.instantiate()
            target = gone.component
            gone.free()
        elif case == "a pointer to something else":
            target = addressof(memory)
        for name, arguments in harmless().items():
            status = witness.call_on(target, name, *arguments)
            assert f"fmi2{status.name}" == without_an_instance()[case], f"{name}: {status.name}"
        witness.library.functions.fmi2FreeInstance(c_void_p(target))
        assert list(memory) == [0] * 64
        assert witness.content() == before
        assert witness.enter() == Status.OK, "the state of another instance has changed"
