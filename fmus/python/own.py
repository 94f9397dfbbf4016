"""A component of the user's own as an FMU: `python -m fmus.python.own SCRIPT --out DIR`.

The script holds a slave of PythonFMU, plain or on the base of this package. Its FMU is sealed like
the ones of the bundle: built again after a change, it runs the changed code in the same process,
and modules that lie beside the script are in it.
"""

from __future__ import annotations

import argparse
import sys
import traceback
from pathlib import Path

from pythonfmu.builder import get_model_class

from fmus.python.packaging import LOADERS, best_loader, fmu_entries, seal

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
    sys.path.insert(0, str(own))
    component = get_model_class(script).__name__
    text = _SCRIPT.format(module=script.stem, component=component)
    entries = fmu_entries(f"{component}_fmu", text, loader or best_loader(), own)
    path = destination / f"{component}.fmu"
    seal(entries, path)
    return path


def main() -> int:
    """Command line of the module."""
    parser = argparse.ArgumentParser(prog="python -m fmus.python.own", description=__doc__)
    parser.add_argument("script", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="folder to write into")
    parser.add_argument("--loader", choices=LOADERS, help="default: native if it can")
    options = parser.parse_args()
    try:
        print(build_script(options.script, options.out, options.loader))
    except Exception as error:
        where = f"{options.script}{_line(error, options.script)}"
        print(f"{where}: {type(error).__name__}: {error}", file=sys.stderr)
        return 2
    return 0


def _line(error: Exception, script: Path) -> str:
    """Where in the script an error was raised."""
    if isinstance(error, SyntaxError):
        return f":{error.lineno}"
    lines = [
        frame.lineno
        for frame in traceback.extract_tb(error.__traceback__)
        if Path(frame.filename).name == script.name
    ]
    return f":{lines[-1]}" if lines else ""


if __name__ == "__main__":
    sys.exit(main())
