"""The kernel, compiled once for each controller and kept in the user's cache folder."""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from auv_fmu.closed_loop import LAWS, Law, Moment
from orchestrator.machine.cache import keep, kept
from orchestrator.machine.children import imported_apart
from orchestrator.master.plan import code_of
from orchestrator.studies.batch import kernel

#: What it is in the user's cache folder.
_CATEGORY = "batch"


@cache
def compiled(gains: type[Any]) -> Callable[..., Moment]:
    """The function :func:`.kernel.run` for the controller with a type of gains.

    It is compiled when it is first called, which takes some ten seconds, unless some process of
    this user has done so before.
    """
    # Not installed where no studies are made.
    imported_apart("numba", ".numba_config.yaml")
    import numba  # noqa: PLC0415

    # It would look for that file before each compilation, too.
    numba.core.config._config_fname = os.devnull

    from orchestrator.studies.batch.equations import EQUATIONS, OPTIONS  # noqa: PLC0415

    made = EQUATIONS.anew(kernel, Path(kernel.__file__))
    vars(made)["law"] = Law(*(EQUATIONS.function(function) for function in LAWS[gains]))
    run: Callable[..., Moment] = numba.njit(made.run.py_func, **OPTIONS)
    vars(run)["_cache"] = _Kept(gains.__name__)
    return run


class _Kept:
    """What numba asks for code that was compiled earlier, in the place of its own cache.

    Numba's own is where its configuration says, and takes whatever is there.
    """

    cache_path = None

    def __init__(self, name: str) -> None:
        """Take the name of a variant of the kernel."""
        self._name = name

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The code for the types of arguments, or None."""
        from numba.core.compiler import CompileResult  # noqa: PLC0415

        target.refresh()
        rebuild: Any = CompileResult._rebuild
        for content in kept(_CATEGORY, self._key(signature, target.codegen())).values():
            return rebuild(target, *pickle.loads(content))
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep code."""
        from numba.core import serialize  # noqa: PLC0415

        dumps: Any = serialize.dumps
        key = self._key(signature, result.codegen)
        # What cannot be kept is compiled again.
        with suppress(OSError):
            if not kept(_CATEGORY, key):
                keep(_CATEGORY, key, {"kernel": dumps(result._reduce())})

    def _key(self, signature: Any, codegen: Any) -> str:
        import numba  # noqa: PLC0415

        machine = (numba.__version__, sys.version, codegen.magic_tuple())
        text = repr((self._name, signature, *machine))
        return f"{digest()}-{sha256(text.encode()).hexdigest()[:16]}"


def digest() -> str:
    """Of the text of all that is compiled."""
    return code_of("auv_fmu", "orchestrator.studies.batch")[:16]
