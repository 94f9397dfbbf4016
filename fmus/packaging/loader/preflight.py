"""Whether PythonFMU can make an instance from a folder of resources.

PythonFMU 0.7 ends the process where the folder lacks the slave. The loader runs this text, which is
compiled into it, before it forwards fmi2Instantiate. It must need nothing but Python 3.9.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

#: Attribute of a script's module: the text that it was made from, once that was found good.
_TEXT = "__checked_text__"


def refusal(resources: str, guid: str) -> str:
    """What speaks against an instance; empty: nothing.

    Args:
        resources: path of the folder.
        guid: what the host takes the FMU's GUID for; empty: it does not say.

    """
    try:
        _check(resources, guid)
    except BaseException as error:
        what = f"{type(error).__name__}: {error}"
        return " ".join(what.encode("utf-8", "replace").decode("utf-8").split())
    return ""


def forget(resources: str) -> None:
    """Take a folder off sys.path."""
    if resources in sys.path:
        sys.path.remove(resources)


def _check(resources: str, guid: str) -> None:
    folder = Path(resources)
    script = (folder / "slavemodule.txt").read_text(encoding="utf-8")
    if not script.isidentifier():
        raise ValueError(f"{resources}/slavemodule.txt names no module")
    text = (folder / f"{script}.py").read_bytes()
    own = (folder / "guid.txt").read_text(encoding="utf-8")
    if guid and guid.strip("{}") != own.strip("{}"):
        raise ValueError(f"GUID {guid} is not that of this FMU, {own}")
    module = sys.modules.get(script)
    if module is None or _TEXT not in vars(module):
        # It tells what is wrong with a text, where an import may find the bytes of an older one.
        compile(text, f"{resources}/{script}.py", "exec")
        module = _imported(script, resources)
        if Path(str(module.__file__)).read_bytes() == text:
            if not _has_slave(module):
                raise ValueError(f"{resources}/{script}.py holds no slave")
            setattr(module, _TEXT, text)
    if vars(module).get(_TEXT) != text:
        raise ValueError(f"another module {script} is loaded in this process")


def _imported(script: str, resources: str) -> ModuleType:
    importlib.invalidate_caches()
    sys.path.insert(0, resources)
    try:
        return importlib.import_module(script)
    finally:
        forget(resources)


def _has_slave(module: ModuleType) -> bool:
    """Whether there is a class where PythonFMU will look for it."""
    return any(
        isinstance(found, type)
        and (name == "" or any(base.__name__ == "Fmi2Slave" for base in found.__mro__[1:]))
        for name, found in vars(module).items()
    )
