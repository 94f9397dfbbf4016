"""The kernel, compiled once for each controller and kept in the user's cache folder."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

from platformdirs import user_cache_path

from auv_fmu.closed_loop import LAWS, Law
from orchestrator.studies.batch import kernel
from orchestrator.studies.batch.kernel import Moment


@cache
def compiled(gains: type[Any]) -> Callable[..., Moment]:
    """The function :func:`.kernel.run` for the controller with a type of gains.

    It is compiled when it is first called, which takes some ten seconds, unless some process of
    this machine has done so before.
    """
    # Not installed for those who make no studies.
    import numba  # noqa: PLC0415

    from orchestrator.studies.batch.equations import EQUATIONS, OPTIONS  # noqa: PLC0415

    path = _place()
    made = EQUATIONS.anew(kernel, path or Path(kernel.__file__))
    vars(made)["law"] = Law(*(EQUATIONS.function(function) for function in LAWS[gains]))
    run: Callable[..., Moment] = numba.njit(made.run.py_func, cache=path is not None, **OPTIONS)
    return run


@cache
def digest() -> str:
    """Of the text of all that is compiled."""
    found = sha256()
    for package in ("auv_fmu", "orchestrator.studies.batch"):
        specification = find_spec(package)
        assert specification is not None and specification.submodule_search_locations
        [root] = specification.submodule_search_locations
        for path in sorted(Path(root).rglob("*.py")):
            found.update(f"{package}/{path.relative_to(root)}\0".encode())
            found.update(path.read_bytes())
    return found.hexdigest()[:16]


def _place() -> Path | None:
    """The file beside which numba keeps what it has compiled; None: it cannot be written.

    Numba looks at nothing but the file of the function, so this one's folder bears the digest of
    all that it calls, and its time is always the same.
    """
    source = Path(kernel.__file__)
    path = user_cache_path("auv-fmu", appauthor=False) / "batch" / digest() / source.name
    with suppress(OSError):
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            with NamedTemporaryFile(dir=path.parent, delete=False) as file:
                file.write(source.read_bytes())
            os.utime(file.name, (0, 0))
            Path(file.name).replace(path)
        return path
    return None
