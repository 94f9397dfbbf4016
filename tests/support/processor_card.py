"""The kernels of programs on the processor: their CUDA, compiled as C++."""

from __future__ import annotations

import ctypes
from functools import cache
from hashlib import sha256
from typing import Any

import numpy as np

from orchestrator.machine.compilers import (
    MATHEMATICS,
    SAME_NUMBERS,
    Compiler,
    compile_text,
    load_library,
    machines_compiler,
)

#: Words of CUDA that C++ lacks. One thread makes all runs.
_HEAD = """\
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define __global__
#define __forceinline__ inline
#define __noinline__
#define EACH(i, n) for (size_t i = 0; i < (size_t)(n); i++)
"""

FLAGS = ("-std=c++20", "-O1", *SAME_NUMBERS, "-fPIC", "-shared", "-w")


class ProcessorCard:
    """A card whose memory is the processor's, with room for so many bytes."""

    name = "this processor"
    arrays = np

    def __init__(self, memory: int = 2**30) -> None:
        self._memory = memory

    def __enter__(self) -> ProcessorCard:
        return self

    def __exit__(self, *failure: object) -> None:
        pass

    def free_memory(self) -> int:
        return self._memory

    def to_numpy(self, array: np.ndarray) -> np.ndarray:
        return array.copy()

    def kernels(self, text: str) -> Any:
        library = _compiled(text)

        def kernel(name: str) -> Any:
            return lambda n, *arguments: getattr(library, name)(
                *(_passed(value) for value in (np.int32(n), *arguments))
            )

        return kernel


def _passed(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        assert value.flags.c_contiguous
        return ctypes.c_void_p(value.ctypes.data)
    types = {np.int32: ctypes.c_int, np.float64: ctypes.c_double}
    return types[type(value)](value)


@cache
def _compiled(text: str) -> ctypes.CDLL:
    command, text = machines_compiler(), _HEAD + text
    assert command is not None
    compiler = Compiler([command, "-x", "c++"])
    key = sha256(text.encode()).hexdigest()[:24]
    return load_library(
        "cards", key, "advance" if "HOT 1" in text else "words_of_a_run",
        lambda: compile_text(compiler, text, *FLAGS, *MATHEMATICS),
    )  # fmt: skip
