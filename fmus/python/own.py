"""A slave of PythonFMU as an FMU, from the user's own script.

The script holds a class, plain or on the base of this package. Its FMU is sealed like the ones of
the bundle: built again after a change, it runs the changed code in the same process. Modules that
lie beside the script are in it, and data files that were read while the script was imported and
its slave was made.
"""

from __future__ import annotations

from pathlib import Path

from pythonfmu.builder import get_model_class

from fmus.python.packaging import best_loader, fmu_entries, seal
from fmus.script import import_from, no_component

#: The script of the FMU, with a slave that may raise.
_SCRIPT = """\
from fmus.python.loading import caught, settle
from {module} import {component}

settle(caught({component}), globals(), locals())
"""


def build_script(script: Path, destination: Path, loader: str | None = None) -> Path:
    """Build the FMU of a script.

    Args:
        script: a Python file with one slave.
        destination: folder of the FMU, which gets the name of the slave's class.
        loader: `native` or `plain`; None: native where it can be compiled.

    Raises:
        Exception: whatever the script raises when it is imported or its slave is made.

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
    text = _SCRIPT.format(module=script.stem, component=component)
    path = destination / f"{component}.fmu"
    seal(fmu_entries(component, text, loader or best_loader(), own), path)
    return path
