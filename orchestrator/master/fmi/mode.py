"""The processor's floating-point mode, which an FMU can change for all who share its thread.

It may round otherwise, or take the smallest numbers for zero: a library that was linked with
`-ffast-math` says so as soon as it is loaded. Every sum of the others would be another one.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

#: Factors whose product passes through the smallest numbers, and is rounded up and down: with
#: another mode it is another one.
A, B, C, PRODUCT = 1e-308, 0.1, 1e300, 1.000000000000002e-09

#: More bytes than any machine needs for its mode.
_SIZE = 1024


def _functions() -> Iterator[Callable[..., object]]:
    """C's functions: to take on the default mode, and to get and to set one."""
    c = ctypes.PyDLL(None)
    if sys.platform == "darwin":
        yield partial(c.fesetenv, ctypes.byref(ctypes.c_char.in_dll(c, "_FE_DFL_ENV")))
    else:
        yield partial(c.fesetenv, ctypes.c_void_p(-1))
    yield c.fegetenv
    yield c.fesetenv


_take_default, _get, _set = _functions()


def put_back() -> None:
    """Take on the default mode after a call of an FMU, if numbers are others in the present one.

    To look is a third of what it costs to take it on.
    """
    if A * B * C != PRODUCT:
        _take_default()


@contextmanager
def default_mode() -> Iterator[None]:
    """Compute in the default mode, and leave behind the one that was there."""
    before = ctypes.create_string_buffer(_SIZE)
    _get(before)
    _take_default()
    try:
        yield
    finally:
        _set(before)
